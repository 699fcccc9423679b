"""Where a robot stands, what pulls at it, and what it carries."""

import gc
import pickle
import re
import weakref
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import planning_model
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.problem.problem import derived
from optiplan.robot.loaded_robots import once_for_each_robot
from optiplan.robot.mounting import FixedFrame, Mounting
from optiplan.robot.robot import load_robot
from optiplan.verify.continuous.bodies import Bodies

UR5 = {"robot": "ur5", "start": [0, -1.5, 1.2, -1.3, -1.57, 0], "goal": [0.6, -1.1, 1.0, -1.5, -1.57, 0.3]}
PANDA = {"robot": "panda", "start": "ready", "goal": [1.2, 0.3, 0.4, -1.6, 0.3, 1.9, 0.4]}
CEILING = op.Pose((0.2, -0.1, 1.5), rpy=(3.0, 0.1, 0.4))
FINGERS = ["panda_leftfinger", "panda_rightfinger"]


def poses(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return {frame.name: data.oMf[i].homogeneous for i, frame in enumerate(robot.model.frames) if i}


def held(**weight):
    return op.Box("load", size=(0.1, 0.08, 0.12), position=(0, 0, 0.15)).attached_to("panda_hand", FINGERS, **weight)


TOLD = op.Pose((0, 0, 0.2), frame="tool0"), op.Pose((0, 0, 0.2), position_tolerance=0.01)
PLACES = {
    "Problem: base": lambda pose: op.Problem(**UR5, base=pose),
    "Tool: tcp": lambda pose: op.Tool("driver", "tool0", tcp=pose),
    "Tool: parked": lambda pose: op.Tool("driver", "tool0", parked=pose),
    "Tour: targets[0]": lambda pose: op.Tour([pose]),
    "Path: points[0]": lambda pose: op.Path([pose, [0, 0, 1]], 0.1),
    "Robot.side_by_side: robots['a'].base": lambda pose: op.Robot.side_by_side({"a": {"use": "ur5", "base": pose}}),
    "Problem: path_constraints[0].X_WF": lambda pose: op.Problem(
        **UR5, path_constraints=[op.OnScrew("tool0", np.array([0, 0, 1.0]), np.zeros(3), 0.0, pose, 0.1, 0.1)]
    ),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("pose", TOLD, ids=["frame", "tolerance"])
def test_a_frame_or_a_tolerance_where_none_counts_is_refused(place, pose):
    with pytest.raises(op.InputError, match=re.escape(place) + r".*a pose with a (frame|tolerance) of its own"):
        PLACES[place](pose)


def test_every_frame_and_body_stands_where_the_base_is():
    plain, mounted = op.Problem(**UR5), op.Problem(**UR5, base=CEILING)
    X_WB, q = CEILING.matrix, plain.start
    before, after = poses(plain.robot, q), poses(mounted.robot, q)
    assert before.keys() == after.keys()
    for name, X in before.items():
        assert after[name] == pytest.approx(X_WB @ X, abs=1e-12), name
    for one, other in ((plain.robot.geometry, mounted.robot.geometry), (plain.robot.visual, mounted.robot.visual)):
        for body, moved in zip(one.geometryObjects, other.geometryObjects, strict=True):
            own = X_WB @ body.placement.homogeneous if body.parentJoint == 0 else body.placement.homogeneous
            assert moved.placement.homogeneous == pytest.approx(own, abs=1e-12), body.name


def test_a_robot_on_the_ceiling_reaches_poses_of_the_world_and_is_verified():
    goal = op.Pose((0.5, 0.2, 1.0), rpy=(3.14, 0, 0))
    problem = op.Problem("ur5", start=UR5["start"], goal=goal, base=CEILING)
    run = op.plan(problem, budget=3.0)
    assert run.verified
    reached = poses(problem.robot, run.trajectory.end)[problem.robot.tool_frame]
    assert reached[:3, 3] == pytest.approx((0.5, 0.2, 1.0), abs=2e-4)
    assert any(line.startswith("base at [0.2, -0.1, 1.5] m") for line in run.report.scope)


def test_closed_form_branches_are_those_of_the_mounted_arm():
    robot = op.Problem(**UR5, base=CEILING).robot
    form = closed_form(robot)
    assert form is not None
    X = poses(robot, np.array(UR5["goal"]))[robot.tool_frame]
    found = form.solve(X[None])
    branches = found.q[found.valid]
    assert len(branches) >= 2
    for q in branches:
        assert poses(robot, q)[robot.tool_frame] == pytest.approx(X, abs=1e-9)


def test_payload_is_in_the_torques_as_its_weight_at_a_lever():
    plain, loaded = op.Problem(**PANDA), op.Problem(**PANDA, scene=op.Scene([], [held(mass=3.0)]))
    q = np.array(PANDA["goal"])
    torque = [pin.computeGeneralizedGravity(p.robot.model, p.robot.model.createData(), q) for p in (plain, loaded)]
    robot = plain.robot
    data = robot.model.createData()
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J = pin.computeFrameJacobian(robot.model, data, q, robot.frame_id("panda_hand"), axes)
    R = poses(robot, q)["panda_hand"][:3, :3]
    lever = pin.skew(R @ np.array([0, 0, 0.15]))
    weight = (J[:3] - lever @ J[3:]).T @ np.array([0, 0, 3.0 * 9.81])
    assert torque[1] - torque[0] == pytest.approx(weight, abs=1e-9)
    assert loaded.robot.mounting.mass == 3.0


def test_a_load_is_planned_with_and_proved():
    limits = {"torque": 0.76}
    light = op.plan(op.Problem(**PANDA, scene=op.Scene([], [held()]), limits=limits), budget=5.0)
    heavy = op.plan(op.Problem(**PANDA, scene=op.Scene([], [held(mass=5.0)]), limits=limits), budget=5.0)
    assert light.verified
    assert heavy.verified
    assert any("attached objects weigh nothing" in line for line in light.report.scope)
    assert any("with load of 5 kg" in line for line in heavy.report.scope)
    refused = op.verify(heavy.problem, light.trajectory)
    assert [check.name for check in refused.failures] == ["torque"]


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (op.Box("x", size=(0.1, 0.2, 0.3)), pin.Inertia.FromBox(2.0, 0.1, 0.2, 0.3)),
        (op.Sphere("x", radius=0.1), pin.Inertia.FromSphere(2.0, 0.1)),
        (op.Cylinder("x", radius=0.1, length=0.3), pin.Inertia.FromCylinder(2.0, 0.1, 0.3)),
        (op.Capsule("x", radius=0.1, length=0.3), pin.Inertia.FromCapsule(2.0, 0.1, 0.3)),
    ],
)
def test_shapes_are_filled_evenly_unless_told_otherwise(shape, expected):
    even = shape.attached_to("panda_hand", mass=2.0).inertia_in_link()
    assert even.matrix() == pytest.approx(expected.matrix(), rel=1e-6, abs=1e-9)
    told = shape.attached_to("panda_hand", mass=2.0, centre=(0, 0, 0.1), inertia=(0.1, 0.2, 0.25)).inertia_in_link()
    assert told.lever == pytest.approx((0, 0, 0.1))
    assert np.diag(told.inertia) == pytest.approx((0.1, 0.2, 0.25))


