"""Forward kinematics and Jacobian of a small arm as text to read: c1 s23 - 0.15 c1, from the symbolic twin."""

from collections import defaultdict
from collections.abc import Iterable
from itertools import pairwise, product
from math import prod
from operator import add
from typing import Any

import numpy as np

from optiplan.errors import OptiPlanError
from optiplan.kinematics.symbolic.functions import SymbolicRobot
from optiplan.records import dataclass
from optiplan.robot.robot import Robot

MOST_JOINTS = 6
ROUNDING = 1e-9
"""Of a coefficient, m or 1: angles of a URDF have a dozen digits, and leave less than this where a zero is meant."""
LEGEND = "c1 = cos q1, s23 = sin(q2 + q3), c2-3 = cos(q2 - q3); lengths in m"

Addend = tuple[float, tuple[str, ...]]
"""Coefficient and factors; a factor is a word such as c23, or a sum in parentheses."""
Exponents = tuple[int, ...]
"""(k_1, m_1, k_2, …) of the product of exp(i k_j q_j) q_j^m_j over all joints."""
Waves = dict[Exponents, complex]
"""Coefficient of each such product: cos q = (exp(i q) + exp(-i q)) / 2, so equal functions have equal sums."""


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
        known: dict[int, Waves] = {}  # of this matrix only: nodes have no identity beyond their lives
        cells = [
            [multiplied_out(matrix[i, j], names, known) for j in range(matrix.shape[1])] for i in range(matrix.shape[0])
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


def as_text(waves: Waves, blocks: list[list[int]]) -> str:
    """A sum of waves as text, common factors of the first blocks put before parentheses; 0 for none."""
    terms: dict[tuple[str, ...], float] = defaultdict(float)
    for exponents, value in waves.items():
        for choice in product(*(_block_words(exponents, block) for block in blocks)):
            terms[tuple(word for word, _ in choice)] += (value * prod(factor for _, factor in choice)).real
    return _sum_text(_factored((words, value) for words, value in terms.items() if abs(value) > ROUNDING))


def _block_words(exponents: Exponents, block: list[int]) -> list[tuple[str, complex]]:
    """exp(i k·q) q^m of one block as c23 + i s23, or q4: words, "" for 1, and their coefficients."""
    angle = [(joint + 1, exponents[2 * joint]) for joint in block if exponents[2 * joint]]
    if not angle:
        return [("*".join(f"q{joint + 1}" for joint in block for _ in range(exponents[2 * joint + 1])), 1.0)]
    sign = 1 if angle[0][1] > 0 else -1  # cos(-A) = cos A, sin(-A) = -sin A
    name = "".join(("-" if sign * k < 0 else "") + str(joint) * abs(k) for joint, k in angle)
    return [(f"c{name}", 1.0), (f"s{name}", sign * 1j)]


def multiplied_out(expression: Any, names: tuple[str, ...], known: dict[int, Waves]) -> Waves:
    """A scalar CasADi SX of sums, products, and sines and cosines of symbols, multiplied out.

    Args:
        expression: the scalar.
        names: of the symbols, in the order of the joints.
        known: what has been multiplied out before, by the hash of the node; filled.

    Raises:
        ValueError: another operation, or the sine or cosine of something else than a symbol.
    """
    key = expression.element_hash()
    if key not in known:
        known[key] = _expand(expression, names, known)
    return known[key]


def _expand(expression: Any, names: tuple[str, ...], known: dict[int, Waves]) -> Waves:
    import casadi

    def power(symbol: Any, place: int, exponent: int) -> Exponents:
        at = 2 * names.index(symbol.name()) + place
        return tuple(exponent * (k == at) for k in range(2 * len(names)))

    if expression.is_constant():
        return _collected([((0,) * (2 * len(names)), complex(float(expression)))])
    if expression.is_symbolic():
        return {power(expression, 1, 1): 1.0}
    operation = expression.op()
    if operation in (casadi.OP_COS, casadi.OP_SIN) and expression.dep(0).is_symbolic():
        half = 0.5 + 0.0j if operation == casadi.OP_COS else -0.5j
        return {power(expression.dep(0), 0, 1): half, power(expression.dep(0), 0, -1): half.conjugate()}
    parts = [multiplied_out(expression.dep(k), names, known) for k in range(expression.n_dep())]
    if operation in (casadi.OP_MUL, casadi.OP_SQ):
        pairs = product(parts[0].items(), parts[-1].items())
        return _collected((tuple(map(add, a, b)), x * y) for (a, x), (b, y) in pairs)
    factors = {casadi.OP_ADD: (1, 1), casadi.OP_SUB: (1, -1), casadi.OP_NEG: (-1,), casadi.OP_TWICE: (2,)}
    if operation not in factors:
        raise ValueError(f"'{expression}' is not a sum or product of sines and cosines of joint angles")
    scaled = zip(factors[operation], parts, strict=True)
    return _collected((exponents, factor * value) for factor, part in scaled for exponents, value in part.items())


def _collected(terms: Iterable[tuple[Exponents, complex]]) -> Waves:
    found: Waves = defaultdict(complex)
    for exponents, value in terms:
        found[exponents] += value
    return {exponents: value for exponents, value in found.items() if value}


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
