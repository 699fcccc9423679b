"""COLLADA files: their scene, with their unit and upward axis (by default 1 m and y).

Not by trimesh: it needs one more dependency, pycollada, does not apply `<unit>` and `<up_axis>`, and accepts fewer
triangles than their `count`.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.meshes.scene_graph import TURNS, MeshPart, PlacedMesh, fan, joined, strip
from optiplan.geometry.meshes.triangles import MeshError, Soup, Triangles, floats, triangulate, whole_numbers


def read_dae(content: bytes) -> Soup:
    """Return the scene of a COLLADA document."""
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise MeshError("a COLLADA file with entities of its own")
    try:
        root = ET.fromstring(content)
    except (ET.ParseError, LookupError) as error:
        raise MeshError(f"no well-formed XML: {error}") from error
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise MeshError(f"an XML file of <{root.tag[:40]}> where <COLLADA> is meant")
    unit, up = root.find("asset/unit"), (root.findtext("asset/up_axis") or "Y_UP").strip()
    metre = 1.0 if unit is None else float(floats([unit.get("meter", "1")])[0])
    if up not in TURNS or not 1e-9 < metre < 1e9:
        raise MeshError(f"<unit meter='{metre:g}'>" if up in TURNS else f"<up_axis> {up[:20]}")
    return _Collada(root).scene().soup(metre, TURNS[up])


class _Collada:
    def __init__(self, root: ET.Element) -> None:
        self.root = root
        self.ids = {name: element for element in root.iter() if (name := element.get("id")) is not None}
        self.read: dict[str, MeshPart] = {}

    def scene(self) -> PlacedMesh:
        """Return everything in <scene>."""
        shown = self.root.find("scene/instance_visual_scene")
        if shown is None:
            raise MeshError("a COLLADA file without a <scene>")
        found = PlacedMesh()
        for node in reversed(self.target(shown, "visual_scene").findall("node")):
            self.place(node, found)
        return found

    def place(self, root: ET.Element, found: PlacedMesh) -> None:
        """Place the geometries of a node and its descendants."""
        stack = [(root, np.eye(4), 0)]
        while stack:
            node, above, depth = stack.pop()
            found.enter(depth)
            X = above @ _collada_pose(node)
            for item in node:
                if item.tag == "instance_geometry":
                    found.add(X, self.geometry(item))
                elif item.tag == "node":
                    stack.append((item, X, depth + 1))
                elif item.tag == "instance_node":
                    stack.append((self.target(item, "node"), X, depth + 1))
                elif item.tag == "instance_controller":
                    raise MeshError("a COLLADA scene with <instance_controller>, a shape that moves")

    def target(self, item: ET.Element, tag: str) -> ET.Element:
        """Return the element that an item refers to."""
        name = item.get("url", item.get("source", ""))
        element = self.ids.get(name.removeprefix("#"))
        if element is None or element.tag != tag or not name.startswith("#"):
            raise MeshError(f"<{item.tag}> of '{name[:60]}', which is no <{tag}> of the file")
        return element

    def geometry(self, item: ET.Element) -> MeshPart:
        """Return the triangles of the geometry that an instance refers to."""
        name = item.get("url", "")
        if name not in self.read:
            mesh = self.target(item, "geometry").find("mesh")
            if mesh is None:
                raise MeshError(f"the geometry '{name[:60]}', which is no <mesh>")
            self.read[name] = self.mesh(mesh)
        return self.read[name]

    def mesh(self, mesh: ET.Element) -> MeshPart:
        """Return the triangles of a <mesh>."""
        parts: list[MeshPart] = []
        for group in mesh:
            if group.tag in POLYGONS:
                points = self.positions(group)
                parts.append((points, triangulate(points, POLYGONS[group.tag](group))))
        return joined(parts)

    def positions(self, group: ET.Element) -> Array:
        """Return the points (k, 3) that a group of polygons indexes."""
        for item in group.findall("input"):
            if item.get("semantic") == "VERTEX":
                for inner in self.target(item, "vertices").findall("input"):
                    if inner.get("semantic") == "POSITION":
                        return self.source(self.target(inner, "source"))
        raise MeshError(f"<{group.tag}> without the positions of its vertices")

    def source(self, source: ET.Element) -> Array:
        """Return the values (k, 3) of a <source> of points."""
        accessor = source.find("technique_common/accessor")
        if accessor is None:
            raise MeshError("a <source> without an <accessor>")
        values = floats((self.target(accessor, "float_array").text or "").split())
        count, stride, offset = whole_numbers(accessor.get(key, default) for key, default in _ACCESSOR).tolist()
        if stride < 3 or min(count, offset) < 0 or offset + count * stride > len(values):
            raise MeshError(f"{count} points of {stride} values each from {len(values)} values")
        return values[offset : offset + count * stride].reshape(count, stride)[:, :3]


_ACCESSOR = (("count", ""), ("stride", "1"), ("offset", "0"))


def _collada_pose(node: ET.Element) -> Array:
    X = np.eye(4)
    for item in node:
        if item.tag in ("skew", "lookat"):
            raise MeshError(f"a node with <{item.tag}>")
        if item.tag not in ("matrix", "translate", "rotate", "scale"):
            continue
        values = floats((item.text or "").split())
        step = np.eye(4)
        if item.tag == "matrix":
            step = values.reshape(4, 4)
        elif item.tag == "translate":
            step[:3, 3] = values.reshape(3)
        elif item.tag == "scale":
            step[:3, :3] = np.diag(values.reshape(3))
        else:
            step[:3, :3] = _rotation(values.reshape(4))
        X = X @ step
    return X


def _rotation(values: Array) -> Array:
    """Return the rotation of an axis and an angle in degrees, by Rodrigues' formula."""
    length = float(np.linalg.norm(values[:3]))
    if length == 0.0:
        return np.eye(3)
    x, y, z = values[:3] / length
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.deg2rad(values[3])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))


