import shutil
from pathlib import Path

import pytest

from optiplan.bench.dask import file_transfer
from optiplan.bench.dask.file_transfer import Packer, TravelError, keep, lacking, unpack_files
from optiplan.bench.results.records import ChangedError
from optiplan.bench.suite.suite import load_suite
from optiplan.problem.load import problem_from_dict
from optiplan.resources import problems_dir
from optiplan.robot.robot import load_robot


@pytest.fixture
def problems(write_suite, robot_of_ours, tmp_path):
    path = write_suite(planners=["quintic"], problems=[{"glob": str(robot_of_ours / "p*.yaml")}])
    return load_suite(path, tmp_path / "files").problems


def test_what_arrives_is_whole_without_its_home(problems, robot_of_ours, tmp_path, monkeypatch):
    packer = Packer()
    packed = [packer.pack(problem) for problem in problems]
    assert lacking(packed[0]) == lacking(packed[1])
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    wanted = lacking(packed[0])
    bundle_contents = {digest: packer.bundle_contents(digest) for digest in wanted}
    assert len(wanted) == 2
    here = problem_from_dict(problems[0].data)
    (robot_of_ours / "block.stl").write_text((robot_of_ours / "block.stl").read_text().replace(".2", ".3"))
    with pytest.raises(ChangedError, match=r"p1: its robot or its meshes were changed"):
        packer.pack(problems[1])
    for digest, content in bundle_contents.items():
        edited = packer.bundle_contents(digest)
        if edited != content:
            with pytest.raises(ChangedError, match=r"^/.*ours: its robot or its meshes were changed"):
                keep(digest, edited)
    assert lacking(packed[0]) == wanted
    shutil.rmtree(robot_of_ours)
    for digest, content in bundle_contents.items():
        keep(digest, content)
        keep(digest, content)
    assert lacking(packed[0]) == set()
    there = problem_from_dict(unpack_files(packed[0]).data)
    assert there.robot.joint_names == here.robot.joint_names
    assert there.robot.source.is_relative_to(tmp_path / "elsewhere")
    assert len(there.robot.geometry.geometryObjects) == len(here.robot.geometry.geometryObjects) == 1
    assert there.start.tolist() == here.start.tolist()


def test_a_cache_that_cannot_hold_a_bundle_is_told(problems, tmp_path, monkeypatch):
    """Else the worker would ask for the bundle again, without end."""
    packer = Packer()
    (digest, *_) = lacking(packer.pack(problems[0])) | {*packer._bundles}
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    folder = file_transfer._folder(f"{file_transfer.SCHEME}{digest}/")
    folder.parent.mkdir(parents=True)
    folder.write_text("a file in its place")
    with pytest.raises(TravelError, match=f"{digest} cannot be written: NotADirectoryError"):
        keep(digest, packer.bundle_contents(digest))
    assert list(folder.parent.iterdir()) == [folder]


def test_a_bundle_begins_below_the_root_folder(problems, monkeypatch):
    monkeypatch.setattr(file_transfer, "LEVELS", 99)
    unpacked = unpack_files(Packer().pack(problems[0]))
    assert load_robot(unpacked.data["robot"]).source.name == "robot.yaml"
    assert file_transfer._settled(b'<a b="/c"/>', "/", Path("/home")) == b'<a b="/home/c"/>'


def test_shipped_robots_stay_names(write_suite, tmp_path):
    arm_and_hand = str(problems_dir() / "40_panda_sorts_cubes.yaml")
    (problem,) = load_suite(write_suite(problems=[{"glob": arm_and_hand}]), tmp_path / "files").problems
    packed = Packer().pack(problem)
    assert packed == problem
    assert lacking(packed) == set()
    assert unpack_files(packed) == problem


def test_a_robot_that_is_not_whole_without_its_surroundings_is_refused(problems, monkeypatch):
    monkeypatch.setattr("optiplan.bench.dask.file_transfer._settled", lambda content, home, folder: b"<nothing/>")
    with pytest.raises(TravelError, match=r"robot .*ours.* cannot be taken to other machines"):
        Packer().pack(problems[0])
