"""The default group of planned joints: the longest chain of joints, without wheels and fingers."""

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from optiplan.robot.urdf.reader import UrdfSource

_FINGER = re.compile(r"finger|gripper|thumb|knuckle|jaw|(^|_)hand(?!le)", re.IGNORECASE)
"""Words in the name of a finger joint; a wrist is often named by its link, so names of links do not count."""

_WHEEL = re.compile(r"wheel|caster|roller", re.IGNORECASE)

_SHORT = 0.25
"""Branches shorter than this share of the arm that carries them are fingers of an unnamed hand."""


def longest_chain(model: pin.Model, urdf: UrdfSource, movable: Sequence[str]) -> list[str]:
    """Return the names of the joints of the longest serial chain, base to tip; the first in the model of equal ones.

    Wheels and fingers are excluded with everything that they carry, unless no joint would remain.

    Wheels are recognised by name, or as continuous joints at the base that carry at most two joints, all continuous.
    Fingers are recognised by name, or as branches of a fork, all shorter than a quarter of the arm that carries them.
    """
    tree = _Tree(model, urdf, movable)
    chains = [tree.kept(tip) for tip in tree.movable]
    best = max(chains, key=len, default=[])
    if not best:
        best = max((tree.path(tip) for tip in tree.movable), key=len, default=[])
    return [str(model.names[j]) for j in best]


class _Tree:
    """The joints of a model with one degree of freedom, by index; `movable` joints follow no other joint."""

    def __init__(self, model: pin.Model, urdf: UrdfSource, movable: Sequence[str]) -> None:
        self.model = model
        self.movable = [model.getJointId(name) for name in movable]
        self.followers = {model.getJointId(name) for name in urdf.mimics}
        self.endless: Mapping[int, bool] = {j: urdf.joint_types[model.names[j]] == "continuous" for j in self.movable}

    def path(self, j: int) -> list[int]:
        """Return the movable joints from the base to j, j included."""
        return [k for k in list(self.model.supports[j])[1:] if k in self.endless]

    def carried(self, j: int) -> list[int]:
        """Return the movable joints and followers that j carries."""
        return [k for k in list(self.model.subtrees[j])[1:] if k in self.endless or k in self.followers]

    def kept(self, tip: int) -> list[int]:
        """Return the path to a tip up to the first wheel or finger."""
        path = self.path(tip)
        for count, j in enumerate(path):
            if self._is_wheel(j, path[:count]) or _FINGER.search(self.model.names[j]) or self._in_hand(j):
                return path[:count]
        return path

    def _is_wheel(self, j: int, before: list[int]) -> bool:
        behind = self.carried(j)
        turning = all(self.endless.get(k, False) for k in (j, *behind)) and len(behind) <= 2
        alone = len(self.movable) == len(behind) + 1
        return bool(_WHEEL.search(self.model.names[j])) or (not before and turning and not alone and not self._arm(j))

    def _arm(self, j: int) -> bool:
        return set(self.movable) <= set(self.model.subtrees[j])

    def _in_hand(self, j: int) -> bool:
        """Return whether j begins a branch of a fork whose branches are all short."""
        parent = int(self.model.parents[j])
        branches = [k for k in self.model.children[parent] if k in self.endless or k in self.followers]
        if parent == 0 or len(branches) < 2:
            return False
        arm = sum(self._offset(k) for k in list(self.model.supports[parent])[1:])
        return all(self._reach(k) < _SHORT * arm for k in branches)

    def _offset(self, j: int) -> float:
        return float(np.linalg.norm(self.model.jointPlacements[j].translation))

    def _reach(self, j: int) -> float:
        """Return the length, m, of the longest path over joint origins from the parent of j through j to a tip."""
        return self._offset(j) + max((self._reach(k) for k in self.model.children[j]), default=0.0)
