import os
import shutil
import sys
from pathlib import Path

import pytest

from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.bench.results.records import BenchTask
from optiplan.bench.sources.base import Found
from optiplan.bench.sources.readers import READERS
from optiplan.bench.suite.schema import read_suite
from optiplan.bench.suite.suite import load_suite, suite_differences
from optiplan.errors import InputError
from optiplan.problem.load import load_problem, problem_from_dict

SUITES = Path(__file__).parents[3] / "benchmarks" / "suites"


@pytest.fixture
def load(tmp_path):
    def load(text):
        path = tmp_path / "suite.yaml"
        path.write_text(f"version: 1\nname: mine\nbudget: 1\n{text}")
        return load_suite(path, tmp_path / "scratch")

    return load


@pytest.fixture
def refused(load):
    def refused(text):
        with pytest.raises(InputError) as caught:
            load(text)
        return [(issue.line, issue.found) for issue in caught.value.issues]

    return refused


def test_problem_files_are_found_and_hashed(load, problems):
    suite = load(f"problems: [{{glob: '{problems}/*.yaml', set: ex, every: 12, first: 2}}]\nplanners: [quintic]\n")
    assert [problem.id for problem in suite.problems] == ["ex/01_reach", "ex/13_mesh"]
    for problem, name in zip(suite.problems, ("01_reach", "13_mesh"), strict=True):
        original = load_problem(problems / f"{name}.yaml")
        assert problem.hash == original.hash == problem_from_dict(problem.data, "/nowhere").hash
        assert problem.data == original.source
        assert problem.origin == {"file": str(problems / f"{name}.yaml")}


def test_every_shipped_problem_is_the_one_that_is_loaded(load, problems):
    suite, robots = load(f"problems: [{{glob: '{problems}/*.yaml'}}]\nplanners: [quintic]\n"), RobotCache()
    assert [one.id for one in suite.problems if problem_from_dict(one.data, "/", robots).hash != one.hash] == []


def test_short_forms_of_a_file_are_written_out_first(load, tmp_path):
    (tmp_path / "arms.yaml").write_text(
        "{version: 1, robots: {a: {use: planar2r}, b: {use: planar2r, base: {in: rail}}}, start: {configuration: out}, "
        "frames: {rail: {position: [0, 1.0, 0]}}, "
        "goal: {joints: {b/shoulder: -0.5, b/elbow: 0, a/shoulder: 0.5, a/elbow: 1}}}"
    )
    (problem,) = load(f"problems: [{{glob: '{tmp_path}/arms.yaml'}}]\nplanners: [quintic]\n").problems
    assert problem.hash == load_problem(tmp_path / "arms.yaml").hash
    assert problem.data["goal"] == {"joints": [0.5, 1.0, -0.5, 0.0]}


def test_the_folder_may_be_called_as_it_likes(problems, tmp_path):
    folder = tmp_path / "odd [a]*? ü"
    folder.mkdir()
    shutil.copy(problems / "12_planar.yaml", folder)
    (folder / "suite.yaml").write_text(
        "{version: 1, name: n, budget: 1, problems: [{glob: '1*.yaml', set: a}], planners: [quintic]}"
    )
    assert [problem.id for problem in load_suite(folder / "suite.yaml", tmp_path).problems] == ["a/12_planar"]


def test_a_set_is_called_like_its_folder(load, problems):
    (problem,) = load(f"problems: [{{glob: '{problems}/12*.yaml'}}]\nplanners: [quintic]\n").problems
    assert (problem.id, problem.set_name, problem.difficulty) == ("problems/12_planar", "problems", None)


def test_every_run_is_a_task_problem_by_problem(load, problems):
    text = (
        f"problems: [{{glob: '{problems}/1[27]*.yaml'}}]\nplanners: [quintic, {{name: quintic, label: few, goals: 1}}]"
    )
    suite = load(f"{text}\nseeds: [3, 4]\nrepetitions: 2\nlimits: {{wall: 9, memory: 500}}\n")
    tasks = list(suite.tasks())
    assert len({task.key for task in tasks}) == len(tasks) == suite.size == 16
    assert [task.problem.id for task in tasks] == ["problems/12_planar"] * 8 + ["problems/17_puma560"] * 8
    assert (tasks[1].planner.label, tasks[1].planner.name, tasks[1].planner.options) == ("few", "quintic", {"goals": 1})
    assert (tasks[0].budget, tasks[0].wall, tasks[0].memory) == (1.0, 9.0, 500.0)
    assert BenchTask.from_dict(tasks[1].to_dict()) == tasks[1]


