"""Commands that choose something about a robot: where it stands, how it is made."""
