"""Scope of a verdict, in short statements, so that no assumption is silent."""

from collections import Counter
from collections.abc import Sequence

from optiplan.problem.problem import Problem
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pairs import FILE, count_reasons, reasons_in_words
from optiplan.verify.report import Check


def scope(problem: Problem, robot: Robot, checks: Sequence[Check]) -> tuple[str, ...]:
    """One statement a subject: pairs, shapes, torque, contacts that robot file and problem allow.

    `robot` is the problem's as it was checked: with other pairs where some of its proofs do not hold.
    """
    return (*_pairs(robot, checks), *_shapes(robot), *_torque(problem, checks), *_allowed(problem))


def _pairs(robot: Robot, checks: Sequence[Check]) -> list[str]:
    counts = [check.witness["pairs"] for check in checks if check.name == "collision"]
    found = [f"collision: {count} {'pair' if count == 1 else 'pairs'} of bodies" for count in counts]
    bare = [f"links without geometry, not checked: {', '.join(robot.bare_links)}"] if robot.bare_links else []
    return [*found, reasons_in_words(count_reasons(robot.allowed)), *bare]


def _shapes(robot: Robot) -> list[str]:
    """Describe the geometry of the links; exceptions by name."""
    geometry = robot.link_geometry
    parts: list[str] = []
    for kind, count in Counter(geometry.values()).most_common():
        names = [link for link, own in geometry.items() if own == kind]
        who = f" ({', '.join(names)})" if parts and count <= 3 else ""
        parts.append(f"{count} as {kind.replace('_', ' ')}{who}")
    beyond = max(robot.over_cover.values(), default=0.0)
    cover = f"; at most {beyond * 1e3:.2g} mm beyond their meshes" if beyond > 0.0 else ""
    return [f"shapes of links: {', '.join(parts)}{cover}"] if parts else []


def _torque(problem: Problem, checks: Sequence[Check]) -> list[str]:
    """Describe how far torques are known, from the check itself."""
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
    """Describe the contacts allowed by robot file and problem: allowed pairs, and contacts of attached objects."""
    declared = [f"{a} – {b}" for (a, b), reason in problem.robot.allowed.items() if reason == FILE]
    own = [f"contacts allowed by the robot file, not checked: {', '.join(declared)}"] if declared else []
    pairs = {" – ".join(sorted(pair)) for pair in problem.scene.allowed}
    pairs |= {" – ".join(sorted((held.name, link))) for held in problem.scene.attached for link in held.touch}
    return [*own, *([f"contacts allowed by the problem, not checked: {', '.join(sorted(pairs))}"] if pairs else [])]
