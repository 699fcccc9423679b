"""Scenes of other programs as obstacles of a problem file: MoveIt's .scene, SDF worlds, MuJoCo's MJCF, USD."""
