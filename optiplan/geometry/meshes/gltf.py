"""Binary glTF 2.0 files: their scene, by the specification in m and with y up.

Not by trimesh: it drops triangle fans, sparse values and a node's second parent without a message, and takes a skin or
an unknown required extension for a rigid mesh.
"""

import json
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.geometry.meshes.scene_graph import TURNS, MeshPart, PlacedMesh, fan, joined, strip
from optiplan.geometry.meshes.triangles import MeshError, Soup, floats, triangulate

HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp", "KHR_animation_")
"""Extensions of glTF that do not change triangles."""

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


def read_glb(content: bytes) -> Soup:
    """Return the scene of a binary glTF 2.0 file; its data must be in the file itself."""
    if content[:4] != b"glTF" or int.from_bytes(content[4:8], "little") != 2:
        raise MeshError("no binary glTF of version 2")
    size, kind = int.from_bytes(content[12:16], "little"), content[16:20]
    if kind != b"JSON" or 20 + size > len(content) or int.from_bytes(content[8:12], "little") != len(content):
        raise MeshError("a GLB file that is cut off")
    data = b""
    if len(content) > 20 + size:
        length, kind = int.from_bytes(content[20 + size : 24 + size], "little"), content[24 + size : 28 + size]
        data = content[28 + size : 28 + size + length]
        if kind != b"BIN\0" or length > len(data):
            raise MeshError(f"a GLB file whose second part is {length} bytes of {kind!r} where its data are meant")
    try:
        document = json.loads(content[20 : 20 + size])
    except (ValueError, RecursionError) as error:
        raise MeshError(f"no JSON in a GLB file: {error}") from error
    needed = [name for name in document.get("extensionsRequired", ()) if not str(name).startswith(HARMLESS)]
    if needed:
        raise MeshError(f"a GLB file that needs {', '.join(map(str, needed))}, which cannot be read")
    return _Gltf(document, data).scene().soup(1.0, TURNS["Y_UP"])


class _Gltf:
    def __init__(self, document: dict[str, Any], data: bytes) -> None:
        self.document, self.data = document, data
        self.read: dict[int, MeshPart] = {}

    def scene(self) -> PlacedMesh:
        """Return everything in the default scene."""
        found = PlacedMesh()
        roots = self.entry("scenes", self.document.get("scene", 0)).get("nodes", ())
        stack = [(int(node), np.eye(4), 0) for node in reversed(roots)]
        while stack:
            index, above, depth = stack.pop()
            found.enter(depth)
            node = self.entry("nodes", index)
            X = above @ _gltf_pose(node)
            if "skin" in node:
                raise MeshError("a GLB file with a skin, a shape that moves")
            if "mesh" in node:
                found.add(X, self.mesh(int(node["mesh"])))
            stack += [(int(child), X, depth + 1) for child in reversed(node.get("children", ()))]
        return found

    def entry(self, kind: str, index: int) -> dict[str, Any]:
        """Return entry `index` of a list of the document."""
        entries = self.document.get(kind, ())
        if not 0 <= index < len(entries):
            raise MeshError(f"{kind} of a GLB file: there is no number {index}")
        found: dict[str, Any] = entries[index]
        return found

    def mesh(self, index: int) -> MeshPart:
        """Return the triangles of one mesh."""
        if index not in self.read:
            primitives = self.entry("meshes", index).get("primitives", ())
            surfaces = (one for one in primitives if one.get("mode", 4) >= 4)  # the others are points and lines
            self.read[index] = joined(map(self.primitive, surfaces))
        return self.read[index]

    def primitive(self, primitive: dict[str, Any]) -> MeshPart:
        """Return the triangles of a list, strip or fan."""
        if primitive.get("targets"):
            raise MeshError("a GLB file with morph targets, a shape that moves")
        points = self.accessor(int(primitive["attributes"]["POSITION"]), "VEC3", 3).astype(np.float64)
        indices = np.arange(len(points))
        if "indices" in primitive:
            indices = self.accessor(int(primitive["indices"]), "SCALAR", 1).astype(np.int64)[:, 0]
        mode = primitive.get("mode", 4)
        if mode == 4 and len(indices) % 3:
            raise MeshError(f"triangles of {len(indices)} corners")
        groups = {4: lambda: indices.reshape(-1, 3).tolist(), 5: lambda: strip(indices), 6: lambda: fan(indices)}
        if mode not in groups:
            raise MeshError(f"primitives of the mode {mode}")
        if not np.isfinite(points).all():
            raise MeshError("a coordinate that is not a finite number")
        return points, triangulate(points, groups[mode]())

    def accessor(self, index: int, kind: str, width: int) -> Any:
        """Return the values (count, width) of an accessor."""
        accessor = self.entry("accessors", index)
        if accessor.get("type") != kind or "sparse" in accessor or "bufferView" not in accessor:
            raise MeshError(f"an accessor of {accessor.get('type')} that is sparse, without data, or not {kind}")
        view = self.entry("bufferViews", int(accessor["bufferView"]))
        if int(view["buffer"]) != 0 or "uri" in self.entry("buffers", 0):
            raise MeshError("a GLB file whose data lie elsewhere than in its second part")
        component = np.dtype(COMPONENTS[int(accessor["componentType"])])
        if (component.kind == "f") != (kind == "VEC3"):
            raise MeshError(f"{kind} of components {accessor['componentType']}")
        count, start = int(accessor["count"]), int(accessor.get("byteOffset", 0))
        stride = int(view.get("byteStride", width * component.itemsize))
        end = start + (count - 1) * stride + width * component.itemsize
        first, length = int(view.get("byteOffset", 0)), int(view["byteLength"])
        if count < 1 or start < 0 or stride < width * component.itemsize or end > length:
            raise MeshError(f"an accessor of {count} values from byte {start} in {length} bytes")
        if first < 0 or first + length > len(self.data):
            raise MeshError(f"{length} bytes from byte {first} in {len(self.data)} bytes")
        return np.ndarray((count, width), component, self.data, first + start, (stride, component.itemsize)).copy()


def _gltf_pose(node: dict[str, Any]) -> Array:
    if "matrix" in node:
        return floats(map(str, node["matrix"])).reshape(4, 4).T
    X = np.eye(4)
    x, y, z, w = floats(map(str, node.get("rotation", (0, 0, 0, 1)))).reshape(4)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    scale = floats(map(str, node.get("scale", (1, 1, 1)))).reshape(3)
    X[:3, :3] = (np.eye(3) + 2.0 * w * K + 2.0 * (K @ K)) @ np.diag(scale)
    X[:3, 3] = floats(map(str, node.get("translation", (0, 0, 0)))).reshape(3)
    return X
