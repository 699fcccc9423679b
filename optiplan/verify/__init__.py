"""The only source of the word *verified*: checks and the continuous-time certificate."""
