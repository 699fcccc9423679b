"""Tables of best known durations: what they take, how they are read, and that their recipes still hold."""

import json
import os
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from optiplan.bench.results import best_known
from optiplan.bench.results.best_known import BestKnown, BestKnownTable
from optiplan.errors import InputError
from optiplan.files import write_text
from optiplan.importers.motion_bench_maker import Importer
from optiplan.planners.base import Budget
from optiplan.problem.load import load_problem
from optiplan.runs.pipeline import run

ENTRY = BestKnown("box/0001", "ab12", 1.25, "trajopt", '{"seeds": 3}', 0, 20.0, "0.2.0 abc", "ffff")
TABLES = Path(__file__).parents[3] / "benchmarks" / "best_known"
SHARED = Path(os.environ.get("OPTIPLAN_SHARED", TABLES.parents[2] / "shared"))
AMPLE = 30.0
"""s, more than the stored motion had: a busy machine must not cut the search, which ends with a motion as short."""

SLACK = 1.05
"""Planners change; a stored motion is the shortest of many runs, so another version may miss it by a little."""


class EndsWhenAsShort:
    """Progress that ends the search once a verified motion takes no longer than so many seconds."""

    def __init__(self, duration):
        self.duration, self.reached = duration, threading.Event()

    def __call__(self, stage, fraction):
        pass

    def proved(self, motion, seconds):
        if motion.duration <= self.duration:
            self.reached.set()


def test_only_what_is_shorter_is_taken(tmp_path):
    table = BestKnownTable(tmp_path / "best.csv")
    assert table.offer(ENTRY)
    assert not table.offer(ENTRY)
    assert not table.offer(replace(ENTRY, duration=1.3))
    assert not table.offer(replace(ENTRY, duration=1.25 * (1.0 - 1e-12)))
    assert table.offer(replace(ENTRY, duration=1.2, seed=4))
    assert table.get("ab12").seed == 4
    assert table.ratio("ab12", 1.5) == pytest.approx(1.25)
    assert table.ratio("unknown", 1.5) is None


def test_a_table_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "best.csv"
    table = BestKnownTable(path)
    table.offer(replace(ENTRY, problem="z", hash="1", duration=0.1 + 0.2))
    table.offer(ENTRY)
    table.write()
    again = BestKnownTable(path)
    assert again.rows() == table.rows()
    assert [row.problem for row in again.rows()] == ["box/0001", "z"]
    before = path.read_bytes()
    again.write()
    assert path.read_bytes() == before


def test_two_suites_with_one_table_lose_nothing(tmp_path, monkeypatch):
    """One writes after the other, and both at once."""
    path = tmp_path / "best.csv"
    one, other, third = BestKnownTable(path), BestKnownTable(path), BestKnownTable(path)
    one.offer(ENTRY)
    one.write()
    other.offer(replace(ENTRY, hash="cd34"))
    third.offer(replace(ENTRY, hash="ef56"))
    beside = threading.Thread(target=third.write)

    def slowly(path, text):
        monkeypatch.undo()
        beside.start()
        beside.join(0.1)
        write_text(path, text)

    monkeypatch.setattr(best_known, "write_text", slowly)
    other.write()
    beside.join()
    assert len(BestKnownTable(path)) == 3
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines, lines[1].replace("1.25", "2.5")]) + "\n")
    assert BestKnownTable(path).get("ab12").duration == 1.25


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("duration", "length", "columns"),
        ("1.25", "fast", "fast"),
        ("1.25", "-1", "no duration"),
        (",ffff", "", "zip"),
    ],
)
def test_what_is_no_table_is_refused_with_its_line(tmp_path, old, new, words):
    path = tmp_path / "best.csv"
    table = BestKnownTable(path)
    table.offer(ENTRY)
    table.write()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError) as refused:
        BestKnownTable(path)
    assert words in str(refused.value)


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the problems of MotionBenchMaker")
@pytest.mark.parametrize("robot", ["panda", "fetch"])  # ur5: its pairs are proved for 20 s first
def test_a_stored_recipe_is_verified_again(robot, tmp_path):
    table = BestKnownTable(TABLES / f"mbm-{robot}.csv")
    if not len(table):
        pytest.skip(f"nothing is known of {robot} yet")
    row = table.rows()[0]
    name, number = row.problem.split("/")
    importer = Importer(str(SHARED / "robots" / f"mbm_{robot}" / "robot.yaml"))
    folder = SHARED / "mbm" / robot / name
    file = importer.write(folder / f"scene{number}.yaml", folder / f"request{number}.yaml", tmp_path / name)
    problem = load_problem(file, seed=row.seed)
    assert problem.hash == row.hash
    progress = EndsWhenAsShort(SLACK * row.duration)
    done = run(problem, row.planner, json.loads(row.options), Budget(AMPLE, progress.reached), progress)
    assert done.verified
    assert done.duration <= SLACK * row.duration
