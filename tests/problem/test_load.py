import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.errors import InputError
from optiplan.geometry.scene import Box, Capsule, Cylinder, HalfSpace, Mesh, Sphere
from optiplan.geometry.shapes import build_geometry
from optiplan.problem.load import check_file, load_problem, problem_from_dict
from optiplan.problem.problem import JointGoal, Objective, PoseGoal

ROOT = Path(__file__).parents[2]
GOAL = "{joints: [1, 0.5]}"
NO_BODIES = "attached: []"
ATTACH = "attached: [{name: part, shape: {sphere: 0.01}, link: LINK, pose: {position: [0.05, 0, 0]}, touch: [TOUCH]}]"
TRIANGLES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"

BAD = [
    (
        "start: {joints: [0, 0]}",
        "start: {joints: [0]}",
        3,
        "start.joints",
        "1 value",
        "one for each of shoulder, elbow",
    ),
    (GOAL, "{joints: [1, 2, 3]}", 4, "goal.joints", "3 values", "2 values, one for each of shoulder, elbow"),
    (GOAL, "{joints: [1, 2.95]}", 4, "goal.joints[1]", "elbow = 2.95 rad, outside its limits", "[-2.9, 2.9]"),
    (GOAL, "{configuration: bend}", 4, "goal.configuration", "unknown configuration 'bend'", "did you mean 'bent'"),
    (
        GOAL,
        "{any_of: [{joints: [0, 0]}, {joints: [-4, 0]}]}",
        4,
        "goal.any_of[1].joints[0]",
        "shoulder = -4 rad, outside",
        "[-3, 3]",
    ),
    (
        GOAL,
        "{pose: {frame: hands, position: [0, 0, 0]}}",
        4,
        "goal.pose.frame",
        "unknown frame 'hands'",
        "did you mean 'hand'",
    ),
    (
        GOAL,
        "{pose: {frame: universe, position: [0, 0, 0]}}",
        4,
        "goal.pose.frame",
        "unknown frame 'universe'",
        "one of: base, fore, hand, tip, upper",
    ),
    ("seed: 0", "locked: {fingr: 0}", 12, "locked.fingr", "unknown joint 'fingr'", "did you mean 'finger'"),
    ("seed: 0", "locked: {elbow: 0}", 12, "locked.elbow", "the planned joint 'elbow'", "outside the group"),
    ("name: ball", "name: fore", 7, "scene.obstacles[0].name", "a link of the robot", "a name of its own"),
    (NO_BODIES, ATTACH.replace("LINK", "hnd").replace("TOUCH", ""), 10, "scene.attached[0].link", "'hnd'", "'hand'"),
    (
        NO_BODIES,
        ATTACH.replace("LINK", "hand").replace("TOUCH", "tp"),
        10,
        "scene.attached[0].touch[0]",
        "'tp'",
        "'tip'",
    ),
    (
        NO_BODIES,
        ATTACH.replace("LINK", "hand").replace("TOUCH", "tip").replace("part", "ball"),
        10,
        "scene.attached[0].name",
        "'ball', which is already the name of an obstacle",
        "a name of its own",
    ),
    (
        "allowed_collisions: []",
        "allowed_collisions: [[tip, boll]]",
        11,
        "scene.allowed_collisions[0][1]",
        "unknown body 'boll'",
        "did you mean 'ball'",
    ),
]


@pytest.mark.parametrize(("old", "new", "line", "field", "found", "expected"), BAD)
def test_what_does_not_fit_the_robot_is_told_with_its_place(write, old, new, line, field, found, expected):
    path = write(old, new)
    with pytest.raises(InputError) as caught:
        load_problem(path)
    (issue,) = caught.value.issues
    assert (issue.file, issue.line, issue.field) == (str(path), line, field)
    assert found in issue.found
    assert expected in issue.expected
    assert check_file(path) == [issue]


@pytest.mark.parametrize("empty", ["goal:", "goal: null\ntask:"])
def test_an_empty_goal_is_none(write, empty):
    path = write("goal: {joints: [1, 0.5]}", empty)
    with pytest.raises(InputError) as caught:
        load_problem(path)
    (issue,) = caught.value.issues
    assert str(issue).endswith(": goal: nothing; expected this key, or `task`, one of which is required")
    assert check_file(path) == [issue]


