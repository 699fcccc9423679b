"""Move goal configurations nearer to the start within a pose's tolerance and along an arm's redundancy."""

from itertools import product

import numpy as np

from optiplan.arrays import Array
from optiplan.kinematics.ik.levenberg_marquardt import Descent
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.problem.problem import PoseGoal, Problem
from optiplan.trajectory.timing.lower_bound import joint_times, lower_bound

_SHARE = 0.9  # share of the tolerance used; the rest is for the error of the planned end
_FINE = 1e-3  # m and rad: smaller tolerances are met exactly, since the program's own accuracy is of that size
_STEPS, _LEAST_GAIN = 25, 1e-3
_FIRST, _SHORTEST, _LONGEST = 0.3, 0.02, 0.4
_SMOOTH = 1e-3  # weight of the squared step beside the time, so that the minimiser is unique
_NORMALS = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
_NORMALS /= np.linalg.norm(_NORMALS, axis=1, keepdims=True)
_INNER = 0.87  # share of a radius: the polytope of these 26 half-spaces then lies within the ball, nearly


class NearerEnds:
    """Find configurations within a pose goal's tolerance with successively smaller lower bounds of the duration.

    The bound is max_j T_j(|q_j - start_j|), with T_j the fastest motion of joint j from rest to rest. With s_j the
    distance that joint j covers in the time T of the slowest, each step solves

        min_{d, tau} tau + 1/2 1e-3 |d / s|^2   s.t.  |q_j + d_j - start_j| <= tau s_j,  |d_j| <= r s_j,  limits,
                                                      |e_p - J_p d| <= rho_p,  |e_R - J_R d| <= rho_R

    for the pose error e and the Jacobian J of the frame, the balls as polytopes; then the error is brought back within
    the tolerance, and the step is accepted if the bound has fallen. Sequential linear programming in a trust region r.
    """

    def __init__(self, problem: Problem, goal: PoseGoal) -> None:
        robot = problem.robot
        self._start, self._limits, self._box = problem.start, problem.limits, robot.limits
        self._descent = Descent(robot, goal.frame, goal.orientation < np.pi)
        self._descent.aim(goal.X_WG)
        self._moving = joints_that_move(robot, goal.frame)
        self._radii = _SHARE * goal.position, _SHARE * goal.orientation
        self._distances = np.geomspace(1e-4, 100.0, 120)
        self._times = joint_times(np.repeat(self._distances[:, None], robot.n, axis=1), problem.limits)
        rows = 3 if goal.orientation >= np.pi else 6
        self._idle = robot.n <= rows and max(goal.position, goal.orientation if rows == 6 else 0.0) <= _FINE

    def contains(self, q: Array) -> bool:
        """Return whether q (n,) is within the tolerance."""
        e, _ = self._descent.error(q)
        return bool(np.linalg.norm(e[:3]) <= self._radii[0] and np.linalg.norm(e[3:]) <= self._radii[1])

    def towards_start(self, q: Array) -> list[Array]:
        """Return the steps from q (n,) within the goal, the soonest reached last; empty where none is sooner."""
        passed: list[Array] = []
        q = np.where(self._moving, q, self._start)
        bound, radius = lower_bound(self._start, q, self._limits), _FIRST
        for _ in range(0 if self._idle else _STEPS):
            if radius < _SHORTEST or bound == 0.0:
                break
            step = self._step(q, bound, radius)
            new = None if step is None else self._descent.settle(self._descent.inside(q + step), *self._radii)
            reached = np.inf if new is None else lower_bound(self._start, new, self._limits)
            if new is None or reached >= bound:
                radius *= 0.4
                continue
            if reached > (1.0 - _LEAST_GAIN) * bound:
                radius *= 0.4
            q, bound, radius = new, reached, min(1.5 * radius, 1.0)
            passed.append(q)
        return passed

    def _step(self, q: Array, bound: float, radius: float) -> Array | None:
        """Return the best step d (n,) within the trust region, by the linearised pose; None if infeasible."""
        import piqp

        n, offset = len(q), q - self._start
        scale = np.array([np.interp(bound, times, self._distances) for times in self._times.T])
        e, J = self._descent.error(q)
        to_start = np.hstack([np.eye(n), -scale[:, None]]), np.hstack([-np.eye(n), -scale[:, None]])
        rows, upper = [*to_start], [-offset, offset]
        equal, value = [np.zeros((0, n + 1))], [np.zeros(0)]
        for part, rho in zip((slice(0, 3), slice(3, 6)), self._radii, strict=True):
            block = np.hstack([J[part], np.zeros((len(e[part]), 1))])
            if rho <= _FINE:
                equal.append(block)
                value.append(e[part])
            elif len(block):
                rows.append(-_NORMALS @ block)
                upper.append(np.maximum(_INNER * rho - _NORMALS @ e[part], 0.0))
        reach = np.minimum(radius * scale, _LONGEST)
        low = np.append(np.maximum(self._box.lower - q, -reach), 0.0)
        high = np.append(np.minimum(self._box.upper - q, reach), 2.0)
        weights, cost = np.diag(np.append(_SMOOTH / scale**2, 1e-9)), np.append(np.zeros(n), 1.0)
        solver = piqp.DenseSolver()
        A, b = np.vstack(equal), np.concatenate(value)
        G, h = np.vstack(rows), np.concatenate(upper)
        solver.setup(weights, cost, A, b, G, np.full(len(h), -np.inf), h, low, high)
        solved = solver.solve() == piqp.PIQP_SOLVED
        return np.where(self._moving, solver.result.x[:n], 0.0) if solved else None
