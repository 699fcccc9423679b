"""Checks of what a `Controller` is given; errors name the function and the argument."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, number_argument
from optiplan.control.arguments import squares_are_finite
from optiplan.control.defaults import ORDER
from optiplan.control.limits.base import ControlLimit
from optiplan.errors import choice_argument, described, flag_argument, wrong_argument
from optiplan.geometry.pose import Pose
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State
from optiplan.trajectory.trajectory import Trajectory

Form = Literal["velocity", "acceleration"]
"""What tasks ask for, and how positions follow: see `Controller`."""


def check_step(robot: Robot, state: State, dt: float, function: str) -> None:
    """Refuse a state or a step that cannot be."""
    if not isinstance(state, State):
        raise wrong_argument(function, "state", described(state), "an op.State")
    number_argument(function, "dt", dt, "a finite number of seconds > 0", above=0.0)
    if state.n != robot.n:
        found = f"{state.n} joints"
        raise wrong_argument(function, "state.q", found, f"{robot.n}, those of {robot.name}")
    if not squares_are_finite(state.q, state.v, state.a):
        raise wrong_argument(function, *_not_finite(state), "finite numbers")


def _not_finite(state: State) -> tuple[str, str]:
    """Field and value of the first number of a state that is not finite."""
    for name in ("q", "v", "a"):
        bad = np.flatnonzero(~np.isfinite(getattr(state, name)))
        if len(bad):
            return f"state.{name}[{bad[0]}]", str(getattr(state, name)[bad[0]])
    return "state", "numbers whose squares overflow"


def check_options(robot: Any, scene: Any, form: Any, damping: Any, relax: Any, guess: Any, longest_step: Any) -> None:
    """Refuse arguments of `Controller` that cannot be."""
    if not isinstance(robot, Robot):
        raise wrong_argument("Controller", "robot", described(robot), "op.load_robot(…)")
    if scene is not None and not isinstance(scene, Scene):
        raise wrong_argument("Controller", "scene", described(scene), "op.Scene([…])")
    if isinstance(relax, str) or not isinstance(relax, Sequence):
        raise wrong_argument("Controller", "relax", described(relax), "a list of names of limits")
    if guess is not None:
        flag_argument("Controller", "guess", guess)
        words = "op.Controller: guess is deprecated; solver='native' begins at the active limits of the last step"
        warnings.warn(words, DeprecationWarning, stacklevel=3)
    choice_argument("Controller", "form", form, get_args(Form))
    number_argument("Controller", "damping", damping, "a finite number > 0", above=0.0)
    number_argument("Controller", "longest_step", longest_step, "a finite number of seconds > 0", above=0.0)


def all_of(parts: Iterable[object], kind: type, argument: str, expected: str) -> tuple:  # type: ignore[type-arg]
    """Return tasks or limits that are all of a kind."""
    try:
        found = tuple(parts)
    except TypeError:
        raise wrong_argument("Controller", argument, described(parts), f"a list of {argument}") from None
    for k, part in enumerate(found):
        if not isinstance(part, kind):
            raise wrong_argument("Controller", f"{argument}[{k}]", described(part), expected)
    return found


def relaxed_order(relax: Sequence[str], limits: Iterable[ControlLimit]) -> tuple[str, ...]:
    """Names of limits, the least important first."""
    if any(name not in ORDER for name in relax):
        raise wrong_argument("Controller", "relax", f"{relax!r}", f"names among: {', '.join(ORDER)}")
    own = dict.fromkeys(limit.name for limit in limits)
    others = [name for name in own if name not in ORDER]
    return (*others, *[name for name in ORDER if name not in relax], *relax)


def followed_motion(robot: Robot, run: Any) -> Trajectory:
    """Return the motion that `Controller.follow` is given: of a run, or itself."""
    motion = getattr(run, "trajectory", run)
    if not isinstance(motion, Trajectory):
        found = "a run without a motion" if motion is None else described(run)
        raise wrong_argument("Controller.follow", "run", found, "a run with a motion, or an op.Trajectory")
    if tuple(motion.joint_names) != tuple(robot.joint_names):
        found, expected = ", ".join(motion.joint_names), ", ".join(robot.joint_names)
        raise wrong_argument("Controller.follow", "run", f"a motion of {found}", f"one of {expected}")
    return motion


def seen(known: set[str], poses: Any, velocities: Any) -> tuple[dict[str, pin.SE3], dict[str, Array]]:
    """Return the poses and velocities that `Controller.update_scene` is given, of all obstacles in `poses`."""
    called, v = "Controller.update_scene", {} if velocities is None else velocities
    if not isinstance(poses, Mapping):
        raise wrong_argument(called, "poses", described(poses), "poses of obstacles by name")
    if not isinstance(v, Mapping):
        raise wrong_argument(called, "velocities", described(v), "velocities of obstacles by name")
    choices = f"one of: {', '.join(sorted(known))}" if known else "a controller with a scene of obstacles"
    for name, pose in poses.items():
        if name not in known:
            raise wrong_argument(called, "poses", f"an obstacle {name!r}", choices)
        if not isinstance(pose, Pose):
            raise wrong_argument(called, f"poses[{name!r}]", described(pose), "an op.Pose")
    for name in v:
        if name not in poses:
            raise wrong_argument(called, "velocities", f"an obstacle {name!r} without a pose", "one of `poses`")
    found = {name: _velocity(called, name, v.get(name, (0.0, 0.0, 0.0))) for name in poses}
    return {name: pin.SE3(pose.matrix) for name, pose in poses.items()}, found


def _velocity(called: str, name: str, value: Any) -> Array:
    try:
        vector = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.full(3, np.nan)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise wrong_argument(called, f"velocities[{name!r}]", described(value), "three finite numbers, m/s")
    return vector
