"""Limits of the planned joints: from the robot.yaml, else from the URDF, else default values with a note."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags, ReadOnlyArrays, read_only
from optiplan.config.document import Document
from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue
from optiplan.records import dataclass
from optiplan.robot.joint_groups import Group, Reduced
from optiplan.robot.mimic_joints import turning
from optiplan.robot.spec import LimitsSpec
from optiplan.robot.urdf.reader import UrdfSource

DEFAULTS = {"velocity": 1.0, "acceleration": 10.0, "jerk": 500.0, "torque": np.inf}
ORDERS = ("position", "velocity", "acceleration", "jerk")
"""Limited quantities by the order of the derivative."""

_STATED = {"velocity": ("velocity",), "acceleration": ("acceleration", "deceleration"), "jerk": ("jerk",)}
"""Attributes of a URDF's <limit>; all but `velocity` are of URDF 1.2."""

UNBOUNDED = 1e6
"""m, stroke of a joint without bounds."""

_PER_SECOND = dict(zip(ORDERS, ("", "/s", "/s²", "/s³"), strict=True))


def joint_unit(quantity: str, revolute: bool) -> str:
    """Return the unit of a quantity of `ORDERS`, or of `torque`, for a revolute or a prismatic joint."""
    if quantity == "torque":
        return "N·m" if revolute else "N"
    return ("rad" if revolute else "m") + _PER_SECOND[quantity]


def joint_units(quantity: str, revolute: Iterable[bool] = (True, False)) -> str:
    """Return the units of a quantity of several joints, each once; by default the units of all kinds of joints."""
    kinds = {bool(turns) for turns in revolute}
    return " or ".join(joint_unit(quantity, turns) for turns in (True, False) if turns in kinds)


@dataclass(frozen=True, eq=False)
class Limits(ReadOnlyArrays):
    """Bounds of the planned joints, each of shape (n,), in rad or m and seconds; torque in N·m or N.

    `lower` and `upper` are -inf and inf for joints that turn without end. The arrays are copied and made read-only:
    proofs are made with them once and kept.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array

    def __post_init__(self) -> None:
        for one in fields(self):
            object.__setattr__(self, one.name, read_only(np.array(getattr(self, one.name))))

    @property
    def rates(self) -> tuple[Array, Array, Array]:
        """Limits of the derivatives of order 1, 2 and 3: velocity, acceleration and jerk."""
        return self.velocity, self.acceleration, self.jerk

    @property
    def stroke(self) -> Array:
        """How far each joint is from 0 at most (n,), rad or m; `UNBOUNDED` of one without bounds."""
        return np.minimum(np.maximum(np.abs(self.lower), np.abs(self.upper)), UNBOUNDED)

    def outside(self, Q: Array, off: Array | float = 0.0) -> Flags:
        """Return which positions of Q (..., n), rad or m, may be outside where they are `off` by up to so much.

        A negative `off` is a tolerance. NaN is outside.
        """
        inside: Flags = (Q - off >= self.lower) & (Q + off <= self.upper)
        return ~inside

    def range_about(self, low: Array | float, high: Array | float) -> tuple[Array, Array]:
        """Return position limits (n,), (n,), rad or m; π below `low` and above `high` where a joint has none."""
        lower = np.where(np.isfinite(self.lower), self.lower, low - np.pi)
        return lower, np.where(np.isfinite(self.upper), self.upper, high + np.pi)

    def of_joints(self, kept: Sequence[int]) -> "Limits":
        """Return the limits of some joints, by index."""
        return Limits(*(getattr(self, one.name)[list(kept)] for one in fields(self)))

    def scaled(
        self, velocity: float = 1.0, acceleration: float = 1.0, jerk: float | str = 1.0, torque: float = 1.0
    ) -> "Limits":
        """Return these limits times fractions; `jerk` "none" removes the limits of jerk."""
        return replace(
            self,
            velocity=self.velocity * velocity,
            acceleration=self.acceleration * acceleration,
            jerk=self.jerk * (np.inf if isinstance(jerk, str) else jerk),
            torque=self.torque * torque,
        )


def thousandths(revolute: Iterable[bool]) -> str:
    """Return the units of a thousandth of the positions of several joints: mrad, mm, or both."""
    return " or ".join(f"m{unit}" for unit in joint_units("position", revolute).split(" or "))


def build_limits(
    spec: LimitsSpec, document: Document, urdf: UrdfSource, reduced: Reduced, group: Group
) -> tuple[Limits, list[str]]:
    """Return the limits of the joints of a model reduced to `group`, and notes on every default value.

    The limits of followers restrict their leader: lower_f <= m q + o <= upper_f, and |m| v <= v_f, so for acceleration
    and jerk, where the leader's are the URDF's; those of the robot.yaml replace both. Torque is the generalised force
    tau + sum m tau_f of the leader's drive; a follower has no drive.

    Raises:
        InputError: wrong sizes, values that are not positive.
    """
    issues: list[Issue] = []
    notes: list[str] = []
    model, names = reduced.model, list(group.joints)
    own = {key: _narrowed_rates(keys, urdf, reduced, names) for key, keys in _STATED.items()}
    own["torque"] = model.upperEffortLimit
    values: dict[str, Array] = {}
    for key in DEFAULTS:
        given = getattr(spec, key)
        if given is None or isinstance(given, dict):
            stated = _by_name(key, given or {}, own.get(key), document, issues, group)
            values[key] = _from_urdf(key, stated, reduced.model, names, notes)
        else:
            values[key] = _from_yaml(key, given, document, issues, group)
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    plain = reduced.plain
    for name in (*names, *reduced.followers):
        k = plain.joints[plain.getJointId(name)].idx_q
        if plain.lowerPositionLimit[k] > plain.upperPositionLimit[k]:
            found = f"joint {name} with a lower limit above the upper"
            issues.append(document.issue(("urdf",), found, "lower <= upper"))
    if not issues:
        _narrow_positions(reduced, names, (lower, upper), notes)
    for name in (name for name, width in zip(names, upper - lower, strict=True) if width < 0 and not issues):
        found = f"joint {name}, which the limits of the joints that follow it leave no position"
        issues.append(document.issue(("urdf",), found, "limits that overlap"))
    if issues:
        raise InputError(issues)
    stuck = [name for name, width in zip(names, upper - lower, strict=True) if width <= 0]
    if stuck:
        notes.append(f"the URDF's position limits leave no room to {', '.join(stuck)}")
    return Limits(lower, upper, values["velocity"], values["acceleration"], values["jerk"], values["torque"]), notes


def _narrow_positions(reduced: Reduced, names: list[str], limits: tuple[Array, Array], notes: list[str]) -> None:
    """Shrink the lower and upper position limits (n,), in place, so that every follower is within its own limits."""
    lower, upper = limits
    for name, mimic in reduced.followers.items():
        k, j = reduced.plain.joints[reduced.plain.getJointId(name)].idx_q, names.index(mimic.source)
        own = reduced.plain.lowerPositionLimit[k], reduced.plain.upperPositionLimit[k]
        low, high = sorted((end - mimic.offset) / mimic.multiplier for end in own)
        if low > lower[j] or high < upper[j]:
            lower[j], upper[j] = max(low, lower[j]), min(high, upper[j])
            notes.append(f"joint {mimic.source} stays within [{lower[j]:g}, {upper[j]:g}], for {name} that follows it")


def _narrowed_rates(keys: Sequence[str], urdf: UrdfSource, reduced: Reduced, names: list[str]) -> Array:
    """Return the URDF's limits of a rate (n,), each at most x_f / |m| of every follower; 0 where none is given."""
    values = np.array([urdf.limit(name, *keys) for name in names])
    for name, mimic in reduced.followers.items():
        own, j = urdf.limit(name, *keys) / abs(mimic.multiplier), names.index(mimic.source)
        if own > 0.0:
            values[j] = min(values[j], own) if values[j] > 0.0 else own
    return values


