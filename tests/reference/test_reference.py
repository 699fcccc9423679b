"""Every entry of the reports has a test of its own name; the numbers here are those of the table."""

import ast
import re
from pathlib import Path
from typing import Any

import pytest

from optiplan.config.document import read_yaml
from tests.reference.entries import HERE, REPORTS, entries

PAGE = Path(HERE).parent.parent / "docs" / "theory" / "reports.md"


def names_of_tests() -> set[str]:
    trees = [ast.parse(path.read_text()) for path in Path(HERE).glob("test_*.py")]
    return {node.name for tree in trees for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("report", REPORTS)
def test_every_copied_entry_has_a_test_of_its_name(report):
    tests = names_of_tests()
    missing = [name for name in entries(report) if f"test_{name.replace('.', '_')}" not in tests]
    assert not missing


def test_the_page_about_the_reports_names_entries_that_exist():
    named = set(re.findall(r"`((?:srra|delbot|lecture|sclerp)\.[\w.]+)`", PAGE.read_text()))
    known = {name for report in REPORTS for name in entries(report)}
    assert named <= known
    assert {name for name in known if entries(name.split(".")[0])[name].printed is not None} <= named


@pytest.fixture(scope="module")
def table(shared) -> dict[str, dict[str, Any]]:
    """All entries of the project's table."""
    files = [shared / "reference" / f"{report}.yaml" for report in REPORTS]
    return {item["id"]: item for file in files for item in read_yaml(file).data["items"]}


def test_every_entry_is_copied(table):
    copied = {name for report in REPORTS for name in entries(report)}
    assert copied == set(table)


def numbers(value: Any, path: tuple[Any, ...] = ()) -> dict[tuple[Any, ...], float]:
    """Every number below a value, by its path; words and formulas are left out."""
    if isinstance(value, dict | list):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        return {place: x for key, part in inner for place, x in numbers(part, (*path, key)).items()}
    return {path: float(value)} if isinstance(value, int | float) else {}


@pytest.mark.parametrize("report", REPORTS)
def test_numbers_and_tolerances_are_those_of_the_table(report, table):
    for name, copy in entries(report).items():
        original = table[name]
        assert copy.tolerance == float(original["tolerance"]), name
        assert numbers(copy.value) == numbers(original.get("value")), name
        if copy.printed is not None:
            assert numbers(copy.printed) == numbers(original["erratum"]["seed_value"]), name
