"""`optiplan plan DIR`: what is printed, exit codes, and flags that do not go with a folder."""

import json
import os
import signal

import pytest

from optiplan.runs.batches.episode import planned_episode
from optiplan.runs.batches.store import BatchStore

pytest.importorskip("pyarrow")

PROBLEM = "version: 1\nrobot: planar2r\nstart: {joints: [0.1, 0.2]}\ngoal: {joints: [0.5, 0.5]}\nplanner: quintic\n"


@pytest.fixture(autouse=True)
def here(monkeypatch):
    monkeypatch.setattr("optiplan.api.batches.in_processes", lambda requests, count: map(planned_episode, requests))


def test_a_folder_is_planned_and_continued(optiplan, tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "one.yaml").write_text(PROBLEM)
    command = ("plan", tmp_path / "in", "--out", tmp_path / "out", "--seeds", "2", "--lerobot")
    code, out, _ = optiplan(*command)
    assert code == 0
    assert "2 verified; 2 new, 0 kept" in out
    assert (tmp_path / "out/lerobot/planar2r/meta/info.json").exists()
    (tmp_path / "in" / "bad.yaml").write_text(PROBLEM.replace("0.5, 0.5", "0.5"))
    code, out, _ = optiplan(*command, "--json")
    told = json.loads(out)
    assert (code, told["counts"], told["planned"], told["kept"]) == (2, {"verified": 2, "bad-input": 2}, 2, 2)
    assert "bad.yaml:4: goal.joints: 1 values" in told["bad"][0]["reason"]
    assert told["failed"] == []


def test_what_has_no_plan_is_named(optiplan, optiplan_json, shut_in, tmp_path):
    """With its seed, where there are several."""
    (tmp_path / "in").mkdir()
    shut_in.rename(tmp_path / "in" / "shut-in.yaml")
    command = ("plan", tmp_path / "in", "--out", tmp_path / "out", "--budget", "0.2", "--seeds", "1")
    code, out, err = optiplan(*command)
    assert (code, out.splitlines()[0]) == (3, "1 no-plan; 1 new, 0 kept")
    assert err.startswith("shut-in.yaml, seed 0: no-plan: ")
    (failed,) = optiplan_json(*command)[1]["failed"]
    assert failed["episode"] == "shut-in.yaml, seed 0"


@pytest.mark.parametrize(
    ("given", "flags", "words"),
    [
        ("in", (), "--out"),
        ("in", ("--out", "out", "--seed", "3"), "goes with one problem, not with a folder"),
        ("in", ("--out", "out", "--full"), "goes with one problem, not with a folder"),
        ("in/one.yaml", ("--planner", "quintic,cubic", "--full"), "goes with one planner at a time"),
        ("in/one.yaml", ("--seeds", "3"), "goes with a folder of problems"),
        ("in", ("--out", "out", "--dask", "tcp://127.0.0.1:1", "--workers", "2"), "not with --dask"),
    ],
)
def test_flags_that_do_not_go_together(optiplan, tmp_path, given, flags, words):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "one.yaml").write_text(PROBLEM)
    code, _, err = optiplan("plan", tmp_path / given, *flags)
    assert code == 2
    assert words in " ".join(err.replace("│", "").split())


def test_ctrl_c_keeps_what_is_done(optiplan, tmp_path, monkeypatch):
    """Pressed after the first of three episodes: its row is written, and the same command goes on."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "one.yaml").write_text(PROBLEM)
    command = ("plan", tmp_path / "in", "--out", tmp_path / "out", "--seeds", "3", "--workers", "1")
    add = BatchStore.add

    def pressed(store, episode):
        add(store, episode)
        os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(BatchStore, "add", pressed)
        code, out, err = optiplan(*command)
    assert (code, out) == (130, "")
    assert "interrupted" in err
    code, out, _ = optiplan(*command)
    assert code == 0
    assert "2 new, 1 kept" in out
