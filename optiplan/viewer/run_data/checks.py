"""Verdict of one run for the page: every check in figures, and what the verdict is about."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from optiplan.collision.bodies_and_pairs import with_asked_checked
from optiplan.problem.problem import Problem
from optiplan.robot.self_collision.pairs import WORDS
from optiplan.verify.report import jsonable
from optiplan.viewer.run_data.curves import short_names

FIELDS = ("name", "kind", "passed", "worst", "limit", "unit", "time", "place", "detail")


def checks_of(problem: Problem, report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Every check with its `share` of the limit (None where there is none), the `joint` and the `pair` it names."""
    return [_check(problem, check) for check in report.get("checks", ())]


def about(problem: Problem, report: Mapping[str, Any]) -> dict[str, Any]:
    """What the verdict is about: `statements`, `geometry` of each link, and `unchecked` pairs by reason."""
    reasons: dict[str, list[str]] = {}
    for (a, b), reason in sorted(with_asked_checked(problem.scene.safety, problem.robot).allowed.items()):
        kind, _, own = reason.partition(": ")
        reasons.setdefault(f"{WORDS.get(kind, kind)}{f' ({own})' if own else ''}", []).append(f"{a} – {b}")
    allowed = [" – ".join(sorted(pair)) for pair in problem.scene.allowed]
    if allowed:
        reasons["allowed by the problem"] = sorted(allowed)
    geometry = {str(link): str(kind).replace("_", " ") for link, kind in (report.get("link_geometry") or {}).items()}
    return {
        "statements": [str(statement) for statement in report.get("scope", ())],
        "notes": [str(note) for note in report.get("notes", ())],
        "geometry": geometry,
        "over_cover": jsonable(report.get("over_cover") or {}),
        "unchecked": reasons,
    }


def _check(problem: Problem, check: Mapping[str, Any]) -> dict[str, Any]:
    shown: dict[str, Any] = {key: jsonable(check.get(key)) for key in FIELDS}
    names = list(problem.robot.joint_names)
    place = check.get("place")
    shown["joint"] = short_names(names)[names.index(place)] if place in names else None
    shown["share"] = _share(problem, check)
    witness = check.get("witness") or {}
    shown["pair"] = [str(name) for name in witness.get("pair") or ()]
    shown["proved"], shown["met"] = witness.get("proved_clearance"), witness.get("met_clearance")
    shown["own"], shown["scene"] = witness.get("self_clearance"), witness.get("scene_clearance")
    return shown


def _share(problem: Problem, check: Mapping[str, Any]) -> float | None:
    """The worst value as a share of its limit, 1 at the limit; a position as a share of the way from the middle."""
    worst, limit, place = check.get("worst"), check.get("limit"), check.get("place")
    if worst is None or limit is None or check.get("name") == "collision":
        return None
    if check.get("name") == "position":
        if place not in problem.robot.joint_names:
            return None
        j = problem.robot.joint_names.index(place)
        low, high = float(problem.limits.lower[j]), float(problem.limits.upper[j])
        finite = bool(np.isfinite([low, high]).all()) and high > low
        return abs(worst - 0.5 * (low + high)) / (0.5 * (high - low)) if finite else None
    return float(worst) / float(limit) if limit > 0.0 else None
