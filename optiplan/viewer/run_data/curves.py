"""Curves of one run for the page: joints up to the jerk with their limits, torques, tools, manipulability."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array, finite_or_none
from optiplan.kinematics.manipulability import JacobianRows, ToolKinematics, manipulability_measures, scaled
from optiplan.kinematics.mecanum import WHEELS, wheel_rates_along
from optiplan.problem.problem import Problem
from optiplan.robot.frames import frame_poses
from optiplan.robot.limits import ORDERS, Limits, joint_units
from optiplan.robot.robot import Robot
from optiplan.trajectory.trajectory import Extrema, Trajectory
from optiplan.viewer.plots.curves import MotionCurves, motion_curves
from optiplan.viewer.plots.refined_extrema import PieceSamples, refined_extrema
from optiplan.viewer.surfaces import base64_of

_MORE = 2  # times the samples asked for are kept at the most, where pieces are many
_APART = 1e-6  # share of the duration by which the two samples at a breakpoint are told apart


def curves_of(problem: Problem, trajectory: Trajectory, least: int) -> dict[str, Any]:
    """JSON-ready curves: `t` (k,), s, and `quantities`, each with `y` (k, m) of its m series; arrays packed.

    A series has `low` and `high`, its limits or None, and `extrema`, [t, y] each: of the joints' derivatives the exact
    ones over all time, of the others those of dense samples, refined between them.
    """
    found = motion_curves(problem, trajectory, least)
    step = max(1, -(-len(found.t) // (_MORE * least)))
    kept = np.unique(np.append(np.arange(0, len(found.t), step), len(found.t) - 1))
    t = found.t[kept]
    t = t + _APART * trajectory.duration * np.append(0.0, np.diff(t) <= 0.0)
    samples = PieceSamples.of(trajectory, least)
    quantities = [*_derivatives(problem, found), _torque(problem, found), *_tools(problem, samples)]
    quantities += _wheels(problem, samples)
    for quantity in quantities:
        quantity["y"] = base64_of(quantity["y"][kept])
    return {"t": base64_of(t), "quantities": quantities}


def _derivatives(problem: Problem, found: MotionCurves) -> list[dict[str, Any]]:
    robot, limits = problem.robot, problem.limits
    bounds = [(limits.lower, limits.upper), *((-rate, rate) for rate in limits.rates)]
    shown = []
    for order, (name, (low, high)) in enumerate(zip(ORDERS, bounds, strict=True)):
        data = _quantity(name, joint_units(name, robot.revolute), short_names(robot.joint_names), found.joints[order])
        data |= {"low": list(map(finite_or_none, low)), "high": list(map(finite_or_none, high))}
        shown.append(data | {"extrema": _extrema(found.extrema[order]), "of": "joints", "kind": "exact"})
    return shown


def _torque(problem: Problem, found: MotionCurves) -> dict[str, Any]:
    limits: Limits = problem.limits
    unit = joint_units("torque", problem.robot.revolute)
    data = _quantity("torque", unit, short_names(problem.robot.joint_names), found.torque)
    data |= {"low": list(map(finite_or_none, -limits.torque)), "high": list(map(finite_or_none, limits.torque))}
    return data | {"extrema": _extrema(found.torque_extrema), "of": "joints", "kind": "sampled"}


def _tools(problem: Problem, samples: PieceSamples) -> list[dict[str, Any]]:
    """Speed, turning and manipulability of each tool, m series each, and of each the extremum that matters."""
    frames = tool_frames(problem.robot)
    kinematics = [ToolKinematics(problem.robot, frame) for frame in frames]
    rows: JacobianRows = "full" if problem.robot.n >= 6 else "translation"

    def at(inside: PieceSamples) -> Array:
        states = inside.states()
        found = [one.evaluate(states[0])[1] for one in kinematics]
        twists = [np.einsum("kij,kj->ki", J, states[1]) for J in found]
        speeds = [np.linalg.norm(twist[:, part], axis=1) for part in (slice(3), slice(3, 6)) for twist in twists]
        return np.column_stack([*speeds, *(manipulability_measures(scaled(J, rows)).yoshikawa for J in found)])

    values = at(samples)
    extrema = _extrema(refined_extrema(samples, values, at))
    shown = []
    for place, (name, unit, shows) in enumerate(
        (("tool speed", "m/s", 0), ("tool turning", "rad/s", 0), ("manipulability", "", 1))
    ):
        own, free = slice(place * len(frames), (place + 1) * len(frames)), [None] * len(frames)
        data = _quantity(name, unit, list(frames), values[:, own]) | {"low": free, "high": free, "of": "tools"}
        shown.append(data | {"extrema": [[both[shows]] for both in extrema[own]], "kind": "sampled"})
    return shown


def _wheels(problem: Problem, samples: PieceSamples) -> list[dict[str, Any]]:
    """Rates of the mecanum wheels of a robot that has them."""

    def at(inside: PieceSamples) -> Array | None:
        return wheel_rates_along(problem.robot, *inside.states()[:2])

    rates = at(samples)
    if rates is None:
        return []
    free = [None] * len(WHEELS)
    data = _quantity("wheels", "rad/s", [name.replace("_", " ") for name in WHEELS], rates)
    found = refined_extrema(samples, rates, lambda inside: np.asarray(at(inside)))
    return [data | {"low": free, "high": free, "of": "wheels", "extrema": _extrema(found), "kind": "sampled"}]


def _quantity(name: str, unit: str, names: Sequence[str], values: Array) -> dict[str, Any]:
    return {"name": name, "unit": unit, "series": list(names), "y": values}


def _extrema(e: Extrema) -> list[list[list[float]]]:
    columns = zip(e.t_high, e.high, e.t_low, e.low, strict=True)
    return [[[float(t1), float(y1)], [float(t0), float(y0)]] for t1, y1, t0, y0 in columns]


def short_names(names: Sequence[str]) -> list[str]:
    """Names without what all of them begin with, up to the last underscore of that."""
    common = names[0] if len(names) > 1 else ""
    for name in names:
        while not name.startswith(common):
            common = common[:-1]
    cut = common.rfind("_") + 1
    return [name[cut:] for name in names]


def tool_frames(robot: Robot) -> tuple[str, ...]:
    """The robot's tool frame, the TCPs of other tools of a task, and the frame of an arm beside it.

    That is the frame of the same name with left and right exchanged.
    """
    own = robot.tool_frame
    twins = (own.replace("left", "right"), own.replace("right", "left"))
    joints = {int(robot.model.frames[robot.frame_id(own)].parentJoint)}
    found = [own]
    for twin in twins:
        if twin != own and robot.model.existFrame(twin):
            joint = int(robot.model.frames[robot.model.getFrameId(twin)].parentJoint)
            if joint and joint not in joints:
                found.append(twin)
    tools = [one.name for one in robot.mounting.frames if not one.held]
    return tuple(dict.fromkeys([*found, *tools]))


def tool_points(robot: Robot, Q: Array) -> Mapping[str, Array]:
    """Positions, m, of each tool frame at Q (k, n): (k, 3)."""
    return {name: frame_poses(robot, Q, name)[:, :3, 3] for name in tool_frames(robot)}
