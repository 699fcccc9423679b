"""`TrajectoryNlp`: the program of a problem with its first curve, and a name for each variable and row."""

import json
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from optiplan.arrays import Array
from optiplan.errors import OfOneProcess, described, writing, wrong_argument
from optiplan.files import write_bytes
from optiplan.planners.trajopt.bspline_basis import DEGREE
from optiplan.planners.trajopt.nonlinear.curve_program import CurveProgram
from optiplan.planners.trajopt.nonlinear.solvers import DEFAULT, SOLVERS, installed
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.term import Curve, SoftRows
from optiplan.trajectory.trajectory import Trajectory

REACH, KEPT_NEAR = 0.1, 0.02
"""Trust region of the control points, as a share of what their joint travels at full speed in the first duration.

The second one is for files, whose distances nobody linearises again.
"""

SHOWN_ROWS = 6
"""Rows of each kind that `repr` prints."""

INSTANTS = 201
"""At which `motion` of a file gives the curve."""

_ABOUT = """The motion of a robot as a nonlinear program of CasADi: minimise f(x, p) with lbx <= x <= ubx and
lbg <= g(x, p) <= ubg. Solve it, without any other program:

    import json
    import casadi

    file = json.load(open("motion.casadi.json"))
    nlp, start, motion = (casadi.Function.deserialize(file[name]) for name in ("nlp", "start", "motion"))
    solver = casadi.nlpsol("solver", "ipopt", nlp, {"ipopt": file["ipopt"], "print_time": False})
    answer = solver(**start())
    print(solver.stats()["return_status"])
    t, q, v, a = motion(answer["x"], start()["p"])

`nlp`: (x, p) -> (f, g), f in s. `start`: () -> x0, p, lbx, ubx, lbg, ubg. `motion`: (x, p) -> t (1, N) in s, and
q, v, a (n, N) of the joints in rad or m. `ipopt`: the planner's settings of IPOPT. `x_names` and `g_names` name
variables and rows, `p_blocks` how many numbers of p have which name. Distances between bodies are linearised at x0, and
lbx and ubx keep x near it."""


