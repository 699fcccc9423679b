"""Pairs of links proved apart, held against random configurations of every robot of a package.

    python benchmarks/pair_samples.py
    python benchmarks/pair_samples.py --robots g1_29dof_rev_1_0 tiago --count 200000

A robot that was never loaded on this machine is proved first, which takes up to a minute. Prints one line per robot;
exit code 1 where a pair that was proved apart collides.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from optiplan.robot.robot import Robot, load_robot
from optiplan.robot.self_collision.pair_proof import PairProof
from optiplan.robot.self_collision.pair_survey import link_pairs
from optiplan.robot.self_collision.pairs import PROVED

ROBOTS = ("panda", "ur10", "tiago", "kinova", "z1", "talos_reduced", "g1_29dof_rev_1_0", "xarm7")
ROWS = 500


def package_file(folder: Path, robot: str) -> str:
    """Write the file of a robot of example-robot-data, and return its path."""
    path = folder / "robot.yaml"
    path.write_text(f"version: 1\nname: r\nurdf: {{package: example-robot-data, robot: {robot}}}\n")
    return str(path)


def proved_pairs(robot: Robot) -> np.ndarray:
    """Pairs of bodies that are proved never to meet, (m, 2); what the user declares or always touches is aside."""
    bodies = link_pairs(robot.model, robot.geometry)
    return np.array(
        [pair for links in bodies if robot.allowed.get(links) == PROVED for pair in bodies[links]], dtype=int
    ).reshape(-1, 2)


def colliding(robot: Robot, pairs: np.ndarray, count: int) -> int:
    """How many of the pairs (m, 2) meet in `count` random configurations, summed over these."""
    proof, found = PairProof(robot.model, robot.geometry, pairs, (robot.limits.lower, robot.limits.upper)), 0
    half, rng = np.where(np.isfinite(proof.half), proof.half, 1.0), np.random.default_rng(11)
    for _ in range(0, count, ROWS):
        Q = proof.middle + half * rng.uniform(-1.0, 1.0, (ROWS, robot.n))
        _, meeting, placed = proof.bounds.meeting(Q, 0.0)
        found += int((~(proof.distances(placed, meeting, np.full(len(meeting), np.inf)) > 0.0)).sum())
    return found


def main() -> None:
    """Print what collides in the robots asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=ROBOTS, help="robots of example-robot-data")
    parser.add_argument("--count", type=int, default=20_000, help="configurations of each robot")
    options, wrong = parser.parse_args(), 0
    for name in options.robots:
        print(f"{name} …", file=sys.stderr)
        with tempfile.TemporaryDirectory() as folder:
            robot = load_robot(package_file(Path(folder), name))
            pairs = proved_pairs(robot)
            found = colliding(robot, pairs, options.count)
        print(f"{name}: {len(pairs)} pairs proved apart, {found} collisions in {options.count} configurations")
        wrong += found
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
