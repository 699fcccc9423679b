"""Design studies: numbers of a robot as parameters, what the robot is then worth, and the best compromises."""
