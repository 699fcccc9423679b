"""Chunks in the scenes of shipped problems and of attacks: whatever is sent, the verifier accepts."""

import threading
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import optiplan as op

ATTACKS = Path(__file__).parents[2] / "attacks"
PROBLEMS = (
    "06_attached",
    "11_baxter",
    "13_mesh",
    "14_half_space",
    "28_circle_of_base_and_arm",
    ATTACKS / "mimic" / "problem.yaml",
    ATTACKS / "never2" / "problem.yaml",
    ATTACKS / "swallowed" / "bin.yaml",
)


def chunks(problem, count, seed):
    """Smooth set-points from rest, in small and large motions, at several speeds and without times."""
    rng, s = np.random.default_rng(seed), np.arange(1, 21) / 20
    for k in range(count):
        by = rng.uniform(-1.0, 1.0, problem.robot.n) * (0.05, 0.3, 1.0)[k % 3]
        q = problem.start + (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None] * by
        yield q, None if k % 4 == 3 else (0.05, 0.1, 0.02)[k % 4] * np.arange(1, 21)


@pytest.mark.parametrize("name", PROBLEMS, ids=lambda name: Path(name).parent.name + Path(name).stem)
def test_what_is_sent_is_verified(name):
    problem, outcomes = op.load_problem(name), Counter()
    for q, t in chunks(problem, 9, 1):
        found = op.certify(problem, q, t)
        outcomes[found.outcome] += 1
        if found.is_proved:
            report = op.verify(found.problem, found.trajectory)
            assert report.verified, (found, report)
    assert outcomes["proved"] >= 2, outcomes


def test_threads_share_a_problem_with_obstacles_elsewhere():
    reach = op.load_problem("01_reach")
    problem = reach.with_scene([*reach.scene.obstacles, op.Sphere("ball", radius=0.1, position=(0.0, 0.0, 1.9))])
    q = problem.start + np.linspace(0.0, 0.3, 31)[1:, None] ** 2 * np.array([1.0, 0, 0, 0, 0, 0, 0])
    t = 0.05 * np.arange(1, 31)
    tool = op.Pose(problem.robot.fk(q[-1] + 0.1).matrix[:3, 3])
    op.certify(problem, q, t)
    wrong = []

    def ask(poses, free):
        for _ in range(40):
            if (op.certify(problem, q, t, poses=poses).outcome == "proved") != free:
                wrong.append(poses)

    blocked = op.certify(problem, q, t, poses={"ball": tool}).outcome != "proved"
    assert blocked
    threads = [threading.Thread(target=ask, args=case) for case in (({"ball": tool}, False), ({}, True))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
