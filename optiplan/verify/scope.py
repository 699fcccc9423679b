"""Scope of a verdict, in short statements, so that no assumption is silent."""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.messages import some
from optiplan.geometry.file_shapes import Mesh
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.problem import Problem
from optiplan.robot.frames import link_names
from optiplan.robot.loaded_robots import once_for_each
from optiplan.robot.mounting import GRAVITY
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pairs import FILE, count_reasons, reasons_in_words
from optiplan.verify.report import Check
from optiplan.verify.safety_words import safety_scope

HALL = 50.0
"""m; few halls are longer, and a part of 50 mm is as long, if its numbers are taken for metres."""


def scope(problem: Problem, robot: Robot, checks: Sequence[Check]) -> tuple[str, ...]:
    """One statement a subject: pairs, shapes, torque, contacts that robot file and problem allow.

    `robot` is the problem's as it was checked: with other pairs where some of its proofs do not hold.
    """
    return (
        *_pairs(checks),
        *(said for check in checks if check.name == "collision" for said in safety_scope(check.witness)),
        *_tube(problem, checks),
        *_of_the_robot(robot),
        *_moving(problem),
        *_large(problem),
        *_torque(problem, checks),
        *_balance(problem),
        *_allowed(problem),
    )


@once_for_each
def _of_the_robot(robot: Robot) -> tuple[str, ...]:
    """Return what is the same of every motion of a robot."""
    return (*_unchecked(robot), *_shapes(robot), *_mounting(robot))


def _pairs(checks: Sequence[Check]) -> list[str]:
    counts = [check.witness["pairs"] for check in checks if check.name == "collision"]
    return [f"collision: {count} {'pair' if count == 1 else 'pairs'} of bodies" for count in counts]


def _tube(problem: Problem, checks: Sequence[Check]) -> list[str]:
    """Say which checks hold wherever the joints are within the tracking error; the others are of the motion alone."""
    error, revolute = problem.tracking_error, problem.robot.revolute
    if not error.any():
        return []
    from optiplan.verify.constraint_check import in_tube
    from optiplan.verify.joint_constraint_check import title

    sizes = [
        f"{values.min():.4g}{'' if values.min() == values.max() else f' to {values.max():.4g}'} {unit}"
        for unit, values in (("rad", error[revolute]), ("m", error[~revolute]))
        if values.any()
    ]
    stated = [*problem.path_constraints, *(one for step in problem.task for one in step.constraints)]
    held = {"collision", "position", *(title(one) for one in stated if in_tube(one))}
    names = list(dict.fromkeys(check.name for check in checks if check.name in held))
    within = f"hold wherever the joints are within {' and '.join(sizes)} of the motion"
    return [f"tracking error: {len(names)} checks ({', '.join(names)}) {within}; the others hold of the motion alone"]


def _unchecked(robot: Robot) -> list[str]:
    bare = [f"links without geometry, not checked: {', '.join(robot.bare_links)}"] if robot.bare_links else []
    return [reasons_in_words(count_reasons(robot.allowed)), *bare]


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


def _mounting(robot: Robot) -> list[str]:
    """Describe where the robot stands and what pulls at it, where that is not the usual."""
    X_WB, gravity, said = robot.mounting.X_WB, robot.mounting.gravity, []
    if not np.array_equal(X_WB.homogeneous, np.eye(4)):
        said.append(f"base at {_vector(X_WB.translation)} m, rpy {_vector(pin.rpy.matrixToRpy(X_WB.rotation))} rad")
    if tuple(gravity) != GRAVITY:
        said.append(f"gravity {_vector(gravity)} m/s²")
    return said


def _moving(problem: Problem) -> list[str]:
    """Name the obstacles that move, as stated, and when."""
    names = [body.name for body in problem.scene.dynamic_obstacles]
    return [f"moving as stated while the robot moves: {', '.join(names)}"] if names else []


def _large(problem: Problem) -> list[str]:
    """Name the obstacles that a mesh in millimetres makes a thousand times too large: nothing then touches them."""
    large = []
    for one in problem.scene.obstacles:
        if isinstance(one.shape, Mesh):
            with suppress(ValueError):  # the file is gone by now: what was checked is kept elsewhere
                box = one.shape.body().aabb_local
                size = max(box.width(), box.height(), box.depth())
                large += [f"{one.name} ({size:.3g} m)"] if size > HALL else []
    said = f"meshes that look like millimetres: those of {some(large, 3)}; `scale: 0.001` turns them into metres"
    return [said] if large else []


def _vector(values: Array) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in values)}]"


def _torque(problem: Problem, checks: Sequence[Check]) -> list[str]:
    """Describe how far torques are known, from the check itself."""
    check = next((check for check in checks if check.name == "torque"), None)
    if check is None:
        return []
    if check.kind == "unchecked":
        return [f"torque: not checked, {check.detail}"]
    held = _carried(problem)
    light = problem.robot.massless_links
    names = f"; without masses of their own: {', '.join(light)}" if light else ""
    return [f"torque: at all times, without friction{held}{names}"]


def _balance(problem: Problem) -> list[str]:
    """Name what counts as one where it must not tip over, and what of it weighs nothing."""
    stated = [*problem.path_constraints, *(one for step in problem.task for one in step.constraints)]
    if not any(isinstance(one, TipOver) for one in stated):
        return []
    robot = problem.robot
    links = link_names(robot.model)
    arms = sorted({link.partition("/")[0] for link in links}) if all("/" in link for link in links) else []
    base = [] if robot.model.inertias[0].mass > 0.0 or robot.mecanum is not None else ["the base"]
    light = ", ".join([*base, *robot.massless_links])
    said = [
        *([f"{' and '.join(arms)} together, as on one base"] if len(arms) > 1 else []),
        *(["on corners that stand still while the base drives"] if robot.mecanum is not None else []),
        *([f"without masses: {light}"] if light else []),
    ]
    return [f"tip over: {'; '.join(said)}"] if said else []


def _carried(problem: Problem) -> str:
    weights = {held.name: held.mass or 0.0 for held in problem.scene.attached}
    if not any(weights.values()):
        return ", attached objects weigh nothing" if weights else ""
    return ", with " + ", ".join(f"{name} of {mass:g} kg" for name, mass in weights.items())


def _allowed(problem: Problem) -> list[str]:
    """Describe the contacts allowed by robot file and problem: allowed pairs, and contacts of attached objects."""
    declared = [f"{a} – {b}" for (a, b), reason in problem.robot.allowed.items() if reason == FILE]
    own = [f"contacts allowed by the robot file, not checked: {', '.join(declared)}"] if declared else []
    pairs = {" – ".join(sorted(pair)) for pair in problem.scene.allowed}
    pairs |= {" – ".join(sorted((held.name, link))) for held in problem.scene.attached for link in held.touch}
    return [*own, *([f"contacts allowed by the problem, not checked: {', '.join(sorted(pairs))}"] if pairs else [])]
