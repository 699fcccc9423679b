"""References: what a closed loop is to follow, as motions of the joints or of the tool."""
