"""Robot, scene and their geometry: everything that holds without a problem or a planner."""
