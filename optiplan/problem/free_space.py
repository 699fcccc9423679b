"""Whether configurations of a problem are free, and how far its bodies are apart."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple, overload

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.collision.contacts import Contact
from optiplan.collision.kept_models import collision_model, touching_model
from optiplan.collision.model import CollisionModel
from optiplan.geometry.safety import Safety
from optiplan.geometry.scene import Scene
from optiplan.robot.given_configurations import configurations
from optiplan.robot.robot import Robot

if TYPE_CHECKING:
    from optiplan.geometry.pose import Values


TOUCHING = 1e-12
"""Bodies nearer than this, m, are in collision: contact itself is refused, rounding of a zero apart."""


class Touching(NamedTuple):
    """Bodies that touch at a configuration.

    Attributes:
        pair: names of the two that overlap most, or of a body and the mesh that it is inside of.
        reason: every pair in contact, in words.
    """

    pair: tuple[str, str]
    reason: str


class FreeCheck:
    """Whether bodies touch at a configuration; true where none do. Which ones do is computed on demand."""

    def __init__(self, free: bool, find: Callable[[], Touching]) -> None:
        self._free, self._find = free, find

    def __bool__(self) -> bool:
        """Return whether the configuration is free."""
        return self._free

    @property
    def pair(self) -> tuple[str, str] | None:
        """The two bodies that overlap most, or a body and the mesh that it is inside of; None where free."""
        return None if self._free else self._found.pair

    @property
    def reason(self) -> str:
        """Every pair in contact, in words; empty where the configuration is free."""
        return "" if self._free else self._found.reason

    @cached_property
    def _found(self) -> Touching:
        return self._find()

    def __repr__(self) -> str:
        """Return the verdict, and what is in contact."""
        return "FreeCheck: free" if self else f"FreeCheck: not free: {self.reason}"


class FreeChecks(Sequence[FreeCheck]):
    """A `FreeCheck` of each of several configurations; see there.

    Attributes:
        free: (k,), whether each is free.
    """

    def __init__(self, robot: Robot, scene: Scene, Q: Array) -> None:
        """Check configurations Q (k, n), rad or m."""
        self._robot, self._scene, self._Q = robot, scene, Q.copy()
        self.free: Flags = ~touching_model(robot, scene).collides_at(Q)
        model = collision_model(robot, scene)
        if model.containment.possible:
            for k in np.flatnonzero(self.free):
                self.free[k] = model.contained(Q[k]) is None

    def __len__(self) -> int:
        """Return the number of configurations."""
        return len(self._Q)

    @overload
    def __getitem__(self, which: int) -> FreeCheck: ...
    @overload
    def __getitem__(self, which: slice) -> list[FreeCheck]: ...
    def __getitem__(self, which: int | slice) -> FreeCheck | list[FreeCheck]:
        """Return the check of one configuration, or a list of several."""
        if isinstance(which, slice):
            return [self[k] for k in range(*which.indices(len(self)))]
        return FreeCheck(bool(self.free[which]), partial(self._touching, self._Q[which]))

    def _touching(self, q: Array) -> Touching:
        found = touching(collision_model(self._robot, self._scene), q)
        if found is not None:
            return found
        contact = touching_model(self._robot, self._scene).clearance(q)  # a hair's breadth decides
        names = ("", "") if contact is None else (contact.pair.name_a, contact.pair.name_b)
        return Touching(names, f"'{names[0]}' and '{names[1]}' touch")

    def __repr__(self) -> str:
        """Return how many of them are free."""
        return f"FreeChecks: {int(self.free.sum())} of {len(self)} free"


class FreeSpace:
    """Questions about the bodies of a problem at configurations of its robot."""

    robot: Robot
    scene: Scene

    @property
    def safety(self) -> Safety | None:
        """How far bodies stay apart; None: they do not touch."""
        return self.scene.safety

    def is_free(self, q: "Values | Mapping[str, float] | str") -> FreeCheck | FreeChecks:
        """Say whether the robot, with what it holds, touches neither itself nor an obstacle.

        Checked are the pairs of bodies that the robot and the scene do not allow to touch; limits are not. Obstacles
        that move are where they are at first. It holds for this configuration, not for a motion: see `op.verify`.
        Of bodies within 1e-6 m of touching the answer may be either. Many configurations are checked at once in the
        native core, as many as a million a second where bodies are boxes and hulls; closed meshes, which may contain
        bodies, take a look at each.

        Args:
            q: (n,), rad or m; values by joint, `{joint: value}`; the name of a configuration; or several, (k, n).

        Returns:
            A `FreeCheck`, which is true where q is free and else has the `pair` that meets; of several a sequence of k,
            whose `free` (k,) says which are.

        Raises:
            InputError: other values than one a joint.

        Example:
            >>> import optiplan as op
            >>> problem = op.load_problem("02_shelf")
            >>> bool(problem.is_free(problem.start))
            True
        """
        Q = configurations(self.robot.joint_names, self.robot.configurations, q, "Problem.is_free")
        found = FreeChecks(self.robot, self.scene, np.atleast_2d(Q))
        return found[0] if Q.ndim == 1 else found

    def clearance(self, q: "Values | Mapping[str, float] | str") -> float | Array:
        """Return the least distance of all pairs of bodies that are checked, m.

        min over the pairs (A, B) of d(A, B), where d < 0 is the depth of penetration of bodies that overlap; infinite
        where there is no pair. It is computed to 1e-6 m; obstacles that move are where they are at first.

        Args:
            q: as of `is_free`.

        Returns:
            The distance, m; of several configurations (k, n) the distances (k,).

        Raises:
            InputError: as `is_free`.

        Example:
            >>> import optiplan as op
            >>> problem = op.load_problem("02_shelf")
            >>> problem.clearance([problem.start, problem.start]).shape
            (2,)
        """
        Q = configurations(self.robot.joint_names, self.robot.configurations, q, "Problem.clearance")
        model = collision_model(self.robot, self.scene)
        return _distance(model, Q) if Q.ndim == 1 else np.array([_distance(model, row) for row in Q])


def touching(model: CollisionModel, q: Array) -> Touching | None:
    """Return the bodies in contact at q (n,), the deepest first; None where it is free."""
    deepest: dict[tuple[str, str], Contact] = {}  # two bodies of several shapes have several contacts
    for contact in sorted(model.touching(q, TOUCHING), key=lambda contact: contact.distance):
        deepest.setdefault((contact.pair.name_a, contact.pair.name_b), contact)
    contacts = list(deepest.values())
    if contacts:
        pair, rest = contacts[0].pair, len(contacts) - 3
        words = "; ".join(_depth(contact) for contact in contacts[:3])
        return Touching((pair.name_a, pair.name_b), words + (f"; and {rest} more pairs" if rest > 0 else ""))
    inside = model.contained(q)
    return None if inside is None else Touching(inside, f"'{inside[0]}' is inside '{inside[1]}'")


def _depth(contact: Contact) -> str:
    names = f"'{contact.pair.name_a}' and '{contact.pair.name_b}'"
    depth = max(0.0, -contact.distance) * 1e3
    return f"{names} overlap by {depth:.3g} mm" if depth >= 1e-3 else f"{names} touch"


def _distance(model: CollisionModel, q: Array) -> float:
    nearest = model.clearance(q)
    return np.inf if nearest is None else float(nearest.distance)
