"""The workspace of a robot's tool: reach, dexterity, accuracy."""
