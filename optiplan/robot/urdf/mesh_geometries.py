"""The meshes of a URDF, read by `geometry.meshes.reading` instead of by pinocchio's own loader.

Pinocchio gets the URDF with a ball for each mesh, so it opens no file. The balls are then replaced by the meshes, with
the same names, order and poses. As in RViz and MoveIt, lengths are in the unit of the file, and its axes are those of
the link. The upward axis of the file is ignored: exporters of robots write Y_UP where z is up.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.geometry.file_shapes import triangle_mesh
from optiplan.geometry.meshes.reading import MeshFile, open_mesh, read_mesh, read_together

Place = tuple[str, int]
"""Name of a link and which of its collisions (or visuals)."""


def build_geometry_of(model: pin.Model, xml: str, kind: pin.GeometryType) -> pin.GeometryModel:
    """Collision or visual geometry of a URDF whose meshes are absolute paths; meshes as triangles, m.

    Raises:
        ValueError: a mesh that cannot be read (`mesh_formats.MeshError`), or what pinocchio says.
        RuntimeError: what pinocchio says.
    """
    root = ET.fromstring(xml)
    tag = "collision" if kind == pin.GeometryType.COLLISION else "visual"
    meshes = {place: mesh for place, mesh in _take_meshes(root, tag)}
    files: dict[str, MeshFile] = {}
    for mesh in meshes.values():
        name = mesh.get("filename", "")
        if name not in files:
            files[name] = open_mesh(Path(name))
    read_together(files.values())
    geometry = pin.buildGeomFromUrdfString(model, ET.tostring(root, encoding="unicode"), kind)
    names = {f"{link}_{index}": mesh for (link, index), mesh in meshes.items()}
    for item in geometry.geometryObjects:
        if item.name in names:
            _exchange(item, names[item.name], files)
    return geometry


def _take_meshes(root: ET.Element, tag: str) -> Iterator[tuple[Place, ET.Element]]:
    """The meshes, out of the tree, with a ball in the place of each."""
    for link in root.iter("link"):
        for index, body in enumerate(link.findall(tag)):
            geometry = body.find("geometry")
            mesh = None if geometry is None else geometry.find("mesh")
            if geometry is not None and mesh is not None:
                geometry.remove(mesh)
                ET.SubElement(geometry, "sphere", radius="1")
                yield (link.get("name", ""), index), mesh


def _exchange(item: pin.GeometryObject, mesh: ET.Element, files: dict[str, MeshFile]) -> None:
    file = files[mesh.get("filename", "")]
    scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
    soup = read_mesh(file)
    item.geometry = triangle_mesh(soup.vertices * scale, soup.triangles)
    item.meshPath, item.meshScale = str(file.path), scale
