import copy

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.poses import pose_from_data
from optiplan.importers.moveit import convert
from optiplan.importers.moveit_objects import CannotConvert
from optiplan.robot.robot import load_robot

BOX = {"type": "box", "dimensions": [0.1, 0.2, 0.3]}
QUARTER = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]  # a quarter turn about z


@pytest.fixture(scope="module")
def robot(request):
    return load_robot(str(request.path.parents[1] / "problem" / "arm" / "robot.yaml"))


def joint_goal(**values):
    return {"joint_constraints": [{"joint_name": name, "position": value} for name, value in values.items()]}


def request_(goals=None, **more):
    state = {"joint_state": {"name": ["shoulder", "elbow", "finger"], "position": [0.0, 0.0, 0.01]}}
    return {"start_state": state, "goal_constraints": goals or [joint_goal(shoulder=1, elbow=0.5)], **more}


def scene(*objects, **more):
    return {"world": {"collision_objects": list(objects)}, **more}


def obstacles(robot, world):
    return {body["name"]: body for body in convert(world, request_(), robot, "1").data["scene"]["obstacles"]}


def pose_goal(**changes):
    position = {
        "link_name": "hand",
        "constraint_region": {
            "primitives": [{"type": "sphere", "dimensions": [0.01]}],
            "primitive_poses": [{"position": [0.5, 0.5, 0.0], "orientation": [0, 0, 0, 1]}],
        },
    }
    orientation = {
        "link_name": "hand",
        "orientation": QUARTER,
        "absolute_x_axis_tolerance": 0.2,
        "absolute_y_axis_tolerance": 0.1,
        "absolute_z_axis_tolerance": 0.3,
    }
    goal = {"position_constraints": [position], "orientation_constraints": [orientation]}
    for key, value in changes.items():
        (position if key in ("target_point_offset", "header", "constraint_region") else goal)[key] = value
    return goal


def test_what_is_left_out_is_told(robot):
    still = {"joint_state": {"name": ["shoulder", "elbow"], "position": [0.0, 0.0], "velocity": [0.0, 0.0]}}
    moving = {"joint_state": {**still["joint_state"], "velocity": [0.0, 0.3]}}
    held = {"object": {"id": "can", "primitives": [BOX]}, "link_name": "hand", "weight": 0.0}

    def told(start, world, **request):
        return convert(world, {**request_(**request), "start_state": start}, robot, "1").notes

    pads = {"link_padding": [{"link_name": "hand", "padding": 0.0}], "link_scale": [{"link_name": "hand", "scale": 1}]}
    assert told({**still, "attached_collision_objects": [held]}, scene(**pads), max_cartesian_speed=0.0) == []
    pads = {
        "link_padding": [{"link_name": "hand", "padding": 0.02}],
        "link_scale": [{"link_name": "arm", "scale": 1.1}],
    }
    heavy = {**moving, "attached_collision_objects": [{**held, "weight": 1.5}]}
    notes = told(heavy, scene(**pads), max_cartesian_speed=0.2)
    assert len(notes) == 4
    for words in ("scale of links: hand, arm", "velocities at the start", "Cartesian speed", "weight of 'can', 1.5"):
        assert any(words in note for note in notes)


def test_pose_of_the_object_comes_before_that_of_its_shape(robot):
    item = {
        "id": "box",
        "pose": {"position": [1, 0, 0], "orientation": QUARTER},
        "primitives": [BOX, {"type": 2, "dimensions": [0.4]}],
        "primitive_poses": [{"position": [0.5, 0, 2]}, {"position": {"x": 0, "y": 1, "z": 0}}],
    }
    bodies = obstacles(robot, scene(item))
    assert bodies["box"]["shape"] == {"box": [0.1, 0.2, 0.3]}
    assert np.allclose(bodies["box"]["pose"]["position"], [1, 0.5, 2])
    assert np.allclose(bodies["box"]["pose"]["quaternion"], QUARTER)
    assert bodies["box_2"]["shape"] == {"sphere": 0.4}
    assert np.allclose(bodies["box_2"]["pose"]["position"], [0, 0, 0])