def test_unknown_robot_lists_the_choices(write, arm):
    (issue,) = check_file(write(str(arm), "armm"))
    assert (issue.line, issue.field, issue.found) == (2, "robot", "unknown robot 'armm'")
    assert "robot.yaml" in issue.expected


def test_missing_robot_file_is_named(write, arm):
    (issue,) = check_file(write(str(arm), "no/such/robot.yaml"))
    assert (issue.line, issue.field) == (2, "robot")
    assert "no/such/robot.yaml" in issue.found


def test_missing_mesh_names_the_path_tried(write, tmp_path):
    (issue,) = check_file(write("{sphere: 0.1}", "{mesh: {file: parts/a.stl}}"))
    assert (issue.line, issue.field) == (8, "scene.obstacles[0].shape.mesh.file")
    assert issue.found == f"'parts/a.stl', but there is no file {tmp_path / 'parts' / 'a.stl'}"


def test_broken_mesh_is_an_issue(write, tmp_path):
    (tmp_path / "a.stl").write_text("not a mesh")
    (issue,) = check_file(write("{sphere: 0.1}", "{mesh: {file: a.stl}}"))
    assert issue.field == "scene.obstacles[0].shape.mesh.file"
    assert "cannot read mesh" in issue.found


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb"])
def test_mesh_formats_of_the_docs_are_read(write, tmp_path, suffix):
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / f"a.{suffix}")
    (obstacle,) = load_problem(write("{sphere: 0.1}", f"{{mesh: {{file: a.{suffix}}}}}")).scene.obstacles
    box = build_geometry(obstacle.shape).aabb_local
    assert np.allclose(np.sort(box.max_ - box.min_), [0.1, 0.2, 0.3], atol=1e-6)  # z up, whatever the file's own is
    page = (ROOT / "docs" / "reference" / "problem-file.md").read_text()
    row = next(line for line in page.splitlines() if line.startswith("| `mesh`"))
    assert suffix.upper() in row


def test_start_in_collision_names_bodies_and_depth(write):
    # The fingertip, a ball of 3 cm at x = 1 m, is 0.03 + 0.1 - 0.11 = 2 cm deep in a ball of 10 cm at x = 1.11 m.
    (issue,) = check_file(write("[0, 2, 0]", "[1.11, 0, 0]"))
    assert (issue.line, issue.field) == (3, "start.joints")
    assert issue.found == "the start is in collision: 'tip' and 'ball' overlap by 20 mm"
    assert "scene.allowed_collisions" in issue.expected


def test_a_task_may_begin_in_contacts_that_the_first_step_of_each_arm_or_alternative_allows(write):
    path = write("[0, 2, 0]", "[1.11, 0, 0]")
    free = path.read_text().replace(next(x for x in path.read_text().splitlines() if x.startswith("goal")), "{task}")
    touches = {"move": {"joints": [0.5, 0]}, "allowed_collisions": [["ball", "tip"]]}
    apart = {"move": {"joints": [0.6, 0]}}
    for task, begins in (
        ([touches], True),
        ([apart, touches], False),
        ([{"either": [[apart], [touches]]}], True),
        ([apart, {"either": [[apart], [touches]]}], False),
    ):
        path.write_text(free.replace("{task}", f"task: {json.dumps(task)}"))
        issues = check_file(path)
        assert (issues == []) is begins
        assert all("allowed_collisions of the first step" in issue.expected for issue in issues)


def test_start_that_touches_is_in_collision(write):
    (issue,) = check_file(write("[0, 2, 0]", "[1.13, 0, 0]"))
    assert issue.found == "the start is in collision: 'tip' and 'ball' touch"
    assert check_file(write("[0, 2, 0]", "[1.13001, 0, 0]")) == []


def test_allowed_pair_may_touch(write):
    path = write("[0, 2, 0]", "[1.11, 0, 0]")
    path.write_text(path.read_text().replace("allowed_collisions: []", "allowed_collisions: [[ball, tip]]"))
    assert load_problem(path).scene.allowed == {frozenset({"ball", "tip"})}


