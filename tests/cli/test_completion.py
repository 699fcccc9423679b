"""Completion in bash, from `--install-completion` to what a person is offered."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from optiplan.cli.completion import planner_names, problem_names, robot_names
from optiplan.cli.main import run

ROOT = Path(__file__).parents[2]
OFFERED = 'COMP_WORDS=("${words[@]}"); COMP_CWORD=$((${#words[@]} - 1)); _optiplan_completion optiplan'


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> Path:
    """A home with a program `optiplan` in its `bin`, and nothing else."""
    home = tmp_path_factory.mktemp("home")
    program = home / "bin" / "optiplan"
    program.parent.mkdir()
    program.write_text(f"#!{sys.executable}\nfrom optiplan.cli.main import main\nmain()\n")
    program.chmod(0o755)
    return home


def bash(home: Path, script: str) -> subprocess.CompletedProcess[str]:
    if shutil.which("bash") is None:
        pytest.skip("no bash on this machine")
    path = f"{home / 'bin'}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "HOME": str(home), "PATH": path, "PYTHONPATH": str(ROOT)}
    arguments = ["bash", "--norc", "-c", script]
    return subprocess.run(arguments, cwd=home, env=environment, capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def installed(home) -> Path:
    done = bash(home, "optiplan --install-completion; code=$?; exit $code")
    assert done.returncode == 0, done.stderr
    assert "bash completion installed" in done.stdout
    return home


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["plan", "02_shelf", "--planner", "rrt"], ["rrtconnect", "rrtstar"]),
        (["plan", "02_shelf", "--bud"], ["--budget"]),
        (["plan", "bi"], []),  # a folder of that name is there: bash offers it
    ],
)
def test_bash_completes_commands_and_names(installed, words, offered):
    quoted = " ".join(f"'{word}'" for word in ["optiplan", *words])
    done = bash(installed, f'. ~/.bashrc; words=({quoted}); {OFFERED}; printf "%s\\n" "${{COMPREPLY[@]}}"')
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == offered


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["ver"], ["verify"]),
        (["robots", "sh"], ["show"]),
        (["plan", "02"], ["02_shelf"]),
        (["check", "29"], ["29_sclerp"]),
        (["verify", "15"], ["15_srra"]),
        (["robots", "show", "pan"], ["panda"]),
        (["workspace", "srra", "pu"], ["puma560"]),
        (["ik", "bax"], ["baxter", "baxter_left", "baxter_report"]),
    ],
)
def test_the_program_answers_what_bash_asks(words, offered, monkeypatch, capfd):
    """As in a process of its own, which takes half a second."""
    asked = {"_OPTIPLAN_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(["optiplan", *words])}
    for name, value in (asked | {"COMP_CWORD": str(len(words))}).items():
        monkeypatch.setenv(name, value)
    with pytest.raises(SystemExit) as ended:
        run([])
    assert (ended.value.code, capfd.readouterr().out.split()) == (0, offered)


def test_without_a_shell_it_says_so(optiplan, monkeypatch):
    monkeypatch.setattr("typer._completion_shared._get_shell_name", lambda: None)
    code, _, err = optiplan("--install-completion")
    assert code == 2
    assert "expected bash, zsh, fish or PowerShell" in err


def test_planners_after_a_comma_are_those_not_named_yet():
    assert planner_names("quintic,rrt") == ["quintic,rrtconnect", "quintic,rrtstar"]
    assert "trajopt,trajopt" not in planner_names("trajopt,")
    assert planner_names("al") == ["all"]


def test_files_go_before_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert problem_names("01") == ["01_reach"]
    assert "panda" in robot_names("")
    Path("01_mine.yaml").touch()
    assert problem_names("01") == []
    assert problem_names("02") == ["02_shelf"]
    assert robot_names("./") == []
