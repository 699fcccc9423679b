"""How near stops along a proved path are to the fastest ones: laws of `op.Executor` beside IPOPT.

    python benchmarks/execution_oracle.py                        # 12 stops on each of four runs, some minutes
    python benchmarks/execution_oracle.py --stops 30 --markdown oracle.md

The oracle minimises the time until the robot stands still on the path: 80 pieces of constant s''' and of equal, free
length, with the limits of acceleration, jerk and torque at both ends of each. It begins at the executor's law and holds
limits at those points alone, so its time is a little too short. Where the best stop is the end of the motion, both
agree and nothing is compared. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

from typing import Any

import casadi as ca
import numpy as np
from published import finish, percentiles, table_parser

import optiplan as op
from optiplan.execution.paths.path_laws import PathPlace
from optiplan.execution.paths.proved_path import ProvedPath
from optiplan.robot.batched.dynamics import inverse_dynamics

RUNS = ("01_reach", "09_ur5", "15_srra", "22_via_spline")
PIECES, GRID = 80, 800
HEADINGS = ("run", "stops", "executor s, median", "IPOPT s, median", "executor / IPOPT: median", "90 %", "largest")


def main() -> None:
    """Stop, compare, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--stops", type=int, default=12, help="on each run")
    parser.add_argument("--runs", nargs="+", default=list(RUNS), help="names of shipped problems")
    options = parser.parse_args()
    rows, data = [], {}
    for name in options.runs:
        run = op.plan(op.load_problem(name), budget=5.0)
        found = compared(run, options.stops)
        ours, best = np.array(found).reshape(-1, 2).T
        medians, shares = (percentiles(times, 50)[0] for times in (ours, best)), percentiles(ours / best, 50, 90, 100)
        rows.append([name, f"{len(found)}", *(f"{x:.3f}" for x in (*medians, *shares))])
        data[name] = {"executor": ours.tolist(), "ipopt": best.tolist()}
        print(f"{name}: {len(found)} stops", flush=True)
    finish(options.markdown, HEADINGS, rows, data)


def compared(run: op.Run, stops: int) -> list[tuple[float, float]]:
    """Times of the executor and of the oracle, s, of random stops that end before the motion does."""
    laws, oracle = ProvedPath(run, "Executor").forwards.laws, Oracle(run)
    rng, found = np.random.default_rng(1), list[tuple[float, float]]()
    for _ in range(10 * stops):
        law = laws.change(PathPlace(float(rng.uniform(0.0, run.duration)), 1.0, 0.0), 0.0, 0.0)
        if law is None or law.at(law.settled)[0] >= 0.999 * run.duration:
            continue
        best = oracle.stop(law)
        if best is not None:
            found.append((law.settled, min(best, law.settled)))
        if len(found) == stops:
            break
    return found


class Oracle:
    """The fastest stop along a motion as a nonlinear program."""

    def __init__(self, run: op.Run) -> None:
        motion, limits, robot = run.trajectory, run.problem.limits, run.problem.robot
        grid = np.linspace(0.0, motion.duration, GRID)
        q, *rates = (motion(grid, order) for order in range(4))
        still = np.zeros_like(q)
        g = inverse_dynamics(robot, q, still, still)
        a = inverse_dynamics(robot, q, still, rates[0]) - g
        b = inverse_dynamics(robot, q, rates[0], rates[1]) - g
        table = np.hstack([*rates, a, b, g])
        self._at = ca.interpolant("path", "linear", [grid], table.ravel())
        self._n, self._end = motion.n, motion.duration
        bounds = [limits.acceleration, limits.jerk, limits.torque]
        self._bound = np.minimum(np.concatenate(bounds), 1e6)

    def stop(self, law: Any) -> float | None:
        """Return the time of the fastest stop from where the law begins, s; None where IPOPT finds none."""
        T, j = ca.MX.sym("T"), ca.MX.sym("j", PIECES)
        X = ca.MX.sym("X", 3, PIECES + 1)  # s, s', s''
        h, s, v, a = T / PIECES, X[0, :], X[1, :], X[2, :]
        next_s = s[:-1] + h * v[:-1] + h**2 / 2 * a[:-1] + h**3 / 6 * j.T
        steps = [s[1:] - next_s, v[1:] - (v[:-1] + h * a[:-1] + h**2 / 2 * j.T), a[1:] - (a[:-1] + h * j.T)]
        rows = [self._rows(s[k + end], v[k + end], a[k + end], j[k]) for k in range(PIECES) for end in (0, 1)]
        guess_t = np.linspace(0.0, law.settled, PIECES + 1)
        guess = np.array([law.at(float(t)) for t in guess_t])
        x = ca.vertcat(T, j, ca.vec(X))
        constraint = ca.vertcat(*[ca.vec(step) for step in steps], *rows)
        solver = ca.nlpsol(
            "stop",
            "ipopt",
            {"x": x, "f": T, "g": constraint},
            {
                "print_time": False,
                "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 300, "hessian_approximation": "limited-memory"},
            },
        )
        low, high = np.full((3, PIECES + 1), -np.inf), np.full((3, PIECES + 1), np.inf)
        low[0], high[0] = guess[0, 0], self._end
        low[1], high[1] = 0.0, 1.0
        low[:, 0] = high[:, 0] = guess[0]
        low[1:, -1] = high[1:, -1] = 0.0
        equal = 3 * PIECES
        answer = solver(
            x0=np.concatenate([[law.settled], np.diff(guess[:, 2]) / np.diff(guess_t), guess.ravel()]),
            lbx=np.concatenate([[0.01], np.full(PIECES, -1e5), low.T.ravel()]),
            ubx=np.concatenate([[law.settled], np.full(PIECES, 1e5), high.T.ravel()]),
            lbg=np.concatenate([np.zeros(equal), -np.ones(constraint.numel() - equal)]),
            ubg=np.concatenate([np.zeros(equal), np.ones(constraint.numel() - equal)]),
        )
        return float(answer["x"][0]) if solver.stats()["success"] else None

    def _rows(self, s: ca.MX, v: ca.MX, a: ca.MX, j: ca.MX) -> ca.MX:
        """Return acceleration, jerk and torque over their limits."""
        first, second, third, by_a, by_v, rest = ca.vertsplit(self._at(s), self._n)
        rows = [second * v**2 + first * a, third * v**3 + 3 * second * v * a + first * j, by_a * a + by_v * v**2 + rest]
        return ca.vertcat(*rows) / self._bound


if __name__ == "__main__":
    main()
