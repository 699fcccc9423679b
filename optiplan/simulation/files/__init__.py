"""Control files: a closed loop as YAML, read as problem files are."""
