"""Joint values by name in files and in Python: the same problem as with lists, and errors with line and field."""

import math

import pytest
import yaml

import optiplan as op
from optiplan.problem.schema.problem import problem_schema
from optiplan.service.cell import _numbers, _request

NAMES = [f"panda_joint{k}" for k in range(1, 8)]
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
GOAL = [0.3, -0.6, 0.1, -2.1, 0.1, 1.6, 0.5]

SLIDE = """<robot name="slide"><link name="a"/><link name="b"/><link name="c"/>
  <joint name="turn" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""


def named(values, names=NAMES):
    """Values by joint, the last joint first: the order of a mapping means nothing."""
    return dict(reversed(list(zip(names, values, strict=True))))


def written(tmp_path, data, name="one"):
    path = tmp_path / f"{name}.yaml"
    path.write_text(yaml.safe_dump({"version": 1, "name": "same"} | data, sort_keys=False))
    return path


def issue(path):
    with pytest.raises(op.InputError) as caught:
        op.load_problem(path)
    (only,) = caught.value.issues
    return only


def by_name(value, key=None):
    """All lists of seven numbers under the keys of joint values, by name."""
    if isinstance(value, dict):
        return {key: by_name(item, key) for key, item in value.items()}
    if isinstance(value, list) and key in ("joints", "joints_deg", "velocity", "acceleration"):
        return named(value)
    return [by_name(item) for item in value] if isinstance(value, list) else value


@pytest.mark.parametrize(
    "data",
    [
        {"start": {"joints": READY}, "goal": {"joints_deg": [math.degrees(q) for q in GOAL]}},
        {
            "start": {"joints": READY, "velocity": [0.01] * 6 + [0.02], "acceleration": [0.0] * 6 + [0.1]},
            "goal": {"any_of": [{"joints": GOAL, "velocity": [0.0] * 6 + [0.1]}, {"configuration": "ready"}]},
            "via": [{"joints": READY, "velocity": [0.1] * 6 + [0.2], "time": 1.0}],
        },
        {
            "start": {"joints": READY},
            "task": [{"move": {"joints": GOAL, "via": [{"joints": READY}]}}, {"move": {"any_of": [{"joints": READY}]}}],
        },
    ],
    ids=["ends", "rates, alternatives and vias", "task"],
)
def test_a_file_with_names_is_the_problem_of_the_lists(tmp_path, data):
    data = {"robot": "panda"} | data
    lists, names = (op.load_problem(written(tmp_path, one, k)) for k, one in (("a", data), ("b", by_name(data))))
    assert names.hash == lists.hash
    assert names.source == lists.source
    assert (names.start == lists.start).all()


def test_a_step_of_a_group_names_the_joints_of_the_group(tmp_path):
    start = {"joints": named([*READY, 0.04], [*NAMES, "panda_finger_joint1"])}
    step = {"gripper": {"group": "hand", "joints": {"panda_finger_joint1": 0.02}}}
    data = {"robot": "panda", "start": start, "task": [{"move": {"joints": named(GOAL)}}, step]}
    task = op.load_problem(written(tmp_path, data)).task
    assert [one.action.goal[0].q.tolist() for one in task] == [GOAL, [0.02]]
    step["gripper"]["joints"] = {"panda_joint1": 0.02}
    found = issue(written(tmp_path, data))
    assert found.field == "task[1].gripper.joints.panda_joint1"
    assert found.expected.startswith("one of: panda_finger_joint1")


def test_a_robot_file_takes_names(tmp_path):
    text = """version: 1\nname: mine\nurdf: slide.urdf\ncollision: none\nconfigurations:
  home: {slide: 0.2, turn: 0.1}\n"""
    (tmp_path / "slide.urdf").write_text(SLIDE)
    (tmp_path / "robot.yaml").write_text(text)
    assert op.load_robot(tmp_path / "robot.yaml").configurations["home"].tolist() == [0.1, 0.2]
    (tmp_path / "robot.yaml").write_text(text.replace("slide: 0.2, ", ""))
    with pytest.raises(
        op.InputError, match=r"robot.yaml:6: configurations.home: no value of slide; expected a value of"
    ):
        op.load_robot(tmp_path / "robot.yaml")
    (tmp_path / "robot.yaml").write_text(text.replace("slide:", "slid:"))
    with pytest.raises(op.InputError, match=r"robot.yaml:6: configurations.home.slid: unknown joint 'slid'; "):
        op.load_robot(tmp_path / "robot.yaml")


def test_a_sliding_joint_stays_in_metres(tmp_path):
    (tmp_path / "slide.urdf").write_text(SLIDE)
    data = {"robot": {"urdf": "slide.urdf", "collision": "none"}, "start": {"joints": {"slide": 0.2, "turn": 0.1}}}
    problem = op.load_problem(written(tmp_path, data | {"goal": {"joints_deg": {"slide": 0.5, "turn": 90.0}}}))
    assert problem.start.tolist() == [0.1, 0.2]
    assert problem.goal[0].q.tolist() == [math.pi / 2, 0.5]


def test_an_unknown_joint_has_its_line_and_the_names(tmp_path):
    joints = named(READY)
    joints["panda_joint8"] = joints.pop("panda_joint3")
    path = written(tmp_path, {"robot": "panda", "start": {"joints": joints}, "goal": {"joints": GOAL}})
    found = issue(path)
    assert (found.file, found.field) == (str(path), "start.joints.panda_joint8")
    assert path.read_text().splitlines()[found.line - 1].strip().startswith("panda_joint8:")
    assert found.found == "unknown joint 'panda_joint8'"
    assert all(name in found.expected for name in NAMES)


def test_a_missing_joint_is_named(tmp_path):
    joints = named(READY)
    del joints["panda_joint3"]
    path = written(tmp_path, {"robot": "panda", "start": {"joints": READY}, "goal": {"any_of": [{"joints": joints}]}})
    found = issue(path)
    assert (found.field, found.found) == ("goal.any_of[0].joints", "no value of panda_joint3")
    assert found.expected == f"a value of each joint: {', '.join(NAMES)}"


@pytest.mark.parametrize(("key", "beside"), [("move", {"group": ["arm"]}), ("arm", {})])
def test_a_group_that_is_no_name_is_reported_alone(tmp_path, key, beside):
    step = {"move": {"joints": named(READY), **beside}, **({"arm": ["arm"]} if key == "arm" else {})}
    found = issue(written(tmp_path, {"robot": "panda", "start": {"joints": READY}, "task": [step]}))
    assert found.field == ("task[0].arm" if key == "arm" else "task[0].move.group")
    assert (found.found, found.expected) == ("a list of 1 value", "text")


def test_a_value_that_does_not_fit_is_named(tmp_path):
    for value, words in (("0.1", "'0.1'"), (9.0, "panda_joint3 = 9 rad, outside its limits")):
        data = {"start": {"joints": named(READY) | {"panda_joint3": value}}, "goal": {"joints": GOAL}}
        found = issue(written(tmp_path, {"robot": "panda"} | data))
        assert (found.field, found.found) == ("start.joints.panda_joint3", words)


def test_python_takes_names_in_every_statement():
    panda = op.load_robot("panda")
    goal = op.JointGoal(named(GOAL), velocity=named([0.0] * 6 + [0.1]))
    via = op.ViaPoint(named(READY), velocity=named([0.1] * 7), time=1.0)
    names = op.Problem(panda, named(READY), goal, vias=[via])
    goal = op.JointGoal(GOAL, velocity=[0.0] * 6 + [0.1])
    lists = op.Problem(panda, READY, goal, vias=[op.ViaPoint(READY, velocity=[0.1] * 7, time=1.0)])
    assert names.hash == lists.hash
    tasks = [op.Task().move(q, vias=[v]) for q, v in ((named(GOAL), named(READY)), (GOAL, READY))]
    assert len({op.Problem(panda, READY, task=task).hash for task in tasks}) == 1
    with pytest.raises(op.InputError, match=r"^op\.Problem: task\[0\]\.move\.joints\.elbow: unknown joint 'elbow'"):
        op.Problem(panda, READY, task=op.Task().move(named(GOAL) | {"elbow": 1.0}))


def test_a_state_takes_names_of_a_robot():
    panda = op.load_robot("panda")
    state = op.State(named(READY), named(GOAL), robot=panda)
    assert (state.q.tolist(), state.v.tolist()) == (READY, GOAL)
    assert op.State("ready", robot=panda).n == 7
    with pytest.raises(
        op.InputError, match=r"^op\.State: v: found unknown joint 'elbow'; expected one of: panda_joint1"
    ):
        op.State(READY, {"elbow": 1.0}, robot=panda)
    with pytest.raises(op.InputError, match=r"^op\.State: q: found values by joint; expected `robot`"):
        op.State(named(READY))


def test_the_cell_client_takes_names():
    given = {name: _numbers(name, named(READY)) for name in ("joints", "velocities", "joint_target")}
    data = _request(given | {"budget": [1.0]})
    assert (data["start"], data["goal"]) == (
        {"joints": named(READY), "velocity": named(READY)},
        {"joints": named(READY)},
    )
    with pytest.raises(ValueError, match=r"^joints\['panda_joint1'\]: found \['x'\]; expected finite numbers"):
        _numbers("joints", {"panda_joint1": "x"})


def test_the_schema_for_editors_takes_both():
    joints = problem_schema()["$defs"]["StartSpec"]["properties"]["joints"]
    kinds = [kind["type"] for one in joints["anyOf"] for kind in one.get("anyOf", [one])]
    assert kinds == ["array", "object", "null"]
