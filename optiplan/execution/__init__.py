"""Execute proved motions: set-points, speed override, pause, stop, reverse and splice, without leaving the proof."""