def box_mesh(path, *boxes):
    """An OBJ file of boxes (centre, size, winding: 1 outward, -1 inward)."""
    lines = []
    for k, (centre, size, winding) in enumerate(boxes):
        mesh = trimesh.creation.box(size)
        lines += ["v " + " ".join(map(repr, vertex)) for vertex in (mesh.vertices + centre).tolist()]
        lines += ["f " + " ".join(str(i + 1 + 8 * k) for i in face[::winding]) for face in mesh.faces.tolist()]
    path.write_text("\n".join(lines))
    return op.Mesh("load", path)


def test_a_mesh_weighs_the_same_whatever_its_winding(tmp_path):
    """Pieces wound inward cancelled others: the centre of two boxes a metre from the hand could be in the hand."""
    near, far = ((0.5, 0.0, 0.0), (0.1, 0.1, 0.1)), ((1.0, 0.0, 0.0), (0.1, 0.1, 0.05))
    expected = pin.Inertia.FromBox(2.0, 0.1, 0.1, 0.1)
    expected.lever = np.array(near[0])
    other = pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.05)
    other.lever = np.array(far[0])
    for k, windings in enumerate([(1, 1), (-1, 1), (1, -1), (-1, -1)]):
        boxes = [(*box, winding) for box, winding in zip((near, far), windings, strict=True)]
        mesh = box_mesh(tmp_path / f"{k}.obj", *boxes)
        found = mesh.attached_to("panda_hand", mass=3.0).inertia_in_link()
        assert found.matrix() == pytest.approx((expected + other).matrix(), rel=1e-6, abs=1e-9)


