"""`State` of a moving robot: what a controller reads at the beginning of a step, and commands for its end."""

from collections.abc import Mapping

import numpy as np

from optiplan.arrays import Array, ReadOnlyArrays, read_only
from optiplan.errors import described, wrong_argument
from optiplan.records import dataclass
from optiplan.robot.given_configurations import configuration
from optiplan.robot.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class State(ReadOnlyArrays):
    """Positions, velocities and accelerations of the planned joints at one instant.

    Args:
        robot: whose joints are named; needed where values are given by joint, `{joint: value}`, or q by the name of a
            configuration.

    Attributes:
        q: (n,), rad or m.
        v: (n,), rad/s or m/s; zeros where none are given.
        a: (n,), rad/s² or m/s²: the acceleration of the last step, from which jerk is counted; zeros where none are
            given.

    Example:
        >>> import optiplan as op
        >>> op.State([0.0, 0.5])
        State: q [0, 0.5], at rest
    """

    q: Array
    v: Array
    a: Array

    def __init__(self, q: object, v: object = None, a: object = None, *, robot: Robot | None = None) -> None:
        if robot is not None and not isinstance(robot, Robot):
            raise wrong_argument("State", "robot", described(robot), "op.load_robot(…)")
        q, v, a = (_listed(name, value, robot) for name, value in (("q", q), ("v", v), ("a", a)))
        position = _vector("q", q, None)
        object.__setattr__(self, "q", position)
        object.__setattr__(self, "v", _vector("v", v, len(position)))
        object.__setattr__(self, "a", _vector("a", a, len(position)))

    @classmethod
    def of(cls, q: Array, v: Array, a: Array) -> "State":
        """A state of arrays (n,) that are known to be good, unchecked; nobody may write into them from now on."""
        state = object.__new__(cls)
        fields = state.__dict__  # of a frozen class; this is done in every step of a loop
        fields["q"], fields["v"], fields["a"] = read_only(q), read_only(v), read_only(a)
        return state

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.q)

    @property
    def is_finite(self) -> bool:
        """Whether there is no NaN and no infinity in it."""
        return bool(np.isfinite(self.q).all() and np.isfinite(self.v).all() and np.isfinite(self.a).all())

    def __repr__(self) -> str:
        """Positions, and how fast it moves."""
        fastest = float(np.abs(self.v).max(initial=0.0))
        motion = f"moving at up to {fastest:.3g}" if fastest else "at rest"
        return f"State: q [{', '.join(f'{x:.4g}' for x in self.q)}], {motion}"


def _listed(name: str, values: object, robot: Robot | None) -> object:
    """Values by joint, or the name of a configuration, in the order of the robot's joints; others as they are."""
    if not isinstance(values, str | Mapping):
        return values
    if robot is None:
        found = "values by joint" if isinstance(values, Mapping) else repr(values)
        raise wrong_argument("State", name, found, "`robot` beside it, or one number a joint")
    return configuration(robot.joint_names, robot.configurations if name == "q" else {}, values, "State", name)


def _vector(name: str, values: object, size: int | None) -> Array:
    """Values as an array of floats, read-only.

    Raises:
        InputError: no numbers, NaN, or another count than that of the positions.
    """
    if values is None and size is not None:
        return read_only(np.zeros(size))
    try:
        vector = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise wrong_argument("State", name, repr(values), "one number a joint") from None
    if vector.ndim != 1 or (size is not None and len(vector) != size):
        expected = "a list of one number a joint" if size is None else f"{size} numbers, as many as positions"
        raise wrong_argument("State", name, f"an array of shape {vector.shape}", expected)
    bad = np.flatnonzero(~np.isfinite(vector))
    if len(bad):
        raise wrong_argument("State", f"{name}[{bad[0]}]", str(vector[bad[0]]), "a finite number")
    return read_only(vector)
