"""Robots of other programs: URDF, xacro, MuJoCo's MJCF, USD and MoveIt configurations as what a robot.yaml needs."""
