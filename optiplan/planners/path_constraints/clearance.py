"""Pairs of bodies with a required clearance."""

from collections.abc import Sequence

import numpy as np

from optiplan.arrays import Array
from optiplan.collision.named_pairs import NamedPairs
from optiplan.problem.constraints.motions import PairClearance
from optiplan.problem.problem import Problem

_FAR = 0.01
"""Distance beyond the required clearance, m, from which pairs are ignored."""


class PairsApart:
    """The inequality d >= at_least of a few pairs.

    Attributes:
        wanted: the pairs and their least distance.
        model: measures the distances.
        depends_on_rates: False.
    """

    depends_on_rates = False

    def __init__(self, problem: Problem, wanted: PairClearance) -> None:
        self.wanted = wanted
        self.model = NamedPairs(problem.robot, problem.scene, wanted.pairs)

    def least(self, motion: Sequence[Array]) -> Array:
        """Return the least clearance beyond the required one, m, of each state (N, n): (N,), at most 1 cm."""
        found = self.model.near(motion[0], self.wanted.at_least + _FAR)
        least = np.full(len(motion[0]), _FAR)
        np.minimum.at(least, found.rows, found.distance - self.wanted.at_least)
        return least

    def slower(self, motion: Sequence[Array]) -> float:
        """Return 1: no clearance grows with time."""
        return 1.0
