"""A run as a recording of other programs: scene, motion, curves and verdict for Foxglove and Rerun."""
