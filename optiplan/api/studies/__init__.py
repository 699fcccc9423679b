"""Functions that choose something: where a robot stands, how it is made, which arm does what."""
