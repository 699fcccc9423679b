"""A motion for each kind of path constraint that the constraint hinders, or nearly so."""

import numpy as np

import optiplan as op
from optiplan.problem.constraints.base import circle_of
from tests.planned import planned_until

GOAL = op.Pose((0.4, 0.4, 0.5), rpy=(np.pi, 0.0, 0.0))
FROM, TO = [0.30702, 0.0, 0.48687], [0.4, 0.4, 0.5]
START = [0.307019570, 0.0, 0.486869558]
CENTRE, NORMAL, RADIUS, _ = circle_of(*(np.array(point) for point in (FROM, [0.36, 0.2, 0.52], TO)))
CIRCLE = {"centre": CENTRE.tolist(), "normal": NORMAL.tolist(), "radius": RADIUS}
SCREW = {"axis": [0, 0, 1], "point": [0.0, 0.0, 0.2], "pose": {"position": START, "rpy": [np.pi, 0.0, 0.0]}}
DRIVEN = [0.8, 0.5, 1.0, -0.5, -1.0, -1.3, -1.9, 1.57, 0.3]
TURNED = {"position": [0.0, 0.0, 0.107], "rpy": [0.0, 0.0, -0.7853981633974483]}

CONSTRAINTS = {
    "orientation": {"axis": [0, 0, 1], "toward": [0, 0, -1], "within": 0.1745},
    "orientation, narrow": {"axis": [0, 0, 1], "toward": [0, 0, -1], "within": 0.01},
    "position": {"box": {"size": [0.3, 0.6, 0.1], "pose": {"position": [0.35, 0.2, 0.5]}}},
    "plane": {"normal": [0.974041, -0.226416, 0.0], "offset": 0.299048, "within": 0.002},
    "line": {"from": FROM, "to": TO, "within": 0.001},
    "tool_speed": {"linear": 0.5, "angular": 0.5},
    "clearance": {"pairs": [["panda_hand", "panda_link0"]], "at_least": 0.44},
    "relative_pose": {"frame": "panda_hand", "to": "panda_link7", **TURNED},
    "fixed_orientation": {"rpy": [np.pi, 0.0, 0.0], "within": 0.01},
    "fixed_orientation, wide": {"rpy": [np.pi, 0.0, 0.0], "within": 0.1},
    "look_at": {"axis": [0, 0, 1], "target": [0.35, 0.2, -1.0], "within": 0.2},
    "arc": {"from": FROM, "through": [0.36, 0.2, 0.52], "to": TO, "within": 0.002},
    "circle": {**CIRCLE, "within": 0.002},
    "screw": {**SCREW, "tolerance": {"position": 0.002, "orientation": 0.01}},
    "screw, pitch": {**SCREW, "pitch": 0.1, "tolerance": {"position": 0.002, "orientation": 0.01}},
    "tool_acceleration": {"linear": 2.0, "angular": 4.0},
    "manipulability": {"at_least": 0.06},
    "coupling": {"joints": {"panda_joint3": 1.0, "panda_joint5": 1.0}, "within": 0.2},
    "wheel_speed": {"at_most": 10.0},
    "tip_over": {"corners": [[-0.18, -0.18], [0.18, -0.18], [0.18, 0.18], [-0.18, 0.18]], "margin": 0.01},
}
KIND = {"tool_acceleration": "sampled", "manipulability": "sampled", "coupling": "exact"}
"""Of the check, where it is not continuous."""


def problem_of(name):
    """A motion that the constraint named hinders or nearly so."""
    if key_of(name) == "wheel_speed":
        return op.Problem("delbot", start=[0.0] * 3 + [0.3, -1.2, -1.6, -1.9, 1.57, 0.0], goal=DRIVEN)
    goal = GOAL
    if key_of(name) == "screw":
        c, s = np.cos(0.5), np.sin(0.5)
        up = 0.05 if "pitch" in name else 0.0
        goal = op.Pose((c * START[0], s * START[0], START[2] + up), rpy=(np.pi, 0.0, 0.5))
    return op.Problem("panda", start="ready", goal=goal)


def stated(name):
    return problem_of(name).with_constraints({key_of(name): CONSTRAINTS[name]})


def key_of(name):
    return name.split(",")[0]


def assert_held_and_proved(name: str, planner: str) -> op.Run:
    """Plan the case of that name, and find its constraint among the checks, of the kind it is proved by."""
    run = planned_until(stated(name), planner)
    assert run.verified, run.failure
    checks = [check for check in run.report.checks if check.name.endswith("constraint")]
    assert checks
    assert all(check.kind == KIND.get(key_of(name), "continuous") for check in checks)
    return run
