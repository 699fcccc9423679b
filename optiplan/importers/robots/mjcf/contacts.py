"""Which pairs of links a MuJoCo model does not let touch, and which of these need no check.

MuJoCo makes no contact between a body and its parent, between bodies that `exclude` names, and between geoms whose
`contype` and `conaffinity` do not meet, unless a `pair` names the two geoms. Only `exclude` says that a pair never
matters. Of the others those go unchecked that overlap as the file draws the robot, at the reference positions or in the
first keyframe: they are built so. All others are checked, though MuJoCo would let them through.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from optiplan.importers.robots.mjcf.geoms import solid_geoms
from optiplan.robot.urdf.srdf import LinkPair, link_pair


def excluded_pairs(model: Any, links: Sequence[str]) -> set[LinkPair]:
    """Pairs of links that `exclude` names; `links` are those of the bodies."""
    signatures = [int(signature) for signature in model.exclude_signature]
    pairs = ((links[one >> 16], links[one & 0xFFFF]) for one in signatures)
    return {link_pair(a, b) for a, b in pairs if a != b}


def overlapping_pairs(mujoco: Any, model: Any, links: Sequence[str]) -> set[LinkPair]:
    """Pairs of links that overlap as they are drawn, and between which MuJoCo makes no contact at all.

    One pair of geoms that may touch keeps the two links checked: `world` holds pedestal, table and walls alike. Where
    the file lets none of the moving geoms touch, it tells nothing of the pairs with `world`: they stay checked.
    """
    geoms, remark = solid_geoms(mujoco, model)
    solid = [geom for geom in sorted(geoms) if _is_body(mujoco, model, geom)]
    named = {frozenset(map(int, two)) for two in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    apart: dict[LinkPair, list[tuple[int, int]]] = {}
    touching: set[LinkPair] = set()
    for a, b in combinations(solid, 2):
        pair = link_pair(links[int(model.geom_bodyid[a])], links[int(model.geom_bodyid[b])])
        if {a, b} in named or _may_touch(model, a, b) or (remark and links[0] in pair):
            touching.add(pair)
        else:
            apart.setdefault(pair, []).append((a, b))
    found: set[LinkPair] = set()
    data = mujoco.MjData(model)
    for key in range(-1, min(model.nkey, 1)):
        if key >= 0:
            mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_kinematics(model, data)
        for pair in apart.keys() - touching - found:
            if any(_overlap(mujoco, model, data, a, b) for a, b in apart[pair]):
                found.add(pair)
    return found


def _overlap(mujoco: Any, model: Any, data: Any, a: int, b: int) -> bool:
    reach = float(model.geom_rbound[a] + model.geom_rbound[b])
    near = np.linalg.norm(data.geom_xpos[a] - data.geom_xpos[b]) <= reach
    return bool(near and mujoco.mj_geomDistance(model, data, a, b, 1e-3, None) < 0.0)


def _is_body(mujoco: Any, model: Any, geom: int) -> bool:
    kinds = mujoco.mjtGeom
    return int(model.geom_type[geom]) not in (int(kinds.mjGEOM_PLANE), int(kinds.mjGEOM_HFIELD))


def _may_touch(model: Any, a: int, b: int) -> bool:
    """Whether MuJoCo makes contacts between two geoms that no pair names, or their bodies never move apart."""
    first, second = (int(model.body_weldid[model.geom_bodyid[geom]]) for geom in (a, b))
    if first == second:
        return True
    parents = [int(model.body_weldid[model.body_parentid[weld]]) for weld in (first, second)]
    if (parents[0] == second and second != 0) or (parents[1] == first and first != 0):
        return False
    masks = int(model.geom_contype[a]), int(model.geom_conaffinity[a])
    others = int(model.geom_contype[b]), int(model.geom_conaffinity[b])
    return bool(masks[0] & others[1] or others[0] & masks[1])