def _indices(group: ET.Element, item: ET.Element | None = None) -> Triangles:
    """Return the vertex indices of a <p>, without the other inputs of its corners."""
    offsets = {entry.get("semantic"): int(entry.get("offset", "0")) for entry in group.findall("input")}
    step, mine = max(offsets.values(), default=0) + 1, offsets.get("VERTEX", 0)
    values = whole_numbers(((item.text if item is not None else "") or "").split())
    if step < 1 or step > 64 or not 0 <= mine < step or len(values) % step:
        raise MeshError(f"<{group.tag}> of {len(values)} indices in steps of {step}")
    return values.reshape(-1, step)[:, mine]


def _only(group: ET.Element) -> Triangles:
    """Return the vertex indices of the <p> of a group that has one."""
    lists = group.findall("p")
    if len(lists) > 1:
        raise MeshError(f"<{group.tag}> with {len(lists)} <p>")
    return _indices(group, *lists)


def _all(group: ET.Element) -> list[Triangles]:
    """Return the vertex indices of each <p> of a group."""
    lists = group.findall("p")
    if len(lists) != int(group.get("count", len(lists))):
        raise MeshError(f"<{group.tag}> of {group.get('count')} with {len(lists)} <p>")
    return [_indices(group, item) for item in lists]


def _triangles(group: ET.Element) -> list[list[int]]:
    indices = _only(group)
    if len(indices) != 3 * int(group.get("count", "-1")):
        raise MeshError(f"{len(indices)} corners of {group.get('count')} triangles")
    return [list(map(int, corners)) for corners in indices.reshape(-1, 3)]


def _polylist(group: ET.Element) -> list[list[int]]:
    indices = _only(group)
    counts = whole_numbers((group.findtext("vcount") or "").split()).tolist()
    if sum(counts) != len(indices) or min(counts, default=0) < 0 or len(counts) != int(group.get("count", "-1")):
        raise MeshError(f"a <polylist> of {len(counts)} polygons with {len(indices)} corners")
    return [list(map(int, corners)) for corners in np.split(indices, np.cumsum(counts, dtype=np.int64))[:-1]]


def _polygons(group: ET.Element) -> list[list[int]]:
    if group.find("ph") is not None:
        raise MeshError("a polygon with holes")
    return [list(map(int, corners)) for corners in _all(group)]


def _strips(group: ET.Element) -> list[list[int]]:
    return [corners for indices in _all(group) for corners in strip(indices)]


def _fans(group: ET.Element) -> list[list[int]]:
    return [corners for indices in _all(group) for corners in fan(indices)]


POLYGONS: Mapping[str, Callable[[ET.Element], list[list[int]]]] = {
    "triangles": _triangles,
    "polylist": _polylist,
    "polygons": _polygons,
    "tristrips": _strips,
    "trifans": _fans,
}
