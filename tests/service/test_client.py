"""`op.Client`, the client for cells, and `optiplan plan --server`: what a server plans is what is planned here."""

import json
import time
from pathlib import Path

import httpx
import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.cli.main import run as command
from optiplan.service.cell import EXECUTIONS, CellError, CellPlanner
from optiplan.service.client import ServerError
from optiplan.service.store.contents import StorageFullError
from tests.service.routes.test_problems import MESH, TETRAHEDRON
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import wait_until

NAN = float("nan")


@pytest.fixture
def quick(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(QUICK)
    return path


@pytest.fixture
def client(server):
    with op.Client(server.url) as client:
        yield client


def test_a_plan_of_a_server_is_a_run(client, quick):
    there, here = client.plan(quick, seed=51), op.plan(op.load_problem(quick), seed=51)
    assert there.verified
    assert there.problem.hash == here.problem.hash
    assert there.trajectory.duration == here.trajectory.duration
    assert np.array_equal(there.trajectory([0.1, 0.2]), here.trajectory([0.1, 0.2]))
    assert there.metrics is not None
    assert set(there.timings) >= {"plan", "verify"}


def test_a_motion_whose_record_cannot_be_kept_is_a_run_all_the_same(client, quick, server, monkeypatch):
    def full(_):
        raise StorageFullError("the disk became full while it was planned")

    monkeypatch.setattr(server.service.archive.contents, "put", full)
    run = client.plan(quick, seed=55)
    assert run.verified
    assert (run.planner, run.problem.seed) == ("quintic", 55)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"budget": "5"}, "budget: found the str '5'"),
        ({"budget": NAN}, "budget: found the float nan"),
        ({"deadline": -1.0}, "deadline: found the float -1.0"),
        ({"seed": 1.5}, "seed: found the float 1.5"),
        ({"options": 5}, "options: found the int 5"),
        ({"options": {"degree": NAN}}, "options.degree: found the float nan"),
        ({"options": {"degree": object()}}, "options.degree: found "),
    ],
)
def test_arguments_that_no_server_can_take_are_told(client, quick, given, word):
    for ask in (client.plan, client.submit):
        with pytest.raises(op.InputError) as raised:
            ask(quick, **given)
        assert word in str(raised.value)


def test_a_constraint_that_no_server_gets_is_refused(client, quick):
    own = op.load_problem(quick).with_constraint(op.Expression("slow", lambda k: k.v[0], upper=9.0))
    for ask in (client.plan, client.submit, client.execute):
        with pytest.raises(op.InputError, match=r"op\.Client: problem: found a problem with the expression 'slow'"):
            ask(own)


def test_options_of_an_execution_are_named(client):
    with pytest.raises(op.InputError, match=r"op.Client.execute: override: found the float nan"):
        client.execute("0" * 32, rate=100.0, override=NAN)


def test_numbers_of_numpy_are_numbers(client, quick):
    assert client.plan(quick, "rrtconnect", {"attempts": np.int64(50)}, np.float64(5), np.int64(3)).verified


def test_submit_watch_and_fetch(client, quick):
    run = client.submit(quick, seed=52)
    assert client.submit(quick, seed=52) == run
    events = list(client.watch(run))
    assert events[-1]["type"] == "end"
    assert client.status(run)["status"] == "done"
    assert client.run(run).verified
    assert repr(client).startswith("Client: http://127.0.0.1:")


def test_cancel(client, tmp_path):
    (tmp_path / "no.yaml").write_text(NO_WAY)
    run = client.submit(tmp_path / "no.yaml", budget=60.0, seed=53)
    client.cancel(run)
    end = time.monotonic() + 20.0
    while client.status(run)["status"] in ("queued", "running") and time.monotonic() < end:
        time.sleep(0.05)
    assert client.status(run)["status"] == "cancelled"
    with pytest.raises(ServerError, match="cancelled"):
        client.run(run)


def test_a_failure_is_a_run_without_a_motion(client, tmp_path):
    (tmp_path / "no.yaml").write_text(NO_WAY)
    run = client.plan(tmp_path / "no.yaml", budget=0.5)
    assert run.trajectory is None
    assert run.failure.detail


def test_meshes_are_uploaded(client, tmp_path):
    (tmp_path / "tetra hedron.obj").write_bytes(TETRAHEDRON)
    (tmp_path / "mesh.yaml").write_text(MESH.format(file='"tetra hedron.obj"'))
    assert client.plan(tmp_path / "mesh.yaml").verified


