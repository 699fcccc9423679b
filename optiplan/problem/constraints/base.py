"""What all statements of path constraints share: a class, whose attributes say how they stand in a problem file."""

import inspect
from abc import ABC
from collections.abc import Callable
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, create_model

from optiplan.arrays import Array
from optiplan.config.document import Number, Strict
from optiplan.config.simple_yaml import Place
from optiplan.config.values import Direction, Length, Name, Vector
from optiplan.geometry.poses import ReadOnlyPoses
from optiplan.records import dataclass

WHOLE = (0.0, 1.0)


class Mention(NamedTuple):
    """A name in a constraint: where it stands under the constraint's key, and of what kind it is."""

    place: Place
    kind: Literal["frame", "body", "joint"]
    name: str


@dataclass(frozen=True)
class Key:
    """How an attribute of a constraint stands in a problem file.

    Attributes:
        kind: type of the value there, as pydantic takes it.
        read: makes the attribute of a valid value.
        write: makes the value of an attribute; None: it is left out where None is the default.
        name: of the key; None: that of the attribute.
        part: the one of the keys in the value that holds the attribute, where several share a value.
        beside: whether the keys of `kind`, a model, stand beside the others, without a key of their own.
        default: of a value that is left out; `...`: it is required.
    """

    kind: Any
    read: Callable[[Any], Any] = lambda value: value
    write: Callable[[Any], Any] = lambda value: value
    name: str | None = None
    part: str | None = None
    beside: bool = False
    default: Any = ...


def array(values: Any) -> Array:
    """Return the numbers as an array."""
    return np.array(values, float)


def unit(values: Any) -> Array:
    """Return the direction (3,) of unit length."""
    vector = array(values)
    return vector / float(np.linalg.norm(vector))


def _ordered(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) != 2 or not 0.0 <= values[0] < values[1] <= 1.0:
        expected = "two fractions of the duration, [from, to] with 0 <= from < to <= 1"
        raise ValueError(f"found {list(values)}; expected {expected}")
    return values


Part = Annotated[tuple[Number, ...], AfterValidator(_ordered)]
"""Part of the motion, as a file states it."""

During: TypeAlias = Annotated[
    tuple[float, float],
    Key(
        Part | None, lambda said: said or WHOLE, lambda said: None if tuple(said) == WHOLE else list(said), default=None
    ),
]
"""Part of the motion, as fractions of its duration."""


class ConstraintSpec(Strict):
    """What constraints of a frame have; `frame` is the robot's tool frame without one."""

    frame: Name | None = None
    during: Part | None = None


Frame: TypeAlias = Annotated[str, Key(Name | None, default=None)]
"""A link or fixed frame of the robot; in a file the tool frame without one."""

Point: TypeAlias = Annotated[Array, Key(Vector, array)]
"""A point (3,), m."""

UnitVector: TypeAlias = Annotated[Array, Key(Direction, unit)]
"""A direction (3,) of unit length."""

Distance: TypeAlias = Annotated[float, Key(Length)]
"""A number > 0."""

Angle: TypeAlias = Annotated[float, Key(Annotated[Length, Field(le=np.pi)])]
"""An angle in (0, pi], rad."""


class Statement(ReadOnlyPoses, ABC):
    """A path constraint: what holds, in numbers that are read-only, and how a problem file says it.

    Attributes:
        KEY: in a problem file.
        during: part of the motion.
    """

    KEY: ClassVar[str]

    during: During

    @classmethod
    @cache
    def keys(cls) -> dict[str, Key]:
        """Return how each attribute stands in a file."""
        found = {one.name: getattr(one.type, "__metadata__", ()) for one in fields(cls)}  # type: ignore[arg-type]
        return {name: key for name, data in found.items() for key in data if isinstance(key, Key)}

    @classmethod
    def spec(cls) -> type[BaseModel]:
        """Return the model of what stands under `KEY`."""
        keys = cls.keys().items()
        usual = (ConstraintSpec,) if "frame" in cls.keys() else (Strict,)
        bases = tuple(key.kind for _, key in keys if key.beside) or usual
        own: dict[str, Any] = {key.name or name: (key.kind, key.default) for name, key in keys if not key.beside}
        return create_model(f"{cls.__name__}Spec", __base__=bases, __doc__=inspect.getdoc(cls), **own)

    @classmethod
    def consistent(cls, stated: Any) -> Any:
        """Return what stands in a file, if its values go together.

        Raises:
            ValueError: what was found and expected.
        """
        return stated

    @classmethod
    def of(cls, stated: Any, tool: str) -> Self:
        """Return the constraint of a valid `spec`; of the frame `tool` where it names none."""
        values = {}
        for name, key in cls.keys().items():
            value = stated if key.beside else getattr(stated, key.name or name)
            values[name] = key.read(value if key.part is None else getattr(value, key.part))
        if values.get("frame", tool) is None:
            values["frame"] = tool
        return cls(**values)

    def to_data(self) -> dict[str, Any]:
        """Return its values as a problem file says them."""
        data: dict[str, Any] = {}
        for name, key in self.keys().items():
            value = key.write(getattr(self, name))
            if key.beside:
                data |= value
            elif key.part is not None:
                data.setdefault(key.name or name, {})[key.part] = value
            elif value is not None or key.default is not None:
                data[key.name or name] = value
        return data

    def mentioned(self) -> list[Mention]:
        """Return the names of what the robot or the scene must have."""
        frame = getattr(self, "frame", None)
        return [] if frame is None else [Mention(("frame",), "frame", frame)]


def circle_of(start: Array, through: Array, end: Array) -> tuple[Array, Array, float, float]:
    """Return centre (3,), unit normal (3,), radius and angle of the arc from one point to another through a third.

    With u and v from the first point to the others and n = u x v: centre = start + (|u|^2 v - |v|^2 u) x n / (2 |n|^2).
    The arc turns about n, by an angle in (0, 2 pi).
    """
    u, v = through - start, end - start
    normal = np.cross(u, v)
    centre = start + np.cross(u @ u * v - v @ v * u, normal) / (2.0 * (normal @ normal))
    normal = normal / float(np.linalg.norm(normal))
    a, b = start - centre, end - centre
    angle = float(np.arctan2(normal @ np.cross(a, b), a @ b)) % (2.0 * np.pi)
    return centre, normal, float(np.linalg.norm(a)), angle
