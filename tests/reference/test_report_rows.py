"""The rows of the reports' table: right numbers are those of the entries, and code finds them."""

import contextlib
import importlib.util
import io
import sys
from pathlib import Path

import pytest

from tests.reference.entries import entry

ROOT = Path(__file__).parents[2]


def table():
    """The script that runs them."""
    sys.path.insert(0, str(ROOT / "benchmarks"))  # Python finds modules beside a script
    spec = importlib.util.spec_from_file_location("report_rows", ROOT / "benchmarks" / "report_rows.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where a dataclass looks for itself
    spec.loader.exec_module(module)
    sys.path.remove(str(ROOT / "benchmarks"))
    return module


SCRIPT = table()
ROWS = SCRIPT.rows()
MORE = SCRIPT.rows(SCRIPT.EXERCISES)
EXERCISES = [row for row in ROWS + MORE if row.ask]
CODE = [row for row in ROWS + MORE if row.python and "op.plan(" not in row.python]
"""Those that plan are left to the script."""


def name(row):
    return f"{row.report}: {row.what}"


def value(path):
    """The number at `entry/key/0`."""
    found = entry(path.partition("/")[0]).value
    for key in path.split("/")[1:]:
        found = found[int(key)] if isinstance(found, list) else found[key]
    return found


def test_there_are_sixty_one_each_with_a_command_or_a_reason():
    assert len(ROWS) == 61
    assert len({name(row) for row in ROWS}) == 61
    assert all(row.ask for row in MORE)
    for row in ROWS + MORE:
        assert bool(row.run) + bool(row.python) + bool(row.missing) == 1, name(row)
        assert bool(row.shows) != bool(row.missing), name(row)


@pytest.mark.parametrize("row", EXERCISES, ids=name)
def test_right_numbers_are_those_of_the_entries_and_not_those_printed(row):
    assert row.printed
    assert row.why
    assert row.right != row.printed
    if row.count_of:
        assert int(row.right) == len(value(row.count_of))
    if row.of:
        digits = len(row.right.partition(".")[2])
        assert f"{value(row.of):.{digits}f}" == row.right


@pytest.mark.parametrize("row", CODE, ids=name)
def test_code_finds_what_the_row_shows(row):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(row.python, row.what, "exec"), {})
    for text in row.shows:
        assert text in printed.getvalue()


def test_commands_that_fail_or_show_something_else_are_no_successes():
    row = SCRIPT.Row("lecture", "a test", python="print(6 * 7)", shows=("42",))
    assert SCRIPT.outcome(row).verdict == "works"
    wrong = SCRIPT.outcome(SCRIPT.Row("lecture", "a test", python="print(6 * 7)", shows=("43",), better="much"))
    assert (wrong.verdict, wrong.words) == ("fails", "does not show '43': 42")
    ended = SCRIPT.outcome(SCRIPT.Row("lecture", "a test", python="print(42); raise SystemExit(3)", shows=("42",)))
    assert (ended.verdict, ended.words) == ("fails", "exit code 3: 42")
    assert SCRIPT.counted([wrong, ended]) == "2 rows: 0 better, 0 works, 2 fails, 0 missing."
    assert SCRIPT.table([wrong])[0][2] == "fails"
