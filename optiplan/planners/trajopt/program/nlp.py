"""`TrajectoryNlp`: the program of `trajopt` in CasADi, with a name for each variable and row."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from optiplan.arrays import Array, Index
from optiplan.planners.trajopt.bspline_basis import DEGREE
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.term import Curve
from optiplan.trajectory.trajectory import Trajectory

NEAR = 0.08
"""m; pairs of bodies nearer than this at a sample of the first curve have a row there."""

FAR = 0.12
"""m; distances beyond this count as this."""

SHORTEST = 1e-3
"""s; lower bound of the duration, which divides derivatives."""

SHOWN_ROWS = 6
"""Rows of each kind that `repr` prints."""

RATES = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True, eq=False, repr=False)
class TrajectoryNlp:
    """Minimise T over the free control points C (M, n) of a spline and its duration T, s, subject to limits.

    The spline is q(u), u = t / T, with the ends of the first curve. Rows, lbg <= g(x) <= ubg:

        velocity, acceleration, jerk    V_i / (T v), A_i / (T² a), J_i / (T³ j) in [-1, 1] of derivative control points,
                                        which bound the curve at all times
        torque                          tau(q, v, a) / limit in [-1, 1] at each sample
        clearance                       distance of a pair of bodies at a sample, m, at least its margin

    Attributes:
        transcription: terms of the planner with the samples.
        control: (K, n), control points of the first curve, rad or m.
        x0: (M n + 1,), the first curve: C, one control point after another, rad or m, then T, s.
        lbx, ubx: (M n + 1,), bounds of x.
        lbg, ubg: (R,), bounds of the rows.
        x_names: (M n + 1,); g_names: (R,), kind of each row, joint or pair of bodies, and control point or sample.
    """

    transcription: Transcription
    joint_names: tuple[str, ...]
    control: Array
    x0: Array = field(init=False)
    lbx: Array = field(init=False)
    ubx: Array = field(init=False)
    lbg: Array = field(init=False)
    ubg: Array = field(init=False)
    x_names: tuple[str, ...] = field(init=False)
    g_names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        made, limits = self.transcription, self.transcription.limits
        M, names = made.basis.variables, self.joint_names
        first = np.append(made.basis.moving(self.control).ravel(), made.shortest_duration(self.control))
        rates = [f"{RATES[r]} of {names[j]} at control point {i}" for r, i, j in self._rates]
        samples = made.samples.u
        torques = [f"torque of {names[j]} at {samples[k]:.4g} T" for k, j in self._torques]
        pairs = [made.model.pairs[p] for _, p in self._near]
        apart = [
            f"clearance of {pair.name_a} and {pair.name_b} at {samples[k]:.4g} T"
            for (k, _), pair in zip(self._near, pairs, strict=True)
        ]
        shares = np.ones(len(rates) + len(torques))
        margins = made.margins.at(samples[self._near[:, 0]], self._near[:, 1])
        parts = {
            "x0": first,
            "lbx": np.append(np.tile(limits.lower, M), SHORTEST),
            "ubx": np.append(np.tile(limits.upper, M), np.inf),
            "lbg": np.concatenate([-shares, margins]),
            "ubg": np.concatenate([shares, np.full(len(apart), np.inf)]),
            "x_names": (*(f"{name} of control point {i}" for i in range(M) for name in names), "duration"),
            "g_names": (*rates, *torques, *apart),
        }
        for name, value in parts.items():
            object.__setattr__(self, name, value)

    @cached_property
    def x(self) -> ca.MX:
        """The variables, (M n + 1,)."""
        return ca.MX.sym("x", len(self.x0))

    @cached_property
    def f(self) -> ca.MX:
        """The cost: the duration, s."""
        return self.x[-1]

    @cached_property
    def g(self) -> ca.MX:
        """The rows, (R,)."""
        basis, n = self.transcription.basis, self.control.shape[1]
        rows = []
        for order, (matrix, limit) in enumerate(zip(basis.bounded, self.transcription.rates, strict=True), start=1):
            known = np.flatnonzero(np.isfinite(limit))
            moving = basis.by_variables(matrix)
            held = matrix @ self.control - moving @ basis.moving(self.control)
            for i in range(len(matrix)):
                for j in known:
                    at = ca.DM(np.kron(moving[i], np.eye(n)[j])[None])
                    rows.append((ca.mtimes(at, self.x[:-1]) + held[i, j]) / (self.x[-1] ** order * limit[j]))
        rest = [self._sampled(self.x)] if len(self._torques) + len(self._near) else []
        return ca.vertcat(*rows, *rest)

    def to_casadi(self) -> dict[str, ca.MX]:
        """Return `{"x": x, "f": f, "g": g}` for `casadi.nlpsol`; keep this object while the solver is used.

        Second derivatives of torques and distances are not known: a solver approximates the Hessian, as IPOPT does with
        `{"ipopt.hessian_approximation": "limited-memory"}`.
        """
        return {"x": self.x, "f": self.f, "g": self.g}

    def arguments(self) -> dict[str, Array]:
        """Return the first curve and all bounds, by the names that a solver of `casadi.nlpsol` is called with."""
        return {name: getattr(self, name) for name in ("x0", "lbx", "ubx", "lbg", "ubg")}

    def trajectory(self, x: Any) -> Trajectory:
        """Return the motion of variables (M n + 1,), unchecked: `op.verify` says whether it is free and in limits."""
        values = np.array(x, dtype=float).ravel()
        knots = self.transcription.basis.knots * values[-1]
        return Trajectory.from_bspline(self.joint_names, knots, self._control(values), DEGREE)

    def violations(self, x: Any, tolerance: float = 1e-6) -> dict[str, float]:
        """Return by how much rows are violated at variables (M n + 1,), by name, the largest first."""
        g = np.array(ca.Function("g", [self.x], [self.g])(np.array(x, dtype=float).ravel())).ravel()
        beyond = np.maximum(self.lbg - g, g - self.ubg)
        order = [k for k in np.argsort(-beyond) if beyond[k] > tolerance]
        return {self.g_names[k]: float(beyond[k]) for k in order}

    def __repr__(self) -> str:
        """Return the sizes, and some rows of each kind by name."""
        lines = [f"TrajectoryNlp: {len(self.x0)} variables, {len(self.g_names)} rows, {len(self.joint_names)} joints"]
        for kind in (*RATES, "torque", "clearance"):
            names = [name for name in self.g_names if name.startswith(kind)]
            more = [f"    … and {len(names) - SHOWN_ROWS} more"] if len(names) > SHOWN_ROWS else []
            lines += [f"  {kind}: {len(names)} rows", *(f"    {name}" for name in names[:SHOWN_ROWS]), *more]
        return "\n".join(lines)

    @cached_property
    def _rates(self) -> list[tuple[int, int, int]]:
        """Order less one, derivative control point and joint of each row of a rate."""
        limits = zip(self.transcription.basis.bounded, self.transcription.rates, strict=True)
        return [
            (order, i, int(j))
            for order, (matrix, limit) in enumerate(limits)
            for i in range(len(matrix))
            for j in np.flatnonzero(np.isfinite(limit))
        ]

    @cached_property
    def _torques(self) -> Index:
        """Sample and joint of each row of a torque, (., 2)."""
        limited = np.flatnonzero(np.isfinite(self.transcription.limits.torque))
        samples = np.arange(len(self.transcription.samples.u))
        return np.column_stack([np.repeat(samples, len(limited)), np.tile(limited, len(samples))]).astype(np.intp)

    @cached_property
    def _near(self) -> Index:
        """Sample and pair of each row of clearance, (., 2)."""
        found = self.transcription.model.near(self.transcription.samples.at[0] @ self.control, NEAR)
        return np.unique(np.column_stack([found.rows, found.pairs]).astype(np.intp).reshape(-1, 2), axis=0)

    @cached_property
    def _sampled(self) -> "_SampledRows":
        return _SampledRows(self)

    def _control(self, x: Array) -> Array:
        basis = self.transcription.basis
        change = x[:-1].reshape(-1, self.control.shape[1]) - basis.moving(self.control)
        return basis.moved(self.control, change)

    def sampled(self, x: Array) -> tuple[Array, Array]:
        """Return the rows of torques and clearances (S,) at variables x, and their Jacobian (S, M n + 1)."""
        curve = self.transcription.curve(self._control(x), float(x[-1]))
        parts = [self._torque_rows(curve), self._clearance_rows(curve)]
        values, slopes = zip(*parts, strict=True)
        return np.concatenate(values), np.vstack(slopes)

    def _torque_rows(self, curve: Curve) -> tuple[Array, Array]:
        if not len(self._torques):
            return np.zeros(0), np.zeros((0, len(self.x0)))
        tau, derivatives = self.transcription.torques.residuals(curve)
        k, j = self._torques.T
        limit = self.transcription.limits.torque[j]
        by_q, by_v, by_a = (part[k, j] / limit[:, None] for part in derivatives)
        rows = curve.rows(k, tau[k, j] / limit, (by_q, by_v, by_a))
        return rows.value, np.column_stack([rows.by_control, rows.by_duration])

    def _clearance_rows(self, curve: Curve) -> tuple[Array, Array]:
        model, n = self.transcription.model, self.control.shape[1]
        found = model.near(curve.motion[0], FAR)
        gradients = model.gradients(curve.motion[0], found)
        number = np.full((len(curve.samples.u), len(model.pairs)), -1)
        number[self._near[:, 0], self._near[:, 1]] = np.arange(len(self._near))
        which = number[found.rows, found.pairs]
        value, by_q = np.full(len(self._near), FAR), np.zeros((len(self._near), n))
        value[which[which >= 0]], by_q[which[which >= 0]] = found.distance[which >= 0], gradients[which >= 0]
        by_control = curve.samples.spread(by_q, self._near[:, 0])
        return value, np.column_stack([by_control, np.zeros(len(value))])


class _SampledRows(ca.Callback):
    """`TrajectoryNlp.sampled` as a function of CasADi."""

    def __init__(self, nlp: TrajectoryNlp) -> None:
        super().__init__()
        self.nlp, self.slopes = nlp, _SampledSlopes(nlp)
        self.construct("sampled", {})

    def get_sparsity_in(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(len(self.nlp.x0), 1)

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(len(self.nlp._torques) + len(self.nlp._near), 1)

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        return [ca.DM(self.nlp.sampled(np.array(arguments[0]).ravel())[0])]

    def has_jacobian(self) -> bool:
        return True

    def get_jacobian(self, *_: Any) -> ca.Function:
        return self.slopes


class _SampledSlopes(ca.Callback):
    """Its Jacobian; CasADi passes the value too."""

    def __init__(self, nlp: TrajectoryNlp) -> None:
        super().__init__()
        self.nlp = nlp
        self.construct("jac_sampled", {})

    def get_n_in(self) -> int:
        return 2

    def get_sparsity_in(self, which: int) -> ca.Sparsity:
        size = len(self.nlp.x0) if which == 0 else len(self.nlp._torques) + len(self.nlp._near)
        return ca.Sparsity.dense(size, 1)

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(len(self.nlp._torques) + len(self.nlp._near), len(self.nlp.x0))

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        return [ca.DM(self.nlp.sampled(np.array(arguments[0]).ravel())[1])]
