import pytest

from optiplan.problem.load import check_file


@pytest.fixture
def some(shared, tmp_path):
    """A folder of two MotionBenchMaker pairs and a scene without a request."""
    source = sorted((shared / "mbm" / "panda" / "bookshelf_small").rglob("scene*.yaml"))[:3]
    folder = tmp_path / "in" / "bookshelf"
    folder.mkdir(parents=True)
    for number, scene in enumerate(source):
        (folder / scene.name).write_bytes(scene.read_bytes())
        if number < 2:
            request = scene.with_name(scene.name.replace("scene", "request"))
            (folder / request.name).write_bytes(request.read_bytes())
    return tmp_path / "in"


def test_pairs_become_problem_files(optiplan, some, shared, tmp_path):
    robot = shared / "robots" / "mbm_panda" / "robot.yaml"
    code, out, err = optiplan("import", "mbm", some, tmp_path / "out", "--robot", robot)
    assert code == 0
    assert "2 problems written" in out
    assert "skipped" in err
    files = sorted((tmp_path / "out").rglob("*.yaml"))
    assert len(files) == 2
    assert check_file(files[0]) == []


def test_json_names_everything(optiplan_json, some, tmp_path):
    code, data = optiplan_json("import", "mbm", some, tmp_path / "out")
    assert code == 0
    assert len(data["written"]) == 2
    assert len(data["skipped"]) == 1


def test_an_empty_folder_is_bad_input(optiplan, tmp_path):
    code, _, err = optiplan("import", "mbm", tmp_path, tmp_path / "out")
    assert code == 2
    assert "no pair of scene and request files" in err
