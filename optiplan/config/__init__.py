"""Configuration files: YAML with the line of every value, and the words for what is wrong with one."""
