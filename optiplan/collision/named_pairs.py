"""The collision model of a few pairs of bodies."""

from collections.abc import Sequence
from dataclasses import replace

from optiplan.collision.contacts import Pair
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot


class NamedPairs(CollisionModel):
    """Distances of pairs chosen by the names of their bodies; pairs proved apart are included."""

    def __init__(self, robot: Robot, scene: Scene, names: Sequence[tuple[str, str]]) -> None:
        self._wanted = frozenset(frozenset(pair) for pair in names)
        super().__init__(robot.with_proved_checked(), scene)

    def _list_pairs(self) -> tuple[Pair, ...]:
        kept = [p for p in super()._list_pairs() if frozenset((p.name_a, p.name_b)) in self._wanted]
        return tuple(replace(pair, index=k) for k, pair in enumerate(kept))