def test_goal_in_collision_only_counts_when_no_alternative_is_free(write):
    blocked = "{joints: [1.5707963, 0]}"
    moved = write(GOAL, blocked)
    moved.write_text(moved.read_text().replace("[0, 2, 0]", "[0, 1.11, 0]"))
    (issue,) = check_file(moved)
    assert (issue.line, issue.field) == (4, "goal")
    assert issue.found.startswith("the goal is in collision: 'tip' and 'ball' overlap by 20 mm")
    moved.write_text(moved.read_text().replace(blocked, f"{{any_of: [{blocked}, {{joints: [0.1, 0]}}]}}"))
    assert len(load_problem(moved).goal) == 2
    moved.write_text(moved.read_text().replace("{joints: [0.1, 0]}", blocked))
    assert [issue.field for issue in check_file(moved)] == ["goal.any_of[0]", "goal.any_of[1]"]


def test_one_bad_part_hides_no_other(write):
    path = write("{joints: [0, 0]}", "{joints: [0, 0], x: 1}")
    text = path.read_text().replace(GOAL, "{any_of: [{joints: [9, 0]}, {joint: []}]}")
    text = text.replace("attached: []", "attached: [{name: ball, shape: {sphere: 1}, link: nose}, 3]")
    path.write_text(text.replace("allowed_collisions: []", "allowed_collisions: [[tip, nobody], [tip]]"))
    assert [issue.field for issue in check_file(path)] == [
        "start.x",
        "goal.any_of[1].joint",
        "goal.any_of[0].joints[0]",
        "scene.attached[1]",
        "scene.attached[0].name",
        "scene.attached[0].link",
        "scene.allowed_collisions[1]",
        "scene.allowed_collisions[0][1]",
    ]


def test_bad_obstacle_does_not_hide_a_collision_with_another(write):
    path = write("[0, 2, 0]", "[1.11, 0, 0]")
    path.write_text(path.read_text().replace("  attached", "    - {name: box, shape: {box: [1]}}\n  attached"))
    assert [issue.field for issue in check_file(path)] == ["start.joints", "scene.obstacles[1].shape.box"]


def test_unreadable_file_is_one_issue(tmp_path):
    (issue,) = check_file(tmp_path / "none.yaml")
    assert (issue.line, issue.field) == (None, "file")
    path = tmp_path / "list.yaml"
    path.write_text("- 1\n")
    assert [issue.field for issue in check_file(path)] == ["file"]


def test_everything_arrives_in_the_problem(write, tmp_path):
    (tmp_path / "a.obj").write_text(TRIANGLES)
    path = write(
        "{sphere: 0.1}\n      pose: {position: [0, 2, 0]}", "{box: [0.1, 0.2, 0.3]}\n      pose: {rpy: [0, 0, 1]}"
    )
    bodies = "".join(
        f"    - {{name: o{i}, shape: {shape}, pose: {{position: [0, 3, 0]}}}}\n"
        for i, shape in enumerate(
            [
                "{cylinder: {radius: 0.1, length: 0.5}}",
                "{capsule: {radius: 0.2, length: 0.6}}",
                "{half_space: {normal: [0, 1.0005, 0], offset: -9}}",
                "{mesh: {file: a.obj, scale: 0.5, convex: true}}",
            ]
        )
    )
    text = path.read_text().replace("  attached: []", bodies + "  " + ATTACH)
    text = text.replace("LINK", "hand").replace("TOUCH", "tip").replace("[[", "[[").replace("seed: 0", "seed: 7")
    text = text.replace(GOAL, "{any_of: [{configuration: bent}, {pose: {position: [0.5, 0.5, 0], rpy: [0, 0, 1]}}]}")
    text += "limits: {velocity: 0.5, jerk: 0.25}\nobjective: {jerk: 1e-6}\nplanner: {name: rrtconnect, range: 0.3}\n"
    path.write_text(text.replace("position: [0, 2, 0]", "").replace("rpy: [0, 0, 1]}\n", "position: [0, 2, 0]}\n"))
    problem = load_problem(path)
    shapes = [obstacle.shape for obstacle in problem.scene.obstacles]
    mesh = Mesh(tmp_path / "a.obj", (0.5, 0.5, 0.5), True)
    half = HalfSpace((0.0, 1.0, 0.0), -9.0)
    assert shapes == [Box((0.1, 0.2, 0.3)), Cylinder(0.1, 0.5), Capsule(0.2, 0.6), half, mesh]
    (held,) = problem.scene.attached
    assert (held.shape, held.link, held.touch) == (Sphere(0.01), "hand", {"tip"})
    assert held.X_LO.translation.tolist() == [0.05, 0.0, 0.0]
    joints, pose = problem.goal
    assert isinstance(joints, JointGoal)
    assert joints.q.tolist() == [0.5, 1.5]
    assert isinstance(pose, PoseGoal)
    assert (pose.frame, pose.position, pose.orientation) == ("hand", 1e-4, 1e-3)
    assert np.isclose(pose.X_WG.rotation[1, 0], np.sin(1.0))
    assert problem.limits.velocity.tolist() == [1.0, 1.5]
    assert problem.limits.acceleration.tolist() == [10.0, 10.0]
    assert problem.limits.jerk.tolist() == [25.0, 25.0]
    assert (problem.planner, problem.options, problem.seed) == ("rrtconnect", {"range": 0.3}, 7)
    assert (problem.objective, problem.name) == (Objective(1.0, 1e-6), "case")


