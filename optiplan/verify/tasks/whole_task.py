"""Checks and scope of a motion that does a task: its alternatives, its tours and its steps."""

from optiplan.problem.problem import Problem
from optiplan.problem.task.timeline import mismatch
from optiplan.problem.task.tour_steps import chosen, in_order
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.statements import choices, tours
from optiplan.verify.tasks.choice_check import choice_checks, choice_scope
from optiplan.verify.tasks.task_check import task_checks, task_scope
from optiplan.verify.tasks.task_parts import step_parts
from optiplan.verify.tasks.tour_check import tour_checks, tour_scope


class WholeTask:
    """A task and a motion.

    Attributes:
        in_order: the problem with the alternatives that the motion does, and with the steps of tours in its order.
    """

    def __init__(self, problem: Problem, trajectory: Trajectory) -> None:
        self._problem, self._trajectory = problem, trajectory
        self._chosen, self.in_order = chosen(problem, trajectory), in_order(problem, trajectory)
        done = not mismatch(self.in_order, trajectory)
        self._parts = list(step_parts(self.in_order, trajectory)) if done else []

    def checks(self, policy: VerifyPolicy) -> list[Check]:
        """Return the checks of alternatives, tours and steps."""
        return [
            *choice_checks(self._problem, self._trajectory),
            *tour_checks(self._chosen, self._trajectory),
            *task_checks(self.in_order, self._trajectory, self._parts, policy),
        ]

    def statements(self) -> list[str]:
        """Return the statements of alternatives and tours, which the problem in the order of the motion lacks."""
        return [*choices(self._problem), *tours(self._chosen)]

    def scope(self) -> tuple[str, ...]:
        """Return what the verdict is about besides."""
        return (
            *choice_scope(self._problem, self._trajectory),
            *tour_scope(self._chosen, self._trajectory),
            *task_scope(self.in_order, self._trajectory, self._parts),
        )
