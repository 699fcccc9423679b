"""Safety distance of a scene: how far bodies stay apart, beyond not touching."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from optiplan.arrays import Array, is_listed, number_argument
from optiplan.errors import described, wrong_argument
from optiplan.records import dataclass

MOST = 1.0
"""m: a larger distance is a slip of the pen (millimetres for metres), and leaves an arm no room."""

WISHED = 0.005
"""m: the distance that is wished where a problem says nothing about it."""

WITHIN = 0.5
"""rad or m, summed over the joints: the way over which the floor of a pair that begins nearer grows to the whole."""


def named_by(pattern: str, name: str) -> bool:
    """Whether a name is one that a pattern means, in which `*` stands for any text."""
    first, *rest = pattern.split("*")
    if not rest:
        return name == pattern
    if not name.startswith(first):
        return False
    at = len(first)
    for part in rest[:-1]:
        found = name.find(part, at)
        if found < 0:
            return False
        at = found + len(part)
    return name.endswith(rest[-1]) and len(name) - len(rest[-1]) >= at


@dataclass(frozen=True)
class SafePairs:
    """The distance that two groups of bodies keep from each other.

    Attributes:
        of: names of links, obstacles and held objects, or a single one; `*` stands for any text in them.
        others: the same of the other group.
        at_least: m.

    Raises:
        InputError: groups that are no names.
    """

    of: tuple[str, ...]
    others: tuple[str, ...]
    at_least: float

    def __post_init__(self) -> None:
        for name in ("of", "others"):
            stated = getattr(self, name)
            if not isinstance(stated, str) and not is_listed(stated):
                raise wrong_argument("SafePairs", name, described(stated), "a name of a body, or several")
            object.__setattr__(self, name, (stated,) if isinstance(stated, str) else tuple(stated))

    def holds(self, a: str, b: str) -> bool:
        """Whether two bodies are one of each group."""
        return (_any(self.of, a) and _any(self.others, b)) or (_any(self.of, b) and _any(self.others, a))


@dataclass(frozen=True)
class BuiltNear:
    """Two links that are built nearer than required of them.

    Attributes:
        links: their names, in order.
        distance: m, the least that was measured of them apart.
        floor: m, what they keep.
    """

    links: tuple[str, str]
    distance: float
    floor: float


@dataclass(frozen=True, eq=False, repr=False)
class Safety:
    """How far bodies stay apart at all times.

    The floor of a pair is the distance required. A pair that is nearer at an end of the motion (the start, the goal,
    a via of joint values, the end of a step of a task that states one) has a lower one about that end q_e:

        min(required, base + (required - base) sum_j |q_j - q_e,j| / within),  base = 0.8 d(q_e),

    the sum over the joints that move the pair.

    A joint-off-motion tube takes what it takes of d(q_e) first. See `collision.floors` for pairs that are built nearer.

    Args:
        scene: of the robot and what it holds from obstacles, m.
        own: of links and held objects from each other, m; `self` in a file.
        pairs: of groups of bodies; the last that holds a pair decides.
        within: rad or m, summed over the joints that move a pair.

    Attributes:
        ends: configurations (n,) at which pairs may be nearer; planners and the verifier put them there. A joint on its
            way there is nan: pairs that it moves keep the whole distance.
        built: pairs of links that are built nearer, see `collision.floors.with_built`; who reads a problem puts them
            there.

    Raises:
        InputError: a distance that is negative, or above `MOST`.

    Example:
        >>> import optiplan as op
        >>> op.Safety(0.005, own=0.002)
        Safety: 5 mm from the scene, 2 mm of the robot from itself
    """

    scene: float = 0.0
    own: float = 0.0
    pairs: tuple[SafePairs, ...] = ()
    within: float = WITHIN
    ends: tuple[Array, ...] = ()
    built: tuple[BuiltNear, ...] = ()

    def __post_init__(self) -> None:
        for name in ("scene", "own"):
            _distance(name, getattr(self, name))
        if not isinstance(self.pairs, tuple | list):
            raise wrong_argument("Safety", "pairs", described(self.pairs), "a tuple of op.SafePairs(…)")
        for k, pair in enumerate(self.pairs):
            if not isinstance(pair, SafePairs):
                raise wrong_argument("Safety", f"pairs[{k}]", described(pair), "op.SafePairs(…)")
            _distance(f"pairs[{k}].at_least", pair.at_least)
        number_argument("Safety", "within", self.within, "a number > 0, rad or m", above=0.0)

    @classmethod
    def of(cls, value: Any) -> "Safety | None":
        """Return a safety of a number, m, for all pairs, or of itself; None of nothing and where nothing is required.

        Raises:
            InputError: neither, or no distance.
        """
        if value is None or isinstance(value, Safety):
            return value if value is not None and value.most > 0.0 else None
        _distance("safety", value, "Scene")
        return cls(float(value), float(value)) if value > 0.0 else None

    @property
    def most(self) -> float:
        """The largest distance required of any pair, m."""
        return max(self.scene, self.own, *(pair.at_least for pair in self.pairs), 0.0)

    def asked(self, a: str, b: str, obstacle: bool) -> float:
        """Return what is required of two bodies, m; `obstacle`: whether one of them is an obstacle."""
        for pair in reversed(self.pairs):
            if pair.holds(a, b):
                return pair.at_least
        return self.scene if obstacle else self.own

    def ending_at(self, ends: Iterable[Array]) -> "Safety":
        """Return the same with these configurations (n,) as the ends."""
        return replace(self, ends=tuple(ends))

    def same_as(self, other: "Safety | None") -> bool:
        """Whether another asks the same, about the same ends."""
        if other is None or len(self.ends) != len(other.ends):
            return False
        mine, others = ((one.scene, one.own, one.pairs, one.within, one.built) for one in (self, other))
        return mine == others and all(
            np.array_equal(a, b, equal_nan=True) for a, b in zip(self.ends, other.ends, strict=True)
        )

    def to_data(self) -> dict[str, Any]:
        """`clearance:` of a file."""
        pairs = [{"of": list(one.of), "from": list(one.others), "at_least": one.at_least} for one in self.pairs]
        data: dict[str, Any] = {"scene": self.scene, "self": self.own, "within": self.within}
        return {**data, **({"pairs": pairs} if pairs else {})}

    @classmethod
    def from_data(cls, data: float | Mapping[str, Any] | None) -> "Safety | None":
        """Return what `clearance:` of a file asks, read already; None where that is nothing."""
        if data is None or isinstance(data, int | float):
            return cls.of(data)
        groups = data.get("pairs", ())
        pairs = tuple(SafePairs(one["of"], one["from"], one["at_least"]) for one in groups)
        return cls.of(cls(data["scene"], data["self"], pairs, data["within"]))

    def __repr__(self) -> str:
        """Return the distances in one line."""
        count = len(self.pairs)
        more = f", {count} group{'' if count == 1 else 's'} of pairs" if count else ""
        return f"Safety: {1e3 * self.scene:g} mm from the scene, {1e3 * self.own:g} mm of the robot from itself{more}"


def _any(patterns: Sequence[str], name: str) -> bool:
    return any(named_by(pattern, name) for pattern in patterns)


def _distance(argument: str, value: Any, of: str = "Safety") -> None:
    number_argument(of, argument, value, f"a distance in [0, {MOST:g}] m", 0.0, most=MOST)
