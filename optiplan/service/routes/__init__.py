"""What the service answers, a file for each part of the interface."""
