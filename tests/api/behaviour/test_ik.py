"""`op.ik`: branches, redundancy, collisions, order; `op.check` and `op.workspace`."""

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op


@pytest.fixture(scope="module")
def panda():
    return op.load_robot("panda")


def off(robot, q, pose):
    """The largest difference of the pose at q from the one asked for."""
    return np.abs(robot.fk(q).matrix - pose.matrix).max()


@pytest.mark.parametrize("name", ["ur5", "panda", "delbot"])
def test_every_solution_has_the_pose_and_the_nearest_comes_first(name):
    robot = op.load_robot(name)
    near = next(iter(robot.configurations.values())) + 0.02
    pose = robot.fk(near)
    found = op.ik(robot, pose, all=True, near=near)
    assert found.shape[1:] == (robot.n,)
    assert len(found) > 1
    assert max(off(robot, q, pose) for q in found) < 1e-7
    assert ((found >= robot.limits.lower) & (found <= robot.limits.upper)).all()
    distance = np.abs(found - near).max(axis=1)
    assert (np.diff(distance) >= 0.0).all()
    assert distance[0] < 1e-6
    assert (op.ik(robot, pose, near=near) == found[:1]).all()


def test_a_pose_may_be_said_in_any_form(panda):
    pose = panda.fk("extended")
    expected = op.ik(panda, pose)
    for form in (pose.matrix, {"position": pose.position, "quaternion": pose.quaternion}):
        assert np.allclose(op.ik(panda, form), expected, atol=1e-6)
    assert (op.ik("panda", pose) == expected).all()


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_pose_of_pinocchio_is_checked_as_a_matrix_is(name):
    """Its numbers may have few digits: then the nearest rotation is meant."""
    robot = op.load_robot(name)
    X = robot.fk("ready").matrix
    coarse = pin.SE3(X[:3, :3].astype(np.float32).astype(float), X[:3, 3])
    assert np.array_equal(op.ik(robot, coarse, all=True), op.ik(robot, coarse.homogeneous, all=True))
    assert len(op.ik(robot, coarse)) == 1
    for wrong in (pin.SE3(np.eye(3), np.full(3, np.nan)), pin.SE3(1.1 * np.eye(3), np.zeros(3))):
        with pytest.raises(op.InputError, match=r"op\.ik: pose"):
            op.ik(robot, wrong)


def test_out_of_reach_is_no_row(panda):
    assert op.ik(panda, op.Pose((3.0, 0.0, 0.0)), all=True).shape == (0, 7)


def test_with_a_scene_every_solution_is_free():
    robot = op.load_robot("ur5")
    pose = robot.fk("ready")
    every = op.ik(robot, pose, all=True)
    nearest = every[0]
    elbow = robot.fk(nearest, "forearm_link").position
    scene = [op.Sphere("ball", radius=0.05, position=elbow)]
    free = op.ik(robot, pose, all=True, scene=scene)
    assert 0 < len(free) < len(every)
    problem = op.Problem(robot, start=free[0], goal=free[0], scene=scene)
    assert all(problem.is_free(free))
    assert not problem.is_free(nearest)


def test_redundancy_is_used_for_what_is_preferred(panda):
    pose = panda.fk("ready")
    middle = (panda.limits.lower + panda.limits.upper) / 2.0
    half = (panda.limits.upper - panda.limits.lower) / 2.0

    def cost(Q):
        return (((Q - middle) / half) ** 2).sum(axis=1).min()

    preferred = op.ik(panda, pose, all=True, prefer="middle")
    assert cost(preferred) < cost(op.ik(panda, pose, all=True))
    assert max(off(panda, q, pose) for q in preferred) < 1e-7


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"robot": "pandda"}, "op.ik: robot: found 'pandda'; expected one of: "),
        ({"pose": np.eye(3)}, "op.ik: pose: found an array of shape (3, 3)"),
        ({"frame": "hand"}, "op.ik: frame: found 'hand'; expected one of: panda_link0, "),
        ({"near": {"elbow": 1.0}}, "op.ik: near: found unknown joint 'elbow'; expected one of: panda_joint1, "),
        ({"prefer": "mid"}, "op.ik: prefer: found the str 'mid'; expected one of: middle, reference, manipulability"),
        ({"count": 0}, "op.ik: count: found the int 0"),
        ({"scene": "shelf"}, "op.ik: scene: found the str 'shelf'"),
    ],
)
def test_errors_name_the_argument_and_the_choices(panda, arguments, words):
    with pytest.raises(op.InputError) as caught:
        op.ik(**{"robot": panda, "pose": op.Pose((0.4, 0.0, 0.4)), **arguments})
    assert str(caught.value).startswith(words)


def test_check_returns_every_issue(tmp_path):
    assert op.check("01_reach") == []
    file = tmp_path / "bad.yaml"
    file.write_text("version: 1\nrobot: pandda\nstart: {configuration: ready}\ngaol: {configuration: ready}\n")
    issues = op.check(file)
    assert {issue.field for issue in issues} >= {"robot", "gaol"}
    assert all(issue.file == str(file) for issue in issues)
    assert op.check(tmp_path / "none.yaml")[0].found == "no such file"


def test_workspace_is_the_study_of_the_command(tmp_path):
    study = op.workspace("planar2r", tmp_path / "ws", samples=2000)
    assert study.samples.q.shape == (2000, 2)
    assert repr(study).startswith("Workspace: planar2r, reach 1.102 m, ")
    assert (tmp_path / "ws" / "workspace.html").exists()
    with pytest.raises(op.InputError, match=r"^op.workspace: samples: found the int 0"):
        op.workspace("planar2r", samples=0)
