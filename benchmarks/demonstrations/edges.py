"""Verdicts at the edges: short steps, mesh files that are cut off or broken, MoveIt's default entries.

A held cube goes into a wall during a step that is a billionth of the motion; a wall's file is cut at every byte and
in the middle of its facets; files of every format are changed at random; two of MoveIt's default entries disagree.
"""

import argparse
import json
import os
import sys
from pathlib import Path

import numpy as np
from asked import Figures

import optiplan as op
from optiplan.geometry.meshes.reading_process import READERS
from optiplan.geometry.meshes.triangles import MeshError
from optiplan.importers.moveit import convert

SHARED = Path(os.environ.get("OPTIPLAN_SHARED", Path(__file__).parents[3] / "shared"))


def short_step(folder: Path) -> tuple[str, str]:
    """Return required and measured values of a cube in a wall during 0.9 ms beside a wait of 10^6 s."""
    problem = op.load_problem(folder / "problem.yaml")
    report = op.verify(problem, op.Trajectory.from_dict(json.loads((folder / "motion.json").read_text())))
    places = ", ".join(check.place for check in report.failures if check.name == "collision")
    return "refused, cube – wall", f"{'verified' if report.verified else 'refused'}, {places}"


def cut_off(folder: Path) -> tuple[str, str]:
    """Return required and measured values of an ASCII STL that ends after half of its facets, cut at every byte."""
    content = (folder / "whole.stl").read_bytes()
    whole, wrong = READERS[".stl"](content), 0
    for length in range(len(content)):
        try:
            found = READERS[".stl"](content[:length])
        except MeshError:
            continue
        wrong += not np.array_equal(found.vertices, whole.vertices)
    try:
        op.load_problem(folder / "cut.yaml")
        words = "half of it read"
    except op.InputError:
        words = "half of it refused"
    count = f"of {len(content)} cuts read as less"
    return f"half of it refused, 0 {count}", f"{words}, {wrong} {count}"


def broken_files(contents: dict[str, bytes], count: int, seed: int) -> tuple[str, str]:
    """Return how many changed files bring out another error than `MeshError`."""
    rng, others = np.random.default_rng(seed), 0
    kinds = sorted(contents)
    for _ in range(count):
        kind = kinds[rng.integers(len(kinds))]
        content = bytearray(contents[kind])
        for _ in range(rng.integers(1, 4)):
            place = int(rng.integers(len(content) + 1))
            content[place : place + int(rng.choice([0, 1, 4, 40, 4000]))] = rng.bytes(int(rng.integers(9)))
        try:
            READERS[kind](bytes(content))
        except (MeshError, MemoryError):
            pass
        except Exception as error:
            others += 1
            print(f"{kind}: {error!r}", file=sys.stderr)
    return f"0 other errors of {count}", f"{others} other errors of {count}"


def default_entries() -> tuple[str, str]:
    """Return whether `wall: true, panda_hand: false` allows the pair."""
    box = {"primitives": [{"type": "box", "dimensions": [0.1, 0.1, 0.1]}], "primitive_poses": [{}]}
    matrix = {"default_entry_names": ["wall", "panda_hand"], "default_entry_values": [True, False]}
    scene = {"world": {"collision_objects": [{"id": "wall", **box}]}, "allowed_collision_matrix": matrix}
    robot = op.load_robot("panda")
    ready = dict(zip(robot.joint_names, robot.configurations["ready"].tolist(), strict=True))
    start = {"joint_state": {"name": list(ready), "position": list(ready.values())}}
    goal = {"joint_constraints": [{"joint_name": name, "position": value} for name, value in ready.items()]}
    data = convert(scene, {"start_state": start, "goal_constraints": [goal]}, robot, "edges").data
    found = data["scene"].get("allowed_collisions", [])
    return "panda_hand is checked", f"panda_hand is {'allowed' if ['panda_hand', 'wall'] in found else 'checked'}"


def contents() -> dict[str, bytes]:
    """Return a whole file of each format."""
    import trimesh

    box = trimesh.creation.box((0.4, 0.2, 0.1))
    made = {f".{kind}": box.export(file_type=kind) for kind in ("stl", "obj", "ply", "glb")}
    dae = sorted((Path(__file__).parents[2] / "tests/attacks/dae_unit").glob("*.dae"))
    return {kind: one.encode() if isinstance(one, str) else bytes(one) for kind, one in made.items()} | {
        ".dae": dae[0].read_bytes()
    }


def main() -> int:
    """Print a line per figure; return 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutations", type=int, default=5000, help="changed mesh files (5000)")
    parser.add_argument("--seed", type=int, default=0, help="of the changes (0)")
    options = parser.parse_args()
    attacks = SHARED / "attacks"
    if not attacks.is_dir():
        parser.error(f"no folder {attacks}; set OPTIPLAN_SHARED to the folder that holds attacks/")
    shown = {
        "a step of 0.9 ms beside 10^6 s": lambda: short_step(attacks / "longtask"),
        "an ASCII STL cut off": lambda: cut_off(attacks / "stl_cut"),
        "changed mesh files": lambda: broken_files(contents(), options.mutations, options.seed),
        "MoveIt's defaults wall: true, panda_hand: false": default_entries,
    }
    figures = Figures()
    for name, figure in shown.items():
        print(f"{name} …", file=sys.stderr)
        figures.tell(name, *figure())
    return figures.exit_code


if __name__ == "__main__":
    sys.exit(main())