def test_labels_of_the_suite_go_before_those_of_its_sources(load, problems):
    text = f"problems: [{{glob: '{problems}/1[27]*.yaml', set: ex, difficulty: easy}}]\nplanners: [quintic]\n"
    suite = load(text + "difficulty: {hard: [ex/12_planar]}\n")
    assert [problem.difficulty for problem in suite.problems] == ["hard", "easy"]


def test_labels_are_of_problems_that_there_are(refused, problems):
    text = f"problems: [{{glob: '{problems}/12*.yaml', set: ex}}]\nplanners: [quintic]\ndifficulty:\n"
    found = refused(text + "  hard: [ex/12_planar, ex/1]\n  easy: [ex/12_planar]\n")
    assert found == [(7, "'ex/1', which no source gives"), (8, "'ex/12_planar' a second time")]
    assert refused(text + "  a: [ex/12_planar]\n  b: [ex/12_planar]\n") == [(8, "'ex/12_planar' a second time")]


def test_the_hash_is_of_contents_not_of_places(load, problems, tmp_path):
    text = "problems: [{{glob: '{}/1[23]*.yaml', set: ex}}]\nplanners: [quintic]\n"
    suite = load(text.format(problems))
    shutil.copytree(problems, tmp_path / "copy")
    moved = load(text.format("copy"))
    assert (moved.hash, suite_differences(suite.parts, moved.parts)) == (suite.hash, [])
    mesh = next((tmp_path / "copy" / "meshes").iterdir())
    mesh.write_bytes(mesh.read_bytes() + b"\n")
    assert load(text.format("copy")).hash != suite.hash
    assert suite_differences(suite.parts, load(text.format("copy")).parts) == ["problems: changed: ex/13_mesh"]
    assert load(text.format(problems) + "seeds: [0, 1]\n").hash != suite.hash


def test_mistakes_in_planners_and_metrics_are_told_with_their_line(refused, problems):
    text = f"problems: [{{glob: '{problems}/12*.yaml'}}]\nplanners:\n  - quintik\n  - {{name: quintic, goals: x}}\n"
    found = refused(
        text + "  - {name: quintic, label: b, gaols: 1}\n  - 'nowhere:Planner'\nmetrics: [tool_path, beauty]\n"
    )
    assert [line for line, _ in found] == [6, 7, 8, 9, 10]
    words = ("'quintik'", "'x'", "'gaols'", "No module named 'nowhere'", "'beauty'")
    assert all(word in what for word, (_, what) in zip(words, found, strict=True))


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("{glob: 'none*.yaml'}", "no file matches"),
        ("{glob: '${NOT_SET_ANYWHERE}/a.yaml'}", "'${NOT_SET_ANYWHERE}/a.yaml'"),
        ("{glob: 'a**b'}", "Invalid pattern" if sys.version_info < (3, 13) else "no file matches"),
        ("{glob: '*.yaml', set: ../up}", "'../up'"),
        ("{mbm: .}", "no scene*.yaml with request*.yaml"),
        ("{glob: 'bad.yaml'}", "nothing"),
        ("{glob: 'alien.yaml'}", "unknown robot 'hal'"),
    ],
)
def test_sources_without_problems(refused, tmp_path, source, words):
    (tmp_path / "bad.yaml").write_text("version: 1\nrobot: planar2r\nstart: {joints: [0, 0]}\n")
    (tmp_path / "alien.yaml").write_text("{version: 1, robot: hal, start: {joints: [0]}, goal: {joints: [1]}}")
    ((_, found),) = refused(f"problems:\n  - {source}\nplanners: [quintic]\n")
    assert words in found


def test_all_broken_problems_are_told(refused, problems, tmp_path):
    good = (problems / "12_planar.yaml").read_text()
    texts = {
        "a": good,
        "b": "name: [",
        "c": good.replace("planar2r", "nobody"),
        "d": good.replace("version: 1", "v: 1"),
    }
    for name, text in texts.items():
        (tmp_path / f"p{name}.yaml").write_text(text)
    found = [what for _, what in refused("problems:\n  - {glob: 'p*.yaml'}\nplanners: [quintic]\n")]
    words = ("but found", "unknown robot 'nobody'", "unknown key", "nothing")
    assert all(any(word in what for what in found) for word in words), found


