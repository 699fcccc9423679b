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
from optiplan.geometry.meshes.triangles import Triangles
from optiplan.robot.urdf.elements import number_words, origin_element

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


def solid_geoms(model: Any) -> tuple[set[int], str]:
    """The geoms that are bodies of a robot, and a remark where the file lets none touch another.

    Those that can touch; without any those that are not drawn, which stand for the links by custom; else all.
    """
    everything = set(range(model.ngeom))
    solid = {geom for geom in everything if touches(model, geom)}
    if solid or not everything:
        return solid, ""
    hidden = {geom for geom in everything if model.geom_group[geom] >= SEEN}
    which = "those that are not drawn" if hidden else "all of them"
    return hidden or everything, f"no geom can touch another in the file: {which} are taken as bodies"


class GeomWriter:
    """Adds geoms to the links of a URDF; `files` gets the meshes, `notes` what is omitted."""

    def __init__(self, mujoco: Any, model: Any) -> None:
        self.model = model
        self.files: dict[str, bytes] = {}
        self.notes: list[str] = []
        self._kinds = mujoco.mjtGeom
        self._written: dict[int, str] = {}
        self._solid, remark = solid_geoms(model)
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
            self._element(link, "visual", X_LG, shape, self._colour(geom))
        if solid:
            self._element(link, "collision", X_LG, shape)

    def _element(
        self, link: ET.Element, tag: str, X_LG: pin.SE3, shape: ET.Element, colour: Array | None = None
    ) -> None:
        """One shape of a link; a capsule is a cylinder that `collision_checking` names, in a picture with two balls."""
        element = ET.SubElement(link, tag)
        origin_element(element, X_LG)
        geometry = ET.SubElement(element, "geometry")
        if shape.tag != "capsule":
            geometry.append(shape)
        else:
            ET.SubElement(geometry, "cylinder", dict(shape.attrib))
        if colour is not None:
            material = ET.SubElement(element, "material", name="rgba_" + "_".join(f"{x:.3g}" for x in colour))
            ET.SubElement(material, "color", rgba=number_words(colour))
        if shape.tag == "capsule" and tag == "collision":
            name = f"{link.get('name')}_{len(link)}"
            element.set("name", name)
            ET.SubElement(ET.SubElement(link, "collision_checking"), "capsule", name=name)
        elif shape.tag == "capsule":
            half = 0.5 * float(shape.get("length", "0"))
            for end in (-half, half):
                ball = ET.Element("sphere", radius=shape.get("radius", "0"))
                self._element(link, tag, X_LG * pin.SE3(np.eye(3), np.array([0.0, 0.0, end])), ball, colour)

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
            return self._mesh_file(-1 - geom, f"ellipsoid_{geom}", *ellipsoid_hull(a, b, c))
        mesh = int(self.model.geom_dataid[geom])
        if kind in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF) and mesh >= 0:
            return self._mesh_file(mesh, self.model.mesh(mesh).name or f"mesh_{mesh}", *mesh_of(self.model, mesh))
        words = "plane" if kind == kinds.mjGEOM_PLANE else "height field"
        self.notes.append(f"left out: the {words} of {link}, which a robot cannot have; put it into the scene")
        return None

    def _mesh_file(self, key: int, name: str, vertices: Array, triangles: Triangles) -> ET.Element:
        if key not in self._written:
            plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
            taken = set(self._written.values())
            file = next(f for k in range(len(taken) + 1) if (f := f"meshes/{plain}{k or ''}.stl") not in taken)
            self._written[key] = file
            self.files[file] = stl_bytes(vertices, triangles)
        return ET.Element("mesh", filename=self._written[key])


def mesh_of(model: Any, mesh: int) -> tuple[Array, Triangles]:
    """Vertices (k, 3), m, in the frame of the geoms that have it, and triangles (m, 3) of a compiled mesh."""
    first, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])]
    return np.array(vertices, float), np.array(model.mesh_face[face : face + int(model.mesh_facenum[mesh])])


def stl_bytes(vertices: Array, triangles: Triangles) -> bytes:
    """A binary STL of vertices (k, 3), m, and triangles (m, 3)."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corners"] = vertices[triangles]
    return bytes(80) + len(triangles).to_bytes(4, "little") + rows.tobytes()


def ellipsoid_hull(a: float, b: float, c: float) -> tuple[Array, Triangles]:
    """A polyhedron around the ellipsoid with half-axes a, b, c: an octahedron split three times, blown up.

    The unit ball touches it from inside: the vertices are on the sphere of radius 1 / r, with r the least distance of a
    facet of the polyhedron in the unit sphere from its centre. An affine map keeps what is inside inside.
    """
    corners = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    points = corners[np.array(faces)]
    for _ in range(3):
        p, q, r = points[:, 0], points[:, 1], points[:, 2]
        pq, qr, rp = p + q, q + r, r + p
        parts = [np.stack(part, axis=1) for part in ((p, pq, rp), (pq, q, qr), (rp, qr, r), (pq, qr, rp))]
        points = np.concatenate(parts)
        points /= np.linalg.norm(points, axis=2, keepdims=True)
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inside = float(np.min(np.einsum("ij,ij->i", normals, points[:, 0])))
    flat = points.reshape(-1, 3) / inside * np.array([a, b, c])
    vertices, index = np.unique(flat.round(12), axis=0, return_inverse=True)
    return vertices, index.reshape(-1, 3)
