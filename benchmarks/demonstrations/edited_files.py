"""Show that files of a run that were edited, and a goal a turn off, are refused.

Plans the tasks `40_panda_sorts_cubes` and `41_delbot_fetches`, saves them, edits what other programs act upon, events,
segments, wheels and the duration, and verifies each again. Then a sliding joint with limits of ±1e30 whose motion ends
2 pi m from its goal, with a leader of a mimic alike.
"""

import argparse
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from asked import Figures

import optiplan as op
from optiplan.runs.run_folder import load_run
from optiplan.runs.stored_runs import judged
from optiplan.trajectory.trajectory import Trajectory

Data = dict[str, Any]

Edit = tuple[str, str, Callable[[Data], None], str]

LINK = '<link name="{}"><collision><geometry><box size=".1 .1 .1"/></geometry></collision></link>'
LIMIT = '<limit lower="-1e30" upper="1e30" velocity="3" effort="400"/>'
JOINT = (
    '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>{}</joint>'
)


def shifted(key: str) -> Callable[[Data], None]:
    """Return what moves the times of all entries by 0.6 s."""

    def change(data: Data) -> None:
        for one in data[key]:
            for time in {"t", "begin", "end"} & one.keys():
                one[time] += 0.6

    return change


def assigned(key: str, value: Any) -> Callable[[Data], None]:
    """Return what replaces a value."""
    return lambda data: data.__setitem__(key, value)


def doubled(data: Data) -> None:
    """Replace rates of wheels by 2 x + 1."""
    data["wheels"] = [[2.0 * rate + 1.0 for rate in row] for row in data["wheels"]]


def verdict(problem: op.Problem, folder: Path) -> str:
    """Return the verdict on a folder, with the checks that failed."""
    report = judged(problem, load_run(folder))
    return "verified" if report.verified else "refused: " + ", ".join(check.name for check in report.failures)


def edits(figures: Figures, name: str, changes: list[Edit], budget: float) -> None:
    """Plan a task, and judge its files as they are and edited: (what, file, change, check that is to refuse it)."""
    print(f"planning {name} …", file=sys.stderr)
    problem = op.load_problem(name)
    run = op.plan(problem, budget=budget)
    if run.trajectory is None:
        figures.tell(f"{name}, within {budget:g} s", "a motion", "none")
        return
    with tempfile.TemporaryDirectory() as made:
        own, other = Path(made) / "own", Path(made) / "other"
        run.save(own)
        figures.tell(f"{name} as it was saved", "verified", verdict(problem, own))
        for what, file, change, check in changes:
            shutil.copytree(own, other, dirs_exist_ok=True)
            data = json.loads((other / file).read_text())
            change(data)
            (other / file).write_text(json.dumps(data))
            figures.tell(f"{name}, {file}: {what}", f"refused: {check}", verdict(problem, other))


EVENTS = [
    (f"{key} {what}", file, change(key), "events")
    for file in ("trajectory.json", "run.json")
    for key in ("events", "segments")
    if (file, key) != ("trajectory.json", "segments")  # those are the motion's own, judged with it
    for what, change in (("moved by 0.6 s", shifted), ("emptied", lambda key: assigned(key, [])))
]
DURATION = (
    "duration halved",
    "run.json",
    lambda data: data.__setitem__("duration", 0.5 * data["duration"]),
    "duration",
)
WHEELS = [
    ("wheels replaced by 2 x + 1", "trajectory.json", doubled, "wheels"),
    ("wheels emptied", "trajectory.json", assigned("wheels", []), "wheels"),
]


def a_turn_off(figures: Figures) -> None:
    """Judge motions of one joint, with limits of ±1e30, that end 2 pi m or rad from their goal."""
    follower = LIMIT + '<mimic joint="j" multiplier="{}" offset="0"/>'
    cases = [("prismatic", None), ("revolute", None), ("prismatic", 1.0), ("revolute", 0.5)]
    for kind, multiplier in cases:
        joints = JOINT.format("j", kind, "a", "b", LIMIT)
        names = "ab" if multiplier is None else "abc"
        if multiplier is not None:
            joints += JOINT.format("k", "revolute", "b", "c", follower.format(multiplier))
        with tempfile.TemporaryDirectory() as made:
            urdf = Path(made) / "robot.urdf"
            urdf.write_text(f'<robot name="r">{"".join(map(LINK.format, names))}{joints}</robot>')
            robot = op.Robot.from_urdf(urdf)
            problem = op.Problem(robot, [0.0], [1.0])
            figures.tell(f"{kind}, limits of ±1e30: infinite", False, bool(np.isinf(robot.limits.upper).any()))
            delta, T = 1.0 - 2.0 * np.pi, 20.0
            c = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * delta / T ** np.arange(6)
            motion = Trajectory(robot.joint_names, np.array([0.0, T]), c[None, :, None])
            refused = "goal" in [check.name for check in op.verify(problem, motion).failures]
            led = "" if multiplier is None else f" that leads another by {multiplier:g}"
            figures.tell(f"{kind}{led}, ends a turn off: refused by the goal", True, refused)
    attack = Path(os.environ.get("OPTIPLAN_SHARED", "../shared")) / "attacks" / "endless"
    if attack.is_dir():
        found = op.verify(op.load_problem(attack / "sliding.yaml"), attack / "pris.json")
        figures.tell("attacks/endless", ["goal"], [check.name for check in found.failures])
    else:
        print(f"{attack} is not there and was left out", file=sys.stderr)


def main() -> int:
    """Print every figure; 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--budget", type=float, default=60.0, help="s, to plan each of both tasks (default: 60)")
    budget = parser.parse_args().budget
    figures = Figures()
    a_turn_off(figures)
    edits(figures, "40_panda_sorts_cubes", [*EVENTS, DURATION], budget)
    edits(figures, "41_delbot_fetches", [*EVENTS, *WHEELS, DURATION], budget)
    return figures.exit_code


if __name__ == "__main__":
    sys.exit(main())