def _by_name(
    key: str, given: Mapping[str, float], own: Array | None, document: Document, issues: list[Issue], group: Group
) -> Array | None:
    """Return the URDF's values (n,) with those of some joints replaced; 0 where nothing is stated."""
    for name, value in given.items():
        if name not in group.listed:
            found, expected = f"unknown joint '{name}'", choices(name, group.listed)
            issues.append(document.issue(("limits", key, name), found, expected))
        elif value <= 0:
            issues.append(document.issue(("limits", key, name), f"{value:g}", "a number > 0"))
    if not given:
        return own
    values = np.zeros(len(group.joints)) if own is None else np.array(own, dtype=np.float64)
    return np.array([given.get(name, value) for name, value in zip(group.joints, values, strict=True)])


def _from_yaml(key: str, given: float | list[float], document: Document, issues: list[Issue], group: Group) -> Array:
    n = len(group.listed)
    listed = given if isinstance(given, list) else [given] * n
    if len(listed) != n:
        issues.append(document.issue(("limits", key), f"a list of {len(listed)} values", f"{n}, one a planned joint"))
    for index, value in enumerate(listed):
        if value <= 0:
            place = ("limits", key, index) if isinstance(given, list) else ("limits", key)
            issues.append(document.issue(place, f"{value:g}", "a number > 0"))
    return group.pick(listed) if len(listed) == n else np.ones(len(group.joints))


def _from_urdf(key: str, own: Array | None, model: pin.Model, names: list[str], notes: list[str]) -> Array:
    default = DEFAULTS[key]
    values = np.full(len(names), default) if own is None else np.array(own, dtype=np.float64)
    missing = np.ones(len(names), bool) if own is None else ~(np.isfinite(values) & (values > 0))
    values[missing] = default
    if missing.any():
        which = "any joint" if missing.all() else ", ".join(name for name, no in zip(names, missing, strict=True) if no)
        kinds = turning(model)[[model.getJointId(name) - 1 for name in names]]
        taken = "no limit" if np.isinf(default) else f"{default:g} {joint_units(key, kinds[missing])}"
        notes.append(f"no {key} limit is given for {which}: {taken} is taken")
    return values
