"""Cubes sorted by two arms beside each other, and by one that stands in the middle: the ratio of the durations.

    python benchmarks/arms.py                                      # 20 cubes, some minutes
    python benchmarks/arms.py --cubes 8 --markdown /tmp/arms.md
    python benchmarks/publish.py arms /tmp/arms.md --readme docs/how-to/two-arms.md

Both bring the same cubes from the same places to the same places. The two arms stand 0.6 m apart; each brings the cubes
of its side, with steps of its own.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

from typing import Any

from published import finish, table_parser

import optiplan as op

HEADINGS = ("arms", "verified", "cubes", "duration, s", "ratio", "in a row with all stops, s", "planning, s of a core")
ROWS = (0.35, 0.42, 0.49, 0.56, 0.63)
"""m, x of cubes, and 5 cm nearer of the places where they are put."""
SIDES = {"left": 1.0, "right": -1.0}
TAKEN = {"left": (0.08, 0.18), "right": (0.18, 0.08)}
"""m from the middle, in the order in which an arm takes them: the arms begin away from each other."""
PUT = (0.3, 0.4)
SIZE = 0.045


def cubes(count: int) -> list[tuple[str, tuple[float, float], tuple[float, float]]]:
    """Return arm, place and target [x, y], m, of each cube; half of them on each side."""
    found = []
    for arm, sign in SIDES.items():
        places = [(x, sign * y) for y in TAKEN[arm] for x in ROWS][: count // 2]
        targets = [(x - 0.05, sign * y) for y in PUT[::-1] for x in ROWS][: count // 2]
        found += [(arm, place, target) for place, target in zip(places, targets, strict=True)]
    return found


def steps(number: int, place: tuple[float, float], target: tuple[float, float], arm: str) -> list[dict[str, Any]]:
    """Return the steps that bring a cube, of an arm; of a robot alone where it is empty."""
    of, own = (f"{arm}/", {"arm": arm}) if arm else ("", {})
    down = {"rpy_deg": [180, 0, 0]}
    fingers = [f"{of}panda_leftfinger", f"{of}panda_rightfinger"]
    held = {"object": f"cube_{number}", "link": f"{of}panda_hand", "touch": fingers, "mass": 0.1}
    said: list[dict[str, Any]] = [
        {"approach": {"pose": {"position": [*place, 0.025], **down}, "distance": 0.1}},
        {"attach": held},
        {"gripper": {"group": f"{of}hand", "joints": [SIZE / 2]}},
        {"retreat": {"distance": 0.1}},
        {"approach": {"pose": {"position": [*target, 0.026], **down}, "distance": 0.1}},
        {"gripper": {"group": f"{of}hand", "joints": [0.04]}},
        {"detach": {"object": f"cube_{number}"}},
        {"retreat": {"distance": 0.1}},
    ]
    return [{**own, **step} for step in said]


def problem_of(count: int, two: bool) -> op.Problem:
    """Return the task of two arms, or of one in the middle."""
    brought = cubes(count)
    boxes = [op.Box("table", size=(0.6, 1.4, 0.04), position=(0.5, 0, -0.02))]
    for k, (_, place, _) in enumerate(brought):
        boxes.append(op.Box(f"cube_{k}", size=(SIZE, SIZE, SIZE), position=(*place, 0.0235)))
    arms = {arm: {"use": "panda", "base": op.Pose((0, 0.3 * sign, 0))} for arm, sign in SIDES.items()}
    robot = op.Robot.side_by_side(arms) if two else op.load_robot("panda")
    task = [step for k, (arm, *ends) in enumerate(brought) for step in steps(k, *ends, arm if two else "")]
    return op.Problem(robot, "ready", task=task, scene=boxes, name="two arms" if two else "one arm")


def measured(count: int, two: bool, budget: float) -> dict[str, Any]:
    """Plan one of them and return what the table says of it."""
    run = op.plan(problem_of(count, two), budget=budget)
    known = run.info or {}
    return {
        "arms": 2 if two else 1,
        "verified": run.verified,
        "cubes": count,
        "duration": run.duration,
        "with_stops": known.get("duration_with_stops"),
        "planning": run.plan_cpu,
        "failure": None if run.failure is None else str(run.failure),
    }


def cells(one: dict[str, Any], alone: dict[str, Any]) -> list[str]:
    """Return the row of one of them."""
    if one["duration"] is None or alone["duration"] is None:
        return [str(one["arms"]), "no", str(one["cubes"]), *["–"] * 4]
    return [
        str(one["arms"]),
        "yes" if one["verified"] else "no",
        str(one["cubes"]),
        f"{one['duration']:.2f}",
        f"{one['duration'] / alone['duration']:.3f}",
        f"{one['with_stops']:.2f}",
        f"{one['planning']:.1f}",
    ]


def main() -> None:
    """Plan both and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("--cubes", type=int, default=20, help="an even number up to 20")
    parser.add_argument("--budget", type=float, default=300.0, help="s, of each plan")
    arguments = parser.parse_args()
    found = [measured(arguments.cubes, two, arguments.budget) for two in (False, True)]
    rows = [cells(one, found[0]) for one in found]
    finish(arguments.markdown, HEADINGS, rows, {"budget": arguments.budget, "runs": found})


if __name__ == "__main__":
    main()
