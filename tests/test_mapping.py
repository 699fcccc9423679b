"""Where tests are: `tests/a/test_b.py` tests `optiplan/a/b.py`; `tests/a/behaviour/` what modules do together."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
WITHOUT_MODULE = {
    "core": "the C++ of optiplan/_core",
    "reference": "the numbers of published reports, against the whole program",
}
"""Folders of tests of something else than a module of the package."""


def modules() -> set[Path]:
    """Return the modules and packages of optiplan, relative to it and without suffix."""
    found = {path.relative_to(ROOT / "optiplan") for path in (ROOT / "optiplan").rglob("*.py")}
    return {path.parent if path.name == "__init__.py" else path.with_suffix("") for path in found}


def test_a_test_file_is_found_from_its_module():
    tests = sorted(path.relative_to(ROOT / "tests") for path in (ROOT / "tests").rglob("test_*.py"))
    known, lost = modules(), []
    for path in tests:
        of_a_room = len(path.parts) > 1 and path.parts[0] not in WITHOUT_MODULE
        if of_a_room and path.parent.name == "behaviour":
            if path.parent.parent not in known:
                lost.append(f"tests/{path}: there is no room optiplan/{path.parent.parent}")
        elif of_a_room and path.parent / path.stem.removeprefix("test_") not in known:
            module = path.parent / path.stem.removeprefix("test_")
            lost.append(f"tests/{path}: there is no optiplan/{module}.py; tests of several modules are in behaviour/")
    assert len(tests) > 200
    assert not lost, "\n".join(lost)


def test_a_file_of_the_core_has_its_test():
    """`optiplan/_core/src/a/b.cpp` is tested by `tests/core/cpp/test_b.cpp`; Python tests the bindings beside them."""
    tested = sorted(path.stem for path in (ROOT / "optiplan" / "_core" / "src").glob("*/*.cpp"))
    tests = sorted(path.stem.removeprefix("test_") for path in (ROOT / "tests" / "core" / "cpp").glob("test_*.cpp"))
    assert tests == tested
