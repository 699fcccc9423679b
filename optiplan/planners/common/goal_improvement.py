"""Move goal configurations nearer to the start within a pose's tolerance and along an arm's redundancy."""

from itertools import product

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.libraries import loading
from optiplan.problem.problem import PoseGoal, Problem, RegionGoal
from optiplan.problem.regions.sampling import RegionSampler
from optiplan.records import dataclass
from optiplan.robot.robot import Robot
from optiplan.trajectory.timing.lower_bound import joint_times, lower_bound

_STEPS, _LEAST_GAIN = 25, 1e-3  # steps, at most; share of the bound: after a smaller gain the trust region shrinks
_FIRST, _SHORTEST = 0.3, 0.02  # trust region r at first, and at last
_LONGEST = 0.4  # rad or m: of a joint in one step
_SMOOTH = 1e-3  # weight of the squared step beside the time, so that the minimiser is unique
_NEAR, _APART = 0.04, 1e-3  # m: nearer pairs of bodies limit a step, and keep this distance

_SHARE = 0.9  # share of the tolerance used; the rest is for the error of the planned end
_FINE = 1e-3  # m and rad: smaller tolerances are met exactly, since the program's own accuracy is of that size
_NORMALS = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_NORMALS /= np.linalg.norm(_NORMALS, axis=1, keepdims=True)
_INNER = 0.87  # share of a radius: the polytope of these 26 half-spaces then lies within the ball, nearly


class NearerEnds:
    """Find configurations in a pose goal or a region with successively smaller lower bounds of the duration.

    The bound is max_j T_j(|q_j - start_j|), with T_j the fastest motion of joint j from rest to rest. With s_j the
    distance that joint j covers in the time T of the slowest, each step solves

        min_{d, tau} tau + 1/2 1e-3 |d / s|^2   s.t.  |q_j + d_j - start_j| <= tau s_j,  |d_j| <= r s_j,  limits

    and the rows of the goal's set. Then the configuration is brought back into the set, and the step is accepted if the
    bound has fallen. Sequential linear programming in a trust region r. Among obstacles every near pair with clearance
    d_k adds a row d_k + grad d_k . d >= min(d_k, 1 mm), and a step that collides is refused. So configurations stay
    free, and slide along obstacles.
    """

    def __init__(self, problem: Problem, goal: PoseGoal | RegionGoal) -> None:
        robot = problem.robot
        self._start, self._limits = problem.start, problem.limits
        self._set = PoseSet(robot, goal) if isinstance(goal, PoseGoal) else RegionSet(robot, goal)
        self._moving = joints_that_move(robot, goal.frame)
        self._distances = np.geomspace(1e-4, 100.0, 120)
        self._times = joint_times(np.repeat(self._distances[:, None], robot.n, axis=1), problem.limits)

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is in the goal."""
        return self._set.contains(q)

    def towards_start(self, q: Array, model: CollisionModel | None = None) -> list[Array]:
        """Return the steps from q (n,) within the goal, the soonest reached last; empty where none is sooner.

        With a model, among its obstacles, from a q that is free.
        """
        passed: list[Array] = []
        q = np.where(self._moving, q, self._start)
        bound, radius = lower_bound(self._start, q, self._limits), _FIRST
        near: tuple[Array, Array] | None = None  # of this q: a step that is refused leaves it as it is
        for _ in range(0 if self._set.point else _STEPS):
            if radius < _SHORTEST or bound == 0.0:
                break
            near = near or self._apart(model, q)
            step = self._step(q, bound, radius, near)
            new = None if step is None else self._set.settle(q + step)
            reached = np.inf if new is None else lower_bound(self._start, new, self._limits)
            if new is None or reached >= bound or (model is not None and model.collides(new)):
                radius *= 0.4
                continue
            if reached > (1.0 - _LEAST_GAIN) * bound:
                radius *= 0.4
            q, bound, radius, near = new, reached, min(1.5 * radius, 1.0), None
            passed.append(q)
        return passed

    def _step(self, q: Array, bound: float, radius: float, near: tuple[Array, Array]) -> Array | None:
        """Return the best step d (n,) within the trust region, by the linearised pose; None if infeasible.

        Args:
            q: (n,) where it begins.
            bound: s, of q.
            radius: of the trust region.
            near: gradients (k, n) and distances (k,), m, of the pairs that are near at q.
        """
        with loading():
            import piqp

        n, offset = len(q), q - self._start
        scale = np.array([np.interp(bound, times, self._distances) for times in self._times.T])
        own, (apart, clearance) = self._set.rows(q), near
        reach = np.minimum(radius * scale, _LONGEST)
        low = np.append(np.maximum(self._limits.lower - q, -reach), 0.0)
        high = np.append(np.minimum(self._limits.upper - q, reach), 2.0)
        weights, cost = np.diag(np.append(_SMOOTH / scale**2, 1e-9)), np.append(np.zeros(n), 1.0)
        A = np.zeros((len(own.b), n + 1))
        A[:, :n] = own.A
        G = np.zeros((2 * n + len(own.h) + len(clearance), n + 1))
        np.fill_diagonal(G[:n], 1.0)
        np.fill_diagonal(G[n : 2 * n], -1.0)
        G[:n, n] = G[n : 2 * n, n] = -scale
        G[2 * n :, :n] = np.concatenate([own.G, -apart])
        h = np.concatenate([-offset, offset, own.h, clearance - np.minimum(clearance, _APART)])
        solver = piqp.DenseSolver()
        solver.setup(weights, cost, A, own.b, G, np.full(len(h), -np.inf), h, low, high)
        solved = solver.solve() == piqp.PIQP_SOLVED
        return np.where(self._moving, solver.result.x[:n], 0.0) if solved else None

    @staticmethod
    def _apart(model: CollisionModel | None, q: Array) -> tuple[Array, Array]:
        """Return gradients (k, n) and distances (k,), m, of the pairs that are near at q (n,); none without a model."""
        if model is None:
            return np.zeros((0, len(q))), np.zeros(0)
        found = model.near(q[None], _NEAR)
        return model.gradients(q[None], found), found.distance


@dataclass(frozen=True, eq=False)
class StepRows:
    """Equalities A d = b and inequalities G d <= h that a step d (n,) of the joints keeps."""

    A: Array
    b: Array
    G: Array
    h: Array


class PoseSet:
    """Configurations in a pose goal: |e_p - J_p d| <= rho_p, |e_R - J_R d| <= rho_R, the balls as polytopes.

    Attributes:
        point: whether steps within it have practically no freedom.
    """

    def __init__(self, robot: Robot, goal: PoseGoal) -> None:
        oriented = goal.orientation < np.pi
        self._descent = Descent(robot, goal.frame, oriented)
        self._descent.aim(goal.X_WG)
        self._radii = _SHARE * goal.position, _SHARE * goal.orientation
        rows = 6 if oriented else 3
        self.point = robot.n <= rows and max(goal.position, goal.orientation if oriented else 0.0) <= _FINE

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is within the tolerance."""
        e, _ = self._descent.error(q)
        return bool(np.linalg.norm(e[:3]) <= self._radii[0] and np.linalg.norm(e[3:]) <= self._radii[1])

    def settle(self, q: Array) -> Array | None:
        """Return a configuration (n,) near q within limits and the tolerance; None if that is not found."""
        return self._descent.settle(self._descent.inside(q), *self._radii)

    def rows(self, q: Array) -> StepRows:
        """Return rows that keep a step from q (n,) in the set, to first order."""
        e, J = self._descent.error(q)
        n = len(q)
        equal, value, rows, upper = [np.zeros((0, n))], [np.zeros(0)], [np.zeros((0, n))], [np.zeros(0)]
        for part, rho in zip((slice(0, 3), slice(3, 6)), self._radii, strict=True):
            if rho <= _FINE:
                equal.append(J[part])
                value.append(e[part])
            elif len(J[part]):
                rows.append(-_NORMALS @ J[part])
                upper.append(np.maximum(_INNER * rho - _NORMALS @ e[part], 0.0))
        return StepRows(np.vstack(equal), np.concatenate(value), np.vstack(rows), np.concatenate(upper))


