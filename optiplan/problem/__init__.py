"""From a YAML file to a `Problem`: schema, goals, and the arrays that planners and the verifier read."""
