"""Forward kinematics and Jacobian of a small arm as text to read: c1 s23 - 0.15 c1, from the symbolic twin."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np

from optiplan.errors import OptiPlanError
from optiplan.kinematics.symbolic.functions import SymbolicRobot
from optiplan.kinematics.symbolic.trig_polynomial import Polynomial, Powers, trig_polynomial
from optiplan.robot.robot import Robot

MOST_JOINTS = 6
ROUNDING = 1e-9
"""Of a coefficient, m or 1: angles of a URDF have a dozen digits, and leave less than this where a zero is meant."""
LEGEND = "c1 = cos q1, s23 = sin(q2 + q3), c2-3 = cos(q2 - q3); lengths in m"

Addend = tuple[float, tuple[str, ...]]
"""Coefficient and factors; a factor is a word such as c23, or a sum in parentheses."""
Sinusoid = tuple[str, tuple[int, ...]]
"""("c" or "s", k): cosine or sine of sum k_i q_i over the joints of a block."""


@dataclass(frozen=True)
class SymbolicText:
    """Pose X_WF (4 rows of 4) and Jacobian in world axes (6 rows of n, linear first) of a frame F, as text."""

    pose: list[list[str]]
    jacobian: list[list[str]]


def symbolic_text(robot: Robot, frame: str) -> SymbolicText:
    """Text of every element. Angles of neighbouring joints with parallel axes are added up: c23, not c2 c3 - s2 s3.

    Raises:
        OptiPlanError: more than six joints, or joints that follow others: too long to be read.
        UnknownChoiceError: there is no such frame.
    """
    robot.frame_id(frame)
    if robot.n > MOST_JOINTS or robot.followers:
        found = f"{robot.n} joints" + (" and some that follow them" if robot.followers else "")
        raise OptiPlanError(
            f"symbolic kinematics of '{robot.name}': found {found}; expected at most {MOST_JOINTS} joints, as of"
            " planar2r, srra, puma560 or ur5 (a smaller --group will do); for longer arms:"
            " optiplan.kinematics.symbolic.functions.SymbolicRobot"
        )
    import casadi

    q = casadi.SX.sym("q", robot.n)
    names = tuple(q[i].name() for i in range(robot.n))
    blocks, twin = parallel_blocks(robot), SymbolicRobot(robot.model, machine_code=False)

    def rows(matrix: Any) -> list[list[str]]:
        """Text of a CasADi matrix."""
        known: dict[int, Polynomial] = {}  # of this matrix only: nodes have no identity beyond their lives
        cells = [
            [trig_polynomial(matrix[i, j], names, known) for j in range(matrix.shape[1])]
            for i in range(matrix.shape[0])
        ]
        return [[as_text(cell, blocks) for cell in row] for row in cells]

    return SymbolicText(rows(twin.pose(frame)(q)), rows(twin.jacobian(frame)(q)))


def parallel_blocks(robot: Robot) -> list[list[int]]:
    """Joints in order, neighbours that turn about parallel axes in one block."""
    kinematics = robot.kinematics
    axes = kinematics.axes(kinematics.poses(np.full((1, robot.n), 0.5)))[0][0]
    blocks = [[0]]
    for i, j in pairwise(range(robot.n)):
        parallel = np.linalg.norm(np.cross(axes[i], axes[j])) < ROUNDING
        if parallel and robot.revolute[i] and robot.revolute[j]:
            blocks[-1].append(j)
        else:
            blocks.append([j])
    return blocks


def as_text(polynomial: Polynomial, blocks: list[list[int]]) -> str:
    """A polynomial as text, common factors of the first blocks put before parentheses; 0 for none."""
    terms: dict[tuple[str, ...], float] = defaultdict(float)
    for powers, coefficient in polynomial.items():
        for choice in product(*(_block_terms(powers, block) for block in blocks)):
            terms[tuple(word for word, _ in choice)] += coefficient * float(np.prod([value for _, value in choice]))
    return _sum_text(_factored((words, value) for words, value in terms.items() if abs(value) > ROUNDING))


def _block_terms(powers: Powers, block: list[int]) -> list[tuple[str, float]]:
    """What the joints of one block contribute to a product: words, "" for 1, and their coefficients."""
    if len(block) == 1:
        c, s, slide = powers[3 * block[0] : 3 * block[0] + 3]
        joint = block[0] + 1
        return [("*".join([f"c{joint}"] * c + [f"s{joint}"] * s + [f"q{joint}"] * slide), 1.0)]
    found: dict[Sinusoid, float] = {("c", (0,) * len(block)): 1.0}
    for place, joint in enumerate(block):
        cosines, sines, _ = powers[3 * joint : 3 * joint + 3]
        for kind in "c" * cosines + "s" * sines:
            found = _times(found, kind, place)
    return [(_word(wave, block), value) for wave, value in found.items()]


def _times(waves: dict[Sinusoid, float], kind: str, place: int) -> dict[Sinusoid, float]:
    """A sum of sinusoids of A times cos B or sin B, by formulas such as 2 cos A cos B = cos(A+B) + cos(A-B)."""
    result: dict[Sinusoid, float] = defaultdict(float)
    for (first, k), value in waves.items():
        for step in (1, -1):  # A + B, then A - B
            sign = {"cc": 1, "sc": 1, "cs": step, "ss": -step}[first + kind]
            angle = tuple(x + step * (i == place) for i, x in enumerate(k))
            lead = next((x for x in angle if x), 0)
            wave = "s" if first != kind else "c"
            if lead < 0:  # cos(-A) = cos A, sin(-A) = -sin A
                angle, sign = tuple(-x for x in angle), -sign if wave == "s" else sign
            if lead or wave == "c":
                result[wave, angle] += 0.5 * sign * value
    return {wave: value for wave, value in result.items() if value}


def _word(wave: Sinusoid, block: list[int]) -> str:
    """c23 for cos(q2 + q3), s2-3 for sin(q2 - q3), c22 for cos(2 q2)."""
    kind, angle = wave
    parts = [("-" if x < 0 else "") + str(joint + 1) * abs(x) for x, joint in zip(angle, block, strict=True) if x]
    return kind + "".join(parts) if parts else ""


def _factored(terms: Iterable[tuple[tuple[str, ...], float]]) -> list[Addend]:
    """Terms, each words of the blocks and a coefficient, as addends that share the first block's word."""
    shared: dict[str, list[tuple[tuple[str, ...], float]]] = defaultdict(list)
    addends: list[Addend] = []
    for words, value in terms:
        if words:
            shared[words[0]].append((words[1:], value))
        else:
            addends.append((value, ()))
    for word, rest in sorted(shared.items(), key=lambda item: (item[0] == "", item[0])):
        inner = _factored(rest)
        if not word:
            addends += inner
        elif len(inner) == 1:
            addends.append((inner[0][0], (word, *inner[0][1])))
        else:
            common = inner[0][0] if len({abs(round(value, 9)) for value, _ in inner}) == 1 else np.sign(inner[0][0])
            bracket = _sum_text([(value / common, factors) for value, factors in inner])
            addends.append((float(common), (word, f"({bracket})")))
    return addends


def _sum_text(addends: list[Addend]) -> str:
    text = ""
    for value, factors in addends:
        size = f"{round(abs(value), 9):.9g}"
        body = "*".join(factors if size == "1" and factors else (size, *factors))
        text += (" - " if value < 0 else " + ") + body if text else ("-" if value < 0 else "") + body
    return text or "0"
