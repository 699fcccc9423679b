"""Geoms of a MuJoCo model as shapes of a URDF, and its meshes as STL files.

plane, height field     left out with a remark: a URDF has none
mesh, SDF               the triangles of the mesh that MuJoCo compiled, in the frame of the geom
ellipsoid               a polyhedron around it, at most 3.2 % wider
"""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.messages import some
from optiplan.geometry.meshes.triangles import Triangles
from optiplan.importers.robots.polyhedra import ellipsoid_hull
from optiplan.importers.robots.urdf_tree import MeshFiles, add_shape
from optiplan.robot.urdf.elements import number_words

SEEN = 3
"""Groups of geoms below this one are drawn, as by MuJoCo's viewer."""


def placed(position: Array, quaternion: Array) -> pin.SE3:
    """A pose from MuJoCo's position (3,), m, and quaternion w, x, y, z (4,)."""
    w, x, y, z = (float(value) for value in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix(), np.array(position, float))


def touches(model: Any, geom: int) -> bool:
    """Whether a geom can touch another: a bit of `contype` or `conaffinity` is set, or a pair names it."""
    named = geom in model.pair_geom1 or geom in model.pair_geom2
    return named or bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def carried_bodies(mujoco: Any, model: Any) -> set[int]:
    """The bodies that a joint which is not free moves: those of robots."""
    free, found = int(mujoco.mjtJoint.mjJNT_FREE), set[int]()
    for body in range(1, model.nbody):  # a body comes after the one that carries it
        first = int(model.body_jntadr[body])
        own = range(first, first + int(model.body_jntnum[body]))
        if int(model.body_parentid[body]) in found or any(int(model.jnt_type[j]) != free for j in own):
            found.add(body)
    return found


def solid_geoms(mujoco: Any, model: Any) -> tuple[set[int], str]:
    """The geoms that are bodies of a robot, and a remark where the file lets none of the moving ones touch another.

    Those that can touch. Where none of a robot's moving geoms can, though perhaps the table beside it: also the geoms
    of bodies that are not drawn, which stand for the links by custom; without any, all.
    """
    everything = set(range(model.ngeom))
    carried = carried_bodies(mujoco, model)
    solid = {geom for geom in everything if touches(model, geom)}
    moving = {geom for geom in everything if int(model.geom_bodyid[geom]) in carried}
    if not everything or (solid and not moving) or solid & moving:
        return solid, ""
    ghosts = {geom for geom in everything - solid if not solid or int(model.geom_bodyid[geom]) != 0}
    hidden = {geom for geom in ghosts if model.geom_group[geom] >= SEEN}
    which, whose = "those that are not drawn" if hidden else "all of them", "that moves " if solid else ""
    return solid | (hidden or ghosts), f"no geom {whose}can touch another in the file: {which} are taken as bodies"


class GeomWriter:
    """Adds geoms to the links of a URDF; `meshes` gets the meshes, `notes` what is omitted."""

    def __init__(self, mujoco: Any, model: Any) -> None:
        self.model = model
        self.meshes = MeshFiles()
        self.notes: list[str] = []
        self._kinds = mujoco.mjtGeom
        self._solid, remark = solid_geoms(mujoco, model)
        self._drawn: set[str] = set()
        self._bodies: set[str] = set()
        self.notes += [remark] if remark else []

    def add(self, link: ET.Element, geom: int, X_LB: pin.SE3) -> None:
        """Add a geom whose body B is at X_LB in the link."""
        model = self.model
        shape = self._shape(geom, link.get("name", ""))
        if shape is None:
            return
        X_LG = X_LB * placed(model.geom_pos[geom], model.geom_quat[geom])
        solid = geom in self._solid
        if model.geom_group[geom] < SEEN or not solid:
            add_shape(link, "visual", X_LG, shape, self._colour(geom))
        if solid:
            add_shape(link, "collision", X_LG, shape)
        (self._bodies if solid else self._drawn).add(str(link.get("name")))

    def bodiless(self) -> list[str]:
        """A remark that names the links which are drawn, and of which no geom can touch another."""
        names = sorted(self._drawn - self._bodies)
        return [f"only drawn, since no geom of them can touch another: {some(names)}"] if names else []

    def _colour(self, geom: int) -> Array:
        material = int(self.model.geom_matid[geom])
        return np.array(self.model.geom_rgba[geom] if material < 0 else self.model.mat_rgba[material], float)

    def _shape(self, geom: int, link: str) -> ET.Element | None:
        kinds, kind = self._kinds, int(self.model.geom_type[geom])
        a, b, c = (float(x) for x in self.model.geom_size[geom])
        if kind == kinds.mjGEOM_BOX:
            return ET.Element("box", size=number_words([2 * a, 2 * b, 2 * c]))
        if kind == kinds.mjGEOM_SPHERE:
            return ET.Element("sphere", radius=repr(a))
        if kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
            tag = "cylinder" if kind == kinds.mjGEOM_CYLINDER else "capsule"
            return ET.Element(tag, radius=repr(a), length=repr(2 * b))
        if kind == kinds.mjGEOM_ELLIPSOID:
            return self.meshes.element(-1 - geom, f"ellipsoid_{geom}", *ellipsoid_hull(a, b, c))
        mesh = int(self.model.geom_dataid[geom])
        if kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF) and mesh >= 0:
            return self.meshes.element(mesh, self.model.mesh(mesh).name or f"mesh_{mesh}", *mesh_of(self.model, mesh))
        words = "plane" if kind == kinds.mjGEOM_PLANE else "height field"
        self.notes.append(f"left out: the {words} of {link}, which a robot cannot have; put it into the scene")
        return None


def mesh_of(model: Any, mesh: int) -> tuple[Array, Triangles]:
    """Vertices (k, 3), m, in the frame of the geoms that have it, and triangles (m, 3) of a compiled mesh."""
    first, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])]
    return np.array(vertices, float), np.array(model.mesh_face[face : face + int(model.mesh_facenum[mesh])])
