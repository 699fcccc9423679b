"""Only regular files of bounded size are opened, and only in the folders that are allowed."""

import errno
import os
import shutil
import socket
from pathlib import Path

import pytest

from optiplan import files
from optiplan.errors import InputError
from optiplan.files import read_bytes, reading, replacing, write_text, write_together
from optiplan.problem.load import check_file, load_problem, problem_from_dict

DEVICES = [Path(name) for name in ("/dev/zero", "/proc/self/environ", "/proc/self/mem", "/sys/power/state")]
SWALLOWED = Path(__file__).parent / "attacks" / "swallowed"


def test_what_is_no_regular_file_is_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "zero").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as plug:
        plug.bind(os.path.relpath(tmp_path / "plug"))
        names = [tmp_path / name for name in ("pipe", "folder", "loop", "zero", "plug", "missing", "nul\0")]
        for path in [*names, *DEVICES]:
            assert not files.is_file(path)
            with pytest.raises(OSError) as caught:  # noqa: PT011
                read_bytes(path)
            assert caught.value.strerror
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "link").symlink_to("file")
    assert read_bytes(tmp_path / "link") == b"content"
    with pytest.raises(OSError, match="more than"):
        read_bytes(tmp_path / "file", most=3)


def test_within_one_reading_a_file_is_read_once(tmp_path):
    file = tmp_path / "file"
    file.write_bytes(b"one")
    with reading():
        assert read_bytes(file) == b"one"
        file.write_bytes(b"two")
        assert read_bytes(file) == b"one"
        with reading():
            assert read_bytes(file) == b"one"
    assert read_bytes(file) == b"two"


