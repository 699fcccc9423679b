"""Targets that a positioner carries: its joints are searched too, and the proof has the targets where they are then."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from ruamel.yaml import YAML

import optiplan as op
from optiplan.errors import InputError
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.planners.tours.carrier import Carrier
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import derived
from optiplan.resources import problems_dir
from optiplan.robot.frames import frame_pose
from optiplan.verify.verify import verify
from tests.checks import named
from tests.planned import planned_until

SIDES = ("front middle", "back middle", "left high", "right low")
PLATE = "table/plate"


@pytest.fixture(scope="module")
def data():
    whole = YAML(typ="safe").load((problems_dir() / "55_positioner_spots.yaml").read_text())
    tour = whole["task"][0]["tour"]
    tour["targets"] = [one for one in tour["targets"] if one["name"] in SIDES]
    return whole


def changed(data, **tour):
    other = copy.deepcopy(data)
    other["task"][0]["tour"].update(tour)
    return other


@pytest.fixture(scope="module")
def problem(data):
    return problem_from_dict(data)


@pytest.fixture(scope="module")
def run(problem):
    found = planned_until(problem, seconds=20.0)
    assert found.verified, (found.failure, found.report)
    return found


def test_the_tool_meets_targets_that_have_turned_with_the_plate(problem, run):
    """Each target, placed by the plate's own pose then, is where the tool is: within a tenth of a millimetre."""
    targets = {one["name"]: one for one in problem.source["task"][0]["tour"]["targets"]}
    led = [one for one in run.trajectory.segments if one.kind == "tour" and one.name in targets]
    assert len(led) == len(SIDES)
    turned = []
    for one in led:
        q = run.trajectory(one.end)
        X_WC, X_WF = frame_pose(problem.robot, q, PLATE), frame_pose(problem.robot, q, problem.robot.tool_frame)
        stated = targets[one.name]
        axis = np.array(stated["axis"], float)
        there = X_WC.act(np.array(stated["position"]) - 0.02 * axis)
        assert np.linalg.norm(there - X_WF.translation) < 1e-4
        assert X_WF.rotation[:, 2] @ X_WC.rotation @ axis > 1.0 - 1e-6
        turned.append(q[problem.robot.joint_names.index("table/joint_1")])
    assert max(turned) - min(turned) > 1.0  # not all sides can be reached where it stands


def test_targets_that_did_not_turn_are_not_met(problem, run):
    """The same motion, judged as if the world carried the targets."""
    step = problem.task[0]
    still = derived(problem, task=(replace(step, action=replace(step.action, carried_by="")),))
    goal = named(verify(still, run.trajectory), "goal")
    assert not goal.passed


def test_positions_of_the_carrier(problem):
    carrier = Carrier(problem, PLATE)
    assert carrier.own == np.flatnonzero(joints_that_move(problem.robot, PLATE)).tolist()
    U = carrier.positions()
    assert np.allclose(U[0], problem.start[carrier.own])
    q = carrier.whole(problem.start[carrier.others], U[3])
    assert np.allclose(carrier.poses(U)[3], frame_pose(problem.robot, q, PLATE).homogeneous)
    near = carrier.near(U[:2], 0.1)
    assert np.allclose(near[:, 0], U[:2])
    assert np.abs(near - U[:2, None]).max() <= 0.4 + 1e-12
    world = Carrier(problem, "")
    assert world.positions().shape == (1, 0)
    assert np.allclose(world.poses(world.positions()), np.eye(4))


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ("table/plat", "unknown link 'table/plat'"),
        ("table/base_link", "which no joint of the tour moves"),
        ("arm/forearm_link", "moves together with"),
    ],
)
def test_other_links_are_refused(data, link, words):
    with pytest.raises(InputError, match=words):
        problem_from_dict(changed(data, carried_by=link))


def test_a_target_that_no_position_brings_near_is_named(data):
    far = [{"name": "far", "position": [0, 0, 3.0], "axis": [1, 0, 0]}]
    found = op.plan(problem_from_dict(changed(data, targets=far)), budget=2.0)
    assert found.failure.kind == "goal-unreachable"
    assert "'far'" in found.failure.detail


def test_arms_without_a_closed_form_descend():
    """The Panda meets two sides of a box on a plate."""
    plate = {
        "version": 1,
        "name": "turntable",
        "dh": {
            "convention": "standard",
            "unit": "deg",
            "rows": [{"name": "plate", "joint": "revolute", "d": 0.2, "limits": [-180, 180], "mass": 5}],
            "radius": 0.05,
        },
        "tool_frame": "plate",
        "limits": {"velocity": [2.0], "acceleration": [4.0], "jerk": [40], "torque": [200]},
    }
    names = [f"arm/panda_joint{k}" for k in range(1, 8)]
    ready = [0, -0.785, 0, -2.356, 0, 1.571, 0.785]
    targets = [
        {"name": "near", "position": [-0.1, 0, 0.25], "axis": [1, 0, 0]},
        {"name": "behind", "position": [0.1, 0, 0.25], "axis": [-1, 0, 0]},
    ]
    robots = {"arm": {"use": "panda"}, "table": {"use": plate, "base": {"position": [0.55, 0, 0]}}}
    start = {"joints": {**dict(zip(names, ready, strict=True)), "table/joint_1": 0.0}}
    task = [{"tour": {"targets": targets, "carried_by": PLATE}}]
    found = planned_until(problem_from_dict({"version": 1, "robots": robots, "start": start, "task": task}))
    assert found.verified, (found.failure, found.report)


def test_a_clearance_goes_with_a_carrier(data):
    """The arm alone has fewer joints than the robot about whose ends pairs may be nearer."""
    asked = problem_from_dict({**data, "clearance": {"scene": 0.002}})
    found = planned_until(asked)
    assert found.verified, (found.failure, found.report)
    ended = derived(asked, scene=asked.scene.ending_at(asked.start, asked.start))
    alone = Carrier(ended, PLATE).problem
    assert all(q.shape == (alone.robot.n,) for q in alone.scene.safety.ends)