def test_source_is_the_problem_again(write, tmp_path):
    (tmp_path / "a.obj").write_text(TRIANGLES)
    problem = load_problem(write("{sphere: 0.1}", "{mesh: {file: a.obj, scale: [1, 1, 0.1]}}"))
    again = problem_from_dict(problem.source, "/")
    assert again.hash == problem.hash
    assert again.source == problem.source
    assert again.scene.obstacles[0].shape == problem.scene.obstacles[0].shape
    assert again.name == problem.name == "case"


def test_arrays_and_paths_in_a_dictionary(arm):
    data = {"version": 1, "robot": arm, "start": {"joints": np.zeros(2)}, "goal": {"joints": (np.float64(1), 0.5)}}
    assert problem_from_dict(data).goal[0].q.tolist() == [1.0, 0.5]
    with pytest.raises(InputError, match=r"<problem>: start\.joints: 3 values"):
        problem_from_dict(data | {"start": {"joints": np.zeros(3)}})


def test_overrides_replace_what_the_file_says(write):
    path = write()
    assert load_problem(path, seed=5, planner="quintic").planner == "quintic"
    assert load_problem(path, seed=5).seed == 5
    with pytest.raises(InputError, match="seed: -2"):
        load_problem(path, seed=-2)


def test_locked_joint_may_stand_beyond_its_limit(write):
    near = write("[0, 2, 0]", "[1.16, 0, 0]")
    assert check_file(near) == []
    near.write_text(near.read_text().replace("seed: 0", "locked: {finger: 0.05}"))
    (issue,) = check_file(near)  # the tip now reaches 5 cm + 3 cm + 10 cm, and the ball is at 16 cm
    assert "'tip' and 'ball' overlap by 20 mm" in issue.found


def test_problem_is_frozen(write):
    problem = load_problem(write())
    with pytest.raises(dataclasses.FrozenInstanceError):
        problem.seed = 1


JUNK = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400)
JUNK = JUNK | st.lists(JUNK, max_size=4) | st.dictionaries(st.sampled_from(["joints", "pose", "box", "mesh"]), JUNK)


def places(value, place=()):
    yield place
    for key, item in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from places(item, (*place, key))


@settings(max_examples=200)
@given(st.data(), JUNK)
def test_any_junk_anywhere_is_told_not_raised(arm, data, junk):
    pose = {"position": [0.5, 0.5, 0.0], "quaternion": [0, 0, 0, 1], "tolerance": {"position": 0.01}}
    body = {"name": "ball", "shape": {"half_space": {"normal": [0, 0, 1], "offset": -1}}, "pose": {"rpy": [0, 0, 1]}}
    held = {"name": "part", "shape": {"mesh": {"file": "a", "scale": 2}}, "link": "hand", "touch": ["tip"]}
    scene = {"obstacles": [body], "attached": [held], "allowed_collisions": [["ball", "tip"]]}
    goal = {"any_of": [{"joints": [0.0, 1.0]}, {"pose": pose}]}
    root = {"version": 1, "robot": str(arm), "locked": {"finger": 0.01}, "start": {"joints": [0, 0]}, "goal": goal}
    root |= {"scene": scene, "limits": {"jerk": 1}, "planner": {"name": "x", "option": [1]}, "seed": 1, "via": []}
    place = data.draw(st.sampled_from([place for place in places(root) if place]))
    target = root
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = junk
    issues = ()
    try:
        attached = problem_from_dict(root).scene.attached
    except InputError as error:
        issues = error.issues
    assert all(issue.found and issue.expected for issue in issues)
    assert issues or not attached  # the mesh of what is attached does not exist
