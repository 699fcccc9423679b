"""Seconds to load a problem with many obstacles, and a robot with many joints.

python benchmarks/scale.py [--obstacles 5000] [--joints 300]
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

LINK = '<link name="l{0}"><collision><geometry><box size="0.04 0.04 0.06"/></geometry></collision></link>'
JOINT = (
    '<joint name="j{0}" type="revolute"><origin xyz="0 0 0.1"/><parent link="l{1}"/><child link="l{0}"/>'
    '<axis xyz="{2}"/><limit lower="-2" upper="2" velocity="1" effort="10"/></joint>'
)


def write_obstacles(folder: Path, count: int) -> Path:
    """A problem of the Panda among small boxes that stand around it."""
    rng = np.random.default_rng(0)
    angle, radius, height = rng.uniform(0, 2 * np.pi, count), rng.uniform(1.5, 3.0, count), rng.uniform(0, 2, count)
    boxes = "".join(
        f"    - {{name: o{k}, shape: {{box: [0.05, 0.04, 0.03]}},"
        f" pose: {{position: [{r * np.cos(a):.4f}, {r * np.sin(a):.4f}, {z:.4f}]}}}}\n"
        for k, (a, r, z) in enumerate(zip(angle, radius, height, strict=True))
    )
    path = folder / "obstacles.yaml"
    goal = "{joints: [0.3, -0.785, 0, -2.356, 0, 1.571, 0.785]}"
    head = f"version: 1\nrobot: panda\nstart: {{configuration: ready}}\ngoal: {goal}\n"
    path.write_text(f"{head}scene:\n  obstacles:\n{boxes}")
    return path


def write_chain(folder: Path, count: int) -> Path:
    """A problem of a chain of boxes on joints about x and y in turn."""
    joints = "".join(JOINT.format(k, k - 1, "0 1 0" if k % 2 else "1 0 0") for k in range(1, count + 1))
    links = "".join(LINK.format(k) for k in range(count + 1))
    (folder / "chain.urdf").write_text(f'<robot name="chain">{links}{joints}</robot>')
    (folder / "chain_robot.yaml").write_text("version: 1\nname: chain\nurdf: chain.urdf\n")
    path = folder / "chain.yaml"
    lists = [f"{{joints: [{', '.join([f'{value}'] * count)}]}}" for value in (0.0, 0.001)]
    path.write_text(f"version: 1\nrobot: chain_robot.yaml\nstart: {lists[0]}\ngoal: {lists[1]}\n")
    return path


def write_triangles(folder: Path, count: int) -> Path:
    """A problem of the Panda among four balls, one of them in its way, with this number of triangles in all."""
    import trimesh  # here: the curves that have no meshes need none

    levels = 1
    while 4 * 20 * 4 ** (levels + 1) <= count:
        levels += 1
    ball = trimesh.creation.icosphere(subdivisions=levels, radius=0.12)
    ball.export(folder / "ball.stl")
    places = [(0.5, 0.0, 0.4), (0.45, -0.55, 0.25), (0.75, 0.0, 0.75), (-0.4, 0.0, 0.3)]
    balls = "".join(
        f"    - {{name: ball{k}, shape: {{mesh: {{file: ball.stl}}}}, pose: {{position: {list(place)}}}}}\n"
        for k, place in enumerate(places)
    )
    path = folder / "triangles.yaml"
    lists = ["[-0.6, -0.2, 0, -2.0, 0, 1.8, 0.785]", "[0.6, -0.2, 0, -2.0, 0, 1.8, 0.785]"]
    head = f"version: 1\nrobot: panda\nstart: {{joints: {lists[0]}}}\ngoal: {{joints: {lists[1]}}}\n"
    path.write_text(f"{head}scene:\n  obstacles:\n{balls}")
    return path


def triangles(folder: Path) -> int:
    """How many triangles the problem of `write_triangles` has."""
    return 4 * (((folder / "ball.stl").stat().st_size - 84) // 50)


def main() -> None:
    """Write, load, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--obstacles", type=int, default=5000)
    parser.add_argument("--joints", type=int, default=300)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        from optiplan.problem.load import load_problem
        from optiplan.robot.robot import load_robot

        load_robot("panda")
        for count, what, path in (
            (arguments.obstacles, "obstacles", write_obstacles(folder, arguments.obstacles)),
            (arguments.joints, "joints", write_chain(folder, arguments.joints)),
        ):
            for again in ("first", "again"):
                start = time.process_time()
                load_problem(path)
                print(f"{count} {what}, {again}: {time.process_time() - start:.1f} s of processor time")


if __name__ == "__main__":
    main()
