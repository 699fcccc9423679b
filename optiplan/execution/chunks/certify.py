"""`certify`: a chunk of set-points of a learned policy becomes a motion that is proved until the robot stands still."""

import math
from collections.abc import Mapping
from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, number_argument
from optiplan.errors import OptiPlanError, described, wrong_argument
from optiplan.execution.arguments import numbers
from optiplan.execution.chunks.chunk import Chunk
from optiplan.execution.chunks.search import ChunkSearch, Prepared
from optiplan.geometry.pose import Pose
from optiplan.problem.problem import Problem
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.warm_proof import MOST_DEGREE, MOST_JOINTS, WarmProof

MOST_SET_POINTS = 1000
"""In one chunk."""

ROUNDED_TO_REST = 1e-10
"""rad or m per s and s²: a joint that is no faster stands still but for rounding."""

_kept: WeakKeyDictionary[Problem, Prepared] = WeakKeyDictionary()


def certify(
    problem: Problem,
    q: object,
    t: object = None,
    *,
    start: State | Trajectory | None = None,
    poses: Mapping[str, Pose] | None = None,
    clearance: float = 0.0,
) -> Chunk:
    """Prove a chunk of set-points, or the nearest chunk that can be proved, or a stop; never send what is not proved.

    The motion is the cubic spline with continuous acceleration through the set-points at their times, from the state of
    the robot, and after the last one the stop of every joint within its limits. So it ends at rest, and the robot may
    follow it to its end if the next chunk comes late or never. Without times the set-points are passed as fast as the
    limits admit, and the robot comes to rest at the last one.

    1. That motion is `proved`, if it is.
    2. Else set-points x minimise the sum of |x_i - q_i|^2, in the Euclidean norm over the joints, within the limits and
       with the distances of bodies linearised, up to three times: `nearest`, if that is proved.
    3. Else the robot follows the chunk as far as it is proved, and stops: `stopped`.
    4. Else it is `refused`: keep to the motion of the chunk before, which ends at rest.

    Wrong shapes are errors of the program and raise. Wrong numbers are errors of the policy and end in the proved stop:
    NaN, times that do not rise, set-points out of reach.

    What depends on the problem alone is prepared in the first call with it, which takes much longer.

    Holds at: all times of the motion, rounding included.

    Args:
        problem: robot, scene and limits; its goal and vias are ignored.
        q: set-points (k, n), rad or m; 1 to 1000 of them.
        t: (k,) s, rising, from 0 at the start of the motion; None: none.
        start: where the robot is: a `State`, or the motion that it would run from now on, to rest, such as
            `chunk.rest(0.1)`, which is then another stop that is tried. None: the problem's start.
        poses: of obstacles of the scene that stand elsewhere by now, by name.
        clearance: m, to keep from obstacles.

    Returns:
        The outcome with the motion to send.

    Raises:
        InputError: arrays of the wrong shape, unknown obstacles, or a problem with a task, path constraints, a
            `clearance`, a `tracking_error` or obstacles that move by the clock, which this proof does not cover.

    Example:
        >>> import numpy as np
        >>> import optiplan as op
        >>> problem = op.load_problem("01_reach")
        >>> ramp = problem.start + np.linspace(0.0, 0.1, 11)[1:, None] ** 2
        >>> op.certify(problem, ramp, 0.05 * np.arange(1, 11))
        Chunk: proved as it is, 10 set-points, 0.500 s
    """
    prepared = _prepared(problem)
    number_argument("certify", "clearance", clearance, "a distance >= 0, m", 0.0)
    n = problem.robot.n
    Q, times = _numbers("q", q), None if t is None else _numbers("t", t)
    if Q.ndim != 2 or Q.shape[1] != n or not 1 <= len(Q) <= MOST_SET_POINTS:
        expected = f"(k, {n}): 1 to {MOST_SET_POINTS} set-points of {n} joints"
        raise wrong_argument("certify", "q", f"an array of shape {Q.shape}", expected)
    if times is not None and times.shape != (len(Q),):
        raise wrong_argument("certify", "t", f"an array of shape {times.shape}", f"({len(Q)},): a time a set-point")
    state = _state(problem, start)
    X = _poses(prepared.proof, poses)
    rest = start if isinstance(start, Trajectory) else None
    with prepared.lock:  # another thread may have obstacles elsewhere
        prepared.proof.place(X)
        return ChunkSearch(problem, prepared, Q, times, state, rest, X, float(clearance)).chunk()


