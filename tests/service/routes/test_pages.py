"""Pages of runs over HTTP: which runs they name how, and what they claim once files of a problem are other ones."""

import re

from tests.service.routes.test_problems import MESH, TETRAHEDRON

NAMES = re.compile(r'"label":"([^"]*)","facts"')


def test_a_run_among_files_that_were_changed_is_shown_without_its_verdict(server):
    at, found = "/api/uploads/changed/part.obj", []
    server.http.put(at, content=TETRAHEDRON)
    run = server.ended(server.submit(problem=MESH.format(file="changed/part.obj"))["id"])
    assert run["verified"]
    for mesh in (TETRAHEDRON, TETRAHEDRON.replace(b"0.1", b"0.2"), TETRAHEDRON):
        server.http.put(at, content=mesh)
        pages = [server.http.get(f"/{path}").text for path in (f"runs/{run['id']}", f"compare?run={run['id']}")]
        badges = {badge for page in pages for badge in re.findall('"badge":"([^"]*)"', page)}
        found.append((*badges, all("were changed since" in page for page in pages)))
    assert found == [("verified", False), ("not checked", True), ("verified", False)]


def test_no_path_is_drawn_through_files_that_were_changed(server):
    problem = MESH.format(file="changed/small.obj")
    for seed, changed in ((3, TETRAHEDRON), (4, TETRAHEDRON.replace(b"0.1", b"0.2"))):
        server.http.put("/api/uploads/changed/small.obj", content=TETRAHEDRON)
        run = server.ended(server.submit(problem=problem, seed=seed)["id"])["id"]
        server.http.put("/api/uploads/changed/small.obj", content=changed)
        drawn = "<polyline" in server.http.get(f"/api/runs/{run}/thumbnail.svg").text
        assert drawn == (changed == TETRAHEDRON)
        scene = server.http.get(f"/api/runs/{run}/scene")
        assert (scene.status_code, "replaced since the run" in scene.text) == ((200, False) if drawn else (422, True))


def test_runs_that_are_compared_have_names_of_their_own(server):
    given = [{"seed": 1}, {"seed": 2}, {"seed": 2, "budget": 6.0}, {"seed": 1, "planner": "cubic"}]
    runs = [server.ended(server.submit(**one)["id"])["id"] for one in given]
    asked = "/compare?" + "&".join(f"run={run}" for run in runs)
    last = [f"quintic (seed 2) ({run[:8]})" for run in runs[1:3]]
    assert NAMES.findall(server.http.get(asked).text) == ["quintic (seed 1)", *last, "cubic"]
    labels = ["a", "b", "<c>", "d"]
    found = NAMES.findall(server.http.get(asked + "".join(f"&label={label}" for label in labels)).text)
    assert found == ["a", "b", "\\u003cc>", "d"]
    refused = server.http.get(asked + "&label=a")
    assert (refused.status_code, "found 1 labels of 4 runs" in refused.text) == (422, True)