def test_boxes_side_by_side_are_one(tmp_path):
    """The face between them is there twice, once of each winding."""
    halves = [((x, 0.0, 0.0), (0.1, 0.1, 0.1), 1) for x in (-0.05, 0.05)]
    found = box_mesh(tmp_path / "x.obj", *halves).attached_to("panda_hand", mass=2.0).inertia_in_link()
    assert found.matrix() == pytest.approx(pin.Inertia.FromBox(2.0, 0.2, 0.1, 0.1).matrix(), rel=1e-6, abs=1e-9)


def test_a_hollow_weighs_nothing(tmp_path):
    outer, inner = ((0.0, 0.0, 0.0), (0.1, 0.2, 0.3), 1), ((0.0, 0.0, 0.05), (0.08, 0.1, 0.1), -1)
    found = box_mesh(tmp_path / "x.obj", outer, inner).attached_to("panda_hand", mass=2.0).inertia_in_link()
    assert found.lever == pytest.approx((0.0, 0.0, -0.05 * 0.0008 / (0.006 - 0.0008)))


@pytest.mark.parametrize("by", ["scene", "task"])
@pytest.mark.parametrize(
    ("faces", "more", "words"),
    [
        (10, {"mass": 1.0}, "open somewhere; expected `centre` and `inertia`"),
        (10, {"mass": 1.0, "centre": [0, 0, 0], "inertia": [0.01, 0.01, 0.01]}, ""),
        (10, {}, ""),
        (12, {"mass": 1.0}, ""),
        (12, {"mass": 1.0, "inertia": [1.0, 0.1, 0.1]}, "none larger than the other two"),
        (12, {"mass": 1.0, "inertia": [-1.0, -1.0, -1.0]}, "none larger than the other two"),
        (12, {"centre": [0, 0, 0]}, "expected `mass` too"),
    ],
)
def test_what_a_mesh_weighs_is_known_or_bad_input(tmp_path, by, faces, more, words):
    """Of an open mesh, the sum over its triangles depends on where the origin is."""
    mesh = box_mesh(tmp_path / "x.obj", ((0.0, 0.0, 0.3), (0.1, 0.1, 0.1), 1))
    kept = (tmp_path / "x.obj").read_text().splitlines()[: 8 + faces]
    (tmp_path / "x.obj").write_text("\n".join(kept) + "\n")

    def made():
        if by == "scene":
            return op.Problem(**PANDA, scene=op.Scene([], [mesh.attached_to("panda_hand", **more)]))
        there = op.Mesh("load", mesh.shape.file, position=(0.0, 0.0, 1.5))
        task = op.Task().attach("load", "panda_hand", **more).dwell(1.0)
        return op.Problem("panda", "ready", scene=[there], task=task)

    if words:
        with pytest.raises(op.InputError, match=re.escape(words)):
            made()
    else:
        assert made().scene.names == ("load",)


