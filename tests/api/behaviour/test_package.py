"""The package from outside: what importing it costs, what it names, and the wheel in an empty environment."""

import ast
import doctest
import inspect
import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

import optiplan as op

ROOT = Path(__file__).parents[3]
FIVE_LINES = """
import optiplan as op
problem = op.load_problem("01_reach")
run = op.plan(problem)
print(run)
run.save("runs/reach")
"""
"""The README's, until it has them: replaced by what stands there."""


def test_importing_loads_nothing_heavy():
    code = """
import sys, time
began = time.process_time()
import optiplan
seconds = time.process_time() - began
heavy = {"numpy", "scipy", "pinocchio", "coal", "pydantic", "ompl", "toppra", "casadi", "trimesh", "ruamel"}
print(seconds < 0.3, sorted(heavy & set(sys.modules)), sorted(name for name in sys.modules if "optiplan." in name))
"""
    told = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout for _ in range(3)]
    assert "True [] []\n" in told  # the clock of a busy machine may err, but not every time


def test_garbage_is_not_looked_for_among_what_was_imported():
    """Nor is anything kept for good: what somebody else froze stays so, and nothing else is frozen."""
    code = """
import gc
import optiplan as op
op.load_problem
young = len(gc.get_objects(generation=0)) + len(gc.get_objects(generation=1))
print(gc.isenabled(), gc.get_freeze_count(), young < 500)
gc.freeze()
before = gc.get_freeze_count()
op.plan
print(gc.isenabled(), gc.get_freeze_count() >= before - 500)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["True 0 True", "True True"]


def test_a_first_plan_loads_no_planner():
    """It is loaded with the function's name, which proofs of motions do without."""
    code = """
import sys
import optiplan as op
def planners(): return {name for name in sys.modules if name.startswith("optiplan.planners.trajopt.")}
op.verify, op.load_problem
print(len(planners()))
op.plan
before = planners()
op.plan(op.load_problem("01_reach"), budget=5)
print(len(before) > 10, sorted(planners() - before))
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert told.stdout == "0\nTrue []\n", told.stdout + told.stderr


def test_every_public_name_is_there_and_told_to_type_checkers():
    tree = ast.parse((ROOT / "optiplan" / "__init__.py").read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    typed = {alias.name for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert typed | {"__version__"} == set(op.__all__)
    assert dir(op) == sorted(op.__all__)
    for node in block.body:
        assert isinstance(node, ast.ImportFrom)
        for alias in node.names:
            thing = getattr(op, alias.name)
            assert thing.__doc__, alias.name
            assert inspect.getdoc(thing) == inspect.getdoc(getattr(thing, "_function", thing))
            assert op._HOME[alias.name] == node.module
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = op.nothing  # type: ignore[attr-defined]


def examples():
    """The doctests of all public names and of their public methods."""
    finder = doctest.DocTestFinder(recurse=False)
    for name in op.__all__:
        thing = getattr(op, name)
        if callable(thing):
            members = {
                f"{name}.{key}": item for key, item in vars(thing).items() if inspect.isroutine(item) and key[0] != "_"
            }
            for place, item in {name: getattr(thing, "_function", thing), **members}.items():
                yield from (
                    test
                    for test in finder.find(inspect.unwrap(getattr(item, "__func__", item)), place)
                    if test.examples
                )


@pytest.mark.usefixtures("urgent")  # some execute in real time
@pytest.mark.parametrize("test", list(examples()), ids=lambda test: test.name)
def test_the_examples_of_the_reference_do_what_they_say(test, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=told.append)
    assert not told, "".join(told)


def readme_lines() -> str:
    """The first Python block of the README that uses `op`."""
    blocks = (ROOT / "README.md").read_text().split("```python\n")[1:]
    found = [block.split("```")[0] for block in blocks if "import optiplan as op" in block]
    return found[0] if found else FIVE_LINES


def test_the_wheel_works_from_an_empty_folder(tmp_path):
    """Built from a copy of the checkout, installed beside the dependencies, with nothing of the checkout in sight."""
    pytest.importorskip("scikit_build_core", reason="builds the wheel; the extra `test` brings it")
    source, empty, home = tmp_path / "source", tmp_path / "empty", tmp_path / "venv"
    empty.mkdir()
    for name in ("optiplan", "robots", "problems", "control"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__", "in_place"))
    for name in ("pyproject.toml", "CMakeLists.txt", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    clean = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "COV_CORE_SOURCE")}
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    build = ["wheel", "--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", str(tmp_path), str(source)]
    without_core = "--config-settings=cmake.define.OPTIPLAN_VARIANTS=none"  # compiling it takes minutes
    subprocess.run([*pip, *build, without_core], check=True, env=clean)
    (wheel,) = tmp_path.glob("optiplan-*.whl")
    assert wheel.name.startswith(f"optiplan-{op.__version__}-")
    held = set(zipfile.ZipFile(wheel).namelist())
    data = ("robots/panda", "problems/01_reach.yaml", "control/")
    for part in (*(f"optiplan/_data/{name}" for name in data), "optiplan/viewer/web/", "optiplan/_core/_core_base.pyi"):
        assert any(name.startswith(part) for name in held), part
    assert not any(name.endswith((".cpp", ".hpp")) or "in_place" in name for name in held)
    venv.create(home, with_pip=False)
    python = home / "bin" / "python"
    packages = next((home / "lib").glob("python*")) / "site-packages"
    install = ["install", "--no-compile", "--no-deps", "--no-index", "--target", str(packages), str(wheel)]
    subprocess.run([*pip, *install], check=True, env=clean)
    beside = [path for path in sys.path if path.endswith("site-packages")]
    # What stands beside, but not the checkout, which an editable install finds by a finder of its own.
    lines = [f"import site; site.addsitedir({path!r})\n" for path in beside]
    kept = "[f for f in sys.meta_path if not getattr(type(f), '__module__', '').startswith('_editable')]"
    lines.append(f"import sys; sys.meta_path[:] = {kept}\n")
    (packages / "dependencies.pth").write_text("".join(lines))
    where = "import optiplan; print(optiplan.__file__, optiplan.__version__)"
    judge = "import optiplan as op; print(op.plan(op.load_problem('12_planar')).verified, *op.robots())"
    lines = "\n".join((where, readme_lines(), judge))
    told = subprocess.run([python, "-c", lines], cwd=empty, env=clean, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    first, *_, last = told.stdout.splitlines()
    assert first.split() == [str(packages / "optiplan" / "__init__.py"), op.__version__]
    assert last.startswith("True baxter baxter_left ")
