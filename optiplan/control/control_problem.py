"""`ControlProblem`: the quadratic program of one step, with a name for every row."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path

import qpsolvers

from optiplan.arrays import Array
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.objective import TaskObjective
from optiplan.control.qp.program import Program
from optiplan.control.qp.solvers import qpsolvers_problem
from optiplan.control.row_stack import RowStack
from optiplan.control.step_report import StepOutcome
from optiplan.errors import writing, wrong_argument
from optiplan.records import dataclass

SHOWN_ROWS = 12
"""Rows of each kind that `repr` prints."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ControlProblem:
    """The quadratic program of one controller step in the joint velocities x (n,) at its end, rad/s or m/s.

    Minimise ½ xᵀ P x + qᵀ x subject to low <= C x <= high, lower <= x <= upper and A x = b, where

        P = Jᵀ J + (w² + s²) I,    q = -Jᵀ rates - (damping and steadiness of the present motion).

    Attributes:
        P: (n, n), positive definite; `q`: (n,).
        J: (k, n), weighted Jacobian of the tasks; `rates`: (k,), the weighted rates that J x should have.
        task_names: (k,), the task and component of each row of J.
        C: (m, n); `low` and `high`: (m,), infinite where a row has one side. A row that cannot hold is relaxed already.
        row_names: (m,), the limit of each row of C and its frame, joint or pair of bodies.
        lower: (n,), `upper`: (n,), bounds of x.
        joint_names: (n,), the joints of x.
        lower_limits: (n,), the limit that sets each bound, such as `jerk`; `upper_limits`: (n,), the same.
        A: (p, n) and `b`: (p,), the equations that keep what tasks of higher priority reach.
        equation_names: (p,), the task and component of each equation.
        slack: by how much rows are relaxed, rad/s or m/s, by the name of the limit; empty where all rows can hold.
    """

    P: Array
    q: Array
    J: Array
    rates: Array
    task_names: tuple[str, ...]
    C: Array
    low: Array
    high: Array
    row_names: tuple[str, ...]
    lower: Array
    upper: Array
    joint_names: tuple[str, ...]
    lower_limits: tuple[str, ...]
    upper_limits: tuple[str, ...]
    A: Array
    b: Array
    equation_names: tuple[str, ...]
    slack: Mapping[str, float] = field(default_factory=dict)

    def to_qpsolvers(self) -> qpsolvers.Problem:
        """Return the program for `qpsolvers.solve_problem`; its G and h have the finite sides of C, upper sides first.

        Example:
            >>> import optiplan as op
            >>> robot = op.load_robot("panda")
            >>> controller = op.Controller(robot, [op.PostureTask("ready")])
            >>> problem = controller.build(op.State(robot.configurations["ready"]), 0.002)
            >>> problem.to_qpsolvers().P.shape
            (7, 7)
        """
        bounds = self.lower, self.upper
        return qpsolvers_problem(Program(self.P, self.q, self.C, self.low, self.high, bounds, self.A, self.b))

    def save(self, path: str | Path) -> Path:
        """Write the program to a file of NumPy arrays (.npz) that `qpsolvers.Problem.load` reads; return its path.

        Raises:
            InputError: the path does not end with .npz, or cannot be written.
        """
        file = Path(path)
        if file.suffix != ".npz":
            raise wrong_argument("ControlProblem.save", "path", repr(str(path)), "a file that ends with .npz")
        with writing("ControlProblem.save", path):
            self.to_qpsolvers().save(str(file))
        return file

    def __repr__(self) -> str:
        """Return sizes, bounds with their limits, and the rows by name."""
        size = f"{len(self.q)} joints, {len(self.J)} task rows, {len(self.C)} limit rows, {len(self.A)} equations"
        bounds = zip(self.joint_names, self.lower, self.upper, self.lower_limits, self.upper_limits, strict=True)
        lines = [
            f"ControlProblem: {size}",
            *_listed(
                "bounds",
                [
                    f"{lower:.4g} ({below}) <= {name} <= {upper:.4g} ({above})"
                    for name, lower, upper, below, above in bounds
                ],
            ),
            *_listed("tasks", [f"{name}: {rate:.4g}" for name, rate in zip(self.task_names, self.rates, strict=True)]),
            *_listed(
                "rows",
                [
                    f"{low:.4g} <= {name} <= {high:.4g}"
                    for name, low, high in zip(self.row_names, self.low, self.high, strict=True)
                ],
            ),
            *_listed("equations", [f"{name} = {b:.4g}" for name, b in zip(self.equation_names, self.b, strict=True)]),
            *_listed("relaxed", [f"{name} by {slack:.4g}" for name, slack in self.slack.items()]),
        ]
        return "\n".join(lines)


def _listed(title: str, entries: list[str]) -> list[str]:
    """Return a title and at most SHOWN_ROWS entries as lines; nothing without entries."""
    more = [f"    … and {len(entries) - SHOWN_ROWS} more"] if len(entries) > SHOWN_ROWS else []
    return [f"  {title}:", *(f"    {entry}" for entry in entries[:SHOWN_ROWS]), *more] if entries else []


def control_problem(
    outcome: StepOutcome, objectives: Sequence[TaskObjective], box: JointBox, rows: RowStack, joint_names: Sequence[str]
) -> ControlProblem:
    """Return the last program of a step with copies of its arrays."""
    program, level = outcome.program, outcome.level
    assert program is not None
    tasks = [objective.row_names(joint_names) for objective in objectives]
    J, rates = objectives[level].weighted
    lower_limits, upper_limits = box.owners()
    return ControlProblem(
        P=program.H.copy(),
        q=program.g.copy(),
        J=J.copy(),
        rates=rates.copy(),
        task_names=tasks[level],
        C=program.C.copy(),
        low=program.low.copy(),
        high=program.high.copy(),
        row_names=rows.names,
        lower=program.box[0].copy(),
        upper=program.box[1].copy(),
        joint_names=tuple(joint_names),
        lower_limits=lower_limits,
        upper_limits=upper_limits,
        A=program.A.copy(),
        b=program.b.copy(),
        equation_names=tuple(name for above in tasks[:level] for name in above),
        slack=dict(outcome.slack),
    )
