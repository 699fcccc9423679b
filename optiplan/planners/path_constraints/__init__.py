"""What a motion's path constraints ask for, as inequalities of the robot's state, and whether a motion holds them."""
