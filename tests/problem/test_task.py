"""Tasks of several steps: what is read, what is refused, and where."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.load import check_file, load_problem, problem_from_dict
from optiplan.problem.task.scene_change import carrying, scene_after
from optiplan.problem.task.steps import Attach, Detach, Dwell, Move, StraightLine

FILE = Path(__file__).with_name("one_cube.yaml")


@pytest.fixture(scope="module")
def problem():
    return load_problem(FILE)


def test_an_approach_is_a_move_and_a_line(problem):
    kinds = [type(step.action) for step in problem.task]
    line, move = StraightLine, Move
    assert kinds == [move, line, Attach, move, line, move, line, move, Detach, Dwell, line]
    assert [step.number for step in problem.task] == [1, 1, 2, 3, 4, 5, 5, 6, 7, 8, 9]
    before, at = problem.task[0].action.goal[0].X_WG, problem.task[1].action.ends[0].X_WG
    assert np.allclose(at.actInv(before).translation, [0, 0, -0.1])


def test_joints_of_all_groups_are_planned(problem):
    assert problem.robot.joint_names[-1] == "panda_finger_joint1"
    assert problem.robot.n == 8
    assert problem.task[3].action.joints == ("panda_finger_joint1",)
    assert len(problem.task[0].action.joints) == 7


def test_source_python_and_file_are_one_problem(problem, tmp_path):
    assert problem_from_dict(problem.source).hash == problem.hash
    problem.save(tmp_path / "again.yaml")
    assert load_problem(tmp_path / "again.yaml").hash == problem.hash
    down = {"rpy": (3.14159265, 0, 0)}
    fingers = ["panda_leftfinger", "panda_rightfinger"]
    task = (
        op.Task()
        .approach(op.Pose((0.5, 0.2, 0.03), **down), 0.1, name="reach")
        .attach("cube", "panda_hand", touch=fingers, mass=0.1)
        .gripper("hand", [0.025], name="close")
        .retreat(0.1, name="lift")
        .approach(op.Pose((0.5, -0.2, 0.031), **down), 0.1, name="put down")
        .gripper("hand", [0.04], name="open")
        .detach("cube")
        .dwell(0.2)
        .line(by=(0, 0, 0.1), speed=0.2, name="away")
    )
    built = op.Problem(op.load_robot("panda"), "ready", task=task, scene=problem.scene, name="one-cube")
    assert built.hash == problem.hash
    assert repr(task).startswith("Task: reach, attach cube, close")


def test_a_task_that_is_read_again_moves_the_same_joints(problem, tmp_path):
    """The robot of a task has the joints of all its groups; steps without a group move those of the problem's own."""
    task = [*problem.source["task"][:4], {"move": {"configuration": "ready"}}, *problem.source["task"][4:]]
    first = problem.with_parts(task=task)
    assert len(first.task[5].action.goal[0].q) == 7
    for again in (first.with_limits(velocity=0.5), first.with_limits()):
        for one, other in zip(first.task, again.task, strict=True):
            assert getattr(one.action, "joints", ()) == getattr(other.action, "joints", ())
    first.with_start("ready").save(tmp_path / "again.yaml")
    assert load_problem(tmp_path / "again.yaml").hash == first.hash
    listed = {"joints": problem.robot.configurations["ready"][:7].tolist()}
    assert problem.with_parts(task=[{"move": listed}, *problem.source["task"]]).with_limits(velocity=0.5).task


def test_what_is_held_goes_along_and_stays_where_it_is_released(problem):
    robot, q = problem.robot, np.array(problem.start)
    scene = scene_after(problem.scene, problem.task[2].action, robot, q)
    (held,) = scene.attached
    assert [body.name for body in scene.obstacles] == ["table"]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    link = robot.model.getFrameId("panda_hand")
    assert np.allclose((data.oMf[link] * held.X_LO).homogeneous, problem.scene.obstacles[1].X_WO.homogeneous)
    assert carrying(robot, scene).mounting.mass == pytest.approx(0.1)
    other = q + 0.1 * np.arange(8) / 8
    released = scene_after(scene, Detach("cube"), robot, other).obstacles[-1]
    pin.framesForwardKinematics(robot.model, data, other)
    assert np.allclose(released.X_WO.homogeneous, (data.oMf[link] * held.X_LO).homogeneous)


HOLD = "{object: cube, link: panda_hand"


