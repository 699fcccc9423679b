"""Inverse kinematics: closed form where the arm allows it, else numeric."""