def _prepared(problem: Problem) -> Prepared:
    """Return what is kept of the problem, made where there is none."""
    if not isinstance(problem, Problem):
        raise wrong_argument("certify", "problem", described(problem), "op.Problem(…) or op.load_problem(…)")
    if problem not in _kept:
        found = _not_covered(problem)
        if found:
            expected = "one robot among obstacles that stand still; `clearance=…` says how far off"
            raise wrong_argument("certify", "problem", found, expected)
        try:
            proof = WarmProof(problem)
        except OptiPlanError as error:
            raise OptiPlanError(f"op.certify: {error}") from None
        limits = problem.limits
        _kept[problem] = Prepared(proof, np.array([limits.lower, limits.upper, *limits.rates]), Lock())
    return _kept[problem]


def _not_covered(problem: Problem) -> str:
    """Return what of the problem the proof does not cover, or nothing."""
    if problem.task:
        return "a problem with a task"
    if problem.path_constraints:
        return f"a problem with the path constraint `{problem.path_constraints[0].KEY}`"
    if problem.scene.safety is not None:
        return "a problem with a `clearance` of its own"
    if problem.tracking_error.any():
        return "a problem with a `tracking_error`, within which the joints may be off the motion"
    moving = problem.scene.dynamic_obstacles
    if moving:
        return f"a problem in which '{moving[0].name}' moves by the clock"
    return f"{problem.robot.n} joints" if problem.robot.n > MOST_JOINTS else ""


def _numbers(name: str, values: object) -> Array:
    """Return an argument as an array of its own."""
    if isinstance(values, np.ndarray) and values.dtype == np.float64:
        return np.array(values, order="C")
    found = numbers(values)
    if not found.size:
        raise wrong_argument("certify", name, described(values), "an array of numbers")
    return np.ascontiguousarray(found)


def _state(problem: Problem, start: State | Trajectory | None) -> Array:
    """Return the state (3, n) at which the motion begins."""
    state = problem.start_state if start is None else start
    if isinstance(state, Trajectory):
        if state.joint_names != problem.robot.joint_names:
            raise wrong_argument("certify", "start", "a motion of other joints", "a motion of the problem's robot")
        if state.coefficients.shape[1] > MOST_DEGREE + 1:
            found = f"a motion of degree {state.coefficients.shape[1] - 1}"
            raise wrong_argument("certify", "start", found, f"at most {MOST_DEGREE}")
        c = state.coefficients[0]
        rows = [c[k] * math.factorial(k) if k < len(c) else np.zeros(state.n) for k in range(3)]
        return _still(np.array(rows))
    if not isinstance(state, State):
        raise wrong_argument("certify", "start", described(start), "a State or a Trajectory")
    if state.n != problem.robot.n:
        raise wrong_argument("certify", "start", f"a state of {state.n} joints", f"one of {problem.robot.n}")
    return _still(np.array([state.q, state.v, state.a]))


def _still(state: Array) -> Array:
    """Return a state (3, n) without the rounding that a motion at rest has left."""
    state[1:][np.abs(state[1:]) < ROUNDED_TO_REST] = 0.0
    return state


def _poses(proof: WarmProof, poses: Mapping[str, Pose] | None) -> dict[str, pin.SE3]:
    """Return the poses of obstacles in the world."""
    if poses is None:
        return {}
    if not isinstance(poses, Mapping) or not all(isinstance(pose, Pose) for pose in poses.values()):
        raise wrong_argument("certify", "poses", described(poses), "poses by name")
    for name in poses:
        if name not in proof.obstacles:
            expected = f"one of: {', '.join(proof.obstacles)}" if proof.obstacles else "a scene with obstacles"
            raise wrong_argument("certify", "poses", f"an obstacle '{name}'", expected)
    return {name: pin.SE3(pose.matrix) for name, pose in poses.items()}
