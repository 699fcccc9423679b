import numpy as np
import pinocchio as pin
import pytest

from optiplan.bench.suite.suite import load_suite
from optiplan.errors import InputError
from optiplan.problem.load import problem_from_dict
from optiplan.resources import robots_dir

READY = [0.0, -0.7, 0.0, -2.3, 0.0, 1.6, 0.8]
OTHER = [0.6, -0.5, 0.1, -2.0, 0.2, 1.5, 0.4]
TURN = (0.8, 0.0, 0.0, 0.6)
"""A quaternion, w first: about z by 2 atan2(0.6, 0.8)."""

FILE = """\
shelf:
- collision_buffer_ik: 0
  goal_ik: []
  goal_pose: {{frame: panda_hand, position_xyz: {position}, quaternion_wxyz: {quaternion}}}
  obstacles:
    cuboid:
      board: {{dims: [0.3, 0.4, 0.02], pose: [0.9, 0.1, 0.2, 0.8, 0.0, 0.0, 0.6]}}
    cylinder:
      can: {{height: 0.12, radius: 0.03, pose: [0.8, -0.5, 0.3, 1.0, 0.0, 0.0, 0.0]}}
    sphere:
      ball: {{radius: 0.04, position: [-0.6, 0.5, 0.3]}}
    capsule:
      pill: {{height: 0.1, radius: 0.02, pose: [-0.6, -0.5, 0.3, 0.8, 0.6, 0.0, 0.0]}}
  start: {start}
  world_frame: panda_link0
- goal_pose: {{frame: panda_hand, position_xyz: {position}, quaternion_wxyz: {quaternion}}}
  obstacles: {{cuboid: {{}}, cylinder: {{}}}}
  start: {start}
bare:
- goal_pose: {{frame: panda_hand, position_xyz: {position}, quaternion_wxyz: {quaternion}}}
  obstacles: {{}}
  start: {start}
"""


@pytest.fixture(scope="module")
def hand():
    """Pose of the hand at `OTHER`, by pinocchio alone."""
    model = pin.buildModelFromUrdf(str(robots_dir() / "panda" / "panda.urdf"))
    data = model.createData()
    q = np.zeros(model.nq)
    q[:7] = OTHER
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId("panda_hand")]


@pytest.fixture
def text(hand):
    quaternion = pin.Quaternion(hand.rotation)
    wxyz = [float(part) for part in (quaternion.w, quaternion.x, quaternion.y, quaternion.z)]
    return FILE.format(position=hand.translation.tolist(), quaternion=wxyz, start=READY)


@pytest.fixture
def load(tmp_path):
    def load(content, keys=""):
        (tmp_path / "problems.yaml").write_text(content)
        source = f"{{robometrics: problems.yaml{keys}}}"
        path = tmp_path / "suite.yaml"
        path.write_text(f"version: 1\nname: mine\nbudget: 1\nproblems: [{source}]\nplanners: [quintic]\n")
        return load_suite(path, tmp_path / "files").problems

    return load


def test_sets_and_problems(load, text, tmp_path):
    found = load(text)
    assert [problem.id for problem in found] == ["bare/0000", "shelf/0000", "shelf/0001"]
    assert found[2].origin == {"file": str(tmp_path / "problems.yaml"), "set": "shelf", "index": 1}
    assert [problem.id for problem in load(text, ", sets: [shelf], every: 2, set: rm")] == ["rm-shelf/0000"]
    assert [problem.id for problem in load(text, ", sets: [shelf], first: 1")] == ["shelf/0000"]


def test_the_goal_is_the_hand_with_w_first(load, text, hand):
    problem = problem_from_dict(load(text)[0].data)
    (goal,) = problem.goal
    assert goal.frame == "panda_hand"
    np.testing.assert_allclose(goal.X_WG.homogeneous, hand.homogeneous, atol=1e-9)
    assert problem.start.tolist() == READY
    data = problem.robot.model.createData()
    pin.framesForwardKinematics(problem.robot.model, data, np.array(OTHER))
    np.testing.assert_allclose(data.oMf[problem.robot.frame_id("panda_hand")].homogeneous, hand.homogeneous, atol=1e-9)


def test_bodies(load, text):
    bodies = {body["name"]: body for body in load(text)[1].data["scene"]["obstacles"]}
    shapes = {name: {k: v for k, v in body["shape"].items() if v is not None} for name, body in bodies.items()}
    assert shapes == {
        "board": {"box": [0.3, 0.4, 0.02]},
        "can": {"cylinder": {"radius": 0.03, "length": 0.12}},
        "ball": {"sphere": 0.04},
        "pill": {"capsule": {"radius": 0.02, "length": 0.1}},
    }
    w, x, y, z = TURN
    assert bodies["board"]["pose"]["position"] == [0.9, 0.1, 0.2]
    assert bodies["board"]["pose"]["quaternion"] == [x, y, z, w]
    assert bodies["ball"]["pose"]["quaternion"] == [0.0, 0.0, 0.0, 1.0]
    scene = problem_from_dict(load(text)[1].data).scene
    board = next(body for body in scene.obstacles if body.name == "board")
    angle = 2 * np.arctan2(z, w)
    np.testing.assert_allclose(np.asarray(board.X_WO.rotation)[:2, 0], [np.cos(angle), np.sin(angle)], atol=1e-12)


def test_no_bodies_may_be_said_by_nothing(load, text):
    found = load(text.replace("obstacles: {}", "obstacles:").replace("cylinder: {}", "cylinder:"))
    assert [problem.data["scene"]["obstacles"] for problem in (found[0], found[2])] == [[], []]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("sphere:", "mesh:", "shelf[0]: ValueError body 'ball' of kind 'mesh'; known are cuboid, cylinder, sphere"),
        ("dims: [0.3, 0.4, 0.02], ", "", "shelf[0]: KeyError 'dims'"),
        ("radius: 0.03, ", "", "shelf[0]: KeyError 'radius'"),
        ("height: 0.12", "height: tall", "shelf[0]: ValueError could not convert"),
        ("quaternion_wxyz: [", "quaternion_wxyz: [0, ", "]: ValueError too many values"),
        ("start: ", "begin: ", "]: KeyError 'start'"),
        ("bare:", "- 3\nbare:", "shelf[2]: TypeError"),
        ("bare:\n", "bare: 3\nmore:\n", "the file"),
        ("bare:\n", "../../bare:\n", "a set called '../../bare'"),
        ("obstacles: {}", "obstacles: 3", "bare[0]: AttributeError"),
    ],
)
def test_what_is_refused(load, text, old, new, said):
    with pytest.raises(InputError) as caught:
        load(text.replace(old, new))
    assert said in " ".join(str(caught.value).split())


@pytest.mark.parametrize(
    ("keys", "said"),
    [(", sets: [shelv]", "unknown set 'shelv'; expected some of: bare, shelf"), (", robot: nobody.yaml", "no file")],
)
def test_what_the_suite_may_not_ask_for(load, text, keys, said):
    with pytest.raises(InputError, match=said):
        load(text, keys)


def test_no_file(load, tmp_path):
    with pytest.raises(InputError, match=r"no file .*gone.yaml; expected a YAML file of robometrics problems"):
        load("x: []\n", ", set: rm}, {robometrics: gone.yaml")
