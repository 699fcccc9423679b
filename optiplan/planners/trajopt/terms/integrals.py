"""Costs that are integrals over the motion: jerk, and sums of squares of residuals with Gauss-Newton derivatives."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.planners.trajopt.bspline_basis import REACH, SplineBasis
from optiplan.planners.trajopt.terms.term import Cost, CostModel, Curve
from optiplan.planners.trajopt.terms.torques import TorqueTerm
from optiplan.problem.objectives.objective import PLAIN
from optiplan.problem.objectives.parts import CLEAR, SINGULAR, has_range, of_obstacles
from optiplan.problem.problem import Problem

if TYPE_CHECKING:
    from optiplan.kinematics.symbolic.state import SymbolicState

_STILL = 1e-2
"""Speed, rad/s or m/s, below which path length is smoothed: it has no derivative at rest."""

Residuals = Callable[[Curve], tuple[Array, tuple[Array, Array, Array]]]
"""r (N, m) at the samples of a curve, and their derivatives (N, m, n) by q, v and a."""

Build = Callable[["SymbolicState"], Any]
"""Makes an expression (m,) from the robot's state."""


class IntegralCost:
    """w * integral of |r|² over the motion, by the trapezoid rule over the samples.

    Holds at: samples; which of several motions is the best is decided by the integral itself (`ObjectiveParts`).

    Attributes:
        residuals: r with its derivatives.
        build: r as an expression of the robot's state; None where there is none.
    """

    timed = True

    def __init__(
        self,
        name: str,
        weight: float,
        residuals: Residuals,
        build: Build | None = None,
    ) -> None:
        self.name, self.weight, self.residuals, self.build = name, weight, residuals, build

    def value(self, curve: Curve) -> float:
        """Return the weighted cost, s."""
        r, _ = self.residuals(curve)
        return self.weight * curve.duration * float(shares(curve.samples.u) @ (r * r).sum(axis=1))

    def model(self, curve: Curve) -> CostModel:
        """Return the cost with its derivatives, second ones without those of r (Gauss-Newton)."""
        r, by_state = self.residuals(curve)
        T, samples, share = curve.duration, curve.samples, shares(curve.samples.u)
        count, size, joints = by_state[0].shape
        points = samples.moving[0].shape[1]
        J = np.zeros((count, size, points, joints))
        by_T = np.zeros((count, size))
        for order, slope in enumerate(by_state):
            if slope.any():
                J += samples.moving[order][:, None, :, None] * (slope / T**order)[:, :, None, :]
                by_T -= order * np.einsum("kmj,kj->km", slope, curve.motion[order]) / T
        scale = 2.0 * self.weight * T * share
        gradient = np.einsum("k,km,kmij->ij", scale, r, J)
        band = np.zeros((points, REACH, joints))
        for d in range(min(REACH, points)):
            band[: points - d, d] = np.einsum("k,kmij,kmij->ij", scale, J[:, :, : points - d], J[:, :, d:])
        value = 0.5 * float(scale @ (r * r).sum(axis=1))
        by_duration = value / T + float(scale @ (r * by_T).sum(axis=1))
        twice = float(scale @ (by_T * by_T).sum(axis=1))
        return CostModel(value, gradient.ravel(), by_duration, band, twice)


