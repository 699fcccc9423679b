"""What a design is worth: reached volume, manipulability, torques, tip-over margin, cycle time, mass."""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.geometry.support_polygon import SupportPolygon
from optiplan.kinematics.manipulability import JacobianRows, ToolKinematics, scaled, yoshikawa
from optiplan.planners.base import Budget
from optiplan.planners.tours.placing import PlaceScore
from optiplan.problem.load import problem_from_dict
from optiplan.records import dataclass
from optiplan.robot.batched.base_reaction import base_reaction
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.robot import Robot
from optiplan.studies.study import DesignStudy, TaskSource, Values
from optiplan.workspace.reach import sampling_range, shoulder_point

_SCORING = 30.0
"""s for the score of one task; it takes milliseconds."""

_CUBES = 100
"""Cubes along the largest reach at most: eight million in all, which take half a gigabyte while they are counted."""

_POSE = 6
"""Joints that a pose of the tool needs; the manipulability of fewer is that of the tool's velocity alone."""


class MeasureMeaning(NamedTuple):
    """Unit and meaning of a measure."""

    unit: str
    meaning: str


MEASURES = {
    "reach_volume": MeasureMeaning("m³", "reached part of the ball of the largest reach, above the ground"),
    "manipulability": MeasureMeaning("1", "mean of Yoshikawa's measure, lengths in units of the largest reach"),
    "torque": MeasureMeaning("N·m", "the largest torque of a turning joint"),
    "torque_share": MeasureMeaning("1", "the largest torque or force of a joint, as a share of its limit"),
    "tip_over": MeasureMeaning("m", "least distance of the zero-moment point from an edge of the support, inside"),
    "cycle_time": MeasureMeaning("s", "sum over the tasks of the least times of straight joint motions"),
    "mass": MeasureMeaning("kg", "mass of the robot with its base"),
}
"""Measures by name. The states they are taken over are of the study; bodies and contacts are left aside."""


@dataclass(frozen=True, eq=False)
class DesignStates:
    """K states of a robot.

    Attributes:
        Q: configurations (K, n), rad or m, uniform within the limits of position.
        V: velocities (K, n), rad/s or m/s: +- `motion` times the limits.
        A: accelerations (K, n), rad/s² or m/s²: +- `motion` times the limits.
    """

    Q: Array
    V: Array
    A: Array


def states_of(robot: Robot, count: int, motion: float, seed: int) -> DesignStates:
    """Return the states that a design is measured over: for the same seed the same shares of every robot's limits."""
    rng = np.random.default_rng(seed)
    lower, upper = sampling_range(robot)
    Q = lower + (upper - lower) * rng.random((count, robot.n))
    signs = rng.choice([-1.0, 1.0], (2, count, robot.n))
    fastest = [np.where(np.isfinite(limit), limit, 0.0) for limit in (robot.limits.velocity, robot.limits.acceleration)]
    return DesignStates(Q, motion * signs[0] * fastest[0], motion * signs[1] * fastest[1])


class DesignMeasures:
    """The measures of a study's designs; only those are taken that the study names."""

    def __init__(self, study: DesignStudy) -> None:
        self.study = study
        spec = study.spec
        named = [*spec.maximise, *spec.minimise, *spec.require]
        self.names = tuple(name for name in MEASURES if name in named)

    def of(self, values: Values) -> dict[str, float]:
        """Return the measures of the design with these parameters.

        Raises:
            InputError, OptiPlanError: the parameters make no robot that can be measured.
        """
        study, spec = self.study, self.study.spec.states
        robot = study.robot(values)
        support = study.support(values)
        states = states_of(robot, spec.count, spec.motion, spec.seed)
        found: dict[str, float] = {}
        if {"reach_volume", "manipulability"} & set(self.names):
            found |= _kinematic(robot, states, support, spec.voxel)
        if {"torque", "torque_share"} & set(self.names):
            found |= torques(robot, inverse_dynamics(robot, states.Q, states.V, states.A))
        if "tip_over" in self.names and support is not None:
            wrench = base_reaction(robot, states.Q, states.V, states.A)
            found["tip_over"] = float(support.margins(wrench).min())
        if "cycle_time" in self.names:
            found["cycle_time"] = sum(straight_time(robot, task) for task in study.tasks)
        found["mass"] = float(sum(body.mass for body in robot.model.inertias))
        return {name: found[name] for name in self.names}


def _kinematic(robot: Robot, states: DesignStates, support: SupportPolygon | None, edge: float) -> dict[str, float]:
    X_WT, J = ToolKinematics(robot).evaluate(states.Q)
    shoulder = shoulder_point(robot)
    away = X_WT[:, :3, 3] - shoulder
    largest = _largest(away)
    ground = -np.inf if support is None else support.height - float(shoulder[2])
    part: JacobianRows = "full" if robot.n >= _POSE else "translation"
    return {
        "reach_volume": reached_volume(away, edge, largest, ground),
        "manipulability": float(yoshikawa(scaled(J, part, largest)).mean()),
    }


