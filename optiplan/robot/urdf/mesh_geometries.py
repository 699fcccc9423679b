"""The meshes of a URDF, read by `geometry.meshes.reading` instead of by pinocchio's own loader.

Pinocchio gets the URDF with a ball for each mesh, so it opens no file. The balls are later replaced by the meshes, or
by what covers them, with the same names, order and poses. As in RViz and MoveIt, lengths are in the unit of the file,
and its axes are those of the link. The upward axis of the file is ignored: exporters of robots write Y_UP where z is
up.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.geometry.file_shapes import check_reach, triangle_mesh
from optiplan.geometry.meshes.reading import MeshFile, open_mesh, read_meshes
from optiplan.geometry.meshes.triangles import Soup
from optiplan.records import dataclass

Place = tuple[str, int]
"""Name of a link and which of its collisions (or visuals)."""


@dataclass(frozen=True, eq=False)
class UrdfBodies:
    """Bodies of a URDF, and the content of its meshes by the name of the body, scaled, m.

    In `geometry` a ball stands for each mesh: building a tree over triangles takes longer than all else of a robot, and
    most meshes are covered by convex bodies.
    """

    geometry: pin.GeometryModel
    meshes: Mapping[str, Soup]

    def with_meshes(self) -> pin.GeometryModel:
        """Return the geometry with the meshes as triangles, in place of the balls."""
        for item in self.geometry.geometryObjects:
            if (soup := self.meshes.get(item.name)) is not None:
                item.geometry = triangle_mesh(soup.vertices, soup.triangles)
        return self.geometry


def read_bodies(model: pin.Model, xml: str, kind: pin.GeometryType) -> UrdfBodies:
    """Return the collision or visual bodies of a URDF whose meshes are absolute paths.

    Raises:
        ValueError: a mesh that cannot be read (`triangles.MeshError`), or what pinocchio says.
        RuntimeError: what pinocchio says.
    """
    root = ET.fromstring(xml)
    tag = "collision" if kind == pin.GeometryType.COLLISION else "visual"
    meshes = dict(_take_meshes(root, tag))
    files: dict[str, MeshFile] = {}
    for mesh in meshes.values():
        name = mesh.get("filename", "")
        if name not in files:
            files[name] = open_mesh(Path(name))
    contents = dict(zip(files, read_meshes(list(files.values())), strict=True))
    geometry = pin.buildGeomFromUrdfString(model, ET.tostring(root, encoding="unicode"), kind)
    names = {f"{link}_{index}": mesh for (link, index), mesh in meshes.items()}
    soups: dict[str, Soup] = {}
    for item in geometry.geometryObjects:
        if item.name in names:
            mesh, name = names[item.name], names[item.name].get("filename", "")
            soups[item.name] = _describe(item, mesh, files[name], contents[name])
    return UrdfBodies(geometry, soups)


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


def _describe(item: pin.GeometryObject, mesh: ET.Element, file: MeshFile, soup: Soup) -> Soup:
    """Write path and scale of a mesh into its body, and return its content at this scale."""
    scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
    item.meshPath, item.meshScale = str(file.path), scale
    check_reach(soup.vertices * scale)
    return replace(soup, vertices=soup.vertices * scale)