def integral_costs(problem: Problem, model: CollisionModel) -> tuple[Cost, ...]:
    """Return the costs of a problem's objective beside time and jerk."""
    if not problem.objective.weights.keys() - PLAIN:
        return ()
    from optiplan.kinematics.symbolic.state import BatchedExpression, SymbolicState

    robot, weights = problem.robot, problem.objective.weights
    limits = robot.limits

    def expression(build: Build) -> tuple[Residuals, Build]:
        batched = BatchedExpression(robot, "residual", build)

        def residuals(curve: Curve) -> tuple[Array, tuple[Array, Array, Array]]:
            value, (by_q, by_v, by_a) = batched(curve.motion)
            return value, (by_q, by_v, by_a)

        return residuals, build

    def length(k: "SymbolicState", rate: Any) -> Any:
        return (rate.T @ rate + _STILL**2) ** 0.25

    def centring(k: "SymbolicState") -> Any:
        limited = has_range(limits)
        half = np.where(limited, 0.5 * (limits.upper - limits.lower), np.inf)
        middle = np.where(limited, 0.5 * (limits.upper + limits.lower), 0.0)
        return (k.q - k.constant(middle)) * k.constant(1.0 / half)

    makers: dict[str, Callable[[], tuple[Residuals, Build | None]]] = {
        "energy": lambda: (TorqueTerm(robot, np.full(robot.n, np.inf)).residuals, SymbolicState.torque),
        "joint_path": lambda: expression(lambda k: length(k, k.v)),
        "tool_path": lambda: expression(lambda k: length(k, k.twist("tool").linear)),
        "tool_smoothness": lambda: expression(lambda k: k.acceleration("tool").linear),
        "manipulability": lambda: expression(lambda k: (SINGULAR + k.manipulability("tool")) ** -0.5),
        "centring": lambda: expression(centring),
        "clearance": lambda: (_Nearness(model), None),
    }
    return tuple(IntegralCost(name, weights[name], *makers[name]()) for name in weights if name not in PLAIN)


class _Nearness:
    """Residual sqrt(0.1 m - d) of the nearest obstacle at each sample."""

    def __init__(self, model: CollisionModel) -> None:
        self._model, self._outside = model, of_obstacles(model)

    def __call__(self, curve: Curve) -> tuple[Array, tuple[Array, Array, Array]]:
        Q = curve.motion[0]
        found, none = self._model.near(Q, CLEAR), np.zeros((len(Q), 1, Q.shape[1]))
        lacking, slope = np.zeros((len(Q), 1)), none.copy()
        if len(found.rows):
            gradients = self._model.gradients(Q, found)
            order = np.argsort(found.distance, kind="stable")[::-1]  # of each sample the nearest pair comes last
            order = order[self._outside[found.pairs[order]]]
            rows = found.rows[order]
            lacking[rows, 0] = np.sqrt(CLEAR - found.distance[order])
            slope[rows, 0] = -0.5 * gradients[order] / np.maximum(lacking[rows], np.sqrt(0.01 * CLEAR))
        return lacking, (slope, none, none)


def shares(u: Array) -> Array:
    """Return the share of the motion (N,) that each sample at u (N,) stands for: half-way to its neighbours."""
    edges = np.concatenate([[0.0], 0.5 * (u[1:] + u[:-1]), [1.0]])
    return np.diff(edges)


class JerkCost:
    """w * (integral of squared jerk) = w T^-5 C' H C; exact at all times."""

    name = "jerk"
    timed = True

    def __init__(self, weight: float, basis: SplineBasis) -> None:
        self.weight, self.basis = weight, basis
        self._half = basis.by_variables(basis.jerk_gram)  # (K, M)
        gram = basis.by_variables(self._half.T)  # (M, M)
        points = len(gram)
        self._band = np.zeros((points, REACH))
        for d in range(min(REACH, points)):
            self._band[: points - d, d] = np.diagonal(gram, d)

    def value(self, curve: Curve) -> float:
        """Return the weighted cost, s."""
        scale = self.weight * curve.duration**-5
        return scale * float(np.sum(curve.control * (self.basis.jerk_gram @ curve.control)))

    def model(self, curve: Curve) -> CostModel:
        """Return the cost with its derivatives."""
        scale, cost = self.weight * curve.duration**-5, self.value(curve)
        gradient = 2.0 * scale * (self._half.T @ curve.control).ravel()
        joints = curve.control.shape[1]
        band = np.repeat(2.0 * scale * self._band[:, :, None], joints, axis=2)
        return CostModel(cost, gradient, -5.0 * cost / curve.duration, band)
