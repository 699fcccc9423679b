"""The C++ of the core by itself: `optiplan/_core/src/a/b.cpp` is tested by `tests/core/cpp/test_b.cpp`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NAMES = sorted(path.stem for path in (ROOT / "tests" / "core" / "cpp").glob("test_*.cpp"))


@pytest.fixture(scope="module")
def program() -> Path:
    """The tests as a program; what did not change is not compiled again."""
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    compiler = os.environ.get("CXX", "c++")
    if shutil.which(compiler, path=search) is None or shutil.which("cmake", path=search) is None:
        pytest.skip("no C++ compiler, or no CMake")
    folder = ROOT / "build" / "core"
    steps = [["--build", str(folder), "--target", "core_tests"]]
    if not (folder / "build.ninja").exists():  # no core has been built here, of whose objects the program could be
        folder = ROOT / "build" / "core-tests"
        steps = [
            ["-G", "Ninja", "-S", str(ROOT), "-B", str(folder), "-DOPTIPLAN_CORE_TESTS=ON"],
            ["--build", str(folder)],
        ]
    for step in steps:
        done = subprocess.run(
            ["cmake", *step], env={**os.environ, "PATH": search}, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "core_tests"


@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_the_core(name, program):
    done = subprocess.run([program, f"{name}.cpp"], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