def test_gravity_pulls_where_the_problem_says():
    problem = op.Problem(**PANDA, gravity=(0, 0, 0))
    torque = pin.computeGeneralizedGravity(problem.robot.model, problem.robot.model.createData(), problem.start)
    assert torque == pytest.approx(np.zeros(7))
    on_the_moon = op.plan(problem.with_gravity((0, 0, -1.62)), "quintic")
    assert any("gravity [0, 0, -1.62] m/s²" in line for line in on_the_moon.report.scope)


def test_a_file_says_it_and_the_hash_knows_it(tmp_path):
    problem = op.Problem(**PANDA, base=CEILING, gravity=(0, 1.0, -9.0), scene=op.Scene([], [held(mass=1.0)]))
    problem.save(tmp_path / "mounted.yaml")
    again = op.load_problem(tmp_path / "mounted.yaml")
    assert again.hash == problem.hash
    assert again.robot.mounting.X_WB.homogeneous == pytest.approx(CEILING.matrix)
    others = [
        problem.with_base(op.Pose((0, 0, 0))),
        problem.with_gravity((0, 0, -9.81)),
        problem.with_scene(op.Scene([], [held()])),
    ]
    assert len({problem.hash, *(other.hash for other in others)}) == 4
    assert others[2].robot.mounting.mass == 0.0
    assert others[0].robot.mounting.X_WB.homogeneous == pytest.approx(np.eye(4))


def test_a_mounted_robot_travels_to_other_processes():
    robot = op.Problem(**PANDA, base=CEILING, scene=op.Scene([], [held(mass=1.0)])).robot
    again = pickle.loads(pickle.dumps(robot))
    assert poses(again, np.zeros(7))["panda_hand"] == pytest.approx(poses(robot, np.zeros(7))["panda_hand"])
    assert again.mounting.mass == 1.0
    assert again.mounted(Mounting()).mounting.usual
    assert again.mounted(Mounting()).model.jointPlacements[1] == load_robot("panda").model.jointPlacements[1]


def test_a_robot_that_stands_as_before_is_the_same_object():
    robot = op.Problem(**PANDA, base=CEILING).robot
    assert op.Problem(**PANDA, base=CEILING).robot is robot
    loaded = op.Problem(**PANDA, base=CEILING, scene=op.Scene([], [held(mass=1.0)])).robot
    assert loaded is not robot
    assert op.Problem(**PANDA, base=CEILING, scene=op.Scene([], [held(mass=2.0)])).robot.mounting.mass == 2.0
    assert op.Problem(**PANDA).robot is robot.unmounted is load_robot("panda")
    for pull in range(10):
        robot.mounted(Mounting(gravity=np.array([0.0, 0.0, -1.0 - pull])))
    assert len(robot.unmounted._mounted) == 4


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_bodies_looked_at_once_are_placed_anew_for_another_base(name):
    """What is known of links from one base says the same at another one as what is found afresh."""
    robot, wall = load_robot(name), op.Scene([op.Box("wall", size=(0.1, 2, 2), position=(0.9, 0, 0.5))])
    rng = np.random.default_rng(3)
    for base in (
        Mounting(),
        Mounting(pin.SE3(CEILING.matrix)),
        Mounting(pin.SE3(pin.utils.rotate("z", 0.7), np.ones(3))),
    ):
        mounted = robot.mounted(base)
        kept = planning_model(mounted, wall)
        fresh = CollisionModel(replace(mounted, bare=None), wall)  # shares nothing
        for q in rng.uniform(-1.5, 1.5, (10, robot.n)):
            assert kept.collides(q) == fresh.collides(q)
            found, expected = (max(model.clearance(q).distance, 0.0) for model in (kept, fresh))
            assert found == pytest.approx(expected, abs=2e-7)
        poses = fresh.kinematics.poses(rng.uniform(-1.5, 1.5, (3, robot.n)))
        one, other = Bodies(CollisionModel(mounted, wall)), Bodies(fresh)
        pairs = np.repeat(np.arange(len(one.pairs))[None], 3, axis=0).ravel()
        rows = np.repeat(np.arange(3), len(one.pairs))
        along = rng.normal(size=(2 * len(pairs), 3))
        found, expected = (
            known.support(placed.bodies.ravel(), placed.poses.reshape(-1, 4, 4), along)
            for known in (one, other)
            for placed in [known.place(poses, rows, pairs)]
        )
        assert found == pytest.approx(expected, abs=1e-12)