def test_frames_of_objects(robot):
    frames = [
        {"child_frame_id": "table", "transform": {"translation": [0, 0, 1], "rotation": QUARTER}},
        {"child_frame_id": "cup", "header": {"frame_id": "table"}, "transform": {"translation": [0.5, 0, 0]}},
    ]
    in_cup = {"id": "a", "header": {"frame_id": "cup"}, "primitives": [BOX], "primitive_poses": [{}]}
    in_hand = {"id": "b", "header": {"frame_id": "hand"}, "primitives": [BOX], "pose": {"position": [0.2, 0, 0]}}
    on_a = {"id": "c", "header": {"frame_id": "a"}, "primitives": [BOX], "pose": {"position": [0.2, 0, 0]}}
    bodies = obstacles(robot, scene(in_cup, in_hand, on_a, fixed_frame_transforms=frames))
    assert np.allclose(bodies["a"]["pose"]["position"], [0, 0.5, 1])
    assert np.allclose(bodies["b"]["pose"]["position"], [1.2, 0, 0])
    assert np.allclose(bodies["c"]["pose"]["position"], [0, 0.7, 1])


def test_transforms_name_the_robots_frames_and_come_in_any_order(robot):
    frames = [
        {"child_frame_id": "cup", "header": {"frame_id": "table"}, "transform": {"translation": [0.5, 0, 0]}},
        {"child_frame_id": "base", "header": {"frame_id": "base"}, "transform": {"translation": [0, 0, 0]}},
        {"child_frame_id": "table", "header": {"frame_id": "/base"}, "transform": {"translation": [0, 0, 1]}},
    ]
    item = {"id": "a", "header": {"frame_id": "cup"}, "primitives": [BOX], "primitive_poses": [{}]}
    bodies = obstacles(robot, scene(item, fixed_frame_transforms=frames))
    assert np.allclose(bodies["a"]["pose"]["position"], [0.5, 0, 1])


def test_base_moved_by_the_virtual_joint_moves_the_world_the_other_way(robot):
    moved = {"multi_dof_joint_state": {"transforms": [{"translation": [1, 0, 0], "rotation": QUARTER}]}}
    item = {
        "id": "a",
        "header": {"frame_id": "world"},
        "primitives": [BOX],
        "primitive_poses": [{"position": [1, 2, 0]}],
    }
    bodies = obstacles(robot, scene(item, robot_state=moved))
    assert np.allclose(bodies["a"]["pose"]["position"], [2, 0, 0])


def test_plane_is_solid_away_from_the_base(robot):
    below = {"id": "floor", "planes": [{"coef": [0, 0, 2, 1]}]}  # z = -0.5
    above = {"id": "roof", "planes": [{"coef": [0, 0, 1, -2]}], "plane_poses": [{"position": [0, 0, 1]}]}  # z = 3
    converted = convert(scene(below, above), request_(), robot, "1")
    floor, roof = (body["shape"]["half_space"] for body in converted.data["scene"]["obstacles"])
    assert (floor["normal"], floor["offset"]) == ([0, 0, 1], -0.5)
    assert (roof["normal"], roof["offset"]) == ([0, 0, -1], -2)
    assert any("roof" in note for note in converted.notes)


def test_attached_object_is_held_by_its_link(robot):
    item = {
        "link_name": "hand",
        "object": {
            "id": "tool",
            "header": {"frame_id": "fore"},
            "primitives": [BOX],
            "pose": {"position": [0.6, 0, 0]},
        },
        "touch_links": ["tip", "no_link"],
    }
    state = request_()
    state["start_state"]["attached_collision_objects"] = [item]
    still_there = {"id": "tool", "primitives": [BOX]}
    world = scene(still_there, robot_state={"attached_collision_objects": [item]})
    bodies = convert(world, state, robot, "1").data["scene"]
    (held,) = bodies["attached"]
    assert (held["link"], held["touch"]) == ("hand", ["tip"])
    assert np.allclose(held["pose"]["position"], [0.1, 0, 0])
    assert bodies["obstacles"] == []


def test_allowed_pairs_are_those_that_would_be_checked(robot):
    item = {"id": "a", "primitives": [BOX, BOX], "primitive_poses": [{}, {}]}
    names = ["base", "upper", "fore", "tip", "a", "ghost"]
    allowed = {("base", "upper"), ("base", "fore"), ("tip", "a"), ("tip", "ghost")}
    values = [[(x, y) in allowed or (y, x) in allowed for y in names] for x in names]
    matrix = {"entry_names": names, "entry_values": values}
    data = convert(scene(item, allowed_collision_matrix=matrix), request_(), robot, "1").data["scene"]
    assert data["allowed_collisions"] == [["a", "tip"], ["a_2", "tip"], ["base", "fore"]]
    always = {"default_entry_names": ["a"], "default_entry_values": [True]}
    data = convert(scene(item, allowed_collision_matrix=always), request_(), robot, "1").data["scene"]
    assert ["a", "fore"] in data["allowed_collisions"]
    assert not any("base" in pair and "fore" in pair for pair in data["allowed_collisions"])