def test_errors_say_what_is_wrong(client, quick, server):
    with pytest.raises(op.InputError, match="unknown planner"):
        client.plan(quick, planner="nonsense")
    with pytest.raises(ServerError, match="there is no run"):
        client.status("0" * 32)
    with pytest.raises(ServerError, match="there is no run"):
        list(client.watch("0" * 32))
    for endless in ({"budget": 1e300}, {"budget": 1.0, "deadline": 1e300}):
        with pytest.raises((op.InputError, ServerError), match=r"at most 300 s|a number ≤"):
            client.plan(quick, **endless)
    with pytest.raises(op.InputError, match="an address such as"):
        op.Client("127.0.0.1")
    with pytest.raises(ServerError, match="no server answers at"):
        op.Client("http://127.0.0.1:9").plan(quick)


@pytest.mark.parametrize("url", ["http://256.1.1.1:7100", "http://[::1", "http://127.0.0.1:x", "http://\0"])
def test_an_address_that_can_be_none_is_bad_input(url, quick, capsys):
    assert command(["plan", str(quick), "--server", url]) == 2
    lines = capsys.readouterr().err.splitlines()  # a server of another test may log among them
    assert any(line.startswith("--server: url: found") for line in lines)


def test_a_host_or_token_that_can_be_none_is_bad_input(quick):
    with pytest.raises(ServerError, match="no server answers at"):
        op.Client("http://a..b").status("0" * 32)
    for token in ("é", "a\nb", None):
        with pytest.raises(op.InputError, match="token: found what no header can carry"):
            op.Client("http://127.0.0.1:9", token)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (httpx.Response(200, content=b"<html>"), "is no `optiplan serve`"),
        (httpx.Response(200, content=b"[]"), "is no `optiplan serve`"),
        (httpx.Response(200, content=b"null"), "is no `optiplan serve`"),
        (httpx.Response(200, content=b"{}"), "is no `optiplan serve`"),
        (httpx.Response(302, headers={"location": "https://there/"}), "sends on to 'https://there/'"),
    ],
)
def test_what_is_no_server_of_ours_is_told_so(quick, answer, words):
    client = op.Client("http://elsewhere")
    client._http = httpx.Client(transport=httpx.MockTransport(lambda request: answer), base_url="http://elsewhere")
    for ask in (client.plan, client.submit, lambda _: client.run("0" * 32), lambda _: client.execute("0" * 32)):
        with pytest.raises(ServerError, match=words):
            ask(quick)


def test_a_cell_gets_timed_points(server, quick):
    with CellPlanner(server.url, quick) as cell:
        motion = cell.plan([0.4, 1.0], joint_target=[-0.4, 1.1])
        assert motion.verified
        assert motion.status == "verified"
        assert motion.q.shape == motion.v.shape == motion.a.shape == (len(motion.t), 2)
        assert motion.q[0] == pytest.approx([0.4, 1.0])
        assert motion.q[-1] == pytest.approx([-0.4, 1.1])
        assert np.abs(motion.v[[0, -1]]).max() < 1e-9
        refused = cell.plan([100.0, 1.0])
        assert refused.status == "failed"
        assert "start" in refused.reason
    with pytest.raises(ValueError, match="unknown robot"):
        CellPlanner(server.url, QUICK.replace("planar2r", "nobody"))


def test_a_cell_that_reaches_nobody_is_told(server, quick):
    with CellPlanner(server.url, quick) as cell:
        cell._http.base_url = "http://127.0.0.1:9"
        assert cell.plan([0.4, 1.0]).status == "unreachable"


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"velocities": [0.1, 0.2]}, "joints"),
        ({"accelerations": [0.1, 0.2]}, "joints"),
        ({"joints": [NAN, 1.0]}, "joints: found [nan, 1.0]"),
        ({"joints": ["0.4", "1.0"]}, "joints"),
        ({"joints": "12"}, "joints: found '12'"),
        ({"joints": 0.4}, "joints: found 0.4"),
        ({"joints": [0.4, 1.0], "velocities": [0.0, float("inf")]}, "velocities"),
        ({"joints": [0.4, 1.0], "joint_target": [[0.1], [0.2, 0.3]]}, "joint_target"),
        ({"target": [0.5, 0.2, 0.6]}, "target: found 3 numbers"),
        ({"target": [0.5, 0.2, 0.6, 1, 0, 0, 0], "joint_target": [0.1, 0.2]}, "target"),
        ({"budget": "soon"}, "budget"),
        ({"budget": -1.0}, "budget"),
        ({"deadline": NAN}, "deadline"),
        ({"rate": 10**400}, "rate"),
        ({"rate": 0}, "rate: found 0"),
        ({"planner": object()}, "object"),
        ({"warm_start": "x"}, "warm_start"),
    ],
)
def test_a_cell_raises_nothing_whatever_it_is_given(server, quick, given, word):
    with CellPlanner(server.url, quick) as cell:
        refused = cell.plan(**given)
    assert (refused.status, refused.verified) == ("failed", False)
    assert word in refused.reason


