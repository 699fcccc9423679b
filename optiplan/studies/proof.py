"""Designs with their bodies, given the tasks: planned, verified, and measured along the motions."""

from collections.abc import Callable

import numpy as np

from optiplan.errors import OptiPlanError
from optiplan.planners.base import Budget, Progress
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.batched.base_reaction import base_reaction
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.runs.run import Run
from optiplan.studies.measures import torques
from optiplan.studies.search import Design, DesignJudge, DesignSearch
from optiplan.studies.study import DesignStudy

_RATE = 200.0
"""Samples a second of a motion that torque and tip-over margin are taken at."""

Plan = Callable[[Problem, Budget], Run]
"""Plans and verifies a problem."""


@dataclass(frozen=True, eq=False)
class DesignProof:
    """A design that was given the tasks.

    Attributes:
        role: why it was chosen, in words.
        design: as it was measured.
        runs: of the tasks, in their order; fewer where one could not be stated.
        trouble: why the design or a task of it could not be stated; empty otherwise.
        along: `torque`, N·m, and `tip_over`, m, the worst along all motions, at 200 samples a second.
    """

    role: str
    design: Design
    runs: tuple[Run, ...]
    trouble: str
    along: dict[str, float]

    @property
    def verified(self) -> bool:
        """Whether the design could be stated, and every task of it is verified."""
        return not self.trouble and all(run.verified for run in self.runs)

    @property
    def cycle_time(self) -> float | None:
        """Sum of the durations, s; None where a task is not verified."""
        return sum(float(run.duration or 0.0) for run in self.runs) if self.verified and self.runs else None


def chosen_designs(study: DesignStudy, search: DesignSearch) -> list[tuple[str, int]]:
    """Return the given design, the compromise, and the best one in every objective: (role, number), each once.

    The compromise is nearest to the best values of all objectives, each in shares of its range over the front.
    """
    roles: dict[int, list[str]] = {0: ["given"]}
    if search.front:
        judge = DesignJudge(study)
        F = np.array([judge.objectives(search.designs[k]) for k in search.front])
        span = np.maximum(F.max(axis=0) - F.min(axis=0), 1e-12)
        nearest = int(np.argmin(np.linalg.norm((F - F.min(axis=0)) / span, axis=1)))
        roles.setdefault(search.front[nearest], []).append("compromise")
        for i, (name, sign) in enumerate(judge.wishes):
            what = f"{'most' if sign < 0.0 else 'least'} {name}"
            roles.setdefault(search.front[int(np.argmin(F[:, i]))], []).append(what)
    return [(", ".join(words), k) for k, words in roles.items()]


def prove_design(study: DesignStudy, role: str, design: Design, plan: Plan, progress: Progress) -> DesignProof:
    """Load a design with its bodies, plan every task of the study and verify it."""
    values = study.values(design.x)
    runs: list[Run] = []
    try:
        robot = study.robot(values, whole=True)
        for task in study.tasks:
            progress(f"planning '{task.name}' with the design '{role}'", 0.0)
            problem = problem_from_dict(task.for_robot(robot), task.base)
            runs.append(plan(problem, Budget(study.spec.proof.budget)))
        trouble = ""
    except OptiPlanError as error:
        trouble = str(error).splitlines()[0]
    return DesignProof(role, design, tuple(runs), trouble, _along(study, design, runs))


def _along(study: DesignStudy, design: Design, runs: list[Run]) -> dict[str, float]:
    """The worst torque and tip-over margin along the motions."""
    worst: dict[str, float] = {}
    for run in runs:
        if run.trajectory is None or not run.problem.robot.has_inertia:
            continue
        robot, motion = run.problem.robot, run.trajectory
        t = motion.sample_times(_RATE)
        Q, V, A = (motion(t, order) for order in range(3))
        torque = torques(robot, inverse_dynamics(robot, Q, V, A))["torque"]
        worst["torque"] = max(worst.get("torque", 0.0), torque)
        support = study.support(study.values(design.x))
        if support is not None:
            margin = float(support.margins(base_reaction(robot, Q, V, A)).min())
            worst["tip_over"] = min(worst.get("tip_over", np.inf), margin)
    return worst
