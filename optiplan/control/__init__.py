"""The task-space controller: tasks and limits become one quadratic program a step, and the answer can always stop."""
