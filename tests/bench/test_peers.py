import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import optiplan as op
from optiplan.bench.peers import Peer, PeerOptions, request
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import derived
from optiplan.runs.pipeline import run

PROBLEM = {
    "version": 1,
    "robot": "planar2r",
    "start": {"joints": [0.5, 1.0]},
    "goal": {"joints": [-0.5, 1.1]},
    "limits": {"jerk": "none"},
    "scene": {"obstacles": [{"name": "far", "shape": {"sphere": 0.1}, "pose": {"position": [-1, 0.18, 1]}}]},
}
ADAPTER = """\
import json, sys
asked = json.load(sys.stdin)
open(__file__ + ".asked", "w").write(json.dumps(asked))
a, b = asked["start"], asked["goals"][0]
print("libraries print")
{body}
"""
PEER = "optiplan.bench.peers:Peer"


@pytest.fixture
def peer(tmp_path):
    """A run of the problem by an adapter that ends with these lines."""

    def plan(body, budget=60.0, **changes):
        adapter = tmp_path / "adapter.py"
        adapter.write_text(ADAPTER.format(body=body))
        options = {"adapter": str(adapter), "python": sys.executable, "settings": ["speed=2"]}
        done = run(problem_from_dict(PROBLEM | changes), PEER, options, Budget(budget), lambda stage, part: None)
        return done, adapter.with_name("adapter.py.asked")

    return plan


def test_waypoints_get_our_timing_and_the_same_verifier(peer):
    done, asked = peer('print(json.dumps({"waypoints": [a, [0.0, 0.6], b], "seconds": 0.25}))')
    assert done.verified
    assert done.info == {"path_found": True, "timed_by": "ours"}
    assert done.stages["peer"] == 0.25
    told = json.loads(asked.read_text())
    assert told["settings"] == {"speed": "2"}
    assert (told["joints"], told["start"], told["goals"]) == (
        list(done.problem.robot.joint_names),
        [0.5, 1.0],
        [[-0.5, 1.1]],
    )
    (body,) = told["obstacles"]
    assert (body["name"], body["shape"]) == ("far", {"sphere": 0.1})
    assert [row[3] for row in body["pose"]] == [-1.0, 0.18, 1.0, 1.0]
    assert "<robot" in told["urdf"]


def test_pieces_are_taken_exactly(peer):
    pieces = [[[0.5, 1.0], [0, 0], [-0.75, 0.075], [0.25, -0.025]]]
    done, _ = peer(f'print(json.dumps({{"pieces": {{"breakpoints": [0, 2], "coefficients": {pieces}}}}}))')
    assert done.verified
    assert done.info["timed_by"] == "peer"
    assert done.trajectory.coefficients.tolist() == pieces


def test_samples_are_met_with_their_velocities(peer):
    code = "dict(times=[0, 1, 3], positions=[a, [0.1, 1.05], b], velocities=[[0, 0], [-0.4, 0.03], [0, 0]])"
    done, _ = peer(f'print(json.dumps({{"samples": {code}}}))')
    q = done.trajectory
    for t, at, speed in ((0, [0.5, 1.0], [0, 0]), (1, [0.1, 1.05], [-0.4, 0.03]), (3, [-0.5, 1.1], [0, 0])):
        np.testing.assert_allclose(q(t), at, atol=1e-12)
        np.testing.assert_allclose(q(t, 1), speed, atol=1e-12)
    for piece in (0.999999999, 1.000000001):
        np.testing.assert_allclose(q(piece, 1), [-0.4, 0.03], atol=1e-6)


def test_what_a_peer_claims_is_not_believed(peer):
    done, _ = peer('print(json.dumps({"waypoints": [a, [b[0] + 0.1, b[1]]]}))')
    assert not done.verified
    assert "goal" in {check.name for check in done.report.failures}


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ('print(json.dumps({"failure": "too hard"}))', "too hard"),
        ('raise SystemExit("no such library")', "exit code 1 without an answer: no such library"),
        ("import time; time.sleep(60)", "no answer within the budget of 2 s"),
    ],
)
def test_no_answer_is_a_failure(peer, body, said):
    done, _ = peer(body, budget=2.0 if "sleep" in body else 60.0)
    assert (done.trajectory, done.failure.kind) == (None, "no-path")
    assert said in done.failure.detail


def test_without_a_script_the_suite_is_refused():
    with pytest.raises(InputError, match="adapter"):
        make_planner(PEER, {"adapter": "/nowhere.py"})


def test_what_peers_are_not_told_of(tmp_path):
    adapter = tmp_path / "x.py"
    adapter.write_text("")
    problem = problem_from_dict(PROBLEM)
    held = op.Sphere("ball", radius=0.01).attached_to(problem.robot.tool_frame)
    there = derived(problem, scene=problem.scene.with_attached(held))
    done = Peer(PeerOptions(str(adapter))).plan(there, Budget(1.0), lambda stage, part: None)
    assert done.failure.kind == "unsupported"


def in_adapter(code):
    """What code prints that runs where the adapters do: importing `common` keeps standard output for the answer."""
    folder = Path(__file__).parents[2] / "benchmarks" / "peers"
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stderr


def test_adapters_lock_joints_where_they_stand():
    text = """<robot name="r"><link name="a"/><link name="b"/><joint name="slide" type="prismatic"><parent link="a"/>
    <child link="b"/><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/></joint></robot>"""
    asked = {"urdf": text, "joints": [], "locked": {"slide": 0.5}}
    fixed = in_adapter(f"import common\nprint(common.locked_urdf({asked!r}))")
    assert 'type="fixed"' in fixed
    x, y, z = (float(part) for part in fixed.split('origin xyz="')[1].split('"')[0].split())
    np.testing.assert_allclose([x, y, z], [1.0, 0.5, 0.0], atol=1e-12)


def test_a_controllers_steps_keep_what_its_commands_keep(peer):
    steps = np.array([[0.5, 1.0], [0.5, 1.0], [0.49, 1.02], [0.46, 1.05], [0.45, 1.06], [0.45, 1.06]])
    code = f"import common, numpy, json\nprint(json.dumps(common.rolled_out(numpy.array({steps.tolist()}), 0.2)))"
    samples = json.loads(in_adapter(code))
    done, _ = peer(f'print(json.dumps({{"samples": {samples}}}))', goal={"joints": [0.45, 1.06]})
    assert done.verified
    q = done.trajectory
    np.testing.assert_allclose([q(0), q(q.duration)], steps[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(q.coefficients[:, 3], 0, atol=1e-9)
    np.testing.assert_allclose(2 * q.coefficients[1:-1, 2], np.diff(steps, 2, axis=0) / 0.2**2, atol=1e-9)


def test_the_hulls_that_peers_check_are_ours():
    problem = problem_from_dict(PROBLEM)
    q = [3.0, 0.3]
    asked = json.dumps(request(problem, [np.array([-0.5, 1.1])], Budget(1.0)))
    code = f"""import common, hulls, json, numpy, pinocchio
model, shapes = hulls.geometry(json.loads({asked!r}))
data = shapes.createData()
pinocchio.computeDistances(model, model.createData(), shapes, data, numpy.array({q}))
print(min(found.min_distance for found in data.distanceResults))
"""
    ours = CollisionModel(problem.robot, problem.scene).clearance(np.array(q)).distance
    assert float(in_adapter(code)) == pytest.approx(ours, abs=1e-6)