@pytest.mark.parametrize(
    ("found", "instead", "line", "field", "words"),
    [
        (HOLD, "{object: cup, link: panda_hand", 11, "task[1].attach.object", "unknown object 'cup'"),
        (HOLD, "{object: cube, link: hand", 11, "task[1].attach.link", "unknown link 'hand'"),
        ("group: hand", "group: hnad", 12, "task[2].gripper.group", "unknown group 'hnad'"),
        ("joints: [0.025]", "joints: [0.05]", 12, "task[2].gripper.joints[0]", "outside its limits"),
        ("retreat: {distance: 0.1}", "retreat: {distance: -0.1}", 13, "task[3].retreat.distance", "-0.1"),
        ("retreat: {distance: 0.1}", "retreat: {distance: 0.1}, dwell: 1", 13, "task[3]", "retreat and dwell"),
        ("- dwell: 0.2", "- detach: {object: cube}", 17, "task[7].detach.object", "not held here"),
        ("by: [0, 0, 0.1]", "by: [0, 0, 0]", 18, "task[8].line.by", "no distance"),
        ("by: [0, 0, 0.1]", "by: [0, 0, 0.1], frame: tip", 18, "task[8].line.frame", "unknown frame 'tip'"),
        ("by: [0, 0, 0.1]", "by: [0, 0, 0.1], blend: 0.01", 18, "task[8].line.blend", "no line after it"),
        ("by: [0, 0, 0.1]", "by: [0, 0, 0.1], blend: -1", 18, "task[8].line.blend", "-1"),
        ("retreat: {distance: 0.1}", "approach: {joints: [0], distance: 0.1}", 13, "task[3].approach", "any_of poses"),
        ("dwell: 0.2", "{dwell: 1, allowed_collisions: [[cube, x]]}", 17, "task[7].allowed_collisions[0][1]", "'x'"),
        ("task:", "goal: {configuration: ready}\ntask:", 9, "goal", "beside a task"),
    ],
)
def test_bad_steps_are_refused_with_their_line(tmp_path, found, instead, line, field, words):
    text = FILE.read_text()
    assert found in text
    path = tmp_path / "bad.yaml"
    path.write_text(text.replace(found, instead, 1))
    issues = [issue for issue in check_file(path) if issue.field == field]
    assert [issue.line for issue in issues] == [line], check_file(path)
    assert words in issues[0].found + issues[0].expected


def test_a_step_ends_at_rest(tmp_path):
    """A rate at one of several ends was read, and asked of nobody."""
    path = tmp_path / "moving.yaml"
    one = "{joints: [0.3, -0.7, 0, -2.3, 0, 1.5, 0.7], velocity: [0.5, 0, 0, 0, 0, 0, 0]}"
    head = "version: 1\nrobot: panda\nstart: {configuration: ready}\ntask:\n"
    path.write_text(f"{head}  - move: {{any_of: [{one}]}}\n")
    (issue,) = check_file(path)
    assert (issue.line, issue.field) == (5, "task[0].move.any_of[0].velocity")


@pytest.mark.parametrize(("group", "expected"), [("dual", "left_gripper"), ("right", "right_gripper")])
def test_a_step_is_about_the_tool_of_its_group(group, expected):
    down = {"pose": {"position": [0.7, -0.3, 0.3], "rpy": [3.1416, 0, 0]}}
    keep = [{"tool_speed": {"linear": 0.2}}]
    steps = [
        {"line": {"by": [0, 0, 0.1], "group": "right"}, "path_constraints": keep},
        {"move": {**down, "group": "right"}},
        {"approach": {**down, "distance": 0.1, "group": "right"}},
        {"retreat": {"distance": 0.1, "group": "right"}},
        {"retreat": {"distance": 0.1, "frame": "left_wrist", "group": "right"}},
        {"retreat": {"distance": 0.1}},
    ]
    source = {"version": 1, "robot": "baxter", "group": group, "start": {"configuration": "ready"}, "task": steps}
    line, move, before, approach, retreat, other, own = problem_from_dict(source).task
    assert line.constraints[0].frame == "right_gripper"
    assert move.action.goal[0].frame == before.action.goal[0].frame == "right_gripper"
    assert [one.action.frame for one in (line, approach, retreat)] == ["right_gripper"] * 3
    assert (other.action.frame, own.action.frame) == ("left_wrist", expected)


