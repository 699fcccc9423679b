"""Jacobians, manipulability, singularities, platforms; inverse and symbolic kinematics in rooms of their own."""
