"""Same problem, options and seed: the same bits, whatever the process did before."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from optiplan.files import write_text
from optiplan.importers.motion_bench_maker import Importer
from optiplan.problem.write import problem_text

ROOT = Path(__file__).parents[3]
SAMPLING = {
    "bitstar": {"batches": 1},
    "informed_rrtstar": {"iterations": 30},
    "kpiece": {},
    "prm": {"vertices": 80},
    "rrtconnect": {},
    "rrtstar": {"iterations": 30},
}

PLANS = """
import hashlib, json, sys
from optiplan.planners.base import Budget
from optiplan.planners.registry import make_planner
from optiplan.problem.load import load_problem
for file, planner, options in json.loads(sys.argv[1]):
    result = make_planner(planner, options).plan(load_problem(file), Budget(120.0), lambda stage, part: None)
    motion, again = result.trajectory, result.info.get("cut_short")
    parts = () if motion is None else (motion.breakpoints, motion.coefficients)
    bits = hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()
    print(json.dumps([file, planner, motion and motion.duration, bits, again]))
"""

BOXES = """
import sys
import numpy as np, pinocchio as pin
import optiplan.collision.model
import coal
def distance(turned):
    at = coal.Transform3s(pin.rpy.rpyToMatrix(0.3, 0.5, 0.7) if turned else np.eye(3), np.array([-0.9, 0.1, 0.2]))
    request = coal.DistanceRequest()
    request.gjk_tolerance = 1e-12
    ball, box = coal.Capsule(0.1, 0.2), coal.Box(0.6, 0.6, 0.6)
    return float(coal.distance(ball, coal.Transform3s(), box, at, request, coal.DistanceResult())).hex()
found = {turned: distance(turned) for turned in (sys.argv[1] == "turned", sys.argv[1] != "turned")}
print(found[True], found[False])
"""


def fresh(program: str, argument: str) -> list[str]:
    """Lines that a new process prints."""
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", program, argument]
    done = subprocess.run(command, capture_output=True, text=True, env=variables, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def plans(jobs: list[tuple[str, str, dict[str, object]]]) -> dict[tuple[str, str], list[object]]:
    """(file, planner) -> duration, hash of the bits, whether the clock cut it, of plans made in one new process."""
    rows = [json.loads(line) for line in fresh(PLANS, json.dumps(jobs))]
    return {(row[0], row[1]): row[2:] for row in rows}


def test_the_first_direction_that_a_box_is_asked_in_decides_nothing() -> None:
    assert fresh(BOXES, "turned") == fresh(BOXES, "straight")


def test_sampling_planners_answer_the_same_in_fresh_and_used_processes(problems: Path) -> None:
    shelf, planar = (str(problems / f"{name}.yaml") for name in ("02_shelf", "12_planar"))
    jobs = [(file, planner, options) for planner, options in SAMPLING.items() for file in (shelf, planar)]
    jobs.remove((shelf, "rrtstar", SAMPLING["rrtstar"]))  # seconds, and the same code as the informed one
    forwards, backwards = plans(jobs), plans(jobs[::-1])
    assert len(forwards) == len(jobs)
    assert forwards == backwards
    assert all(duration and not cut for duration, _, cut in forwards.values())


def test_trajopt_answers_the_same_alone_and_after_another_problem(shared: Path, tmp_path: Path) -> None:
    sets = shared / "mbm" / "panda"
    if not sets.is_dir():
        pytest.skip("no MotionBenchMaker problems of the Panda")
    importer = Importer(str(shared / "robots" / "mbm_panda" / "robot.yaml"))
    files = []
    for name, number in (("bookshelf_small", "0004"), ("bookshelf_small", "0001"), ("table_pick", "0002")):
        folder = sets / name
        data, _ = importer.convert(folder / f"scene{number}.yaml", folder / f"request{number}.yaml")
        files.append(str(tmp_path / f"{name}_{number}.yaml"))
        write_text(Path(files[-1]), problem_text(data, ""))
    jobs = [(file, "trajopt", {}) for file in files]
    assert plans(jobs) == plans(jobs[::-1])  # the first of each is alone, the last of each comes after two others