def test_pairs_checked_of_a_mounted_robot_stay_checked_wherever_it_stands():
    robot, high = load_robot("panda"), Mounting(pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])))
    checked = robot.mounted(high).with_proved_checked()
    assert len(checked.geometry.collisionPairs) > len(robot.geometry.collisionPairs)
    for other in (checked.mounted(Mounting()), checked.holding({"panda_joint1": 0.1})):
        assert other.allowed == checked.allowed


@pytest.mark.parametrize(
    ("change", "place", "words"),
    [
        ({"gravity": [0, 0]}, ("gravity",), "3 values"),
        ({"base": {"position": [0, 0, 0], "rpy": [0, 0, 0], "quaternion": [0, 0, 0, 1]}}, ("base",), "at most one"),
        ({"mass": -1.0}, ("scene", "attached", 0, "mass"), "expected a number ≥ 0"),
        ({"centre": [0, 0, 0]}, ("scene", "attached", 0), "expected `mass` too"),
        (
            {"mass": 1.0, "inertia": [1.0, 0.1, 0.1]},
            ("scene", "attached", 0),
            "none larger than the other two",
        ),
    ],
)
def test_bad_values_are_named(change, place, words):
    attached = {"name": "load", "shape": {"sphere": 0.02}, "link": "panda_hand", "pose": {"position": [0, 0, 0.2]}}
    attached |= {key: value for key, value in change.items() if key not in ("gravity", "base")}
    rest = {key: value for key, value in change.items() if key in ("gravity", "base")}
    with pytest.raises(op.InputError) as caught:
        op.Problem(**PANDA, scene={"attached": [attached]}, **rest)
    issue = caught.value.issues[0]
    assert issue.path[: len(place)] == place
    assert words in str(issue)


def test_a_start_that_the_base_puts_into_an_obstacle_is_refused():
    floor = op.HalfSpace("floor", offset=-0.01)
    problem = op.Problem(**UR5, scene=[floor])
    with pytest.raises(op.InputError, match="the start is in collision"):
        problem.with_base(op.Pose((0, 0, -0.9)))


def test_what_was_put_together_by_hand_has_no_base_to_change():
    problem = derived(op.Problem(**UR5))
    with pytest.raises(op.InputError, match="put together by hand"):
        problem.with_gravity((0, 0, 0))


def test_what_is_made_of_a_robot_alone_is_made_once_for_all_places():
    made = []

    @once_for_each_robot
    def names(robot):
        made.append(robot)
        return list(robot.joint_names)

    arm = load_robot("planar2r")
    high = arm.mounted(Mounting(pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0]))))
    assert names(high) is names(arm) is names(high.mounted(Mounting()))
    assert made == [arm]
    assert names(load_robot("ur5")) != names(arm)


def test_what_is_made_of_a_robot_goes_with_it():
    arm, numbers = replace(load_robot("planar2r")), once_for_each_robot(lambda robot: np.zeros(robot.n))
    kept = weakref.ref(numbers(arm))
    assert kept() is numbers(arm)
    del arm
    gc.collect()
    assert kept() is None


def test_what_is_held_is_no_tool_of_the_same_name():
    """In one process, such as a server's, robots are kept by their mounting."""
    robot = load_robot("panda")
    frames = [FixedFrame("driver", "panda_link8", pin.SE3.Identity(), held) for held in (True, False)]
    assert [robot.mounted(Mounting(frames=(one,))).mounting.frames[0].held for one in frames] == [True, False]
