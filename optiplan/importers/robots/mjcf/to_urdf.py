"""A robot of MuJoCo (MJCF) as a URDF: bodies, joints, inertias, geoms, sites, exclusions and keyframes.

MuJoCo compiles the file; its compiled model is read. A body B with joints i = 1 … k of anchor p_i and axis a_i moves as

    X_PB(q) = X_PB0 Π_i T(p_i) R(a_i, q_i - q0_i) T(-p_i),    of a slide: T(a_i (q_i - q0_i)),

with q0 the reference positions, so each joint becomes one of a URDF, with links without a body between them.
"""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.importers.robots.description import Description
from optiplan.importers.robots.mjcf.compiled import compile_mjcf
from optiplan.importers.robots.mjcf.contacts import excluded_pairs, overlapping_pairs
from optiplan.importers.robots.mjcf.couplings import Couplings, find_couplings
from optiplan.importers.robots.mjcf.geoms import GeomWriter, placed
from optiplan.importers.robots.urdf_tree import FAR, WORLD, UrdfTree, moved, torques_without
from optiplan.robot.urdf.elements import inertial_element, number_words

UNNAMED = "MuJoCo Model"
"""MuJoCo's name of a model whose file has none."""


def describe_mjcf(path: Path) -> Description:
    """Read the robot of an MJCF file.

    Raises:
        InputError: no MJCF, or one that MuJoCo does not compile; a body without a finite inertia.
        OptiPlanError: the package `mujoco` is not installed.
    """
    mujoco, model, remarks = compile_mjcf(path)
    for body in np.flatnonzero(~np.isfinite(model.body_inertia).all(axis=1)).tolist():
        found = f"an inertia of body {model.body(body).name or body} that is not finite"
        raise InputError([Issue(str(path), None, "mjcf", found, "masses and sizes that are finite")])
    writer = _MjcfWriter(mujoco, model, _model_name(model, path))
    for body in range(model.nbody):
        writer.body(body)
    states, rest = writer.keyframes()
    excluded = excluded_pairs(model, writer.links)
    overlapping = sorted(overlapping_pairs(mujoco, model, writer.links) - excluded)
    if overlapping:
        listed = ", ".join(f"{a}-{b}" for a, b in overlapping)
        writer.notes.append(f"not checked, since they overlap as drawn and MuJoCo lets them: {listed}")
    notes = [
        *remarks,
        *writer.couplings.notes,
        *writer.geoms.notes,
        *writer.geoms.bodiless(),
        *writer.notes,
        *writer.left_out(),
    ]
    return Description(
        source=path,
        name=str(writer.urdf.root.get("name")),
        text=writer.urdf.text(),
        files=writer.geoms.meshes.files,
        keys={"collision": "hull"},
        states=states,
        rest=rest,
        allowed=(*sorted(excluded), *overlapping),
        notes=tuple(dict.fromkeys([*notes, "links touch as hulls of their meshes, as in MuJoCo: collision: hull"])),
    )


def _model_name(model: Any, path: Path) -> str:
    """The name that MuJoCo read, whose XML may have comments that Python's parser refuses; else that of the file."""
    name = bytes(model.names).partition(b"\0")[0].decode(errors="replace")
    return (path.stem if name in ("", UNNAMED) else name).replace(" ", "_")


