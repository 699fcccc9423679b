"""What a verdict is about: said beside it, in short statements, so that nothing is assumed silently."""

from collections import Counter
from collections.abc import Sequence

from optiplan.problem.problem import Problem
from optiplan.verify.report import Check


def scope(problem: Problem, checks: Sequence[Check]) -> tuple[str, ...]:
    """One statement a subject: pairs, shapes, torque, contacts that the problem allows."""
    return (*_pairs(checks), *_shapes(problem), *_torque(problem, checks), *_allowed(problem))


def _pairs(checks: Sequence[Check]) -> list[str]:
    return [f"collision: {check.witness['pairs']} pairs of bodies" for check in checks if check.name == "collision"]


def _shapes(problem: Problem) -> list[str]:
    """What stands for the links; the few that are unlike the others by name."""
    geometry = problem.robot.link_geometry
    parts: list[str] = []
    for kind, count in Counter(geometry.values()).most_common():
        names = [link for link, own in geometry.items() if own == kind]
        who = f" ({', '.join(names)})" if parts and count <= 3 else ""
        parts.append(f"{count} as {kind.replace('_', ' ')}{who}")
    return [f"shapes of links: {', '.join(parts)}"] if parts else []


def _torque(problem: Problem, checks: Sequence[Check]) -> list[str]:
    """How far torques are known, from the check itself."""
    check = next((check for check in checks if check.name == "torque"), None)
    if check is None:
        return []
    if check.kind == "unchecked":
        return [f"torque: not checked, {check.detail}"]
    held = ", attached objects weigh nothing" if problem.scene.attached else ""
    light = problem.robot.massless_links
    names = f"; without masses of their own: {', '.join(light)}" if light else ""
    return [f"torque: at all times, without friction{held}{names}"]


def _allowed(problem: Problem) -> list[str]:
    """Which contacts the problem waves through: allowed pairs, and what attached objects may touch."""
    pairs = {" – ".join(sorted(pair)) for pair in problem.scene.allowed}
    pairs |= {" – ".join(sorted((held.name, link))) for held in problem.scene.attached for link in held.touch}
    return [f"contacts allowed by the problem, not checked: {', '.join(sorted(pairs))}"] if pairs else []
