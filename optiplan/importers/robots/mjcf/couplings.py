"""Which joints of a MuJoCo model move by themselves, which follow another one, and which are held.

followers   of a linear equality of two joints, or of a fixed tendon of two joints that keeps its length;
held        joints that an equality fixes or couples otherwise, that share a drive with others by a tendon, that no
            actuator drives where the model has some that drive joints, and ball and free joints.
"""

from dataclasses import field
from typing import Any

import numpy as np

from optiplan.records import dataclass
from optiplan.robot.mimic_joints import Mimic


@dataclass
class Couplings:
    """By the index of the joint: its leader, or the position, rad or m, at which it is held; and remarks."""

    followers: dict[int, tuple[int, float, float]] = field(default_factory=dict)
    held: dict[int, float] = field(default_factory=dict)
    driven: set[int] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)

    def mimic(self, j: int, names: list[str]) -> Mimic | None:
        """Return how joint j follows another: q_j = multiplier · q_leader + offset."""
        if j not in self.followers:
            return None
        leader, multiplier, offset = self.followers[j]
        return Mimic(names[leader], multiplier, offset)


def find_couplings(mujoco: Any, model: Any, names: list[str]) -> Couplings:
    """Read equalities, tendons and actuators of a compiled model; `names` are those of its joints."""
    found = Couplings()
    direct, shared = _drives(mujoco, model)
    found.driven |= direct
    _equalities(mujoco, model, found, names)
    for tendon, joints in shared.items():
        free = [j for j in joints if j not in found.followers and j not in found.held]
        if len(free) == 1:
            found.driven.add(free[0])
        elif alone := [j for j in free if j not in direct]:
            for j in alone:
                found.held[j] = _reference(model, j)
            listed = ", ".join(names[j] for j in alone)
            found.notes.append(f"held: {listed}, which share the drive of tendon {_name(model.tendon(tendon), tendon)}")
    _passive(mujoco, model, found, names)
    return found


def _drives(mujoco: Any, model: Any) -> tuple[set[int], dict[int, list[int]]]:
    """Joints that an actuator drives, and the joints of each fixed tendon that one drives."""
    kinds = mujoco.mjtTrn
    direct: set[int] = set()
    shared: dict[int, list[int]] = {}
    for k in range(model.nu):
        target = int(model.actuator_trnid[k, 0])
        if int(model.actuator_trntype[k]) in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
            direct.add(target)
        elif int(model.actuator_trntype[k]) == kinds.mjTRN_TENDON:
            shared[target] = [joint for joint, _ in _fixed_tendon(mujoco, model, target)]
    return direct, {tendon: joints for tendon, joints in shared.items() if joints}


def _fixed_tendon(mujoco: Any, model: Any, tendon: int) -> list[tuple[int, float]]:
    """The joints of a fixed tendon with their coefficients; none of a spatial one."""
    first = int(model.tendon_adr[tendon])
    wraps = range(first, first + int(model.tendon_num[tendon]))
    if any(int(model.wrap_type[w]) != mujoco.mjtWrap.mjWRAP_JOINT for w in wraps):
        return []
    return [(int(model.wrap_objid[w]), float(model.wrap_prm[w])) for w in wraps]


def _equalities(mujoco: Any, model: Any, found: Couplings, names: list[str]) -> None:
    kinds = mujoco.mjtEq
    loops = 0
    for k in range(model.neq):
        if not model.eq_active0[k]:
            continue
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        if int(model.eq_type[k]) == kinds.mjEQ_JOINT:
            _joint_equality(model, found, names, (first, second), model.eq_data[k, :5])
        elif int(model.eq_type[k]) == kinds.mjEQ_TENDON and second < 0:
            _tendon_equality(mujoco, model, found, names, first, float(model.eq_data[k, 0]))
        elif int(model.eq_type[k]) in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            loops += 1
        else:
            found.notes.append(f"left out: equality {_name(model.equality(k), k)}")
    if loops:
        found.notes.append(f"left out: {loops} equalities that close a loop of bodies (connect, weld)")


def _joint_equality(model: Any, found: Couplings, names: list[str], pair: tuple[int, int], poly: Any) -> None:
    """Follow y - y0 = a0 + a1 (x - x0); of higher powers the joint is held at x = x0."""
    y, x = pair
    y0 = _reference(model, y)
    if x < 0 or not np.any(poly[1:]):
        found.held[y] = y0 + float(poly[0])
    elif np.any(poly[2:]):
        found.held[y] = y0 + float(poly[0])
        found.notes.append(f"held: {names[y]}, which follows {names[x]} by a polynomial of a higher degree")
    else:
        slope = float(poly[1])
        _follow(model, found, names, (y, x), slope, y0 + float(poly[0]) - slope * _reference(model, x))


def _tendon_equality(mujoco: Any, model: Any, found: Couplings, names: list[str], tendon: int, change: float) -> None:
    """Follow c_y (y - y0) + c_x (x - x0) = a0, the length that a fixed tendon of two joints keeps."""
    joints = _fixed_tendon(mujoco, model, tendon)
    if len(joints) != 2 or 0.0 in (joints[0][1], joints[1][1]):
        found.notes.append(f"left out: the length of tendon {_name(model.tendon(tendon), tendon)}")
        return
    (y, c_y), (x, c_x) = joints
    slope = -c_x / c_y
    _follow(model, found, names, (y, x), slope, _reference(model, y) + change / c_y - slope * _reference(model, x))


def _follow(model: Any, found: Couplings, names: list[str], pair: tuple[int, int], slope: float, offset: float) -> None:
    """Note that y = slope · x + offset; the other way round where y has the drive, or carries x: a leader carries."""
    y, x = pair
    if _carries(model, y, x) or (y in found.driven and x not in found.driven and not _carries(model, x, y)):
        y, x, slope, offset = x, y, 1.0 / slope, -offset / slope
    if y in found.driven:  # either of two coupled joints may be told where to go
        found.driven.add(x)
    leaders, leader = {y}, x
    while leader in found.followers:
        leaders.add(leader)
        leader = found.followers[leader][0]
    if y in found.followers or leader in leaders:
        found.notes.append(f"left out: a second equality of {names[y]} and {names[x]}")
    else:
        found.followers[y] = (x, slope, offset)


def _carries(model: Any, a: int, b: int) -> bool:
    """Whether joint a moves the body of joint b."""
    first, body = int(model.jnt_bodyid[a]), int(model.jnt_bodyid[b])
    while body > first:  # a body comes after the one that carries it
        body = int(model.body_parentid[body])
    return body == first and a != b


def _passive(mujoco: Any, model: Any, found: Couplings, names: list[str]) -> None:
    kinds = mujoco.mjtJoint
    for j in range(model.njnt):
        if int(model.jnt_type[j]) in (kinds.mjJNT_FREE, kinds.mjJNT_BALL):
            found.held[j] = 0.0
            kind = "free" if int(model.jnt_type[j]) == kinds.mjJNT_FREE else "ball"
            found.notes.append(f"held where the file puts it: the {kind} joint {names[j]}")
    if not found.driven:
        return
    alone = [j for j in range(model.njnt) if j not in found.driven | found.held.keys() | found.followers.keys()]
    for j in alone:
        found.held[j] = _reference(model, j)
    if alone:
        found.notes.append(f"held: {', '.join(names[j] for j in alone)}, which no actuator drives")


def _reference(model: Any, j: int) -> float:
    """The position of joint j, rad or m, in which the file draws the model."""
    return float(model.qpos0[model.jnt_qposadr[j]])


def _name(element: Any, k: int) -> str:
    return str(element.name) or f"number {k}"
