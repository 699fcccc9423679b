"""Tours: the order of targets, the configuration at each, and the motions between them, found together."""
