"""Caches: whole or not there, and never the reason why a run ends."""

import errno
import os
import pwd
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import casadi
import pytest
import trimesh
from trimesh.transformations import translation_matrix

from optiplan import cache
from optiplan.errors import InputError
from optiplan.kinematics.symbolic.compiled import as_machine_code
from optiplan.robot.robot import load_robot
from optiplan.service.settings import default_data
from tests.robot.robots import LINK, TWO, write_robot

pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.mark.parametrize("content", [b"", b"content", bytes(range(256)) * 40])
def test_what_is_stored_is_what_is_loaded(content):
    cache.store("room/name", content)
    assert cache.load("room/name") == content
    assert cache.load("room/other") is None


DAMAGE = {
    "empty": lambda whole: b"",
    "cut": lambda whole: whole[: len(whole) // 2],
    "without its mark": lambda whole: whole.split(cache.MARK)[0],
    "a bit turned": lambda whole: bytes([whole[0] ^ 1]) + whole[1:],
    "another content": lambda whole: b"x" + whole,
    "zeros": lambda whole: bytes(len(whole)),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_file_is_made_again(own_cache, damage):
    made = []

    def make():
        made.append(1)
        return b"content"

    assert cache.kept("a/b", make) == cache.kept("a/b", make) == b"content"
    assert len(made) == 1
    file = own_cache / "a/b"
    file.write_bytes(damage(file.read_bytes()))
    assert cache.kept("a/b", make) == cache.kept("a/b", make) == b"content"
    assert len(made) == 2


MAKER = """
import sys, time
from optiplan import cache

def make():
    print("made", flush=True)
    time.sleep(float(sys.argv[1]))
    return b"content"

print(cache.kept("room/name", make))
"""


def maker(seconds):
    return subprocess.Popen([sys.executable, "-c", MAKER, str(seconds)], stdout=subprocess.PIPE, text=True)


def test_processes_that_ask_at_once_wait_for_the_first(own_cache):
    first = maker(1.0)
    assert first.stdout.readline() == "made\n"
    others = [maker(0.0), maker(0.0)]
    assert [process.communicate()[0] for process in (first, *others)] == ["b'content'\n"] * 3
    assert [path.name for path in (own_cache / "room").iterdir()] == ["name"]


def test_threads_that_ask_at_once_wait_for_the_first():
    made = []

    def make():
        made.append(1)
        time.sleep(0.1)
        return b"content"

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda _: cache.kept("name", make), range(4))) == [b"content"] * 4
    assert len(made) == 1


def test_nobody_waits_for_a_process_that_has_ended():
    first = maker(60.0)
    assert first.stdout.readline() == "made\n"
    first.kill()
    first.communicate()
    assert maker(0.0).communicate(timeout=30)[0] == "made\nb'content'\n"


def test_what_another_makes_for_too_long_is_made_here_as_well(monkeypatch):
    monkeypatch.setattr(cache, "PATIENCE", 0.05)
    first = maker(60.0)
    assert first.stdout.readline() == "made\n"
    assert cache.kept("room/name", lambda: b"own") == b"own"
    first.kill()
    first.communicate()


def test_files_that_cannot_be_locked_are_no_hindrance(monkeypatch):
    def refuse(handle, how):
        raise OSError(errno.ENOLCK, "no locks here")

    monkeypatch.setattr(cache.fcntl, "flock", refuse)
    assert cache.kept("name", lambda: b"made") == cache.kept("name", lambda: b"other") == b"made"


def test_what_fails_to_be_made_is_made_at_the_next_try(own_cache):
    def fail():
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        cache.kept("name", fail)
    assert list(own_cache.iterdir()) == []
    assert cache.kept("name", lambda: b"made") == b"made"


def test_what_is_no_file_is_not_opened(own_cache):
    own_cache.mkdir(parents=True)
    os.mkfifo(own_cache / "pipe")
    (own_cache / "folder").mkdir()
    assert cache.load("pipe") is None
    assert cache.load("folder") is None
    assert cache.kept("folder", lambda: b"made") == b"made"  # cannot be kept there, and that is no error
    assert not [path for path in own_cache.iterdir() if path.name.startswith("tmp")]


def test_no_cache_of_a_robot_can_end_a_run(own_cache, tmp_path):
    """A robot of an L in pieces, a ball and a box: every cache that loading a robot has."""
    sizes, at = [(0.4, 0.05, 0.05), (0.05, 0.4, 0.05)], [(0.0, 0.0, 0.0), (0.225, 0.175, 0.0)]
    bars = [trimesh.creation.box(*one) for one in zip(sizes, map(translation_matrix, at), strict=True)]
    trimesh.util.concatenate(bars).export(tmp_path / "a.obj")
    trimesh.creation.icosphere(subdivisions=1, radius=0.1).export(tmp_path / "b.obj")
    body = '<link name="{0}"><collision><geometry><mesh filename="{1}/{0}.obj"/></geometry></collision></link>'
    links = [*(body.format(name, tmp_path) for name in "ab"), LINK.format("c")]
    path = write_robot(tmp_path, [*links, *TWO[3:]], "collision: {convex_pieces: [a]}\n")
    first = load_robot(str(path))
    files = [file for file in own_cache.rglob("*") if file.is_file()]
    assert {file.parent.name for file in files} == {"covers", "hulls", "meshes", "pairs", "pieces"}
    for k, file in enumerate(files):
        file.write_bytes(DAMAGE[("empty", "cut")[k % 2]](file.read_bytes()))
    again = load_robot(str(path))
    assert dict(again.allowed) == dict(first.allowed)
    assert again.link_geometry == first.link_geometry


def homeless(monkeypatch, **environment):
    """A user of whom the system knows a number only, without HOME, as a container may have it."""

    def unknown(uid):
        raise KeyError(uid)

    monkeypatch.setattr(pwd, "getpwuid", unknown)
    for name in ("HOME", "XDG_CACHE_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)


@pytest.mark.parametrize("home", [{}, {"HOME": "here"}])
def test_a_user_without_a_home_has_no_cache_and_plans_all_the_same(monkeypatch, tmp_path, home):
    monkeypatch.chdir(tmp_path)
    homeless(monkeypatch, **home)
    assert cache.load("a") is None
    assert cache.kept("a", lambda: b"made") == b"made"
    x = casadi.SX.sym("x")
    assert float(as_machine_code(casadi.Function("square", [x], [x * x]))(3.0)) == 9.0
    with pytest.raises(InputError, match=r"data: this user has no home folder; expected --data DIR"):
        default_data()
    assert not (tmp_path / "here").exists()


def test_a_relative_folder_is_passed_over(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    homeless(monkeypatch, XDG_CACHE_HOME="here", XDG_DATA_HOME="here", HOME=str(tmp_path / "home"))
    cache.store("a", b"content")
    assert (tmp_path / "home/.cache/optiplan/a").is_file()
    assert default_data() == tmp_path / "home/.local/share/optiplan"
    assert not (tmp_path / "here").exists()
