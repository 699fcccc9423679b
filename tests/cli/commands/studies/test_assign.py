"""`optiplan assign`: the table, JSON, files, and assembly files that say nothing sensible."""

import re

import pytest

FILE = """\
version: 1
robots:
  a: {use: planar2r}
  b: {use: planar2r, base: {position: [0, 3, 0]}}
start: {configuration: ready}
planner: quintic
jobs:
  - {name: one, steps: [{move: {joints: [1.0, 0.5]}}, {dwell: 0.2}]}
  - {name: two, steps: [{do: look, with: {seconds: 0.4}}], after: [one]}
  - {name: three, steps: [{move: {joints: [-0.5, 0.9]}}], arms: [a]}
tasks:
  look: [{move: {joints: [0.5, 0.9]}}, {dwell: =seconds}]
"""


@pytest.fixture
def assembly(tmp_path):
    (tmp_path / "assembly.yaml").write_text(FILE)
    return tmp_path / "assembly.yaml"


def test_jobs_are_given_to_arms_and_written(optiplan, assembly, tmp_path):
    code, out, _ = optiplan("assign", str(assembly), "--budget", "30", "--out", str(tmp_path / "out"))
    assert code == 0
    rows = dict(re.findall(r"^ *(one|two|three) +([ab]) ", out, re.M))
    assert rows == {"one": "b", "two": "b", "three": "a"}
    found, alone, bound = map(float, re.findall(r"([\d.]+) s[,;]", out))
    assert bound < 1.1 * found
    assert found < alone
    written = tmp_path / "out"
    assert optiplan("verify", str(written / "problem.yaml"), str(written / "run"))[0] == 0


def test_json_of_a_job_that_no_arm_can_do(optiplan_json, assembly):
    far = "{move: {pose: {position: [9, 0, 0], rpy: [0, 0, 0]}}}"
    assembly.write_text(FILE.replace("{move: {joints: [-0.5, 0.9]}}", far))
    code, data = optiplan_json("assign", str(assembly), "--budget", "30")
    assert code == data["exit_code"] == 3
    assert list(data["impossible"]) == ["three"]
    assert "step 1" in data["impossible"]["three"]["a"]
    assert data["makespan"] is data["lower_bound"] is None
    assert data["files"] == []


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "steps: [{move: {joints: [1.0, 0.5]}}",
            "after: [two], steps: [{dwell: 1}",
            ":8: jobs[0].after: a circle: one",
        ),
        ("after: [one]", "after: [on]", ":9: jobs[1].after[0]: 'on', no name of another job; expected one of: one"),
        ("after: [one]", "after: [two]", "'two', no name of another job"),
        ("name: two", "name: one", ":9: jobs[1].name: 'one', the name of job 1 too"),
        ("arms: [a]", "arms: [c]", ":10: jobs[2].arms: 'c', no group of the robot; expected one of:"),
        ("arms: [a]", "arms: [all]", ":10: jobs[2].arms: 'all', which moves a/"),
        ("arms: [a]", "arm: [a]", "did you mean 'arms'?"),
        ("[-0.5, 0.9]", "[-0.5]", ":10: jobs[2].steps[0].move.joints"),
        ("{dwell: 0.2}", "{dwell: 0.2, arm: b}", ":8: jobs[0].steps[1].arm: 'b' in a step of a job"),
        ("{dwell: 0.2}", "{dwell: 0.2, wait_for: two}", "expected `after` of the job"),
        ("{do: look,", "{do: lok,", "did you mean 'look'?"),
        ("[{move: {joints: [0.5, 0.9]}}, ", "[{mov: 1}, ", ":12: tasks.look[0]"),
        ("start:", "goal: {joints: [0, 0, 0, 0]}\nstart:", ":5: goal: `goal` beside `jobs`"),
        ("jobs:", "job:", "jobs: nothing; expected this key, which is required"),
        ("{move: {joints: [-0.5, 0.9]}}", "{attach: {object: x, link: a/tip}}", ":10: jobs[2].steps[0].attach.object"),
        ("{move: {joints: [-0.5, 0.9]}}", "{dwell: 1}", ":10: jobs[2].steps: a job that moves nothing"),
        ("planner: quintic", "planner: quintik", ":6: planner"),
    ],
)
def test_a_bad_assembly_names_the_line(optiplan, assembly, old, new, words):
    assert old in FILE
    assembly.write_text(FILE.replace(old, new))
    code, _, err = optiplan("assign", str(assembly))
    assert code == 2
    assert words in err
    assert "Traceback" not in err


def test_a_job_must_not_end_with_something_in_hand(optiplan, assembly):
    take = "[{attach: {object: x, link: a/tip}}, {move: {joints: [1, 0]}}]"
    ball = "scene: {obstacles: [{name: x, shape: {sphere: 0.02}, pose: {position: [0.3, 0.3, 1]}}]}\n"
    assembly.write_text(FILE.replace("[{move: {joints: [-0.5, 0.9]}}]", take) + ball)
    code, _, err = optiplan("assign", str(assembly))
    assert code == 2
    assert ":10: jobs[2].steps: a job that ends with 'x' in hand" in err
