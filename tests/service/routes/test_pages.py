"""Pages of runs over HTTP: what they claim once files of a problem are other ones."""

import re

from tests.service.routes.test_problems import MESH, TETRAHEDRON


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


def test_a_small_picture_has_no_path_through_files_that_were_changed(server):
    problem = MESH.format(file="changed/small.obj")
    for seed, changed in ((3, TETRAHEDRON), (4, TETRAHEDRON.replace(b"0.1", b"0.2"))):
        server.http.put("/api/uploads/changed/small.obj", content=TETRAHEDRON)
        run = server.ended(server.submit(problem=problem, seed=seed)["id"])["id"]
        server.http.put("/api/uploads/changed/small.obj", content=changed)
        drawn = "<polyline" in server.http.get(f"/api/runs/{run}/thumbnail.svg").text
        assert drawn == (changed == TETRAHEDRON)
