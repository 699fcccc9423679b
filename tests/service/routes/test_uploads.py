"""Uploaded files: listed, deleted, bounded in bytes and number, swept by their last use."""

import os
import time

import pytest

from optiplan.service.store import uploads as module
from optiplan.service.store.contents import StorageFullError
from optiplan.service.store.uploads import IN_USE, MARKED, Uploads
from tests.service.routes.test_problems import MESH, TETRAHEDRON

DAY = 86400.0


def aged(folder, file, seconds):
    """Make a file as old as that, s."""
    then = time.time() - seconds
    os.utime(folder / file, (then, then))


def names(kept):
    return [upload.file for upload in kept.all()]


def test_files_are_listed_and_deleted(server):
    for path in ("listed/a.obj", "listed/b.obj"):
        assert server.http.put(f"/api/uploads/{path}", content=TETRAHEDRON).status_code == 201
    answer = server.http.get("/api/uploads").json()
    found = {upload["file"]: upload for upload in answer["uploads"]}
    assert found["listed/a.obj"]["bytes"] == len(TETRAHEDRON)
    assert abs(found["listed/a.obj"]["used"] - time.time()) < 60.0
    assert answer["bytes"] == sum(upload["bytes"] for upload in answer["uploads"])
    assert server.http.delete("/api/uploads/listed/a.obj").status_code == 204
    assert server.http.delete("/api/uploads/listed/a.obj").status_code == 404
    assert server.http.delete("/api/uploads/listed").status_code == 404, "a folder is no upload"
    assert server.http.delete("/api/uploads/../contents/store").status_code in (404, 405, 422)
    left = [upload["file"] for upload in server.http.get("/api/uploads").json()["uploads"]]
    assert "listed/b.obj" in left
    assert "listed/a.obj" not in left
    server.http.delete("/api/uploads/listed/b.obj")
    assert not (server.service.settings.upload_folder / "listed").exists()


def test_bytes_and_files_have_a_bound(tmp_path):
    kept = Uploads(tmp_path, most_bytes=100, most_files=3)
    kept.put("a", b"x" * 60)
    kept.put("a", b"x" * 90)  # in place of the older one
    with pytest.raises(StorageFullError, match=r"0\.0001 MB"):
        kept.put("b", b"x" * 11)
    kept.put("a", b"")
    for name in ("b", "c"):
        kept.put(name, b"")
    with pytest.raises(StorageFullError, match="3 files"):
        kept.put("d/e", b"")
    assert names(kept) == ["a", "b", "c"]
    kept.put("c", b"again")
    assert kept.delete("b")
    kept.put("d/e", b"")


def test_the_longest_unused_make_room_and_none_that_is_in_use(tmp_path):
    kept = Uploads(tmp_path, most_bytes=100, most_files=10)
    for name, age in (("oldest", 3.0 * IN_USE), ("older", 2.0 * IN_USE), ("young", 0.5 * IN_USE)):
        kept.put(name, b"x" * 30)
        aged(tmp_path, name, age)
    kept.sweep(days=30.0)
    kept.put("new", b"x" * 40)
    assert names(kept) == ["new", "older", "young"]
    aged(tmp_path, "older", 0.0)  # used meanwhile, in another process
    with pytest.raises(StorageFullError):
        kept.put("more", b"x" * 40)
    assert names(kept) == ["new", "older", "young"]


def test_what_nobody_used_for_long_is_swept(tmp_path):
    kept = Uploads(tmp_path, most_bytes=10**6, most_files=100)
    for name, age in (("old/mesh.obj", 31.0 * DAY), ("young.obj", 29.0 * DAY), (".123-half", 2.0 * DAY)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
        aged(tmp_path, name, age)
    assert kept.sweep(days=30.0) == ["old/mesh.obj"]
    assert [path.name for path in tmp_path.iterdir()] == ["young.obj"]


def test_a_bound_that_was_lowered_holds_after_a_sweep(tmp_path):
    first = Uploads(tmp_path, most_bytes=10**6, most_files=100)
    for k in range(5):
        first.put(f"{k}", b"x" * 100)
        aged(tmp_path, f"{k}", (10 - k) * DAY)
    assert Uploads(tmp_path, most_bytes=250, most_files=100).sweep(days=30.0) == ["0", "1", "2"]


def test_an_upload_does_not_walk_the_folder(tmp_path, monkeypatch):
    kept, walks = Uploads(tmp_path, most_bytes=10**9, most_files=10**5), []
    walk = os.walk
    monkeypatch.setattr(module.os, "walk", lambda folder: walks.append(folder) or walk(folder))
    for number in range(50):
        kept.put(f"{number % 10}/{number}", b"x")
    assert len(walks) == 1, "once, to know what is there"


def test_what_a_problem_reads_is_in_use(server):
    folder = server.service.settings.upload_folder
    for name in ("read.obj", "unread.obj"):
        server.http.put(f"/api/uploads/used/{name}", content=TETRAHEDRON)
        aged(folder, f"used/{name}", 3.0 * MARKED)
    given = {"problem": MESH.format(file="used/read.obj")}
    assert server.http.post("/api/problems/validate", json=given).json()["valid"] is True
    used = {upload["file"]: upload["used"] for upload in server.http.get("/api/uploads").json()["uploads"]}
    assert used["used/read.obj"] > time.time() - MARKED
    assert used["used/unread.obj"] < time.time() - 2.0 * MARKED


def test_a_server_sweeps_its_uploads(server):
    server.http.put("/api/uploads/forgotten.obj", content=TETRAHEDRON)
    aged(server.service.settings.upload_folder, "forgotten.obj", 31.0 * DAY)
    server.service.tidy()
    assert server.http.delete("/api/uploads/forgotten.obj").status_code == 404
