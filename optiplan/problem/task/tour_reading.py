"""Read a tour, checked: names, duplicates, and that some order keeps to everything that is stated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.errors import InputError, Issue
from optiplan.geometry.pose import pose_of
from optiplan.kinematics.ik.numeric import joints_that_move
from optiplan.problem.builder import Compiler
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.schema.tour import TargetSpec, TourSpec
from optiplan.problem.task.steps import Process, Target, TargetTour
from optiplan.problem.task.target_files import read_targets
from optiplan.problem.task.tour_order import cycle
from optiplan.robot.frames import link_names
from optiplan.robot.robot import Robot

_SAME = 1e-6
"""m and rad: targets that are nearer are one."""


def read_tour(
    compiler: Compiler, robot: Robot, place: Place, spec: TourSpec, joints: tuple[str, ...]
) -> TargetTour | None:
    """Return a tour of these joints with its targets; None where there are issues, which go to the compiler."""
    count = len(compiler.issues)
    frame = compiler.frame(robot, place, spec.frame)
    carrier = _carrier(compiler, robot, place, spec, frame, joints)
    file, lines = None, list[int]()
    if isinstance(spec.targets, str):
        file = str(compiler.base / spec.targets)
        try:
            rows = read_targets(compiler.base / spec.targets)
        except InputError as error:
            compiler.issues.extend(error.issues)
            return None
        given, lines = [one.row for one in rows], [one.line for one in rows]
    else:
        given = list(spec.targets)
    reader = _TargetReader(compiler, (*place, "targets"), file, lines)
    named = [one if one.name else one.model_copy(update={"name": f"target {k}"}) for k, one in enumerate(given, 1)]
    reader.names(named)
    for key in ("first", "last"):
        name = getattr(spec, key)
        if name is not None and name not in {one.name for one in named}:
            compiler.report((*place, key), f"unknown target '{name}'", choices(name, [str(one.name) for one in named]))
    if frame is None or carrier is None or len(compiler.issues) > count:
        return None
    targets = tuple(_target(one, spec, frame) for one in named)
    reader.duplicates(targets)
    reader.axes(named, spec)
    processes = tuple(Process(one.dwell, one.do or "") for one in spec.at_each)
    ends = spec.first or "", spec.last or ""
    tour = TargetTour(joints, targets, spec.order == "free", *ends, spec.closed, processes, carrier)
    caught = cycle(tour) if len(compiler.issues) == count else []
    if caught:
        names = " before ".join(f"'{name}'" for name in (*caught[:6], caught[0]))
        compiler.report(place, f"targets in a circle: {names}", "an order (of `after`, clusters, `first` and `last`)")
    return tour if len(compiler.issues) == count else None


def _carrier(
    compiler: Compiler, robot: Robot, place: Place, spec: TourSpec, frame: str | None, joints: tuple[str, ...]
) -> str | None:
    """Return the link that carries the targets; empty: the world does. None where it cannot, which is reported."""
    name = spec.carried_by
    if name is None or frame is None:
        return "" if name is None else None
    links = link_names(robot.model)
    if name not in links:
        compiler.unknown((*place, "carried_by"), "link", name, links)
        return None
    carrying, reaching = (joints_that_move(robot, one) for one in (name, frame))
    if not carrying[[robot.joint_names.index(joint) for joint in joints]].any():
        found, expected = f"'{name}', which no joint of the tour moves", "a link that one of these joints moves: "
        compiler.report((*place, "carried_by"), found, expected + ", ".join(joints))
        return None
    if (both := carrying & reaching).any():
        found = f"'{name}', which '{robot.joint_names[int(both.argmax())]}' moves together with '{frame}'"
        compiler.report((*place, "carried_by"), found, "a link that no joint of the arm moves")
        return None
    return name


class _TargetReader:
    """Reports issues of targets where they stand: in the problem file, or on their lines of a CSV file."""

    def __init__(self, compiler: Compiler, place: Place, file: str | None, lines: Sequence[int]) -> None:
        self.compiler, self.place, self.file, self.lines = compiler, place, file, lines

    def report(self, k: int, key: str, found: str, expected: str) -> None:
        """Record an issue of target k."""
        if self.file is None:
            self.compiler.report((*self.place, k, key), found, expected)
        else:
            self.compiler.issues.append(Issue(self.file, self.lines[k], key, found, expected))

    def names(self, targets: list[TargetSpec]) -> None:
        """Report names that two targets have, and names in `after` that none has."""
        first: dict[str, int] = {}
        for k, one in enumerate(targets):
            name = str(one.name)
            if name in first:
                self.report(k, "name", f"'{name}', the name of target {first[name] + 1}", "a name of its own")
            first.setdefault(name, k)
        for k, one in enumerate(targets):
            for other in one.after:
                if other not in first:
                    self.report(k, "after", f"unknown target '{other}'", choices(other, sorted(first)))
                elif other == one.name:
                    self.report(k, "after", f"'{other}' itself", "other targets")

    def duplicates(self, targets: tuple[Target, ...]) -> None:
        """Report targets at one place with one orientation, or with one free axis."""
        p = np.array([one.goal.X_WR.translation for one in targets])
        for k in range(len(targets)):
            for i in np.flatnonzero(np.abs(p[:k] - p[k]).max(axis=1, initial=0.0) < _SAME):
                if _alike(targets[int(i)].goal, targets[k].goal):
                    found = f"the place of '{targets[int(i)].name}'"
                    self.report(k, "position", found, "a place of its own: every target is visited once")
                    break

    def axes(self, targets: list[TargetSpec], spec: TourSpec) -> None:
        """Report an axis where another is free."""
        for k, one in enumerate(targets):
            if one.axis is not None and spec.free_axis not in (None, "z"):
                self.report(k, "axis", f"an axis with `free_axis: {spec.free_axis}`", "`free_axis: z`, or a rotation")


def _alike(a: RegionGoal, b: RegionGoal) -> bool:
    turn = a.X_WR.rotation.T @ b.X_WR.rotation
    if a.free != b.free:
        return False
    if a.free:
        return bool(np.abs(turn[:, a.free[0]] - np.eye(3)[a.free[0]]).max() < _SAME)
    return bool(np.linalg.norm(pin.log3(turn)) < _SAME)


def _target(spec: TargetSpec, tour: TourSpec, frame: str) -> Target:
    free = "z" if spec.axis is not None else tour.free_axis
    X = pose_of(spec) if spec.axis is None else pin.SE3(_along(np.array(spec.axis, float)), np.array(spec.position))
    back = np.zeros(3)
    back["xyz".index(free or "z")] = -tour.standoff
    turn = tour.tolerance.orientation
    turn /= 1.0 if turn >= np.pi else np.sqrt(3.0 if free is None else 2.0)
    off = np.repeat([tour.tolerance.position / np.sqrt(3.0), turn], 3)
    low, high = -off, off.copy()  # as of a pose, no place of the region is farther off than the tolerance
    if free is not None:
        low[3 + "xyz".index(free)], high[3 + "xyz".index(free)] = -np.inf, np.inf
    goal = RegionGoal(frame, X * pin.SE3(np.eye(3), back), pin.SE3.Identity(), low, high)
    target = Target(str(spec.name), goal, spec.after, spec.cluster or "")
    return target if spec.window is None else replace(target, window=spec.window)


def _along(axis: Array) -> Array:
    """Return the rotation (3, 3) that turns z to an axis (3,), the shortest one."""
    z = axis / np.linalg.norm(axis)
    across = np.array([-z[1], z[0], 0.0])  # z of the world x the axis
    sine = float(np.linalg.norm(across))
    angle = float(np.arctan2(sine, z[2]))
    about = across / sine if sine > 1e-12 else np.array([1.0, 0.0, 0.0])
    return np.asarray(pin.exp3(angle * about))
