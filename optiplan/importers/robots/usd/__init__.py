"""USD stages with UsdPhysics: bodies, joints, colliders and masses as what a robot.yaml needs."""
