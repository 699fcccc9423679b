"""Scenes: shapes, obstacles, attached objects, allowed contacts."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, is_finite, is_listed, number_argument
from optiplan.errors import counted, described, flag_argument, wrong_argument
from optiplan.geometry.file_shapes import Mesh, Octree, PointCloud
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.poses import FixedPose
from optiplan.geometry.safety import Safety
from optiplan.geometry.shape import Shape
from optiplan.geometry.shapes import Box, Capsule, Cylinder, HalfSpace, Sphere, build_geometry
from optiplan.records import dataclass

__all__ = [
    "Attachment",
    "Box",
    "Capsule",
    "Cylinder",
    "HalfSpace",
    "Mesh",
    "Obstacle",
    "Octree",
    "PointCloud",
    "Scene",
    "Shape",
    "Sphere",
]


@dataclass(frozen=True, eq=False, repr=False)
class Obstacle:
    """A shape in the world, which stands still or moves on a given trajectory.

    Attributes:
        name: of the obstacle.
        shape: in its own frame.
        X_WO: its pose in the world, read-only; that of a moving obstacle without its displacement.
        stated: keys of a problem file for that pose (`position`, and `rpy` or `quaternion`); None: not from a file.
        motion: None: it stands still.
    """

    name: str
    shape: Shape
    X_WO: pin.SE3
    stated: Mapping[str, Any] | None = None
    motion: ObstacleMotion | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "X_WO", _fixed(self.X_WO, "Obstacle", "X_WO"))

    def moving(
        self,
        polynomial: Sequence[Sequence[float]] | None = None,
        until: float | None = None,
        *,
        turn: Mapping[str, Sequence[float]] | None = None,
    ) -> "Obstacle":
        """Return the same shape on a trajectory: its pose turned, and displaced by a polynomial of time.

        Time counts from the start of the robot's motion.

        Args:
            polynomial: for x, y and z of the world the coefficients of t^0, t^1 …, m/s^k; None: it is not displaced.
            until: s, after which it stands still; None: it always moves.
            turn: `axis` (3,) about which it turns, coefficients of the `angle` likewise, rad/s^k, and `about`, a point
                of the axis, m (default: its own position); None: it does not turn.

        Raises:
            InputError: not three lists of finite numbers, no axis, or a time that is not above 0.

        Example:
            >>> import optiplan as op
            >>> op.Box("cart", size=(0.3, 0.2, 0.2), position=(0.5, -0.6, 0.3)).moving([[0], [0, 0.2], [0]], until=3.0)
            Obstacle: cart, Box(size=(0.3, 0.2, 0.2)), at [0.5, -0.6, 0.3] m, moving
        """
        rows = [[0.0]] * 3 if polynomial is None and turn is not None else _rows(polynomial)
        if len(rows) != 3 or not all(is_finite(value) for row in rows for value in row):
            expected = "coefficients of x, y and z: three lists of finite numbers"
            raise wrong_argument("Obstacle.moving", "polynomial", described(polynomial), expected)
        if until is not None and not (is_finite(until) and until > 0.0):
            raise wrong_argument("Obstacle.moving", "until", described(until), "a time above 0, s")
        return replace(self, motion=ObstacleMotion.of_data(rows, until, turning_data(turn, self.X_WO.translation)))

    def attached_to(
        self,
        link: str,
        touch: Iterable[str] = (),
        *,
        mass: float | None = None,
        centre: Sequence[float] | None = None,
        inertia: Sequence[float] | None = None,
    ) -> "Attachment":
        """Return the same shape held by a link; its pose becomes the pose in the frame of the link.

        Args:
            link: name of the link that holds it.
            touch: names of links that it may touch; it may always touch the one that holds it.
            mass: kg; None: no mass.
            centre: of mass, (3,) in the frame of the shape, m; None: that of uniform density.
            inertia: (3,) moments [ixx, iyy, izz] about that centre along the axes of the shape, kg m²; None: likewise.

        Example:
            >>> import optiplan as op
            >>> op.Box("bar", size=(0.5, 0.06, 0.03), position=(0, 0, 0.1)).attached_to("panda_hand")
            Attachment: bar, Box(size=(0.5, 0.06, 0.03)), at [0, 0, 0.1] m of panda_hand
        """
        weight = mass, None if centre is None else tuple(centre), None if inertia is None else tuple(inertia)
        return Attachment(self.name, self.shape, link, self.X_WO, frozenset(touch), self.stated, *weight)

    def __repr__(self) -> str:
        """Return name, shape and place in one line."""
        return f"Obstacle: {self.name}, {self.shape}, at {_at(self.X_WO)}{', moving' if self.motion else ''}"


@dataclass(frozen=True, eq=False, repr=False)
class Attachment:
    """A shape held by a link at `X_LO`; it may touch the links named in `touch` (and always its own link).

    `stated` is as in `Obstacle`; `mass` (kg), `centre` (m) and `inertia` (kg m²) are as in `Obstacle.attached_to`.
    `framed` says that goals or constraints are about its own frame, which the robot then carries.
    """

    name: str
    shape: Shape
    link: str
    X_LO: pin.SE3
    touch: frozenset[str] = frozenset()
    stated: Mapping[str, Any] | None = None
    mass: float | None = None
    centre: tuple[float, ...] | None = None
    inertia: tuple[float, ...] | None = None
    framed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "X_LO", _fixed(self.X_LO, "Attachment", "X_LO"))

    def inertia_in_link(self) -> pin.Inertia:
        """Return the spatial inertia in the frame of the link, by default that of uniform density.

        Raises:
            ValueError: the shape encloses no volume, or is an open mesh.
        """
        from optiplan.geometry.mass_properties import mass_properties

        if not self.mass:
            return pin.Inertia.Zero()
        centre, moments = self.centre, None if self.inertia is None else np.diag(self.inertia)
        if centre is None or moments is None:
            body = build_geometry(self.shape)
            try:
                even = mass_properties(body)
            except ValueError as error:
                raise ValueError(f"{self.mass:g} kg of '{self.name}', whose shape {error}") from error
            moments = self.mass * even.moments if moments is None else moments
            centre = tuple(even.centre.tolist()) if centre is None else centre
        return self.X_LO.act(pin.Inertia(self.mass, np.array(centre), moments))

    def __repr__(self) -> str:
        """Return name, shape, place and link in one line."""
        return f"Attachment: {self.name}, {self.shape}, at {_at(self.X_LO)} of {self.link}"


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Scene:
    """Obstacles, attached objects, and pairs of names (links, obstacles, attachments) that may touch.

    A scene is immutable: methods return a new one.

    Args:
        obstacles: bodies in the world.
        attached: bodies that the robot holds.
        allowed: pairs of names that may touch.
        safety: how far bodies stay apart: a `Safety`, or a distance in m for all pairs; None: they do not touch.
        unwished: whether no clearance is wished either, as `safety=0` says.

    Raises:
        InputError: an entry of another type, or no distance.

    Example:
        >>> import optiplan as op
        >>> scene = op.Scene([op.Box("shelf", size=(0.8, 0.3, 0.02), position=(0.5, 0.0, 0.4))])
        >>> scene.moved("shelf", z=0.05)
        Scene: 1 obstacle (shelf)
    """

    obstacles: tuple[Obstacle, ...]
    attached: tuple[Attachment, ...]
    allowed: frozenset[frozenset[str]]
    safety: Safety | None
    unwished: bool

    def __init__(
        self,
        obstacles: Iterable[Obstacle] = (),
        attached: Iterable[Attachment] = (),
        allowed: Iterable[Iterable[str]] = (),
        safety: Safety | float | None = None,
        unwished: bool = False,
    ) -> None:
        flag_argument("Scene", "unwished", unwished)
        object.__setattr__(self, "obstacles", _all(obstacles, Obstacle, "obstacles"))
        object.__setattr__(self, "attached", _all(attached, Attachment, "attached"))
        object.__setattr__(self, "allowed", frozenset(map(_pair, _listed(allowed, "allowed", "pairs of names"))))
        object.__setattr__(self, "safety", Safety.of(safety))
        object.__setattr__(self, "unwished", unwished or (safety is not None and self.safety is None))

    def ending_at(self, *ends: Array) -> "Scene":
        """Return the scene for a motion with these ends (n,), see `Safety`; itself where no distance is asked."""
        return self if self.safety is None else replace(self, safety=self.safety.ending_at(ends))

    @property
    def dynamic_obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles that move."""
        return tuple(body for body in self.obstacles if body.motion is not None)

    @property
    def turning_obstacles(self) -> tuple[Obstacle, ...]:
        """Those that turn."""
        return tuple(body for body in self.obstacles if body.motion is not None and body.motion.axis is not None)

    @property
    def standing(self) -> "Scene":
        """The scene without the obstacles that move; itself where there are none."""
        return self.without(*(body.name for body in self.dynamic_obstacles)) if self.dynamic_obstacles else self

    def later(self, t: float) -> "Scene":
        """Return the scene t seconds later, in which moving obstacles continue their trajectories."""
        if not self.dynamic_obstacles:
            return self
        return replace(self, obstacles=tuple(_later(body, t) for body in self.obstacles))

    def stopped(self, t: float) -> "Scene":
        """Return the scene t seconds later, in which moving obstacles stand still from then on."""
        return replace(self, obstacles=tuple(_stopped(body, t) for body in self.obstacles))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of everything in the scene, obstacles first."""
        bodies: list[Obstacle | Attachment] = [*self.obstacles, *self.attached]
        return tuple(body.name for body in bodies)

    def with_attached(self, *attached: Attachment) -> "Scene":
        """Return a new scene with further attached objects."""
        return replace(self, attached=(*self.attached, *attached))

    def with_(self, *bodies: Obstacle | Attachment, allowed: Iterable[Iterable[str]] = ()) -> "Scene":
        """Return a new scene with further bodies and pairs that may touch; a body replaces the one of its name.

        Raises:
            InputError: an argument that is neither an obstacle nor an attached object.
        """
        names = {body.name for body in bodies if isinstance(body, Obstacle | Attachment)}
        kept: list[Any] = [body for body in self.obstacles if body.name not in names]
        held = [body for body in self.attached if body.name not in names]
        held += [body for body in bodies if isinstance(body, Attachment)]
        kept += [body for body in bodies if not isinstance(body, Attachment)]
        pairs = [*self.allowed, *_listed(allowed, "allowed", "pairs of names")]
        return Scene(kept, held, pairs, self.safety, self.unwished)

    def without(self, *names: str) -> "Scene":
        """Return a new scene without these obstacles and attached objects, and without their allowed pairs.

        Raises:
            InputError: an unknown name.
        """
        for name in names:
            self._known(name)
        return Scene(
            [body for body in self.obstacles if body.name not in names],
            [body for body in self.attached if body.name not in names],
            [pair for pair in self.allowed if not pair & set(names)],
            self.safety,
            self.unwished,
        )

    def moved(self, name: str, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> "Scene":
        """Return a new scene with one body moved *by* (x, y, z), m: in the world or, if attached, in its link.

        Raises:
            InputError: an unknown name, or a distance that is not finite.
        """
        self._known(name)
        for axis, distance in (("x", x), ("y", y), ("z", z)):
            number_argument("Scene.moved", axis, distance, "a finite number of metres")
        by = np.array([x, y, z], float)
        return Scene(
            [_moved(body, by) if body.name == name else body for body in self.obstacles],
            [_moved(body, by) if body.name == name else body for body in self.attached],
            self.allowed,
            self.safety,
            self.unwished,
        )

    def _known(self, name: str) -> None:
        if not isinstance(name, str) or name not in self.names:
            expected = f"one of: {', '.join(self.names)}" if self.names else "a scene with something in it"
            raise wrong_argument("Scene", "name", f"nothing called {name!r}", expected)

    def __repr__(self) -> str:
        """Return the numbers and names of the bodies."""
        parts = [_counted("obstacle", self.obstacles)] if self.obstacles else []
        parts += [_counted("attached object", self.attached)] if self.attached else []
        parts += [f"{len(self.allowed)} allowed contacts"] if self.allowed else []
        parts += [str(self.safety).removeprefix("Safety: ")] if self.safety is not None else []
        return f"Scene: {', '.join(parts) or 'empty'}"


Body = TypeVar("Body", Obstacle, Attachment)


def _later(body: Obstacle, t: float) -> Obstacle:
    if body.motion is None:
        return body
    ahead = body.motion.until - t
    if ahead > 0.0:
        return replace(
            body, motion=replace(body.motion, coefficients=body.motion.from_times(np.array([t]))[0], until=ahead)
        )
    return _stopped(body, t)


def _stopped(body: Obstacle, t: float) -> Obstacle:
    if body.motion is None:
        return body
    return replace(body, X_WO=body.motion.pose(t) * body.X_WO, stated=None, motion=None)


def turning_data(turn: Any, position: Array) -> dict[str, Any] | None:
    """Return the `turn` of a motion in full; None where there is none.

    Raises:
        InputError: no axis of some length, or no finite numbers.
    """
    if turn is None:
        return None
    said = dict(turn) if isinstance(turn, Mapping) else {}
    usual = {"axis": (), "angle": (), "about": position}
    parts = dict(zip(usual, _rows([said.get(key, value) for key, value in usual.items()]) or [[], [], []], strict=True))
    sound = said.keys() <= parts.keys() and len(parts["axis"]) == len(parts["about"]) == 3 and bool(parts["angle"])
    sound = sound and all(is_finite(value) for part in parts.values() for value in part)
    if not sound or not any(parts["axis"]):
        expected = "`axis` [x, y, z], `angle` [rad, rad/s, …] and `about` [x, y, z], m"
        raise wrong_argument("Obstacle.moving", "turn", described(turn), expected)
    return parts


def _rows(values: Any) -> list[list[Any]]:
    """Return lists of lists, or of other sequences; none of anything else."""
    try:
        return [list(row) for row in values]
    except TypeError:
        return []


def _moved(body: Body, by: Array) -> Body:
    name = "X_WO" if isinstance(body, Obstacle) else "X_LO"
    X = getattr(body, name)
    there = X.translation + by
    stated = None if body.stated is None else {**body.stated, "position": there.tolist()}
    changes: dict[str, Any] = {name: pin.SE3(X.rotation, there), "stated": stated}
    if isinstance(body, Obstacle) and body.motion is not None and body.motion.point is not None:
        changes["motion"] = replace(body.motion, point=body.motion.point + by)
    return replace(body, **changes)


def _all(bodies: Iterable[Any], kind: type[Body], argument: str) -> tuple[Body, ...]:
    words = {"obstacles": "an obstacle, such as op.Box(…)", "attached": "an attached object: op.Box(…).attached_to(…)"}
    found = tuple(_listed(bodies, argument, {"obstacles": "obstacles", "attached": "attached objects"}[argument]))
    for k, body in enumerate(found):
        if not isinstance(body, kind):
            raise wrong_argument("Scene", f"{argument}[{k}]", described(body), words[argument])
    return found


def _listed(values: Any, argument: str, expected: str) -> list[Any]:
    if not is_listed(values):
        raise wrong_argument("Scene", argument, described(values), f"{expected} in a list")
    return list(values)


def _pair(pair: Any) -> frozenset[str]:
    names = [] if isinstance(pair, str) or not isinstance(pair, Iterable) else list(pair)
    if len(set(map(str, names))) != 2 or not all(isinstance(name, str) for name in names):
        raise wrong_argument("Scene", "allowed", described(pair), "pairs of two names")
    return frozenset(names)


def _counted(what: str, bodies: Sequence[Obstacle | Attachment]) -> str:
    names = [body.name for body in bodies[:4]] + (["…"] if len(bodies) > 4 else [])
    return f"{counted(len(bodies), what)} ({', '.join(names)})"


def _fixed(X: Any, body: str, argument: str) -> FixedPose:
    if not isinstance(X, pin.SE3):
        raise wrong_argument(body, argument, described(X), "a pose: pinocchio.SE3(rotation, translation)")
    return X if isinstance(X, FixedPose) else FixedPose(X)


def _at(X: pin.SE3) -> str:
    return f"[{', '.join(f'{x:.6g}' for x in X.translation)}] m"
