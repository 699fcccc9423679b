"""The native core's kinematic tree of a model."""

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.robot.mimic_joints import coupling, screws

if TYPE_CHECKING:
    from optiplan._core._core_base import Tree

_made: "WeakKeyDictionary[pin.Model, tuple[object, Tree]]" = WeakKeyDictionary()
"""The build and the tree of each model in use: models of robots never change."""


def native_tree(model: pin.Model) -> "Tree":
    """Return the tree of joints, leaders and link inertias; requires the core."""
    build, tree = _made.get(model, (None, None))
    if tree is None or build is not core:
        tree = tree_of(model, *coupling(model))
        _made[model] = core, tree
    return tree


def tree_of(model: pin.Model, A: Array, b: Array) -> "Tree":
    """Return a tree whose joints are at A q + b, each follower of one planned joint of q; requires the core."""
    joints = range(1, model.njoints)
    leaders = np.abs(A).argmax(axis=1)
    inertias = [
        np.concatenate([[body.mass], body.lever, np.asarray(body.inertia).ravel()])
        for body in (model.inertias[j] for j in joints)
    ]
    return core.Tree.of(
        parents=np.array([model.parents[j] for j in joints], dtype=np.int64),
        placements=np.array([model.jointPlacements[j].homogeneous for j in joints]).reshape(-1, 4, 4),
        screws=screws(model),
        leaders=leaders.astype(np.int64),
        couplings=np.column_stack([A[np.arange(len(A)), leaders], b]),
        inertias=np.array(inertias).reshape(-1, 13),
        planned=A.shape[1],
        gravity=np.array(model.gravity.linear),
    )