@pytest.mark.parametrize(
    "values", [(True, False), (False, True), (False, False), (True, True), (True, None), (False, None)]
)
def test_of_two_defaults_never_allowing_the_contact_wins(robot, values):
    """As MoveIt has it: a pair is allowed if both defaults allow it, or the only one."""
    defaults = {name: value for name, value in zip(("a", "fore"), values, strict=True) if value is not None}
    matrix = {"default_entry_names": list(defaults), "default_entry_values": list(defaults.values())}
    item = {"id": "a", "primitives": [BOX], "primitive_poses": [{}]}
    data = convert(scene(item, allowed_collision_matrix=matrix), request_(), robot, "1").data["scene"]
    assert (["a", "fore"] in data.get("allowed_collisions", [])) == all(defaults.values())
    assert (["a", "upper"] in data.get("allowed_collisions", [])) == defaults["a"]


def test_values_a_rounding_beyond_the_limits_are_moved_inside(robot):
    data = request_([joint_goal(shoulder=3.0004, elbow=0)])
    converted = convert(scene(), data, robot, "1")
    assert converted.data["goal"] == {"joints": [3.0, 0.0]}
    assert "the goal has shoulder beyond its limit by 4.0e-04: moved to the limit" in converted.notes


def test_a_goal_of_a_joint_that_is_not_planned_is_noted(robot):
    converted = convert(scene(), request_([joint_goal(shoulder=1, elbow=0, finger=0.02)]), robot, "1")
    assert converted.data["goal"] == {"joints": [1.0, 0.0]}
    assert "left out of the goal: joints that are not planned, finger" in converted.notes


def test_scaling_factors_become_limits(robot):
    data = request_(max_velocity_scaling_factor=0.5, max_acceleration_scaling_factor=0)
    assert convert(scene(), data, robot, "1").data["limits"] == {"velocity": 0.5}
    assert "limits" not in convert(scene(), request_(max_velocity_scaling_factor=1.0), robot, "1").data


def test_pose_goal(robot):
    goal = convert(scene(), request_([pose_goal()]), robot, "1").data["goal"]["pose"]
    assert goal["frame"] == "hand"
    assert goal["tolerance"] == {"position": 0.01, "orientation": 0.1}
    assert np.allclose(goal["position"], [0.5, 0.5, 0])
    assert np.allclose(goal["quaternion"], QUARTER)


@pytest.mark.parametrize("tolerance", [{"absolute_z_axis_tolerance": 0.0}, {}])
def test_a_tolerance_of_0_is_exact_and_not_free(robot, tolerance):
    orientation = {"link_name": "hand", "orientation": QUARTER, **tolerance}
    point = {"primitives": [{"type": "sphere", "dimensions": [0.0]}], "primitive_poses": [{"position": [1, 0, 0]}]}
    data = request_([pose_goal(orientation_constraints=[orientation], constraint_region=point)])
    goal = convert(scene(), data, robot, "1").data["goal"]["pose"]
    assert goal["tolerance"] == {"position": 1e-4, "orientation": 1e-3}


def test_pose_goal_of_a_point_beside_the_link(robot):
    goal = convert(scene(), request_([pose_goal(target_point_offset=[0.1, 0, 0])]), robot, "1").data["goal"]["pose"]
    X_WL = pose_from_data(goal | {"tolerance": None})
    assert np.allclose(X_WL.act(np.array([0.1, 0, 0])), [0.5, 0.5, 0])


def test_position_goal_leaves_the_orientation_free(robot):
    region = {"primitives": [BOX], "primitive_poses": [{"position": [1, 0, 0]}]}
    data = request_([pose_goal(orientation_constraints=[], constraint_region=region, header={"frame_id": "base"})])
    goal = convert(scene(), data, robot, "1").data["goal"]["pose"]
    assert goal["tolerance"] == {"position": 0.05, "orientation": np.pi}
    assert goal["position"] == [1, 0, 0]


