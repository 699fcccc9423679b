"""The weights of what a motion costs."""

from collections.abc import Iterable
from dataclasses import fields

from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory

UNITS = {
    "time": "s",
    "jerk": "rad² s⁻⁵",
    "energy": "N² m² s",
    "joint_path": "rad",
    "tool_path": "m",
    "tool_smoothness": "m² s⁻³",
    "clearance": "m s",
    "manipulability": "s",
    "centring": "s",
}
"""Of each part of the cost; weights are in s for one of these, and the cost in s."""

_OF_JOINTS = {"jerk": "rad", "energy": "N² m²", "joint_path": "rad"}
"""The part of a unit that is another one of joints that slide."""

_SLIDING = {"rad": "m", "N² m²": "N²"}

PLAIN = frozenset({"time", "jerk"})
"""Parts that follow from the trajectory alone."""


def part_unit(name: str, revolute: Iterable[bool]) -> str:
    """Return the unit of a part of the cost for a robot of joints that turn or slide."""
    turning = UNITS[name]
    own = _OF_JOINTS.get(name)
    sliding = turning if own is None else turning.replace(own, _SLIDING[own])
    kinds = {bool(turns) for turns in revolute}
    return " or ".join(dict.fromkeys(unit for unit, turns in ((turning, True), (sliding, False)) if turns in kinds))


@dataclass(frozen=True)
class Objective:
    """Weights of the cost, a sum of integrals over the motion.

    Attributes:
        time: of the duration, s.
        jerk: of the integral of sum_j (d³q_j/dt³)².
        energy: of the integral of sum_j tau_j², N² m² s.
        joint_path: of the length of the path of the joints, integral of |dq/dt|, rad, sliding joints in m.
        tool_path: of the length of the tool's path, m.
        tool_smoothness: of the integral of the tool's squared acceleration, m² s⁻³.
        clearance: of the integral of what the nearest obstacle lacks of a distance of 0.1 m, m s.
        manipulability: of the integral of 1 / (0.001 + w), with Yoshikawa's measure w of the tool, s.
        centring: of the integral of sum_j ((q_j - middle_j) / half range_j)², over joints with limits, s.

    Example:
        >>> import optiplan as op
        >>> op.Objective(time=1.0, jerk=1e-6)
        Objective(time=1.0, jerk=1e-06)
    """

    time: float = 1.0
    jerk: float = 0.0
    energy: float = 0.0
    joint_path: float = 0.0
    tool_path: float = 0.0
    tool_smoothness: float = 0.0
    clearance: float = 0.0
    manipulability: float = 0.0
    centring: float = 0.0

    @property
    def weights(self) -> dict[str, float]:
        """The weights that are not 0, by name."""
        return {field.name: weight for field in fields(self) if (weight := float(getattr(self, field.name))) != 0.0}

    @property
    def only_time(self) -> bool:
        """Whether nothing but time costs: the fastest motion along a curve is the cheapest."""
        return self.weights.keys() <= {"time"}

    @property
    def plain(self) -> bool:
        """Whether the cost follows from the trajectory alone: time and jerk."""
        return self.weights.keys() <= PLAIN

    def cost(self, trajectory: Trajectory) -> float:
        """Return the weighted time and jerk of a motion, s; see `Problem.cost` for all parts."""
        jerk = self.jerk * trajectory.squared_jerk() if self.jerk else 0.0
        return self.time * trajectory.duration + jerk

    def __repr__(self) -> str:
        """Return time, and the weights that are not 0."""
        said = {"time": self.time} | self.weights
        return f"Objective({', '.join(f'{name}={weight!r}' for name, weight in said.items())})"
