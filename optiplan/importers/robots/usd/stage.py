"""A USD stage in metres and kilograms with z up, read by `usd-core`; every error names the file and the prim.

With s the metres of a unit, R_U the turn that takes the stage's up axis to z, and M the matrix of a prim for columns,

    p_W = s R_U (M p + t),    so A_WP = (s R_U M, s R_U t).

The pose of a prim is the rotation that is nearest to its A, and its origin; scale and shear belong to its shapes.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue, OptiPlanError
from optiplan.files import is_file
from optiplan.records import dataclass

_AT_LINE = re.compile(r"([^:]+):(\d+):\d+: (.*)")
"""An error of the parser: file, line, column, what is wrong."""


@dataclass(frozen=True)
class Affine:
    """p ↦ A p + t, lengths in m.

    Attributes:
        A: (3, 3).
        t: (3,), m.
    """

    A: Array
    t: Array

    def points(self, points: Array) -> Array:
        """Map points (k, 3) to m."""
        return points @ self.A.T + self.t

    def pose(self) -> pin.SE3:
        """The nearest rotation, of a mirrored map that of its negative, and the origin, m."""
        u, _, vt = np.linalg.svd(self.A if np.linalg.det(self.A) >= 0.0 else -self.A)
        return pin.SE3(u @ vt, self.t)

    def seen_from(self, X_WL: pin.SE3) -> "Affine":
        """The same map, in the frame L."""
        R = X_WL.rotation.T
        return Affine(R @ self.A, R @ (self.t - X_WL.translation))


@contextmanager
def opened_stage(path: Path) -> Iterator["UsdStage"]:
    """Open a stage, which usd-core may also refuse later, when it is asked for a pose or a target.

    Raises:
        OptiPlanError: the package `usd-core` is not installed.
        InputError: what usd-core refuses, or as of `UsdStage`.
    """
    try:
        yield UsdStage(path)
    except RuntimeError as error:
        if type(error).__name__ != "ErrorException":  # of pxr.Tf, which may not be installed
            raise
        told = [line.split(" : ", 1)[-1].strip().strip("'") for line in str(error).splitlines() if " : " in line]
        placed = next((match for one in told if (match := _AT_LINE.match(one))), None)
        text = told[0] if told else " ".join(str(error).split())
        file, line = str(path), None
        if placed is not None:
            file, line, text = placed[1], int(placed[2]), placed[3]
        raise InputError([Issue(file, line, "usd", text, "a USD file that usd-core reads")]) from error


class UsdStage:
    """An open stage and its units; `usd` holds the modules of usd-core. See `opened_stage`."""

    def __init__(self, path: Path) -> None:
        """Open a stage with everything that it references.

        Raises:
            OptiPlanError: the package `usd-core` is not installed.
            InputError: no USD, a layer that is missing, or units that are none.
        """
        if find_spec("pxr") is None:
            raise OptiPlanError(f"{path.name} is USD, which needs the package usd-core: pip install 'optiplan[usd]'")
        if not is_file(path):
            raise InputError([Issue(str(path), None, "usd", "no such file", "a USD file")])
        self.path = path
        self.usd: Any = import_module("pxr.Usd")
        self.geom: Any = import_module("pxr.UsdGeom")
        self.physics: Any = import_module("pxr.UsdPhysics")
        self.time = self.usd.TimeCode.EarliestTime()
        self.stage = self.usd.Stage.Open(str(path))
        broken = self.stage.GetCompositionErrors()
        if broken:
            raise InputError([self._broken(error) for error in broken[:5]])
        self.metres = float(self.geom.GetStageMetersPerUnit(self.stage))
        self.kilograms = float(self.physics.GetStageKilogramsPerUnit(self.stage))
        for key, value in (("metersPerUnit", self.metres), ("kilogramsPerUnit", self.kilograms)):
            if not 0.0 < value < 1e6:
                raise InputError([Issue(str(path), None, key, repr(value), "a number > 0")])
        up = str(self.geom.GetStageUpAxis(self.stage))
        self._R_U = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float) if up == "Y" else np.eye(3)
        self._poses = self.geom.XformCache(self.time)

    def _broken(self, error: Any) -> Issue:
        site = str(getattr(error, "rootSite", "")).rpartition("<")[2].strip(">") or "usd"
        return Issue(str(self.path), None, site, str(error).rstrip("."), "layers that are there")

    def issue(self, prim: Any, found: str, expected: str, key: str = "") -> InputError:
        """An error at a prim, and at an attribute of it."""
        field = f"{prim.GetPath()}.{key}" if key else str(prim.GetPath())
        return InputError([Issue(str(self.path), None, field, found, expected)])

    def prims(self) -> Iterator[Any]:
        """Every prim that is loaded and defined, also within instances."""
        yield from self.usd.PrimRange(self.stage.GetPseudoRoot(), self.usd.TraverseInstanceProxies())

    def placed(self, prim: Any) -> Affine:
        """A_WP of a prim."""
        if not prim or prim.IsPseudoRoot():
            return Affine(self.metres * self._R_U, np.zeros(3))
        M = np.array(self._poses.GetLocalToWorldTransform(prim), float).T
        if not np.isfinite(M).all() or abs(np.linalg.det(M[:3, :3])) < 1e-30:
            raise self.issue(prim, "a transform that flattens, or with values that are no numbers", "a transform")
        return Affine(self.metres * self._R_U @ M[:3, :3], self.metres * self._R_U @ M[:3, 3])

    def drawn(self, prim: Any) -> bool:
        """Whether a shape is visible and made for pictures."""
        image = self.geom.Imageable(prim)
        purposes = (self.geom.Tokens.default_, self.geom.Tokens.render)
        hidden = image.ComputeVisibility(self.time) == self.geom.Tokens.invisible
        return not hidden and image.ComputePurpose() in purposes

    def value(self, prim: Any, name: str, default: Any = None) -> Any:
        """The value of an attribute by its name, of a schema that usd-core knows or not; the default without one."""
        attribute = prim.GetAttribute(name)
        value = attribute.Get(self.time) if attribute else None
        return default if value is None else value

    def number(self, prim: Any, name: str, default: float, expected: str = "a number") -> float:
        """The number of an attribute, which may be endless.

        Raises:
            InputError: no number.
        """
        value = self.value(prim, name, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or value != value:
            raise self.issue(prim, repr(value), expected, name)
        return float(value)

    def targets(self, prim: Any, name: str) -> list[Any]:
        """The prims that a relationship names, without those that are not there."""
        relation = prim.GetRelationship(name)
        paths = relation.GetForwardedTargets() if relation else []
        return [target for path in paths if (target := self.stage.GetPrimAtPath(path))]


def schemas(prim: Any) -> tuple[str, ...]:
    """The names of the API schemas of a prim, also those that usd-core does not know, such as those of PhysX."""
    listed = prim.GetMetadata("apiSchemas")
    authored = [] if listed is None else [str(name) for name in listed.GetAddedOrExplicitItems()]
    return tuple(dict.fromkeys([*(str(name) for name in prim.GetAppliedSchemas()), *authored]))
