"""Planners of `plan_many` that do not come back with an answer."""

import os

import optiplan as op


class Killed(op.Planner):
    """Ends its process at once, as the system does when memory is short; plans nothing of other seeds than 1."""

    def plan(self, problem, budget, progress):
        """End."""
        if problem.seed == 1:
            os._exit(9)
        return op.PlanResult(failure=op.Failure("no-path", "not looked for"))


class Broken(op.Planner):
    """Raises an error for seed 1."""

    def plan(self, problem, budget, progress):
        """Raise."""
        if problem.seed == 1:
            raise ZeroDivisionError("one by zero")
        return op.PlanResult(failure=op.Failure("no-path", "not looked for"))
