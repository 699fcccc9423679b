"""A simulated robot in real time, in a process of its own: the driver `sim`."""
