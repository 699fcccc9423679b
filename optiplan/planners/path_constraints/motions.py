"""Constraints of speeds, accelerations and joints, as inequalities: one function for each kind of statement."""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from optiplan.kinematics.mecanum import Mecanum
from optiplan.kinematics.symbolic.state import SymbolicState
from optiplan.planners.path_constraints.inequality import Inequality
from optiplan.planners.path_constraints.parts import ANGLE, LENGTH, both_sides, held_to, stacked
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.constraints.motions import (
    JointCoupling,
    ManipulabilityAbove,
    ToolAcceleration,
    ToolSpeed,
    WheelSpeed,
)

_SPEED_RESERVE = 0.003
"""Share of a speed or acceleration reserved for the motion between samples."""


_MARGIN_RESERVE = 0.002
"""m of a tip-over margin, times F_z as a share of the weight, reserved for the motion between samples."""


def _tool_speed(one: ToolSpeed) -> list[Inequality]:
    return _tool_rate(one, "tool speed", lambda k: k.twist(one.frame), 1)


def _acceleration(one: ToolAcceleration) -> list[Inequality]:
    return _tool_rate(one, "tool acceleration", lambda k: k.acceleration(one.frame), 2)


def _tool_rate(
    one: ToolSpeed | ToolAcceleration, name: str, of: Callable[[SymbolicState], Any], rate: Literal[1, 2]
) -> list[Inequality]:
    """(1 - r²) / 2 with the linear and the angular part r of a rate of the tool, as shares of their limits."""

    def share(which: str, limit: float) -> Callable[[SymbolicState], Any]:
        def build(k: SymbolicState) -> Any:
            part = getattr(of(k), which) / k.constant(limit)
            return 0.5 * (1.0 - part.T @ part)

        return build

    return [
        Inequality(name, share(which, limit), 0.25, rate * _SPEED_RESERVE, rate=rate)
        for which, limit in (("linear", one.linear), ("angular", one.angular))
        if np.isfinite(limit)
    ]


def _wheels(one: WheelSpeed) -> list[Inequality]:
    def build(k: SymbolicState) -> Any:
        spec = k.robot.mecanum
        if spec is None:
            raise TypeError(f"{k.robot.name} has no wheels")
        x, y, turn = (list(k.robot.joint_names).index(name) for name in spec.joints)
        matrix = k.constant(Mecanum(spec.radius, spec.half_wheelbase, spec.half_track).matrix)
        cosine, sine = k.cos(k.q[turn]), k.sin(k.q[turn])
        ahead, aside = cosine * k.v[x] + sine * k.v[y], cosine * k.v[y] - sine * k.v[x]
        share = matrix @ stacked(ahead, aside, k.v[turn]) / k.constant(one.at_most)
        return 0.5 * (1.0 - share * share)

    return [Inequality("wheel speed", build, 0.25, _SPEED_RESERVE, rate=1)]


def _manipulability(one: ManipulabilityAbove) -> list[Inequality]:
    least = one.at_least

    def build(k: SymbolicState) -> Any:
        return k.manipulability(one.frame) - k.constant(least)

    return [Inequality("manipulability", build, 0.2 * least, 0.01 * least)]


def _coupling(one: JointCoupling) -> list[Inequality]:
    def build(k: SymbolicState) -> Any:
        off = sum(k.constant(weight) * k.joint(name) for name, weight in one.joints.items()) - k.constant(one.equals)
        return both_sides(k, off, one.within)

    return [held_to("coupling", build, one.within, ANGLE)]


def _tip_over(one: TipOver) -> list[Inequality]:
    def build(k: SymbolicState) -> Any:
        mass = sum(body.mass for body in k.robot.model.inertias)
        weight = max(mass * float(np.linalg.norm(k.robot.model.gravity.linear)), 1e-9)
        return k.constant(one.polygon.rows(one.margin) / weight) @ k.base_wrench()

    return [Inequality("tip over", build, LENGTH, _MARGIN_RESERVE)]


KINDS: dict[type[Any], Callable[[Any], list[Inequality]]] = {
    ToolSpeed: _tool_speed,
    ToolAcceleration: _acceleration,
    WheelSpeed: _wheels,
    ManipulabilityAbove: _manipulability,
    JointCoupling: _coupling,
    TipOver: _tip_over,
}
"""The inequalities of each kind of statement."""
