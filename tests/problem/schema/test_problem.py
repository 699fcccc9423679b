import json

import pytest

from optiplan.errors import InputError
from optiplan.problem.load import check_file, load_problem
from optiplan.problem.schema.problem import ProblemSpec, problem_schema

SHAPE = "{sphere: 0.1}"
POSE = "{position: [0, 2, 0]}"
GOAL = "{joints: [1, 0.5]}"

BAD = [
    ("version: 1", "version: 2", 1, "version", "2", "1"),
    ("version: 1", "version: true", 1, "version", "true", "1"),
    ("version: 1", "version: 1.0", 1, "version", "1", "1"),
    ("seed: 0", "sed: 0", 12, "sed", "unknown key 'sed'", "did you mean 'seed'"),
    ("seed: 0", "seed: -1", 12, "seed", "-1", "≥ 0"),
    ("seed: 0", "seed: 1.5", 12, "seed", "1.5", "a whole number"),
    ("seed: 0", "seed: true", 12, "seed", "true", "a whole number"),
    ("start: {joints: [0, 0]}\n", "", 1, "start", "nothing", "required"),
    ("[0, 0]", "[0, .nan]", 3, "start.joints[1]", "NaN", "finite"),
    ("[0, 0]", "[0, .inf]", 3, "start.joints[1]", "infinity", "finite"),
    ("[0, 0]", "[0, '1']", 3, "start.joints[1]", "'1'", "a number"),
    ("{joints: [0, 0]}", "{}", 3, "start", "an empty mapping", "exactly one of: joints, joints_deg, configuration"),
    (
        "{joints: [0, 0]}",
        "{joints: [0, 0], configuration: bent}",
        3,
        "start",
        "joints, configuration",
        "exactly one of: joints, joints_deg, configuration",
    ),
    (
        GOAL,
        "{area: 1}",
        4,
        "goal.area",
        "unknown key 'area'",
        "joints, joints_deg, configuration, velocity, acceleration, pose, region, all_of, any_of",
    ),
    (GOAL, "{any_of: []}", 4, "goal.any_of", "a list of 0 values", "at least 1"),
    (GOAL, "{any_of: [{any_of: []}]}", 4, "goal.any_of[0].any_of", "unknown key 'any_of'", "joints"),
    (GOAL, "{pose: {rpy: [0, 0, 0]}}", 4, "goal.pose.position", "nothing", "required"),
    (
        GOAL,
        "{pose: {position: [0, 0, 0], tolerance: {position: 0}}}",
        4,
        "goal.pose.tolerance.position",
        "0",
        "a number > 0",
    ),
    (SHAPE, "{ball: 0.1}", 8, "scene.obstacles[0].shape.ball", "unknown key 'ball'", "box, sphere, cylinder"),
    (SHAPE, "{}", 8, "scene.obstacles[0].shape", "an empty mapping", "exactly one of: box, sphere"),
    (SHAPE, "{sphere: -0.1}", 8, "scene.obstacles[0].shape.sphere", "-0.1", "a number > 0"),
    (SHAPE, "{box: [1, 2]}", 8, "scene.obstacles[0].shape.box", "a list of 2 values", "3 values [x, y, z]"),
    (SHAPE, "{box: [1, 2, -3]}", 8, "scene.obstacles[0].shape.box[2]", "-3", "a number > 0"),
    (SHAPE, "{cylinder: {radius: 1}}", 8, "scene.obstacles[0].shape.cylinder.length", "nothing", "required"),
    (
        SHAPE,
        "{half_space: {normal: [0, 0, 3]}}",
        8,
        "scene.obstacles[0].shape.half_space.normal",
        "length 3",
        "unit length",
    ),
    (SHAPE, "{mesh: {file: a.stl, scale: 0}}", 8, "scene.obstacles[0].shape.mesh.scale", "0", "a number > 0"),
    (
        POSE,
        "{quaternion: [0, 0, 0, 1.01]}",
        9,
        "scene.obstacles[0].pose.quaternion",
        "length 1.01",
        "unit length (1 ± 0.001)",
    ),
    (POSE, "{quaternion: [0, 0, 1]}", 9, "scene.obstacles[0].pose.quaternion", "a list of 3", "[x, y, z, w]"),
    (
        POSE,
        "{rpy: [0, 0, 0], quaternion: [0, 0, 0, 1]}",
        9,
        "scene.obstacles[0].pose",
        "both rpy and quaternion",
        "at most one",
    ),
    (
        "allowed_collisions: []",
        "allowed_collisions: [[ball]]",
        11,
        "scene.allowed_collisions[0]",
        "a list of 1",
        "2 values",
    ),
    (
        "allowed_collisions: []",
        "allowed_collisions: [[tip, tip]]",
        11,
        "scene.allowed_collisions[0]",
        "'tip' twice",
        "two bodies",
    ),
    ("seed: 0", "via: [1]", 12, "via[0]", "1", "a mapping"),
    ("seed: 0", "path_constraints: [1]", 12, "path_constraints[0]", "1", "a mapping"),
    ("seed: 0", "path_constraints: [{cup: 1}]", 12, "path_constraints[0]", "unknown key 'cup'", "orientation"),
    ("seed: 0", "limits: {velocity: 1.5}", 12, "limits.velocity", "1.5", "a number ≤ 1"),
    ("seed: 0", "limits: {jerk: 0}", 12, "limits.jerk", "0", "a number ≥ 1e-06"),
    ("seed: 0", "objective: {time: 0}", 12, "objective", "all weights 0", "at least one weight > 0"),
    ("seed: 0", "objective: {jerk: -1}", 12, "objective.jerk", "-1", "≥ 0"),
    ("seed: 0", "planner: {name: 3}", 12, "planner.name", "3", "text"),
]


@pytest.mark.parametrize(("old", "new", "line", "field", "found", "expected"), BAD)
def test_what_does_not_fit_is_told_with_its_place(write, old, new, line, field, found, expected):
    path = write(old, new)
    with pytest.raises(InputError) as caught:
        load_problem(path)
    (issue,) = caught.value.issues
    assert (issue.file, issue.line) == (str(path), line)
    assert issue.field.startswith(field)  # `scale: 0` is about each of the three it stands for
    assert found in issue.found
    assert expected in issue.expected
    assert check_file(path) == list(caught.value.issues)


def test_every_error_of_a_file_at_once(write):
    path = write(f"[1, 0.5]}}\nscene:\n  obstacles:\n    - name: ball\n      shape: {SHAPE}", "[1, 9]}\nscene: 3\nx: 1")
    path.write_text(path.read_text().split("\n      pose")[0] + "\nlimits: {jerk: 2}\n")
    assert [(issue.line, issue.field) for issue in check_file(path)] == [
        (4, "goal.joints[1]"),
        (5, "scene"),
        (6, "x"),
        (7, "limits.jerk"),
    ]


def test_schema_for_editors_knows_short_forms():
    schema = json.loads(json.dumps(problem_schema()))
    assert set(schema["required"]) == {"version", "start"}
    assert [one["required"] for one in schema["oneOf"]] == [["robot"], ["robots"]]
    assert {"type": "string"} in schema["properties"]["planner"]["anyOf"]
    box = schema["$defs"]["ShapeSpec"]["properties"]["box"]["anyOf"][0]
    assert (box["minItems"], box["maxItems"]) == (3, 3)
    assert schema["$defs"]["ShapeSpec"]["additionalProperties"] is False


def test_schema_lists_every_key_of_the_model():
    assert set(problem_schema()["properties"]) == {*ProblemSpec.model_fields, "frames", "robots", "tasks"}