class TrajectoryNlp(OfOneProcess):
    """Minimise cost + penalty over the free control points of a spline, its duration T, s, and slacks.

    What planner `casadi` solves in every step, see `optiplan.planners.trajopt.nonlinear.curve_program.CurveProgram`.
    Rows lbg <= g(x, p) <= ubg:

        velocity, acceleration, jerk    V / (T v), A / (T² a), J / (T³ j) in [-1, 1] of derivative control points, which
                                        bound the curve at all times
        torque                          1 -+ tau(q, v, a) / limit + s >= 0 at each sample
        path constraints                (g(q, v, a) - least) / unit + s >= 0
        clearance                       (d + grad d . (q - q') - margin) / unit + s >= 0 of the nearest pairs

    Distances are linearised at a curve q', whose numbers are parameters: `arguments(x)` linearises at another one.

    Attributes:
        x: (X,) variables; `p`: (P,) parameters; `g`: (R,) rows, expressions.
        f: cost + penalty, s; `cost`, `penalty`: its parts.
        control: (n, M) control points, rad or m; `duration`: T, s; `slack`: (S,), what is missing of each row's unit.
        q, v, a: (n, N), the motion at the samples, for a cost of your own.
        samples: (N,) instants, as fractions of the duration.
        x_names: (X,); `g_names`: (R,), kind of each row, joint or number, and control point or sample.
        blocks: how many numbers of p have which name, in their order.
    """

    def __init__(
        self, transcription: Transcription, control: Array, duration: float, held: Sequence[Array] | None = None
    ) -> None:
        self.first, self._transcription = transcription.curve(control, duration), transcription
        self._held, self.joint_names = held, transcription.robot.joint_names
        self._program = CurveProgram(transcription, self._rows(self.first), moving=held is not None)
        made = self._program
        self.x, self.p, self.g, self.cost, self.penalty = made.x, made.p, made.g, made.cost, made.penalty
        self.control, self.duration, self.slack = made.control, made.duration, made.slack
        self.q, self.v, self.a, self.samples, self.blocks = made.q, made.v, made.a, made.samples, made.blocks
        self.f = self.cost + self.penalty

    def to_casadi(self) -> dict[str, ca.MX]:
        """Return `{"x": x, "p": p, "f": f, "g": g}` for `casadi.nlpsol`; put a cost of your own in place of f."""
        return {"x": self.x, "p": self.p, "f": self.f, "g": self.g}

    def solver(self, name: str = DEFAULT, cost: ca.MX | None = None) -> Any:
        """Return the `casadi.nlpsol` with the settings of planner `casadi`.

        Args:
            name: of a solver, as of the option `solver` of that planner.
            cost: in place of `cost`, s; the penalty is added.

        Raises:
            InputError: no such solver here, or a cost that is no number.
        """
        if name not in (known := installed()):
            raise wrong_argument("TrajectoryNlp.solver", "name", described(name), f"one of {', '.join(known)}")
        if cost is not None and not (isinstance(cost, ca.MX | ca.DM | float | int) and ca.MX(cost).numel() == 1):
            raise wrong_argument("TrajectoryNlp.solver", "cost", described(cost), "a CasADi expression (1, 1) of x")
        program = self.to_casadi() if cost is None else {**self.to_casadi(), "f": cost + self.penalty}
        return SOLVERS[name].make(program, self._program.gauss_newton)

    def arguments(self, x: Any = None, *, reach: float = REACH, elastic: bool = True) -> dict[str, Array]:
        """Return x0, p, lbx, ubx, lbg and ubg, by which a solver of `casadi.nlpsol` is called.

        Args:
            x: variables (X,) at which distances are linearised and the solver begins; None: the first curve.
            reach: how far control points may move from there, as a share of what their joint travels at full speed.
            elastic: whether rows may be violated at their price; else slacks are 0.
        """
        curve = self.first if x is None else self._curve(x)
        rows, travel = self._rows(curve), self._transcription.limits.velocity * self.first.duration
        lbx, ubx = self._program.bounds(curve, reach * travel)
        x0, slacks = self._program.point(curve, rows), self.slack.numel()
        if not elastic and slacks:
            ubx[-slacks:] = x0[-slacks:] = 0.0
        p = self._program.values(curve, rows, self.first.duration, self._held)
        return {"x0": x0, "p": p, "lbx": lbx, "ubx": ubx, "lbg": self._program.lbg, "ubg": self._program.ubg}

    def trajectory(self, x: Any) -> Trajectory:
        """Return the motion of variables (X,), unchecked: `op.verify` says whether it is free and in limits."""
        curve = self._curve(x)
        knots = self._transcription.basis.knots * curve.duration
        return Trajectory.from_bspline(self.joint_names, knots, curve.control, DEGREE)

    def motion(self, u: Array) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
        """Return t (1, N) in s, and q, v, a (n, N) as expressions, at fractions u (N,) of the duration."""
        states = (self._program.points(self._transcription.basis.at(u, order)) for order in range(3))
        q, v, a = (points / self.duration**order for order, points in enumerate(states))
        return ca.DM(u[None]) * self.duration, q, v, a

    def save(self, path: str | Path) -> Path:
        """Write the program with its first curve to a JSON file, which CasADi alone can solve; return its path.

        Raises:
            InputError: the file cannot be written.
        """
        with writing("TrajectoryNlp.save", path):
            write_program(self, self.arguments(reach=KEPT_NEAR), Path(path))
        return Path(path)

    def violations(self, x: Any, tolerance: float = 1e-6) -> dict[str, float]:
        """Return by how much rows are violated at variables (X,), by name, the largest first: distances exact there."""
        values, slacks = self._values(x), self.slack.numel()
        p = self.arguments(values)["p"]
        values[len(values) - slacks :] = 0.0
        g = np.array(ca.Function("g", [self.x, self.p], [self.g])(values, p)).ravel()
        beyond = np.maximum(self._program.lbg - g, g - self._program.ubg)
        order = [k for k in np.argsort(-beyond) if beyond[k] > tolerance]
        return {self.g_names[k]: float(beyond[k]) for k in order}

    @cached_property
    def x_names(self) -> tuple[str, ...]:
        """Name of each variable."""
        points, samples = self._transcription.basis.variables, self.samples
        soft = [(block.term.name, samples[k]) for block in self._program.soft for k in block.rows.columns]
        joints = (f"{name} of control point {i}" for i in range(points) for name in self.joint_names)
        return (*joints, "duration", *(f"missing of {name} at {u:.4g} T" for name, u in soft))

    @cached_property
    def g_names(self) -> tuple[str, ...]:
        """Name of each row."""
        hard = len(self._program.rows) - len(self._program.soft)
        return tuple(
            f"{label} at control point {k}" if number < hard else f"{label} at {self.samples[k]:.4g} T"
            for number, block in enumerate(self._program.rows)
            for k in block.columns
            for label in block.labels
        )

    def __repr__(self) -> str:
        """Return the sizes, and some rows of each kind by name."""
        joints = len(self.joint_names)
        lines = [f"TrajectoryNlp: {self.x.numel()} variables, {self.g.numel()} rows, {joints} joints"]
        begin = 0
        for block in self._program.rows:
            names = self.g_names[begin : begin + block.rows.numel()]
            begin += len(names)
            shown = ", ".join(names[:SHOWN_ROWS]) + (", …" if len(names) > SHOWN_ROWS else "")
            lines.append(f"  {block.kind}: {len(names)}, {shown}")
        return "\n".join(lines)

    def _values(self, x: Any) -> Array:
        """Return variables (X,) as an array; no others are an answer of a solver."""
        try:
            values = np.array(x, dtype=float).ravel()
        except (TypeError, ValueError):
            values = np.empty(0)
        if len(values) != self.x.numel() or not np.isfinite(values).all():
            raise wrong_argument("TrajectoryNlp", "x", described(x), f"{self.x.numel()} finite numbers: see x_names")
        return values

    def _rows(self, curve: Curve) -> list[SoftRows]:
        return [term.rows(curve) for term in self._transcription.terms]

    def _curve(self, x: Any) -> Curve:
        control, duration = self._program.moved(self._values(x), self.first.control)
        if self._held is not None:
            ends = np.sum([points * duration**order for order, points in enumerate(self._held)], axis=0)
            control = np.vstack([ends[:3], control[3:-3], ends[3:]])
        return self._transcription.curve(control, duration)


def write_program(nlp: TrajectoryNlp, arguments: dict[str, Array], path: Path) -> None:
    """Write a program with its start and bounds as JSON: how to solve it, functions that CasADi reads, and names.

    Raises:
        OSError: the file cannot be written.
    """
    program = nlp.to_casadi()
    functions = {
        "nlp": ca.Function("nlp", [nlp.x, nlp.p], [program["f"], nlp.g], ["x", "p"], ["f", "g"]),
        "start": ca.Function("start", [], [ca.DM(value) for value in arguments.values()], [], list(arguments)),
        "motion": ca.Function("motion", [nlp.x, nlp.p], list(nlp.motion(np.linspace(0.0, 1.0, INSTANTS)))),
    }
    content = {
        "about": _ABOUT.splitlines(),
        "casadi": ca.CasadiMeta.version(),
        "ipopt": SOLVERS["ipopt"].options["ipopt"],
        "joints": nlp.joint_names,
        "x_names": nlp.x_names,
        "g_names": nlp.g_names,
        "p_blocks": nlp.blocks,
        **{name: function.serialize() for name, function in functions.items()},
    }
    write_bytes(path, json.dumps(content, indent=1, allow_nan=False).encode() + b"\n")