class _MjcfWriter:
    """The URDF of one compiled model."""

    def __init__(self, mujoco: Any, model: Any, name: str) -> None:
        self.mujoco, self.model = mujoco, model
        self.notes: list[str] = []
        self.geoms = GeomWriter(mujoco, model)
        self.joints = _unique([str(model.joint(j).name) or self._joint_of(j) for j in range(model.njnt)], set())
        bodies = [WORLD] + [str(model.body(b).name) or f"body_{b}" for b in range(1, model.nbody)]
        self.links = _unique(bodies, {*self.joints, "universe"}, "_link")
        self.sites = _unique(
            [str(model.site(s).name) for s in range(model.nsite)], {*self.joints, *self.links, "universe"}, "_site"
        )
        self.couplings: Couplings = find_couplings(mujoco, model, self.joints)
        self.urdf = UrdfTree(name, {*self.joints, *self.links, *self.sites})

    def _joint_of(self, j: int) -> str:
        body = int(self.model.jnt_bodyid[j])
        return f"{self.model.body(body).name or f'body_{body}'}_joint"

    def body(self, b: int) -> None:
        """One body: its joints, links between them, its inertia, geoms and sites."""
        model = self.model
        link = self.links[b]
        if b > 0:
            self._chain(b, link)
        element = self.urdf.link(link)
        if model.body_mass[b] > 0.0:
            inertia = pin.Inertia(float(model.body_mass[b]), np.zeros(3), np.diag(model.body_inertia[b]))
            inertial_element(element, placed(model.body_ipos[b], model.body_iquat[b]).act(inertia))
        first = int(model.body_geomadr[b])
        for geom in range(first, first + int(model.body_geomnum[b])):
            self.geoms.add(element, geom, pin.SE3.Identity())
        for site in (s for s in range(model.nsite) if model.site_bodyid[s] == b and model.site(s).name):
            self.urdf.link(self.sites[site])
            X_BS = placed(model.site_pos[site], model.site_quat[site])
            self.urdf.joint(self.urdf.free(f"{self.sites[site]}_fixed"), "fixed", (link, self.sites[site]), X_BS)

    def _chain(self, b: int, link: str) -> None:
        """The joints before a body; the last link is the body's own frame."""
        model = self.model
        parent = self.links[int(model.body_parentid[b])]
        X = placed(model.body_pos[b], model.body_quat[b])
        first = int(model.body_jntadr[b])
        own = range(first, first + int(model.body_jntnum[b]))
        moving = [j for j in own if self._has_axis(j)]
        for j in moving:
            anchor, axis = np.array(model.jnt_pos[j], float), np.array(model.jnt_axis[j], float)
            turns = int(model.jnt_type[j]) == self.mujoco.mjtJoint.mjJNT_HINGE
            before = X * pin.SE3(np.eye(3), anchor) * moved(turns, axis, -float(model.qpos0[model.jnt_qposadr[j]]))
            held = self._held(j)
            if held is not None:
                X = before * moved(turns, axis, held) * pin.SE3(np.eye(3), -anchor)
                continue
            last = j == moving[-1] and not np.any(anchor)
            child = link if last else self.urdf.free(f"{self.joints[j]}_frame")
            self._moving(j, (parent, child), before, turns)
            if last:
                return
            self.urdf.link(child)
            parent, X = child, pin.SE3(np.eye(3), -anchor)
        self.urdf.joint(self.urdf.free(f"{link}_fixed"), "fixed", (parent, link), X)

    def _held(self, j: int) -> float | None:
        """The position at which joint j is held, itself or by its leader; None where it moves."""
        found = self.couplings
        if j in found.held:
            return found.held[j]
        if j in found.followers:
            leader, slope, offset = found.followers[j]
            value = self._held(leader)
            return None if value is None else slope * value + offset
        return None

    def _moving(self, j: int, links: tuple[str, str], X_PJ: pin.SE3, turns: bool) -> None:
        model = self.model
        limited = bool(model.jnt_limited[j])
        kind = ("revolute" if limited else "continuous") if turns else "prismatic"
        element = self.urdf.joint(self.joints[j], kind, links, X_PJ)
        ET.SubElement(element, "axis", xyz=number_words(model.jnt_axis[j]))
        limit = ET.SubElement(element, "limit", effort=repr(self._effort(j)), velocity="0")
        if limited or not turns:
            low, high = model.jnt_range[j] if limited else (-FAR, FAR)
            limit.set("lower", repr(float(low)))
            limit.set("upper", repr(float(high)))
        if not limited and not turns:
            self.notes.append(f"{self.joints[j]} slides without limits: ±{FAR:g} m are taken")
        mimic = self.couplings.mimic(j, self.joints)
        if mimic is not None:
            follower = ET.SubElement(element, "mimic", joint=mimic.source)
            follower.set("multiplier", repr(mimic.multiplier))
            follower.set("offset", repr(mimic.offset))

    def _effort(self, j: int) -> float:
        """The largest force, N, or torque, N·m, of the drives of a joint; 0 where none is stated."""
        model, transmission = self.model, self.mujoco.mjtTrn
        if np.any(model.body_gravcomp):
            self.notes.append("gravity is compensated in the file (gravcomp): no limits of torque are taken")
            return 0.0
        ranges = [model.jnt_actfrcrange[j]] if model.jnt_actfrclimited[j] else []
        own = (transmission.mjTRN_JOINT, transmission.mjTRN_JOINTINPARENT)
        for k in range(model.nu):
            if int(model.actuator_trntype[k]) not in own or model.actuator_trnid[k, 0] != j:
                continue
            gear = float(model.actuator_gear[k, 0])
            if model.actuator_forcelimited[k]:
                ranges.append(model.actuator_forcerange[k] * gear)
            if model.actuator_ctrllimited[k] and self._is_motor(k):
                ranges.append(model.actuator_ctrlrange[k] * float(model.actuator_gainprm[k, 0]) * gear)
        if any(float(low) * float(high) >= 0.0 for low, high in ranges):
            self.notes.append(f"{self.joints[j]} is driven one way only: its limit of torque is taken for both ways")
        return min(filter(None, map(_either_way, ranges)), default=0.0)

    def _is_motor(self, k: int) -> bool:
        """Whether the force of a drive is its gain times its control, without a bias."""
        gains, biases, dynamics = self.mujoco.mjtGain, self.mujoco.mjtBias, self.mujoco.mjtDyn
        return (
            int(self.model.actuator_gaintype[k]) == gains.mjGAIN_FIXED
            and int(self.model.actuator_biastype[k]) == biases.mjBIAS_NONE
            and int(self.model.actuator_dyntype[k])
            in (dynamics.mjDYN_NONE, dynamics.mjDYN_FILTER, dynamics.mjDYN_FILTEREXACT)
        )

    def left_out(self) -> list[str]:
        """What torques of the file are without: remarks that name the joints."""
        model, moving = self.model, [j for j in range(self.model.njnt) if self._moves(j)]
        dofs = [int(model.jnt_dofadr[j]) for j in moving]
        kinds = {
            "inertia of rotors (armature)": model.dof_armature[dofs],
            "friction (damping, frictionloss)": model.dof_damping[dofs] + model.dof_frictionloss[dofs],
            "springs (stiffness)": model.jnt_stiffness[moving],
        }
        return torques_without(
            {kind: [self.joints[j] for j, x in zip(moving, of, strict=True) if x > 0] for kind, of in kinds.items()}
        )

    def keyframes(self) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
        """Named configurations, and the positions of joints that are not planned: of the first keyframe."""
        model = self.model
        moving = [j for j in range(model.njnt) if self._moves(j)]
        states = {}
        for k in range(model.nkey):
            q = model.key_qpos[k]
            states[str(model.key(k).name) or f"key_{k}"] = {
                self.joints[j]: float(q[model.jnt_qposadr[j]]) for j in moving
            }
        return states, dict(next(iter(states.values()), {}))

    def _moves(self, j: int) -> bool:
        return self._has_axis(j) and self._held(j) is None and j not in self.couplings.followers

    def _has_axis(self, j: int) -> bool:
        kinds = self.mujoco.mjtJoint
        return int(self.model.jnt_type[j]) in (kinds.mjJNT_SLIDE, kinds.mjJNT_HINGE)


def _either_way(ends: Array) -> float:
    """The size that a force between two ends has in both directions, in its own one where these are of one side."""
    low, high = (float(end) for end in ends)
    return min(abs(low), abs(high)) if low * high < 0.0 else max(abs(low), abs(high))


def _unique(names: list[str], taken: set[str], ending: str = "_") -> list[str]:
    """The names, with an ending where one is taken."""
    taken, result = set(taken), []
    for name in names:
        while name in taken:
            name += ending
        taken.add(name)
        result.append(name)
    return result
