"""Units follow the type of the joint: a base that slides is in m and N, wherever a joint is named."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.geometry.scene import Scene
from optiplan.problem.constraints.motions import JointCoupling
from optiplan.problem.objectives.objective import UNITS, part_unit
from optiplan.problem.problem import Problem, derived
from optiplan.robot.limits import joint_unit, joint_units, thousandths
from optiplan.robot.robot import load_robot
from optiplan.robot.urdf.export import export_urdf
from optiplan.trajectory.given_files import GivenFiles
from optiplan.trajectory.sample_file import Samples
from optiplan.trajectory.state import State
from optiplan.verify.verify import verify
from tests.checks import named
from tests.robot.robots import chain, joint, write_robot
from tests.verify.motions import problem_of, quintic

QUANTITIES = ("position", "velocity", "acceleration", "jerk", "torque")


@pytest.fixture(scope="module")
def base():
    """Two slides and a turn."""
    return load_robot("delbot", group="base")


def of_joints(report, robot):
    """The checks whose place is a joint, with its index."""
    names = list(robot.joint_names)
    return [(check, names.index(check.place)) for check in report.checks if check.place in names]


def test_a_unit_is_of_a_joint():
    assert [joint_unit(quantity, True) for quantity in QUANTITIES] == ["rad", "rad/s", "rad/s²", "rad/s³", "N·m"]
    assert [joint_unit(quantity, False) for quantity in QUANTITIES] == ["m", "m/s", "m/s²", "m/s³", "N"]
    assert joint_units("velocity", [True, True]) == "rad/s"
    assert joint_units("torque", [False, True]) == joint_units("torque") == "N·m or N"
    assert thousandths([False]) == "mm"
    assert thousandths([False, True]) == "mrad or mm"


@pytest.mark.parametrize("moved", [0, 2])
def test_every_check_of_a_joint_has_its_unit(base, moved):
    """The joint moves far beyond everything and ends elsewhere, so that each check names it."""
    step = np.zeros(base.n)
    step[moved] = 40.0
    motion = quintic(base.joint_names, np.zeros(base.n), step, 1.0)
    at = JointCoupling({base.joint_names[moved]: 1.0}, 0.0, 0.1)
    problem = problem_of(base, motion, Scene())
    problem = derived(problem, start=step, goal=(replace(problem.goal[0], q=-step),), path_constraints=(at,))
    t = np.array([0.0, motion.duration])
    report = verify(problem, motion, given=GivenFiles(Samples(base.joint_names, t, motion(t) + 0.1 * step)))
    length = "rad" if base.revolute[moved] else "m"
    expected = {"start": length, "goal": length, "position": length, "velocity": f"{length}/s"}
    expected |= {"acceleration": f"{length}/s²", "jerk": f"{length}/s³", "samples": length}
    found = {check.name: check.unit for check, j in of_joints(report, base) if j == moved}
    assert found.items() >= expected.items()
    coupling = named(report, "coupling constraint")
    assert coupling.unit == length


def test_a_via_of_a_slide_is_in_metres(base):
    motion = quintic(base.joint_names, np.zeros(base.n), np.array([1.0, 0.0, 0.0]), 5.0)
    problem = Problem(base, start=motion.start, goal=motion.end, vias=[[0.5, 0.1, 0.0]])
    via = named(verify(problem, motion), "via")
    assert via.unit == "m"
    assert "missed by 0.1 m" in via.detail


def test_a_slide_is_driven_by_a_force(tmp_path):
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    heavy = f'<link name="b"><inertial><mass value="1"/>{inertia}</inertial></link>'
    parts = ['<link name="a"/>', heavy, joint("j", "a", "b", "prismatic")]
    robot = load_robot(str(write_robot(tmp_path, parts, "collision: none\n")))
    motion = quintic(robot.joint_names, [0.0], [0.5], 20.0)
    (torque,) = (check for check in verify(problem_of(robot, motion, Scene()), motion).checks if check.name == "torque")
    assert (torque.unit, torque.place) == ("N", "j")


def test_limits_that_are_assumed_have_the_units_of_their_joints(tmp_path):
    free = '<limit lower="-1" upper="1" effort="1" velocity="0"/>'
    parts = chain(joint("s", "a", "b", "prismatic", inside=free), joint("t", "b", "c", inside=free))
    notes = load_robot(str(write_robot(tmp_path, parts))).notes
    assert any("any joint: 1 rad/s or m/s is taken" in note for note in notes)
    alone = chain(joint("s", "a", "b", "prismatic", inside=free))
    notes = load_robot(str(write_robot(tmp_path / "alone", alone))).notes
    assert any("any joint: 10 m/s² is taken" in note for note in notes)


def test_messages_about_states_and_planners_are_in_metres(base):
    fast = State(np.zeros(base.n), np.array([90.0, 0.0, 0.0]), np.zeros(base.n))
    with pytest.raises(InputError, match=r"= 90 m/s, beyond its limit"):
        Problem(base, start=fast, goal=[1.0, 0.0, 0.0])
    run = op.plan(Problem(base, start=np.zeros(base.n), goal=[3.0, 0.0, 0.0]), "quintic", {"duration": 0.5})
    assert run.failure is not None
    assert "m/s" in run.failure.detail
    assert "rad" not in run.failure.detail


def test_parts_of_an_objective_have_the_units_of_the_joints():
    assert part_unit("joint_path", [True]) == UNITS["joint_path"]
    assert part_unit("joint_path", [False]) == "m"
    assert part_unit("jerk", [True, False]) == "rad² s⁻⁵ or m² s⁻⁵"
    assert part_unit("energy", [False]) == "N² s"
    assert part_unit("time", [True, False]) == "s"


def test_limits_by_name_leave_the_others_to_the_urdf(tmp_path):
    urdf = chain(joint("j1", "a", "b"), joint("j2", "b", "c"))
    path = write_robot(tmp_path, urdf, "limits: {velocity: {j2: 0.5}, jerk: {j1: 40}}")
    limits = load_robot(str(path)).limits
    plain = load_robot(str(write_robot(tmp_path / "plain", urdf))).limits
    assert limits.velocity.tolist() == [plain.velocity[0], 0.5]
    assert limits.jerk.tolist() == [40.0, 500.0]
    assert (limits.acceleration == plain.acceleration).all()


def test_rates_of_urdf_1_2(tmp_path):
    """Of acceleration and deceleration the smaller counts; what follows a joint by m takes 1/m of its own limits."""
    free = '<limit lower="-1" upper="1" velocity="1" effort="1" {}/>'
    first = free.format('acceleration="0.5" deceleration="0.4" jerk="8"')
    tail = free.format('jerk="3"') + '<mimic joint="j1" multiplier="-2"/>'
    parts = chain(joint("j1", "a", "b", inside=first), joint("j2", "b", "c"), joint("f", "c", "d", inside=tail))
    robot = load_robot(str(write_robot(tmp_path, parts)))
    assert robot.limits.acceleration.tolist() == [0.4, 10.0]
    assert robot.limits.jerk.tolist() == [1.5, 500.0]
    assert any("no acceleration limit is given for j2:" in note for note in robot.notes)
    own = load_robot(str(write_robot(tmp_path / "own", parts, "limits: {acceleration: 2, jerk: 30}")))
    assert own.limits.acceleration.tolist() == [2.0, 2.0]
    limit = ET.fromstring(export_urdf(own)).find("joint[@name='j1']/limit")
    assert [limit.get(key) for key in ("acceleration", "deceleration", "jerk")] == ["2.0", "2.0", "30.0"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("{j3: 1}", "limits.velocity.j3: unknown joint 'j3'"),
        ("{j2: 0}", "limits.velocity.j2: 0; expected a number > 0"),
    ],
)
def test_wrong_limits_by_name_are_named(tmp_path, given, words):
    path = write_robot(tmp_path, chain(joint("j1", "a", "b"), joint("j2", "b", "c")), f"limits: {{velocity: {given}}}")
    with pytest.raises(InputError) as caught:
        load_robot(str(path))
    assert words in str(caught.value)
