import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from optiplan import __version__
from optiplan.cli import main
from optiplan.cli.program import COMMANDS, program
from optiplan.errors import InputError, Issue
from optiplan.planners.registry import PLANNERS


@pytest.mark.parametrize("command", ["plan", "verify", "view", "check", "planners", "robots", "import"])
def test_help_teaches(optiplan, command):
    code, out, _ = optiplan(command, "--help")
    assert code == 0
    assert "Usage: optiplan" in out
    if command not in ("planners", "import"):
        assert "Example" in out


def test_version(optiplan):
    assert optiplan("--version") == (0, f"optiplan {__version__}\n", "")


def test_the_package_is_the_program_too():
    done = subprocess.run([sys.executable, "-m", "optiplan", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"optiplan {__version__}\n"


def test_a_worker_needs_a_database(optiplan):
    assert "default: SQLite" in optiplan("serve", "--help")[1]
    assert "default: SQLite" not in optiplan("worker", "--help")[1]


def test_no_arguments_is_help(optiplan):
    code, out, _ = optiplan()
    assert code == 0
    assert "Exit codes: 0 verified" in out


@pytest.mark.parametrize("arguments", [["fly"], ["plan"], ["plan", "a", "--fast"], ["robots", "fly"], ["verify", "a"]])
def test_wrong_usage_is_exit_code_2_and_points_to_help(optiplan, arguments):
    code, out, err = optiplan(*arguments)
    assert (code, out) == (2, "")
    assert "--help" in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plan", "a", "--budget", "soon"], "'--budget': expected a number\n"),
        (["plan", "a", "--budget", "0"], "'--budget': expected a number of seconds above 0\n"),
        (["plan", "a", "--budget", "nan"], "'--budget': expected a number of seconds above 0\n"),
        (["plan", "a", "--seed", "1.5"], "'--seed': expected a whole number\n"),
        (["plan", "a", "--seed", "-1"], "'--seed': expected a number ≥ 0\n"),
        (["view", "a", "--port", "70000"], "'--port': expected a number ≤ 65535\n"),
    ],
)
def test_values_of_options_that_do_not_fit(optiplan, arguments, words):
    code, out, err = optiplan(*arguments)
    assert (code, out) == (2, "")
    assert words in err


@pytest.mark.parametrize("arguments", [["plan", "a", "--out", ""], ["plan", "a", "--out="], ["verify", "a", ""], [""]])
def test_an_empty_value_is_not_the_folder_one_is_in(optiplan, optiplan_json, arguments):
    code, out, err = optiplan(*arguments)
    assert (code, out) == (2, "")
    assert "an empty value" in err
    assert optiplan_json(*arguments)[1]["exit_code"] == 2


def test_a_group_of_commands_says_that_none_was_given(optiplan):
    assert "optiplan bench: no command\n" in optiplan("bench")[2]


def test_unknown_commands_are_answered_with_the_near_or_with_all(optiplan):
    assert "Did you mean 'verify'?" in optiplan("verfy")[2]
    assert all(name in optiplan("fly")[2] for name in COMMANDS)
    assert "Choose from: init, show, srdf, export." in optiplan("robots", "fly")[2]


def helps(command):
    yield command.help or ""
    yield from (option.help or "" for option in command.params if hasattr(option, "help"))
    for inner in getattr(command, "commands", {}).values():
        yield from helps(inner)


def test_no_word_of_the_help_is_taken_for_a_style():
    """Rich leaves out what stands in square brackets where it takes it for one."""
    for text in helps(get_command(program())):
        tags = re.findall(r"(?<!\\)\[/?([a-z_]*)\]", text)
        assert set(tags) <= {"", "bold", "cyan", "dim"}, text


def test_what_is_wrong_is_told_once():
    issue = Issue("a.yaml", 3, "limits", "-1", "a number > 0")
    assert str(InputError([issue, issue])) == str(issue)


def test_wrong_usage_in_json_mode(optiplan_json):
    code, data = optiplan_json("plan", "a", "--fast")
    assert code == data["exit_code"] == 2
    assert "--fast" in data["error"]


def test_no_traceback_reaches_a_person(optiplan, optiplan_json, free, monkeypatch):
    monkeypatch.setattr("optiplan.runs.pipeline.run", lambda *_: 1 / 0)
    code, out, err = optiplan("plan", free)
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    log = re.search(r"traceback in (.+)\)", err)
    assert log is not None
    assert "ZeroDivisionError" in Path(log[1]).read_text()
    Path(log[1]).unlink()
    code, data = optiplan_json("plan", free)
    assert code == data["exit_code"] == 1
    Path(re.search(r"traceback in (.+)\)", data["error"])[1]).unlink()


def test_a_library_that_the_system_lacks_is_named(optiplan, free, monkeypatch):
    def without(*_):
        raise ImportError("libgomp.so.1: cannot open shared object file: No such file or directory")

    monkeypatch.setattr("optiplan.runs.pipeline.run", without)
    code, out, err = optiplan("plan", free)
    assert (code, out) == (2, "")
    assert "libgomp.so.1" in err
    assert "apt install libgomp1" in err
    assert "Traceback" not in err


def test_debug_lets_it_through(free, monkeypatch):
    monkeypatch.setenv("OPTIPLAN_DEBUG", "1")
    monkeypatch.setattr("optiplan.runs.pipeline.run", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main.run(["plan", str(free)])


def test_unwritable_output_is_bad_input(optiplan, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = optiplan("robots", "srdf", "planar2r", tmp_path / "file" / "out.srdf")
    assert code == 2
    assert "file" in err


def test_main_ends_the_process_with_the_code(monkeypatch, capfd):
    monkeypatch.setattr(main.sys, "argv", ["optiplan", "planners", "--json"])
    monkeypatch.setattr(main.signal, "signal", lambda *_: None)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code == 0
    assert set(json.loads(capfd.readouterr().out)["planners"]) == set(PLANNERS)