def test_readings_within_each_other_narrow(tmp_path):
    for name in ("a", "a/b", "c"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_bytes(b"x")
    with reading([tmp_path / "a"]):
        assert read_bytes(tmp_path / "a/file") == read_bytes(tmp_path / "a/b/file") == b"x"
        with reading([tmp_path / "a/b", tmp_path / "c"]):
            assert files.is_file(tmp_path / "a/b/file")
            assert not files.is_file(tmp_path / "a/file")
            assert not files.is_file(tmp_path / "c/file")
        later = files.bound(lambda: files.is_file(tmp_path / "c/file"))
        with reading():
            assert not files.is_file(tmp_path / "c/file")
    assert files.is_file(tmp_path / "c/file")
    assert later() is False


def test_signatures_follow_links_as_reading_does(tmp_path):
    (tmp_path / "real").mkdir()
    for name in ("a", "b"):
        (tmp_path / "real" / name).write_text(name)
    (tmp_path / "way").symlink_to("real")
    (tmp_path / "real" / "link").symlink_to("a")
    paths = [tmp_path / "way" / "a", tmp_path / "way" / ".." / "real" / "b", tmp_path / "way" / "link"]
    found = files.signatures(paths)
    assert [one.path for one in found] == [path.resolve() for path in paths]
    assert [one.inode for one in found] == [path.stat().st_ino for path in paths]
    (tmp_path / "real" / "link").unlink()
    (tmp_path / "real" / "link").symlink_to("b")
    assert files.signatures(paths[2:])[0].path.name == "b"
    with reading([tmp_path / "way"]), pytest.raises(OSError, match="outside"):
        files.signatures([tmp_path / "missing"])
    with pytest.raises(IsADirectoryError):
        files.signatures([tmp_path / "way"])


@pytest.fixture
def inside(tmp_path):
    """A folder that is allowed, with a problem, its robot and its mesh; beside it one that is not."""
    for name in ("inside", "outside"):
        shutil.copytree(SWALLOWED, tmp_path / name)
    return tmp_path / "inside"


def told(inside, **changes):
    text = (inside / "bin.yaml").read_text()
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    (inside / "p.yaml").write_text(text)
    assert check_file(inside / "p.yaml") == []  # the command line leaves all folders open
    issues = check_file(inside / "p.yaml", folders=[inside])
    with pytest.raises(InputError):
        load_problem(inside / "p.yaml", folders=[inside])
    return "\n".join(map(str, issues))


def test_a_problem_in_an_allowed_folder_is_read_with_all_that_it_names(inside):
    problem = load_problem(inside / "bin.yaml", folders=[inside])
    assert problem.hash == load_problem(SWALLOWED / "bin.yaml").hash
    ends = {"start": {"configuration": "ready"}, "goal": {"configuration": "extended"}}
    scene = {"scene": problem.source["scene"] | {"allowed_collisions": [["panda_link0", "block"]]}}
    source = problem.source | ends | scene | {"robot": "panda"}  # which comes with the program
    assert problem_from_dict(source, inside, folders=[inside]).robot.name == "panda"
    assert problem.robot.visual.ngeoms == 0


@pytest.mark.parametrize("way", ["absolute", "upwards", "link to a file", "link to a folder"])
def test_no_way_leads_out_of_the_allowed_folders(inside, way):
    outside = inside.parent / "outside"
    (inside / "link.obj").symlink_to(outside / "bin.obj")
    (inside / "link.yaml").symlink_to(outside / "robot.yaml")
    (inside / "there").symlink_to(outside)
    mesh, robot = {
        "absolute": (f"{outside}/bin.obj", f"{outside}/robot.yaml"),
        "upwards": ("../outside/bin.obj", "../outside/robot.yaml"),
        "link to a file": ("link.obj", "link.yaml"),
        "link to a folder": ("there/bin.obj", "there/robot.yaml"),
    }[way]
    text = told(inside, **{"bin.obj": mesh})
    assert "outside the folders that may be read" in text
    assert "robot" in told(inside, **{"robot.yaml": robot})


@pytest.mark.parametrize("name", ["arm.urdf", "bin.obj"])
def test_what_a_robot_names_is_held_to_the_folders_too(inside, name):
    outside = inside.parent / "outside" / "arm.urdf"
    (inside / "robot.yaml").write_text(f"version: 1\nname: gantry\nurdf: {outside}\n")
    assert "outside the folders that may be read" in told(inside)
    mesh = '<collision><geometry><mesh filename="../outside/closed.obj"/></geometry></collision></link>'
    urdf = (SWALLOWED / "arm.urdf").read_text().replace('<link name="c1"/>', f'<link name="c1">{mesh}')
    (inside / "arm.urdf").write_text(urdf)
    (inside / "robot.yaml").write_text("version: 1\nname: gantry\nurdf: arm.urdf\ncollision: mesh\n")
    text = "\n".join(map(str, check_file(inside / "closed.yaml", folders=[inside])))
    assert "closed.obj" in text
    assert "missing" in text


def test_the_problem_itself_is_held_to_the_folders(inside):
    (issue,) = check_file(inside.parent / "outside" / "bin.yaml", folders=[inside])
    assert "outside the folders" in issue.found


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "made" / "file.txt"
    write_text(path, "old")
    with pytest.raises(UnicodeEncodeError), replacing(path) as temporary:
        temporary.write_text("half \udc80", encoding="utf-8")
    assert [file.name for file in path.parent.iterdir()] == ["file.txt"]
    assert path.read_text() == "old"
    with pytest.raises(IsADirectoryError):
        write_text(tmp_path, "a folder")


def test_the_longest_name_is_written(tmp_path):
    write_text(tmp_path / ("€" * 85), "x")  # 255 bytes
    assert [path.name for path in tmp_path.iterdir()] == ["€" * 85]


def test_what_cannot_be_written_is_named_by_its_own_name():
    with pytest.raises(OSError, match=r"'/proc/file\.txt'"):
        write_text(Path("/proc/file.txt"), "text")


def test_what_cannot_be_written_is_named_where_nothing_can_be_removed_either(tmp_path, monkeypatch):
    """A file system that is read-only refuses both."""

    def refused(path, *_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(Path, "write_bytes", refused)
    monkeypatch.setattr(Path, "unlink", refused)
    with pytest.raises(OSError, match=r"/file\.txt'") as caught:
        write_text(tmp_path / "file.txt", "text")
    assert caught.value.filename == str(tmp_path / "file.txt")


def test_what_is_no_file_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe.txt"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(pipe, "text")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


def test_a_link_stays_a_link_to_the_new_file(tmp_path):
    (tmp_path / "there").mkdir()
    link, target = tmp_path / "link.txt", tmp_path / "there" / "file.txt"
    link.symlink_to(target)
    for text in ("dangling", "again"):
        write_text(link, text)
        assert link.is_symlink()
        assert target.read_text() == text
    assert list(target.parent.iterdir()) == [target]


def test_the_last_of_several_files_may_be_a_link(tmp_path):
    (tmp_path / "there").write_text("old")
    (tmp_path / "last").symlink_to("there")
    (tmp_path / "older").write_text("old")
    write_together(tmp_path, {"last": b"2", "first": b"1"}, "last", ["older", "first"])
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"there": "2", "last": "2", "first": "1"}
    assert (tmp_path / "last").is_symlink()


def test_a_full_disk_names_the_file():
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"):
        write_text(Path("/dev/full"), "text")
    assert not Path("/dev/full").is_file()
