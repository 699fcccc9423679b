import json

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.importers.motion_bench_maker import import_mbm
from optiplan.problem.load import check_file, load_problem

SCENE = """\
robot_model_name: Arm
robot_state:
  joint_state: {name: [shoulder, elbow, finger], position: [9, 9, 0]}
  multi_dof_joint_state:
    joint_names: [virtual_joint]
    transforms: [{translation: [0, 0, 0], rotation: [0, 0, 0, 1]}]
fixed_frame_transforms:
  - {child_frame_id: world, transform: {translation: [0, 0, 0], rotation: [0, 0, 0, 1]}}
world:
  collision_objects:
    - id: can
      primitives: [{type: cylinder, dimensions: [0.14, 0.03]}]
      primitive_poses: [{position: [0, 1.5, 0], orientation: [0, 0, 0, 1]}]
"""
REQUEST = """\
group_name: arm
max_velocity_scaling_factor: 0
goal_constraints:
  - joint_constraints:
      - {joint_name: elbow, position: 0.5}
      - {position: 1, joint_name: shoulder}
start_state:
  joint_state: {name: [shoulder, elbow, finger, mount], position: [0, 0.25, 0.05, 0]}
"""


def place(folder, scene=SCENE, request=REQUEST, number="0001"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"scene{number}.yaml").write_text(scene)
    (folder / f"request{number}.yaml").write_text(request)


def test_pair_becomes_a_problem(tmp_path, arm):
    place(tmp_path / "sets" / "near")
    summary = import_mbm(tmp_path / "sets", tmp_path / "out", str(arm))
    assert summary.written == (tmp_path / "out" / "near" / "0001.yaml",)
    assert summary.skipped == ()
    problem = load_problem(summary.written[0])
    assert problem.name == "near/0001"
    assert problem.robot.source == arm
    assert problem.start.tolist() == [0.0, 0.25]
    assert problem.goal[0].q.tolist() == [1.0, 0.5]
    (can,) = problem.scene.obstacles
    assert (can.shape.radius, can.shape.length) == (0.03, 0.14)
    assert can.X_WO.translation.tolist() == [0.0, 1.5, 0.0]


def test_joints_outside_the_group_stay_where_the_request_puts_them(tmp_path, arm):
    place(tmp_path / "a")
    place(tmp_path / "a", number="0002")
    summary = import_mbm(tmp_path / "a", tmp_path / "out", str(arm))
    assert [load_problem(path).robot.locked for path in summary.written] == [{"finger": 0.05}] * 2
    assert dict(summary.notes) == {
        "joint finger is locked at 0.05, beyond its own limits [0, 0.04]; kept": 2,
        "left out joints that the robot has fixed or does not have: mount": 2,
    }


@pytest.mark.parametrize(
    ("scene", "request_", "number"),
    [
        ("scene0003.yaml", "request0003.yaml", "0003"),
        ("0003_scene.yaml", "0003_request.yaml", "0003"),
        ("scene.yml", "request.yml", "request"),
    ],
)
def test_names_of_pairs(tmp_path, arm, scene, request_, number):
    (tmp_path / scene).write_text(SCENE)
    (tmp_path / request_).write_text(REQUEST)
    summary = import_mbm(tmp_path, tmp_path / "out", str(arm))
    assert [path.name for path in summary.written] == [f"{number}.yaml"]


def test_files_without_partner_and_bad_pairs_are_told(tmp_path, arm):
    place(tmp_path)
    place(tmp_path, number="0002", scene="[1")
    place(tmp_path, number="0003", request="goal_constraints: [{joint_constraints: [3]}]")
    place(tmp_path, number="0004", scene="3")
    place(tmp_path, number="0005", scene=SCENE.replace("[0.14, 0.03]", "[0.14, -0.03]"))
    (tmp_path / "scene_sensed0001.yaml").write_text(SCENE)
    (tmp_path / "request0009.yaml").write_text(REQUEST)
    summary = import_mbm(tmp_path, tmp_path / "out", str(arm))
    assert [path.name for path in summary.written] == ["0001.yaml"]
    reasons = {path.name: reason for path, reason in summary.skipped}
    assert set(reasons) == {
        "request0002.yaml",
        "request0003.yaml",
        "request0004.yaml",
        "request0005.yaml",
        "request0009.yaml",
        "scene_sensed0001.yaml",
    }
    assert "scene0002.yaml cannot be read" in reasons["request0002.yaml"]
    assert reasons["request0004.yaml"] == "scene0004.yaml holds no mapping"
    assert reasons["request0005.yaml"].startswith("scene.obstacles.0.shape.cylinder.radius: Input should be greater")
    assert reasons["request0009.yaml"] == "no scene file of this number"
    assert reasons["scene_sensed0001.yaml"] == "no request file of this number"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["0001.yaml"]


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (SCENE.replace("1.5", "9" * 400), "not a MoveIt scene and request: OverflowError"),
        (SCENE.replace("orientation: [0, 0, 0, 1]", "orientation: [0, 0, 0, 1e308]"), "not a MoveIt scene"),
        (SCENE.replace("1.5", "9" * 5000), "scene0001.yaml cannot be read: Exceeds the limit"),
    ],
)
def test_numbers_of_hundreds_of_digits_cost_one_pair(tmp_path, arm, scene, words):
    place(tmp_path / "in", scene)
    place(tmp_path / "in", number="0002")
    summary = import_mbm(tmp_path / "in", tmp_path / "out", str(arm))
    assert [path.name for path in summary.written] == ["0002.yaml"]
    ((_, reason),) = summary.skipped
    assert words in reason


