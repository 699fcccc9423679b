"""`Replanner`: one problem that changes a little again and again."""

from collections.abc import Mapping, Sequence
from typing import Any

from optiplan.api.planning import BUDGET, checked_problem, plan
from optiplan.errors import described, errors_about, options_argument, wrong_argument
from optiplan.geometry.pose import Values
from optiplan.geometry.scene import Obstacle, Scene
from optiplan.planners.base import Budget, Planner
from optiplan.problem.problem import Problem
from optiplan.problem.statement import End
from optiplan.runs.run import Run
from optiplan.trajectory.state import State

_CALLED = "op.Replanner.plan"


class Replanner:
    """Plan a problem, then what becomes of it, each time from the last motion that was verified.

    The robot stays loaded with its pairs proved, its collision model is kept while the scene stays and, but for their
    places, while only obstacles move; and the planner begins at the earlier motion, so that a small change takes a
    fraction of the first time. What has changed is checked as a problem file is. No clearance is wished, which takes as
    long as a small change: require one where you need it.

    Args:
        problem: the first one.
        planner: as of `op.plan`.
        options: of the planner.

    Attributes:
        problem: as it is by now.
        run: the last run that was verified; None before the first.

    Example:
        >>> import optiplan as op
        >>> replanner = op.Replanner(op.load_problem("02_shelf"))
        >>> first = replanner.plan()
        >>> replanner.plan(scene=replanner.problem.scene.moved("board", z=0.05)).verified
        True
        >>> replanner.plan(start=replanner.run.trajectory.state(0.2)).verified
        True
    """

    def __init__(
        self, problem: Problem, planner: str | Planner[Any] | None = None, options: Mapping[str, Any] | None = None
    ) -> None:
        checked_problem(problem, "Replanner")
        if planner is not None and not isinstance(planner, str | Planner):
            raise wrong_argument("Replanner", "planner", described(planner), "a name of op.planners()")
        options_argument("Replanner", options)
        self.problem = problem
        self.run: Run | None = None
        self._planner, self._options = planner, options

    def plan(
        self,
        *,
        start: Values | str | State | None = None,
        goal: End | Sequence[End] | None = None,
        scene: Scene | Sequence[Obstacle] | None = None,
        budget: float | Budget = BUDGET,
    ) -> Run:
        """Plan with what has changed, from the last verified motion; a run that fails changes the problem all the same.

        Args:
            start: where the robot is by now: a configuration, or the `State` of one that moves.
            goal: where it shall go, in place of a task too.
            scene: what stands around it.
            budget: seconds of planning and proof, or a `Budget`.

        Raises:
            InputError: as `Problem.with_parts` and `op.plan`.
        """
        changes = {"start": start, "goal": goal, "scene": scene}
        changes = {part: value for part, value in changes.items() if value is not None}
        with errors_about("op.Problem", _CALLED), errors_about("op.plan", _CALLED):
            self.problem = self.problem.with_parts(**changes) if changes else self.problem
            asked = Problem.of({**vars(self.problem), "wished_clearance": 0.0})
            run = plan(asked, self._planner, self._options, budget, warm_start=self.run)
        self.run = run if run.verified else self.run
        return run

    def __repr__(self) -> str:
        """The problem, and the last verified run."""
        return f"Replanner: {self.problem!r}; {self.run or 'no run yet'}"