def test_events_alone_are_no_task(tmp_path):
    path = tmp_path / "events.yaml"
    head, steps = FILE.read_text().split("task:")
    attach = next(line for line in steps.splitlines() if "attach" in line)
    path.write_text(f"{head}task:\n{attach}\n  - detach: {{object: cube}}\n")
    (issue,) = check_file(path)
    assert issue.field == "task"
    assert "take no time" in issue.found


def test_a_problem_has_a_goal_or_a_task(tmp_path):
    path = tmp_path / "none.yaml"
    path.write_text("version: 1\nrobot: panda\nstart: {configuration: ready}\n")
    (issue,) = check_file(path)
    assert (issue.field, issue.found) == ("goal", "nothing")


def test_steps_in_python_are_checked():
    with pytest.raises(InputError, match="distance"):
        op.Task().retreat(-1.0)
    with pytest.raises(InputError, match=r"op.Task\(\)"):
        op.Problem("panda", "ready", task=3)


def test_a_replaced_tool_frame_stands_in_every_step(tmp_path):
    """The file of such a problem describes the same motion, though the robot file has another tool frame."""
    panda = op.load_robot("panda").with_tool("panda_link8")
    near, far = op.Pose((0.5, 0.0, 0.4), rpy=(3.14, 0, 0)), op.Pose((0.5, 0.1, 0.4), rpy=(3.14, 0, 0))
    task = op.Task().move([near, "ready"], vias=[far]).line(far).line(by=(0, 0, -0.05)).retreat(0.05)
    task = task.approach(near, 0.1).approach([near, far], 0.1)
    problem = op.Problem(panda, "ready", task=task)
    problem.save(tmp_path / "task.yaml")
    again = op.load_problem(tmp_path / "task.yaml")
    for one in (problem, again):
        frames = {step.action.frame for step in one.task if hasattr(step.action, "frame")}
        ends = {end.frame for step in one.task for end in getattr(step.action, "goal", ()) if hasattr(end, "frame")}
        assert frames | ends == {"panda_link8"}
        assert one.task[0].action.vias[0].at.frame == "panda_link8"
    assert op.Problem(panda, "ready", task=op.Task().line(op.Pose((0.5, 0, 0.4), frame="panda_hand"))).task


def test_a_replaced_tool_frame_stands_in_what_is_written_out_and_in_constraints(tmp_path):
    upright = [{"orientation": {"axis": [0, 0, 1], "toward": [0, 0, -1], "within": 3.1}}]
    down, other = (op.Pose((0.5, y, 0.4), rpy=(np.pi, 0, 0)) for y in (0.0, 0.1))
    task = op.Task().approach(op.Grasps("cube", opening=0.08), 0.1, path_constraints=upright)
    task = task.retreat(0.1).pick("cube", grasps=[op.Pose((0, 0, 0.1), rpy=(np.pi, 0, 0))], link="panda_hand")
    task = task.place("cube", [down, other]).dwell(0.1, path_constraints=upright)
    task = task.either(op.Task().move(down), op.Task().line(by=(0, 0, 0.1)))
    panda = op.load_robot("panda").with_tool("panda_link8")
    cube = [op.Box("cube", size=(0.05, 0.05, 0.05), position=(0.5, 0.2, 0.4))]
    problem = op.Problem(panda, "ready", task=task, scene=cube, path_constraints=upright)
    problem.save(tmp_path / "task.yaml")
    for one in (problem, op.load_problem(tmp_path / "task.yaml")):
        stated = [*one.path_constraints, *(part for step in one.task for part in step.constraints)]
        stated += [end for step in one.task for end in getattr(step.action, "goal", ()) if hasattr(end, "frame")]
        stated += [end for step in one.task for end in getattr(step.action, "ends", ())]
        frames = [one.frame for one in stated] + [s.action.frame for s in one.task if hasattr(s.action, "frame")]
        assert len(stated) > 15
        assert set(frames) == {"panda_link8"}


def test_a_retreat_goes_back_along_the_tool_and_up_in_the_world():
    steps = [{"retreat": {"distance": 0.1}}, {"retreat": {"distance": 0.1, "in": "world"}}]
    back, up = (step.action for step in op.Problem("panda", "ready", task=steps).task)
    assert (back.by.tolist(), back.in_tool) == ([0.0, 0.0, -0.1], True)
    assert (up.by.tolist(), up.in_tool) == ([0.0, 0.0, 0.1], False)
    (down,) = op.Problem("panda", "ready", task=op.Task().retreat(0.1, along=(0, 0, -1), within="world")).task
    assert down.action.by.tolist() == [0.0, 0.0, -0.1]