class RegionSet:
    """Configurations in a region: low <= c + A J d <= high of its coordinates c.

    Attributes:
        point: whether steps within it have practically no freedom.
    """

    def __init__(self, robot: Robot, goal: RegionGoal) -> None:
        self._sampler, self._descent = RegionSampler(robot, goal), Descent(robot, goal.frame)
        self._goal = goal.inner(_SHARE)
        self._fine = goal.high - goal.low <= 2.0 * _FINE
        self.point = robot.n <= 6 and bool(self._fine.all())

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is in the region."""
        return self._sampler.contains(q)

    def settle(self, q: Array) -> Array | None:
        """Return a configuration (n,) near q within limits and the region; None if that is not found."""
        found, inside = self._sampler.onto(q)
        return found if inside else None

    def rows(self, q: Array) -> StepRows:
        """Return rows that keep a step from q (n,) in the set, to first order."""
        X_WF, goal = self._descent.place(q).copy(), self._goal
        c, J = goal.coordinates(X_WF), goal.rates(X_WF) @ self._descent.jacobian(q)
        middle = 0.5 * (goal.low[self._fine] + goal.high[self._fine])
        below, above = np.isfinite(goal.low) & ~self._fine, np.isfinite(goal.high) & ~self._fine
        G = np.vstack([-J[below], J[above]])
        h = np.concatenate([(c - goal.low)[below], (goal.high - c)[above]])
        return StepRows(J[self._fine], middle - c[self._fine], G, np.maximum(h, 0.0))
