"""Same problem, options and seed, same bits: whatever a worker did before, however many there are, resumed or not."""

import pytest

from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.suite.suite import load_suite

BOX = "{{name: {name}, shape: {{box: {size}}}, pose: {{position: {position}, rpy: [0, 0, {turn}]}}}}"
PROBLEM = """\
version: 1
name: {name}
robot: planar2r
start: {{joints: [1.2, 0.6]}}
goal: {{joints: [-1.2, -0.4]}}
scene: {{obstacles: [{boxes}]}}
"""
BOXES = [
    [([0.069, 0.108, 0.12], [0.899, 0.229, 0.15], 0), ([0.142, 0.138, 0.173], [0.44, -0.497, 0.15], 0.619)],
    [([0.161, 0.081, 0.099], [0.746, 0.209, 0.15], 0), ([0.186, 0.123, 0.117], [0.238, -0.439, 0.15], 0.976)],
    [([0.101, 0.143, 0.11], [0.726, 0.281, 0.15], 0.311), ([0.174, 0.073, 0.188], [0.282, -0.753, 0.15], 0)],
]
"""Of three problems, size, position and turn about z of boxes in the way: some along the axes, which decides how
coal rounds boxes where nobody has asked it before (`geometry/coal_queries.py`)."""
PLANNERS = ["quintic", "rrtconnect", {"name": "prm", "vertices": 200}]


class Enough(Exception):
    """As if somebody had ended the program."""


@pytest.fixture
def suite(write_suite, tmp_path):
    """Three problems among boxes; three planners, two seeds."""
    path = write_suite(count=0, planners=PLANNERS, seeds=[0, 1], budget=60, limits={"wall": 120, "memory": 2000})
    for index, bodies in enumerate(BOXES):
        boxes = [
            BOX.format(name=f"b{k}", size=size, position=position, turn=turn)
            for k, (size, position, turn) in enumerate(bodies)
        ]
        text = PROBLEM.format(name=f"p{index}", boxes=", ".join(boxes))
        (tmp_path / "problems" / f"p{index}.yaml").write_text(text)
    return load_suite(path, tmp_path / "files")


def hashes(suite, folder, workers, enough=None):
    """The trajectory of every run by its key; resumed after so many runs when told."""

    def watch(outcome):
        seen.append(outcome)
        if len(seen) == enough:
            raise Enough

    seen = []
    for again in (False, True) if enough else (True,):
        with open_results(suite, folder) as store:
            try:
                run_suite(suite, store, LocalPool(workers), "here", (lambda outcome: None) if again else watch)
            except Enough:
                continue
            rows = store.query("SELECT problem, planner, seed, trajectory, failure_kind, cut_short FROM runs")
    assert not any(row["cut_short"] for row in rows)
    return {tuple(row)[:3]: row["trajectory"] or row["failure_kind"] for row in rows}


def test_resumed_and_with_other_workers_the_trajectories_are_the_same(suite, tmp_path):
    alone = hashes(suite, tmp_path / "one", 1)
    assert len(alone) == suite.size == 18
    assert len(set(alone.values())) == 13
    for text in (f"{'/'.join(map(str, key))} {value}" for key, value in sorted(alone.items())):
        print(text)
    assert hashes(suite, tmp_path / "resumed", 2, enough=7) == alone
