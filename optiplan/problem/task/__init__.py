"""Tasks of several steps: what a step is, how it is read, and how it changes the scene."""