def test_a_problem_comes_once(refused, problems):
    source = f"{{glob: '{problems}/12*.yaml'}}"
    assert refused(f"problems:\n  - {source}\n  - {source}\nplanners: [quintic]\n") == [
        (6, "a second problem 'problems/12_planar'")
    ]


@pytest.fixture
def no_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_motion_bench_maker(load, shared, no_cache):
    folder, robot = shared / "mbm" / "panda", shared / "robots" / "mbm_panda" / "robot.yaml"
    source = f"{{mbm: '{folder}', robot: '{robot}', sets: [cage, box], every: 20, first: 2}}"
    suite = load(f"problems: [{source}]\nplanners: [quintic]\n")
    assert [problem.id for problem in suite.problems] == ["cage/0001", "cage/0021", "box/0001", "box/0021"]
    assert suite.problems[0].data["robot"] == str(robot.resolve())
    problem = problem_from_dict(suite.problems[0].data)
    assert problem.hash == suite.problems[0].hash
    assert len(problem.scene.obstacles) > 3
    (other,) = load(
        f"problems: [{source.replace('first: 2', 'first: 1, set: arm').replace('cage, ', '')}]\nplanners: [quintic]\n"
    ).problems
    assert (other.id, other.set_name, other.hash) == ("arm-box/0001", "arm-box", suite.problems[2].hash)


def test_a_conversion_is_kept_for_the_same_contents(load, shared, no_cache, tmp_path):
    for source in (shared / "mbm" / "panda" / "box").glob("*0001.yaml"):
        (tmp_path / "box").mkdir(exist_ok=True)
        shutil.copy(source, tmp_path / "box")
    text = "problems: [{mbm: ., robot: panda, sets: [box]}]\nplanners: [quintic]\n"
    first, again = load(text), load(text)
    assert len(list((tmp_path / "cache" / "optiplan" / "mbm").iterdir())) == 1
    assert again.parts == first.parts
    request = tmp_path / "box" / "request0001.yaml"
    request.write_text(request.read_text().replace("velocity_scaling_factor: 0", "velocity_scaling_factor: 0.5"))
    assert load(text).problems[0].data["limits"]["velocity"] == 0.5


def test_motion_bench_maker_through_the_environment(load, refused, shared, monkeypatch):
    monkeypatch.setenv("SOMEWHERE", os.fspath(shared))
    text = "problems:\n  - {mbm: '${SOMEWHERE}/mbm/panda', robot: panda, sets: [%s], first: 1}\nplanners: [quintic]\n"
    assert load(text % "box").problems[0].id == "box/0001"
    assert "unknown set 'bax'" in refused(text % "bax")[0][1]


def test_another_reader_is_a_line_in_a_table(load, refused, monkeypatch, tmp_path):
    monkeypatch.setitem(READERS, "generate", generated)
    suite = load("problems: [{generate: spheres, count: 2, seed: 5, params: {size: 0.2}}]\nplanners: [quintic]\n")
    assert [(problem.id, problem.difficulty) for problem in suite.problems] == [
        ("spheres/5-0", None),
        ("spheres/5-1", "hard"),
    ]
    monkeypatch.delitem(READERS, "generate")
    assert refused("problems: [{generate: spheres}]\nplanners: [quintic]\n") == [(4, "the source 'generate'")]


def generated(place):
    """A generator as a reader."""
    spec = place.spec
    for index in range(spec.count):
        data = {
            "version": 1,
            "robot": "planar2r",
            "start": {"joints": [0.5, 1.0]},
            "goal": {"joints": [0.1 * index, 1.2]},
        }
        yield Found(f"{spec.seed}-{index}", spec.generate, data, place.folder, {}, "hard" if index else None)


def test_the_quick_suite_is_whole(tmp_path):
    suite = load_suite(SUITES / "quick.yaml", tmp_path)
    assert len(suite.planners) == 6
    assert len(suite.problems) >= 25
    assert {problem.difficulty for problem in suite.problems} >= {"easy", "hard"}


@pytest.mark.parametrize("name", sorted(path.name for path in SUITES.glob("*.yaml")))
def test_shipped_suites_are_read(name):
    spec, _ = read_suite(SUITES / name)
    assert spec.name == name.removesuffix(".yaml")