def _largest(away: Array) -> float:
    """Return the largest distance, m, of points (K, 3) from the shoulder."""
    return max(float(np.linalg.norm(away, axis=1).max()), 1e-9)


def reached_volume(points: Array, edge: float, largest: float, ground: float = -np.inf) -> float:
    """Reached part, m³, of the ball of radius `largest`, m, about the origin, above z = `ground`.

    It is the ball's volume there times the share of its cubes of edge `edge`, m, in which one of the points (K, 3), m,
    lies; cubes go by their centre. Few points in small cubes miss some, so compare equal numbers only. No point is
    further away than `largest`.

    Raises:
        OptiPlanError: the cubes are so small that there are too many.
    """
    side = int(np.ceil(largest / edge))
    if side > _CUBES:
        raise OptiPlanError(f"found cubes of {edge:g} m; expected at most {_CUBES} along the reach of {largest:.3g} m")
    line = (np.arange(2 * side) - side + 0.5) * edge
    centres = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    counted = (np.linalg.norm(centres, axis=1) <= largest) & (centres[:, 2] > ground)
    if not counted.any():
        return 0.0
    cells = np.clip(np.floor(points / edge).astype(np.int64) + side, 0, 2 * side - 1)
    reached = np.zeros(len(centres), dtype=bool)
    reached[(cells[:, 0] * 2 * side + cells[:, 1]) * 2 * side + cells[:, 2]] = True
    cut = min(max(ground, -largest), largest)
    ball = np.pi * (2.0 / 3.0 * largest**3 - largest**2 * cut + cut**3 / 3.0)
    return float(reached[counted].mean() * ball)


def torques(robot: Robot, tau: Array) -> dict[str, float]:
    """Return `torque` and `torque_share` of the torques (K, n) of K states, N·m or N."""
    largest = np.abs(tau).max(axis=0, initial=0.0)
    limit = robot.limits.torque
    share = np.divide(largest, limit, out=np.zeros_like(largest), where=np.isfinite(limit) & (limit > 0.0))
    return {"torque": float(largest[robot.revolute].max(initial=0.0)), "torque_share": float(share.max(initial=0.0))}


def straight_time(robot: Robot, task: TaskSource) -> float:
    """Return the least time, s, of straight joint motions through the places of a task; infinite where one is missing.

    It knows nothing of obstacles between the places, so it ranks designs and promises no duration.
    """
    problem = problem_from_dict(task.for_robot(robot), task.base)
    return PlaceScore(problem, Budget(_SCORING)).at(np.zeros(4))[1]


def check_measures(study: DesignStudy) -> None:
    """Refuse a study whose given design cannot be measured: no masses, or a task that cannot be read.

    Raises:
        InputError: with the line of the task, or of the robot.
    """
    robot, document = study.robot(study.values(study.given)), study.document
    names = set(DesignMeasures(study).names)
    issues = []
    if names & {"torque", "torque_share", "tip_over", "mass"} and not robot.has_inertia:
        issues.append(document.issue(("robot",), "a robot whose links have no mass", "rows with `mass:`"))
    if "torque_share" in names and not np.isfinite(robot.limits.torque).any():
        issues.append(document.issue(("robot",), "a robot without limits of torque", "`limits: {torque: …}`"))
    if names & {"reach_volume", "manipulability"}:
        issues += _small_cubes(study)
    for k, task in enumerate(study.tasks):
        try:
            problem_from_dict(task.for_robot(robot), task.base)
        except InputError as error:
            for issue in error.issues:
                place = ("tasks", k, *issue.path) if isinstance(study.spec.tasks[k], dict) else ("tasks", k)
                issues.append(document.issue(place, f"{issue.field}: {issue.found}", issue.expected))
        except OptiPlanError as error:
            issues.append(document.issue(("tasks", k), str(error), "a problem that the design can be given"))
    if issues:
        raise InputError(issues)


def _small_cubes(study: DesignStudy) -> list[Issue]:
    """Return an issue of cubes that are too small for the reach of the given design, or of one at an end of the ranges.

    Raises:
        OptiPlanError: a sliding joint without limits.
    """
    spec, reach = study.spec.states, 0.0
    for x in (study.given, study.lower, study.upper):
        robot = study.robot(study.values(x))
        X_WT, _ = ToolKinematics(robot).evaluate(states_of(robot, spec.count, spec.motion, spec.seed).Q)
        reach = max(reach, _largest(X_WT[:, :3, 3] - shoulder_point(robot)))
    if reach <= _CUBES * spec.voxel:
        return []
    expected = f"at least {1.01 * reach / _CUBES:.3g} m, for a reach of {reach:.3g} m"
    return [study.document.issue(("states", "voxel"), f"{spec.voxel:g} m", expected)]
