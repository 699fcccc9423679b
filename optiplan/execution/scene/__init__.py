"""What moves around the robot: seen, watched, avoided, kept apart."""
