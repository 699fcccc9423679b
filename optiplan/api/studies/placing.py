"""`place`: where the robot should stand to do a task, and fastest."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.api.planning import plan, positive_seconds
from optiplan.api.studies.result_folder import ResultFolder
from optiplan.arrays import number_argument
from optiplan.errors import InputError, described, progress_argument, whole_argument, wrong_argument
from optiplan.geometry.poses import pose_to_data
from optiplan.planners.base import Budget, Progress, silent
from optiplan.planners.tours.placing import PlaceRange, PlaceScores, moved_base, search_places
from optiplan.problem.from_python import file_data
from optiplan.problem.load import problem_from_dict
from optiplan.problem.problem import Problem
from optiplan.problem.write import problem_text
from optiplan.records import dataclass
from optiplan.robot.reference import several_robots
from optiplan.robot.robot import Robot, load_robot
from optiplan.runs.run import Run
from optiplan.runs.run_folder import folder_argument
from optiplan.viewer.plots.place_map import draw_map, place_page

BUDGET = 60.0
"""Seconds for the map and the plans, when none are given."""

_MAP = 0.5
"""Share of the budget for the map; the rest is for planning at the given base and at the best ones."""

RESULT = ResultFolder("place.html", "problem.yaml")

_PLANNED, _APART = 3, 0.1
"""Bases that are planned, and how far apart they are at least, m and rad."""


@dataclass(frozen=True, eq=False, repr=False)
class Placement:
    """Base poses of a robot for a problem.

    Attributes:
        scores: of all base poses that were scored, as displacements of the given one.
        given: the run at the given base.
        runs: (moved, run) of the bases that were planned besides, the shortest verified run first.
        refused: (moved, why) of bases at which the problem cannot be stated.
    """

    problem: Problem
    scores: PlaceScores
    given: Run
    runs: tuple[tuple[tuple[float, ...], Run], ...]
    refused: tuple[tuple[tuple[float, ...], str], ...] = ()

    @property
    def unverified(self) -> list[tuple[tuple[float, ...], str]]:
        """(moved, why) of the bases, the given one among them, without a verified motion."""
        unverified = [(moved, run.why_not) for moved, run in self.planned if not run.verified]
        return unverified + list(self.refused)

    @property
    def planned(self) -> list[tuple[tuple[float, ...], Run]]:
        """(moved, run) of all bases that were planned, the given one first."""
        return [((0.0,) * 4, self.given), *self.runs]

    @property
    def run(self) -> Run | None:
        """The shortest verified run at any base; None without one."""
        verified = [run for _, run in self.planned if run.verified]
        return min(verified, key=lambda run: float(run.duration or np.inf), default=None)

    @property
    def moved(self) -> tuple[float, ...] | None:
        """How far the base of `run` is from the given one: x, y, z, m, and yaw, rad."""
        return next((moved for moved, run in self.planned if run is self.run), None)

    @property
    def base(self) -> dict[str, Any] | None:
        """The base of `run` as a problem file says it."""
        return None if self.run is None else pose_to_data(self.run.problem.robot.mounting.X_WB)

    def save(self, folder: Path) -> list[Path]:
        """Write `place.html`, `place.png` and, where a base was found, `problem.yaml`; return the paths.

        Raises:
            InputError: the folder cannot be written, or has a `problem.yaml` that no earlier result left there; or the
                problem has an `op.Expression`, which no file holds.
        """
        title = f"Where {self.problem.robot.name} stands for {self.problem.name}"
        picture = draw_map(self.scores, title)
        rows = [_cells(moved, self._score(moved), run) for moved, run in self.planned]
        text = problem_text(file_data(self.run.problem, "Placement.save")) if self.run is not None else ""
        page = place_page(title, self.words, picture, rows, problem_text({"base": self.base}) if self.base else "–")
        files = {"place.png": picture, "place.html": page.encode()} | ({"problem.yaml": text.encode()} if text else {})
        return RESULT.write(folder, files)

    @property
    def words(self) -> str:
        """The result in a sentence."""
        given = _seconds(self.given)
        if self.run is None or self.moved is None:
            return f"no base was found at which the task is verified; at the given one: {given}"
        x, y, z, yaw = self.moved
        where = f"base moved by x {x:.3f} m, y {y:.3f} m, z {z:.3f} m, turned by {yaw:.3f} rad"
        return f"{where}: {_seconds(self.run)}; at the given one: {given}"

    def _score(self, moved: Sequence[float]) -> float:
        k = int(np.abs(self.scores.moved - np.array(moved)).max(axis=1).argmin())
        return float(self.scores.seconds[k])

    def __repr__(self) -> str:
        """Return the result in a line."""
        return f"Placement: {self.words}; {len(self.scores.seconds)} bases scored"


def place(
    problem: Problem,
    robot: Robot | str | Path | None = None,
    where: PlaceRange | None = None,
    *,
    out: Path | str | None = None,
    budget: float = BUDGET,
    progress: Progress | None = None,
) -> Placement:
    """Find where the robot should stand: the base pose at which a task is feasible and fastest, proved.

    Base poses about the given one are scored on a map: all places of the task need a free configuration, and the score
    is the least time of straight joint motions through them. The best ones are planned and verified.

    Args:
        problem: the task; its base is the middle of the map.
        robot: another robot than the problem's; it starts in its configuration `ready`, or its first one.
        where: how far the base may be moved and turned; None: 0.4 m along x and y, a quarter turn either way.
        out: folder for the map, a page and the problem with the best base; None: nothing is written.
        budget: s, half of it for the map.
        progress: called with the stage and its fraction.

    Returns:
        The placement: `run` (the shortest verified one), `given`, `moved`, `base`, `scores`.

    Raises:
        InputError: an argument that does not fit, or a problem of several robots: there is no single base to move;
            `out` has a `problem.yaml` that no earlier result left there; or a problem with an `op.Expression` together
            with `out` or another robot: no file holds it.

    Example:
        >>> import optiplan as op
        >>> found = op.place(op.load_problem("12_planar"), where=op.PlaceRange(0.1, 0.1, yaw=0.0, points=2), budget=5)
        >>> found.run.verified
        True
    """
    if not isinstance(problem, Problem) or not problem.source:
        raise wrong_argument("place", "problem", described(problem), "a problem that was read, or made by op.Problem")
    progress_argument("place", progress)
    told = progress or silent
    if not isinstance(robot, Robot | str | Path | None):
        expected = "a Robot, the name of a shipped one, or the path of a robot.yaml"
        raise wrong_argument("place", "robot", described(robot), expected)
    seconds = positive_seconds("place", budget)
    where = _checked(PlaceRange() if where is None else where)
    folder = folder_argument("place", out, RESULT.check)
    if folder is not None:
        file_data(problem, "place")  # else `save` would refuse it once all is planned
    _refuse_several(problem.robot, "problem")
    problem = problem if robot is None else _with_robot(problem, robot)
    _refuse_several(problem.robot, "robot")
    whole = Budget(seconds)
    scores = search_places(problem, where, whole.share(_MAP), told)
    given = plan(problem, budget=_share(whole, 1 + _PLANNED), progress=partial(_quiet, told))
    runs: list[tuple[tuple[float, ...], Run]] = []
    refused: list[tuple[tuple[float, ...], str]] = []
    for count, moved in enumerate(_candidates(scores)):
        told("planning at the best places", count / _PLANNED)
        try:
            own = problem.with_base(_base(problem, moved))
        except InputError as error:  # such as a start that the exact shapes of the verifier's model collide at
            refused.append((moved, "; ".join(f"{one.field}: {one.found}" for one in error.issues)))
            continue
        runs.append((moved, plan(own, budget=_share(whole, _PLANNED - count))))
    runs.sort(key=lambda one: (not one[1].verified, float(one[1].duration or np.inf)))
    found = Placement(problem, scores, given, tuple(runs), tuple(refused))
    if folder is not None:
        found.save(folder)
    return found


def _share(whole: Budget, count: int) -> float:
    """Return the seconds of one of so many plans that are left; at least 1 s, also where the map took all of them."""
    return max(1.0, whole.remaining / count)


def _quiet(progress: Progress, stage: str, fraction: float) -> None:
    progress("planning at the given place", fraction)


def _candidates(scores: PlaceScores) -> list[tuple[float, ...]]:
    """Return the best base poses, apart from each other and from the given one."""
    chosen = [np.zeros(4)]
    for k in scores.ranked():
        if scores.missing[k] or len(chosen) > _PLANNED:
            break
        if all(np.abs(scores.moved[k] - other).max() > _APART for other in chosen):
            chosen.append(scores.moved[k])
    return [tuple(map(float, moved)) for moved in chosen[1:]]


def _base(problem: Problem, moved: Sequence[float]) -> Mapping[str, Any]:
    return pose_to_data(moved_base(problem.robot.mounting.X_WB, np.array(moved)))


def _with_robot(problem: Problem, robot: Robot | str | Path) -> Problem:
    """Return the problem for another robot, at the same base, from its own first configuration."""
    other = robot if isinstance(robot, Robot) else load_robot(str(robot))
    if other.fingerprint == problem.robot.fingerprint:
        return problem
    names = list(other.configurations)
    if not names:
        found = f"{other.name}, which has no named configuration to start in"
        raise wrong_argument("place", "robot", found, "the robot of the problem, or one with `configurations`")
    start = {"configuration": "ready" if "ready" in names else names[0]}
    source = {key: value for key, value in file_data(problem, "place").items() if key not in ("group", "locked")}
    stated = {**source, "robot": other.reference.robot or other.name, "start": start}
    return problem_from_dict(stated).with_seed(problem.seed)


def _refuse_several(robot: Robot, argument: str) -> None:
    """Refuse arms side by side: each has a base of its own."""
    ref = robot.reference.robot
    if ref and several_robots(ref, None) is not None:
        raise wrong_argument("place", argument, "several robots, each with a base of its own", "one robot")


def _checked(where: PlaceRange) -> PlaceRange:
    if not isinstance(where, PlaceRange):
        raise wrong_argument("place", "where", described(where), "an op.PlaceRange")
    for name in ("x", "y", "z", "yaw"):
        most = np.pi if name == "yaw" else 100.0
        expected = "a number >= 0 (yaw: at most pi)"
        number_argument("place", f"where.{name}", getattr(where, name), expected, 0.0, most=most)
    whole_argument("place", "where.points", where.points, 2)
    return replace(where)


def _cells(moved: Sequence[float], score: float, run: Run) -> list[str]:
    planned = "–" if run.duration is None else f"{run.duration:.3f}"
    verified = "yes" if run.verified else "no"
    return [*(f"{value:.3f}" for value in moved), f"{score:.3f}", planned, verified]


def _seconds(run: Run) -> str:
    return f"{run.duration:.3f} s" if run.verified else "no verified motion"
