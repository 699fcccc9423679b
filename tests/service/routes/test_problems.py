"""Problems over HTTP: checked with every issue, stored under their hash, with files from nowhere but where allowed."""

import json
import time
from pathlib import Path

import pytest

import optiplan as op
from optiplan.problem.load import load_problem
from optiplan.resources import robots_dir
from optiplan.service.store.contents import FULL
from tests.small_problems import QUICK

MESH = """\
version: 1
name: mesh
robot: planar2r
start: {{joints: [0.5, 1.0]}}
goal: {{joints: [-0.5, 1.2]}}
scene: {{obstacles: [{{name: far, shape: {{mesh: {{file: {file}}}}}, pose: {{position: [-1, 0.18, 1]}}}}]}}
planner: quintic
"""

TETRAHEDRON = b"""v 0 0 0
v 0.1 0 0
v 0 0.1 0
v 0 0 0.1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


def check(server, problem, **given):
    return server.http.post("/api/problems/validate", json={"problem": problem, **given})


def test_a_valid_problem_has_the_hash_that_it_has_everywhere(server, tmp_path):
    path = tmp_path / "problem.yaml"
    path.write_text(QUICK)
    assert check(server, QUICK).json() == {
        "valid": True,
        "issues": [],
        "hash": load_problem(path).hash,
        "name": "free",
        "robot": "planar2r",
    }


def test_every_issue_is_told_with_its_line(server):
    broken = QUICK.replace("planar2r", "planar3r").replace("sphere: 0.1", "sphere: -0.1")
    found = check(server, broken).json()
    assert found["valid"] is False
    assert [(issue["line"], issue["field"]) for issue in found["issues"]] == [
        (3, "robot"),
        (6, "scene.obstacles[0].shape.sphere"),
    ]
    refused = server.http.post("/api/runs", json={"problem": broken})
    assert refused.status_code == 422
    assert len(refused.json()["issues"]) == 2


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"planner": "nonsense"}, "unknown planner"),
        ({"planner": "os:system"}, "unknown planner"),
        ({"planner": "optiplan.planners.point_to_point.quintic:Quintic"}, "unknown planner"),
        ({"options": {"nonsense": 1}}, "unknown"),
        ({"budget": -1}, "budget"),
        ({"budget": 301}, "at most 300"),
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"nonsense": 1}, "nonsense"),
        ({"deadline": 0}, "deadline"),
        ({"name": "two\nlines"}, "name"),
        ({"start": {"joints": [1.0]}}, "start"),
    ],
)
def test_what_is_wrong_with_a_submission_is_said(server, given, word):
    answer = server.http.post("/api/runs", json={"problem": QUICK, **given})
    assert answer.status_code == 422
    assert word in answer.json()["error"]


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[" * 100_000,
        b'{"problem": ' + b"[" * 5000 + b"]" * 5000 + b"}",
        b"9" * 10_000,
        b"\xff\xfe",
        b"null",
    ],
)
def test_broken_bodies_are_refused(server, body):
    answer = server.http.post("/api/runs", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code in (400, 422)
    assert answer.json()["error"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"problem": 5}, "body.problem: 5; expected text, or a mapping of keys to values"),
        ({}, "body.problem: nothing; expected this key, which is required"),
        ({"problem": QUICK, "budget": "soon"}, "body.budget: 'soon'; expected a number"),
        ({"problem": QUICK, "seeds": 5}, "body.seeds: unknown key 'seeds'; expected one of: "),
        ({"problem": QUICK, "seeds": 5}, "(did you mean 'seed'?)"),
        ({"problem": QUICK, "budget": 5000}, "budget: found 5000 s; expected at most 300 s on this server"),
    ],
)
def test_what_does_not_fit_is_told_in_our_words(server, given, words):
    answer = server.http.post("/api/runs", json=given)
    assert answer.status_code == 422
    assert words in answer.json()["error"]


@pytest.mark.parametrize(
    ("method", "path", "content", "status", "words"),
    [
        ("GET", "/api/runs?lmit=5", "", 422, "unknown key 'lmit'; expected one of: limit, before (did you mean 'limit"),
        ("POST", "/api/runs?budget=5", "{}", 422, "query: unknown key 'budget'; expected no query"),
        ("POST", "/api/runs", "{", 400, "body: broken JSON"),
        ("POST", "/api/plan", QUICK, 422, "Content-Type: text/plain; expected application/json, or application/yaml"),
        ("GET", "/runs/nope", "", 404, "there is no run 'nope'"),
        ("GET", "/api/problems/nope", "", 404, "there is no problem 'nope'"),
    ],
)
def test_what_is_asked_in_a_wrong_way_is_told(server, method, path, content, status, words):
    kind = "application/json" if content.startswith("{") else "text/plain"
    answer = server.http.request(method, path, content=content, headers={"Content-Type": kind})
    assert answer.status_code == status
    assert words in answer.json()["error"]


@pytest.mark.parametrize("text", ["NaN", "Infinity", '"\\ud800"', '"\\u0000"', '{"a": 1e999}'])
def test_values_that_are_no_json_are_refused(server, text):
    body = f'{{"problem": {{"robot": {text}}}}}'
    answer = server.http.post("/api/runs", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422


def test_a_yaml_bomb_is_refused_early(server):
    levels = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    levels += [f"a{k}: &a{k} [" + ", ".join([f"*a{k - 1}"] * 10) + "]" for k in range(1, 10)]
    began = time.monotonic()
    answer = check(server, "\n".join(levels))
    assert answer.json()["valid"] is False
    assert "too large" in answer.text
    assert time.monotonic() - began < 60.0  # it would never end


def test_a_million_obstacles_are_refused_early(server):
    one = {"name": "a", "shape": {"sphere": 0.1}}
    answer = server.http.post("/api/runs", json={"problem": {"scene": {"obstacles": [one] * 100_000}}})
    assert answer.status_code == 422
    assert "this server takes 2000" in answer.json()["error"]
    by_alias = QUICK.replace(
        "scene:", "x: &x {name: a, shape: {sphere: 0.1}}\nscene: {obstacles: [" + "*x, " * 3000 + "]}\nold:"
    )
    assert "3000 bodies" in check(server, by_alias).text


def test_stored_problems_are_found_by_their_hash(server):
    stored = server.http.post("/api/problems", json={"problem": QUICK, "name": "quick"})
    assert stored.status_code == 201
    hash = stored.json()["hash"]
    assert hash in [problem["hash"] for problem in server.http.get("/api/problems").json()]
    assert server.http.get(f"/api/problems/{hash}").json()["problem"] == QUICK
    run = server.submit(problem=hash, seed=31)
    assert run["problem"] == hash
    moved = server.http.post("/api/plan", json={"problem": hash, "start": {"joints": [0.4, 1.0]}}).json()
    assert moved["problem"] != hash
    assert moved["trajectory"]["q"][0] == pytest.approx([0.4, 1.0])
    planned = server.http.get(f"/api/runs/{moved['id']}/problem").text  # with the start that it was planned from
    assert server.http.post("/api/problems/validate", json={"problem": planned}).json()["hash"] == moved["problem"]
    assert server.http.get(f"/api/runs/{run['id']}/problem").text == QUICK
    asked = {"problem": hash, "goal": {"joints": [-0.4, 1.2]}, "name": "not its own"}
    other = server.http.post("/api/problems", json=asked).json()["hash"]
    again = server.http.get(f"/api/problems/{other}").json()["problem"]
    assert server.http.post("/api/problems/validate", json={"problem": again}).json()["hash"] == other
    assert server.http.delete(f"/api/problems/{hash}").status_code == 204
    assert server.http.post("/api/runs", json={"problem": hash}).status_code == 404
    assert server.ended(run["id"])["status"] == "done"


def test_meshes_come_from_uploads_and_allowed_folders_alone(server, tmp_path):
    (tmp_path / "canary.obj").write_bytes(TETRAHEDRON)
    outside = check(server, MESH.format(file=tmp_path / "canary.obj")).json()
    assert outside["valid"] is False
    assert "outside the folders" in outside["issues"][0]["found"]
    for file in ("../contents/store", "/etc/passwd", "/proc/self/environ", "../../../../../../etc/passwd"):
        assert "outside the folders" in check(server, MESH.format(file=file)).text
    (server.service.settings.folders[0] / "allowed.obj").write_bytes(TETRAHEDRON)
    assert check(server, MESH.format(file=server.service.settings.folders[0] / "allowed.obj")).json()["valid"] is True
    link = server.service.settings.folders[0] / "link.obj"
    link.symlink_to(tmp_path / "canary.obj")
    assert "outside the folders" in check(server, MESH.format(file=link)).text
    assert server.http.put("/api/uploads/part/tetra.obj", content=TETRAHEDRON).status_code == 201
    assert check(server, MESH.format(file="part/tetra.obj")).json()["valid"] is True


ARM = {"planar2r.urdf": robots_dir() / "planar2r/planar2r.urdf", "robot.yaml": robots_dir() / "planar2r/robot.yaml"}
TOUR = """\
version: 1
robot: panda
start: {configuration: ready}
task: [{tour: {targets: %s/holes.csv}}]
"""


@pytest.mark.parametrize(
    ("files", "problem", "changed"),
    [
        ({"holes.csv": b"x,y,z,nx,ny,nz\n0.5,0.1,0.4,0,0,-1\n"}, TOUR, {"holes.csv": (b"0.5", b"0.6")}),
        (
            {name: path.read_bytes() for name, path in ARM.items()},
            QUICK.replace("planar2r", "%s"),
            {"robot.yaml": (b"velocity: 2.0", b"velocity: 1.0")},
        ),
    ],
    ids=["table", "robot"],
)
def test_a_file_that_is_replaced_makes_another_problem(server, files, problem, changed):
    folder = f"changed-{min(files).partition('.')[0]}"
    for name, content in files.items():
        assert server.http.put(f"/api/uploads/{folder}/{name}", content=content).status_code == 201
    first, again = (check(server, problem % folder).json()["hash"] for _ in range(2))
    assert first == again
    for name, (old, new) in changed.items():
        content = files[name].replace(old, new)
        assert server.http.put(f"/api/uploads/{folder}/{name}", content=content).status_code == 201
    assert check(server, problem % folder).json()["hash"] != first


def test_errors_show_no_paths_of_the_server(server):
    data, meshes = server.service.settings.data, server.service.settings.folders[0]
    (meshes / "broken.obj").write_bytes(b"v 1 2\n")
    server.http.put("/api/uploads/arm/robot.yaml", content=b"version: 1\nurdf: missing.urdf\n")
    server.http.put("/api/uploads/arm/broken.urdf", content=b"<robot")
    problems = [MESH.format(file=file) for file in ("nowhere.obj", "arm", meshes / "broken.obj", meshes / "no.obj")]
    problems += [
        {"version": 1, "robot": robot, "start": {}} for robot in ("arm/robot.yaml", {"urdf": "arm/broken.urdf"})
    ]
    for problem in problems:
        for path in ("/api/problems/validate", "/api/runs", "/api/plan"):
            answer = server.http.post(path, json={"problem": problem})
            assert answer.json().get("valid") is False or answer.status_code == 422
            for folder in (data.parent, Path(op.__file__).parents[1], Path.home()):
                assert f"{folder}/" not in answer.text
    assert "nowhere.obj" in check(server, problems[0]).text


def test_a_robot_file_outside_is_not_read(server, tmp_path):
    (tmp_path / "robot.urdf").write_text("<robot name='canary'/>")
    for robot in (str(tmp_path / "robot.yaml"), {"urdf": str(tmp_path / "robot.urdf")}):
        answer = server.http.post("/api/problems/validate", json={"problem": {"version": 1, "robot": robot}})
        assert answer.json()["valid"] is False
        assert "canary" not in answer.text


@pytest.mark.parametrize("path", ["../a", ".hidden", "a//b", "a\\b", "a b", "%2e%2e/a", "a/b/c/d/e/f/g/h/i", ""])
def test_uploads_have_plain_names(server, path):
    answer = server.http.put(f"/api/uploads/{path}", content=b"x")
    assert answer.status_code in (404, 405, 422)


def test_a_folder_is_no_file_of_an_upload(server):
    assert server.http.put("/api/uploads/folder/file", content=b"x").status_code == 201
    assert server.http.put("/api/uploads/folder", content=b"x").status_code == 422
    assert server.http.put("/api/uploads/folder/file/below", content=b"x").status_code == 422


def test_a_full_disk_is_said_and_nothing_is_corrupted(server, monkeypatch):
    def full(*_):
        raise OSError(FULL[0], "No space left on device")

    before = server.http.get("/api/runs?limit=500").json()["counts"]
    with monkeypatch.context() as patch:
        patch.setattr("optiplan.service.store.contents.write_bytes", full)
        patch.setattr("optiplan.service.store.uploads.write_bytes", full)
        patch.setattr("optiplan.service.store.write_probe.FRESH", 0.0)
        assert server.http.get("/readyz").status_code == 503
        assert server.http.put("/api/uploads/full.obj", content=TETRAHEDRON).status_code == 507
        for path, seed in (("/api/runs", {"seed": 41}), ("/api/problems", {}), ("/api/plan", {"seed": 42})):
            answer = server.http.post(path, json={"problem": QUICK.replace("free", "full"), **seed})
            assert answer.status_code == 507
            assert "full" in answer.json()["error"]
    assert server.http.get("/api/runs?limit=500").json()["counts"] == before
    assert server.submit(problem=QUICK.replace("free", "full"), seed=41)["status"] == "queued"


def test_a_disk_that_fills_while_a_run_is_solved_fails_that_run_alone(server, monkeypatch):
    run = None
    with monkeypatch.context() as patch:
        real = server.service.archive.contents.put

        def put(content):
            if content.startswith(b'{\n "name"'):
                from optiplan.service.store.contents import StorageFullError

                raise StorageFullError("the disk is full")
            return real(content)

        patch.setattr(server.service.archive.contents, "put", put)
        run = server.ended(server.submit(seed=43)["id"])
        assert run["status"] == "failed"
        assert run["failure"]["kind"] == "storage"
    assert server.submit(seed=43)["status"] in ("queued", "running", "done")
    assert server.ended(run["id"])["status"] == "done"


def test_little_room_is_said_before_anything_is_taken_on(server, monkeypatch):
    known = server.ended(server.submit(seed=40)["id"])
    monkeypatch.setattr(server.service.archive.contents, "spare", 10**18)
    assert server.submit(seed=40) | {"submission": ""} == known | {"submission": ""}, "nothing has to be kept for it"
    assert server.http.post("/api/runs", json={"problem": QUICK, "seed": 44}).status_code == 507


def test_a_full_queue_says_when_to_come_again(server, monkeypatch):
    monkeypatch.setattr(server.service.archive.runs, "waiting", lambda: 1000)
    answer = server.http.post("/api/runs", json={"problem": QUICK, "seed": 45})
    assert answer.status_code == 429
    assert 1 <= int(answer.headers["retry-after"]) <= 60


def test_what_there_is_to_choose_from(server):
    assert "panda" in [robot["name"] for robot in server.http.get("/api/robots").json()]
    assert server.http.get("/api/robots/panda").json()["name"] == "panda"
    assert server.http.get("/api/robots/nobody").status_code == 404
    assert "trajopt" in [planner["name"] for planner in server.http.get("/api/planners").json()]
    assert "properties" in server.http.get("/api/schema").json()
    examples = server.http.get("/api/examples").json()
    assert "01_reach" in examples
    assert not {"46_window_frame_spots", "47_floor_pan_spots"} & examples.keys(), "they need tables"
    metrics = server.http.get("/metrics").text
    assert 'optiplan_requests_total{method="GET",status="200"}' in metrics
    assert json.dumps(server.http.get("/openapi.json").json())


def test_a_frame_that_the_robot_lacks_is_refused_with_those_that_it_has(server):
    asked = {"problem": QUICK, "pose": [0.5, 0.18, 0.5, 0, 0, 0, 1], "frame": "tol"}
    answer = server.http.post("/api/ik", json=asked)
    assert answer.status_code == 422
    assert "did you mean 'tool'?" in answer.text
    assert server.http.post("/api/ik", json=asked | {"frame": "tool"}).status_code == 200