def test_robot_is_found_by_the_name_in_the_scene(tmp_path):
    place(tmp_path, SCENE.replace("Arm", "Planar2R"))
    (path,) = import_mbm(tmp_path, tmp_path / "out").written
    assert "\nrobot: planar2r\n" in path.read_text()
    assert load_problem(path).robot.name == "planar2r"


def test_unknown_robot_lists_the_choices(tmp_path):
    place(tmp_path)
    with pytest.raises(InputError, match=r"scene0001\.yaml: robot_model_name: 'Arm'; expected one of: .*planar2r"):
        import_mbm(tmp_path, tmp_path / "out")


def test_folder_without_pairs_is_refused(tmp_path):
    with pytest.raises(InputError, match="no pair of scene and request"):
        import_mbm(tmp_path, tmp_path / "out")
    with pytest.raises(InputError, match="no folder"):
        import_mbm(tmp_path / "none", tmp_path / "out")


def test_mesh_is_written_beside_the_problem(tmp_path, arm):
    mesh = {
        "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "triangles": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    }
    item = {"id": "part one", "meshes": [mesh], "mesh_poses": [{"position": [0, 2, 0], "orientation": [0, 0, 0, 1]}]}
    place(tmp_path / "in", json.dumps({"robot_model_name": "arm", "world": {"collision_objects": [item]}}))
    (path,) = import_mbm(tmp_path / "in", tmp_path / "out", str(arm)).written
    (part,) = load_problem(path).scene.obstacles
    assert part.name == "part one"
    assert part.shape.file == path.parent / "0001_part_one_0.obj"
    assert part.shape.file.read_text().splitlines()[:5] == [
        "v 0.0 0.0 0.0",
        "v 1.0 0.0 0.0",
        "v 0.0 1.0 0.0",
        "v 0.0 0.0 1.0",
        "f 1 3 2",
    ]


SETS = ["bookshelf_small", "bookshelf_tall", "bookshelf_thin", "box", "cage", "table_pick", "table_under_pick"]


def test_panda_data_set(tmp_path, shared):
    """All sets are converted; starts and goals are free under the robot of the data set."""
    for name in SETS:
        (tmp_path / "in" / name).mkdir(parents=True)
        for file in ("scene0007.yaml", "request0007.yaml"):
            (tmp_path / "in" / name / file).symlink_to(shared / "mbm" / "panda" / name / file)
    robot = shared / "robots" / "mbm_panda" / "robot.yaml"
    summary = import_mbm(tmp_path / "in", tmp_path / "out", str(robot))
    assert summary.written == tuple(tmp_path / "out" / name / "0007.yaml" for name in SETS)
    assert summary.skipped == ()
    assert [check_file(tmp_path / "out" / name / "0007.yaml") for name in ("bookshelf_thin", "cage")] == [[], []]


@pytest.fixture
def plain_ur5(tmp_path, shared):
    """The UR5 of the data set with its meshes as they are: cutting them into convex pieces takes minutes."""
    folder = tmp_path / "robot"
    folder.mkdir()
    for name in ("ur5.urdf", "ur5.srdf", "meshes"):
        (folder / name).symlink_to(shared / "robots" / "mbm_ur5" / name)
    lines = (shared / "robots" / "mbm_ur5" / "robot.yaml").read_text().splitlines()
    kept = [line for line in lines if not line.startswith("collision:")]
    (folder / "robot.yaml").write_text("\n".join([*kept, "collision: mesh"]) + "\n")
    return str(folder / "robot.yaml")


def test_ur5_data_set_has_poses_of_objects_and_of_their_shapes(tmp_path, shared, plain_ur5):
    source = tmp_path / "in"
    source.mkdir()
    for file in ("scene0001.yaml", "request0001.yaml"):
        (source / file).symlink_to(shared / "mbm" / "ur5" / "table_pick" / file)
    (path,) = import_mbm(source, tmp_path / "out", plain_ur5).written
    obstacles = {obstacle.name: obstacle for obstacle in load_problem(path).scene.obstacles}
    top, can = obstacles["table_top"], obstacles["Can1"]
    height = top.X_WO.translation[2] + top.shape.size[2] / 2
    assert np.isclose(can.X_WO.translation[2] - can.shape.length / 2, height, atol=0.021)  # it stands on the table


def test_fetch_data_set_names_the_robots_own_frames(tmp_path, shared):
    """Its scenes give transforms and objects in `base_link`, which only the robot knows."""
    for name in ("box", "table_pick"):
        (tmp_path / "in" / name).mkdir(parents=True)
        for file in ("scene0001.yaml", "request0001.yaml"):
            (tmp_path / "in" / name / file).symlink_to(shared / "mbm" / "fetch" / name / file)
    robot = shared / "robots" / "mbm_fetch" / "robot.yaml"
    summary = import_mbm(tmp_path / "in", tmp_path / "out", str(robot))
    assert not summary.skipped
    box, table = (load_problem(path) for path in summary.written)
    assert box.robot.joint_names[0] == table.robot.joint_names[0] == "torso_lift_joint"
    can = next(item for item in box.scene.obstacles if item.name == "Can1")
    assert can.X_WO.translation == pytest.approx([0.6891922481543604, 0.3801750115407592, 0.6437735542248464])
