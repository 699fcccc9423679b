"""What planners of several families share."""