def test_several_goals_are_alternatives(robot):
    data = request_([joint_goal(shoulder=1, elbow=0), pose_goal()])
    first, second = convert(scene(), data, robot, "1").data["goal"]["any_of"]
    assert first == {"joints": [1, 0]}
    assert set(second) == {"pose"}


def broken(change):
    data = copy.deepcopy(request_([pose_goal()]))
    change(data["goal_constraints"][0])
    return data


CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
CONE = {"id": "a", "primitives": [{"type": "cone", "dimensions": [1, 2]}]}
REFUSED = [
    (scene(CONE), request_(), "object 'a' is a cone"),
    (scene({"id": "a"}), request_(), "object 'a' has no shape"),
    (
        scene({"id": "a", "primitives": [BOX], "primitive_poses": [{}, {}]}),
        request_(),
        "1 primitives and 2 primitive_poses",
    ),
    (scene({"id": "a", "header": {"frame_id": "moon"}, "primitives": [BOX]}), request_(), "unknown frame 'moon'"),
    (
        scene(fixed_frame_transforms=[{"child_frame_id": "moon", "header": {"frame_id": "sun"}, "transform": {}}]),
        request_(),
        "unknown frame 'sun'",
    ),
    (scene({"id": "a", "meshes": [{"resource": "package://x"}]}), request_(), "a mesh without vertices"),
    *(
        (
            scene({"id": "a", "meshes": [{"vertices": CORNERS, "triangles": [{"vertex_indices": triangle}]}]}),
            request_(),
            r"a mesh with a triangle \[0, 1.* of 3 vertices",
        )
        for triangle in ([0, 1, 1.5], [0, 1, -2], [0, 1, 3], [0, 1])
    ),
    (scene({"id": "a", "planes": [{"coef": [0, 0, 0, 1]}]}), request_(), "a plane without a normal"),
    ({"world": {"octomap": {"octomap": {"data": [1]}}}}, request_(), "an octomap"),
    (scene(), request_(path_constraints={"joint_constraints": [1]}), "path constraints"),
    (scene(), request_([joint_goal(shoulder=1)]), "the goal gives no value for elbow"),
    (scene(), request_([joint_goal(shoulder=4, elbow=0)]), "the goal has shoulder = 4, beyond its limit 3"),
    (scene(), request_([{"visibility_constraints": [1]}]), "visibility constraints"),
    (scene(), request_([{**pose_goal(), **joint_goal(elbow=1)}]), "joints and a pose at once"),
    (scene(), request_([{}]), "0 position and 0 orientation constraints"),
    (scene(), {"start_state": request_()["start_state"]}, "no goal"),
    (scene(), broken(lambda g: g["position_constraints"][0].update(link_name="fore")), "two links, fore and hand"),
    (scene(), broken(lambda g: g["position_constraints"][0]["constraint_region"].update(primitives=[])), "not a box"),
    (
        scene(),
        request_([pose_goal(orientation_constraints=[], target_point_offset=[1, 0, 0])]),
        "without an orientation",
    ),
    (
        scene(robot_state={"attached_collision_objects": [{"link_name": "x", "object": {"id": "a"}}]}),
        request_(),
        "attached to link x, which the robot does not have",
    ),
    (scene(robot_state={"joint_state": {"name": ["elbow"], "position": []}}), request_(), "1 names and 0 values"),
]


@pytest.mark.parametrize(("world", "data", "reason"), REFUSED)
def test_reasons_for_refusing(robot, world, data, reason):
    with pytest.raises(CannotConvert, match=reason):
        convert(world, data, robot, "1")


def test_goal_about_an_unknown_link_is_refused(robot):
    def change(goal):
        for kind in ("position_constraints", "orientation_constraints"):
            goal[kind][0]["link_name"] = "nose"

    with pytest.raises(CannotConvert, match="link nose, which the robot does not have"):
        convert(scene(), broken(change), robot, "1")


@pytest.mark.parametrize("name", ["fore", "world"])
def test_object_named_like_a_link_or_the_world_gets_another_name(robot, name):
    assert list(obstacles(robot, scene({"id": name, "primitives": [BOX]}))) == [f"{name}_"]


def test_orientation_never_filled_in_is_the_identity(robot):
    item = {"id": "a", "primitives": [BOX], "primitive_poses": [{"orientation": [0, 0, 0, 0]}]}
    X = pose_from_data(obstacles(robot, scene(item))["a"]["pose"])
    assert pin.SE3.Identity().isApprox(X)