def test_a_cell_raises_nothing_whatever_it_is_answered(server, quick):
    for content in (b"<html>", b"[]", b"{}", b'{"id": 1, "timings": {}, "trajectory": {"t": "x"}}'):
        answer = httpx.MockTransport(lambda request, content=content: httpx.Response(200, content=content))
        with CellPlanner(server.url, quick) as cell:
            cell._http = httpx.Client(transport=answer, base_url="http://cell")
            assert cell.plan([0.4, 1.0]).status == "failed"
    assert cell.plan([0.4, 1.0]).status == "failed", "it is closed"


def test_the_cells_client_is_handed_out_and_needs_nothing_of_ours(server, tmp_path):
    text = server.http.get("/cell.py").text
    assert "optiplan" not in "".join(line for line in text.splitlines() if line.startswith(("import", "from")))
    compile(text, "cell.py", "exec")


def test_the_command_line_plans_on_a_server(server, quick, tmp_path, capsys):
    code = command(
        ["plan", str(quick), "--server", server.url, "--seed", "54", "--out", str(tmp_path / "run"), "--json"]
    )
    told = json.loads(capsys.readouterr().out)
    assert code == 0
    assert told["verified"] is True
    assert told["seed"] == 54
    assert command(["verify", str(quick), str(tmp_path / "run")]) == 0
    assert command(["plan", str(quick), "--server", "http://127.0.0.1:9"]) == 2
    assert "no server answers" in capsys.readouterr().err
    assert command(["plan", str(quick), "--server", server.url, "--planner", "all"]) == 2
    capsys.readouterr()
    urdf = Path(__file__).parents[2] / "examples" / "my_arm.urdf"
    (tmp_path / "robot.yaml").write_text(f"version: 1\nname: arm\nurdf: {urdf}\n")
    here = tmp_path / "here.yaml"
    here.write_text("version: 1\nrobot: robot.yaml\nstart: {joints: [0, 0, 0]}\ngoal: {joints: [0.1, 0, 0]}\n")
    assert command(["plan", str(here), "--server", server.url]) == 2
    said = capsys.readouterr().err.splitlines()  # the server logs there, too
    refused = next(line for line in said if line.startswith(f"{here} at {server.url}: robot: "))
    assert "robot.yaml: outside the folders that may be read (`optiplan serve --folder DIR`); expected" in refused


def free(server):
    """Wait until no execution uses the driver."""
    wait_until(lambda: all(one["ended"] is not None for one in server.http.get(EXECUTIONS).json()["executions"]))


def test_a_motion_is_executed_and_steered_through_a_client(client, server, quick):
    free(server)
    run = op.plan(op.load_problem(quick))
    with client.execute(run, "paper", override=0.1, lease=2.0) as robot:
        assert robot.about["duration"] == run.duration
        assert robot.override(0.15)["phase"] in ("running", "changing")
        away = op.Pose((-1, 0.18, 1), rpy=(0.3, 1.2, -2.0))
        seen = robot.update_scene({"far": away}, {"far": (0, 0, 0.1)})["obstacles"]["far"]
        assert np.allclose(pin.XYZQUATToSE3(seen).homogeneous, away.matrix, atol=1e-12)
        robot.pause()
        begin = next(one["t"] for one in robot.events() if one["phase"] == "paused")
        robot.resume()
        state = robot.state_in(2.0)
        start = op.State(state["joints"], state["velocity"], state["acceleration"])
        problem = op.Problem("planar2r", start, [0.2, 0.6], planner="trajopt")
        assert robot.splice(op.plan(problem, budget=0.25)) is True
        end = robot.wait(20.0)
    assert (end["ended"], end["clean"]) == ("done", True), end
    assert end["state"]["t"] > begin
    assert end["state"]["q"] == pytest.approx([0.2, 0.6])
    with pytest.raises(ServerError, match="has ended: done"):
        robot.reverse()
    with pytest.raises(op.InputError, match="did you mean 'paper'"):
        client.execute(run, "papr")
    with pytest.raises(op.InputError, match=r"body\.overide"):
        client.execute(run, "paper", overide=0.5)


def test_a_cell_that_goes_away_stops_its_robot(server, quick):
    free(server)
    with CellPlanner(server.url, quick) as cell:
        motion = cell.plan([0.4, 1.0], joint_target=[-0.4, 1.1])
        with cell.execute(motion, "paper", override=0.05, lease=0.4) as robot:
            time.sleep(0.6)
            assert robot.wait(0.0)["ended"] is None
        assert "renewed its lease" in list(robot.events())[-1]["reason"]
        with pytest.raises(CellError, match="there is no run"):
            cell.execute("0" * 32, "paper")
        with pytest.raises(ValueError, match="expected a verified one"):
            cell.execute(cell.plan([100.0, 1.0]))
