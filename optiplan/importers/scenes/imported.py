"""What an importer makes of another program's scene: obstacles, mesh files beside the problem file, remarks."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.messages import some
from optiplan.geometry.meshes.triangles import Triangles
from optiplan.geometry.poses import pose_to_data
from optiplan.importers.robots.polyhedra import mesh_file, obj_text
from optiplan.problem.schema.scene import WORLD
from optiplan.records import dataclass


@dataclass
class ImportedScene:
    """Obstacles as data of a problem file, meshes by file name, and what was assumed or left out."""

    source: Path
    obstacles: list[dict[str, Any]] = field(default_factory=list)
    files: dict[str, bytes] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, shape: dict[str, Any], X_WO: pin.SE3) -> None:
        """Add an obstacle; a name that is taken gets a number."""
        taken = {body["name"] for body in self.obstacles}
        numbered = (name if k == 0 else f"{name}_{k + 1}" for k in range(len(taken) + 1))
        free = next(one for one in numbered if one not in taken)
        pose = {} if shape.keys() == {"half_space"} else {"pose": pose_to_data(X_WO)}
        self.obstacles.append({"name": free, "shape": shape, **pose})

    def add_half_space(self, name: str, X_WP: pin.SE3, normal: Iterable[float] = (0.0, 0.0, 1.0)) -> None:
        """Add what lies below a plane through the origin of P."""
        n = X_WP.rotation @ (np.array(list(normal), float) / np.linalg.norm(list(normal)))
        offset = float(n @ X_WP.translation)
        self.add(name, {"half_space": {"normal": [float(x) for x in n], "offset": offset}}, pin.SE3.Identity())

    def rename(self, taken: Collection[str]) -> None:
        """Give the obstacles other names whose own is the name of a link of the robot, or of the world."""
        taken = {WORLD, *taken}
        names = {body["name"] for body in self.obstacles}
        for body in (body for body in self.obstacles if body["name"] in taken):
            new = body["name"]
            while new in taken or new in names:
                new += "_"
            owner = "the world" if body["name"] == WORLD else "a link of the robot"
            self.notes.append(f"obstacle {body['name']} is called {new}, since {owner} is called so")
            body["name"] = new
            names.add(new)

    def note_bodies(self, robots: Sequence[str], loose: Sequence[str]) -> None:
        """Note the bodies with joints, which are left out, and those that lie loose."""
        if robots:
            command = f"`optiplan robots init {self.source.name}` makes a robot"
            self.notes.append(f"left out: {some(robots, 6)}, which have joints; {command}")
        if loose:
            self.notes.append(f"stand still where they are drawn: the loose bodies {some(loose, 6)}")

    def mesh(self, name: str, vertices: Array, triangles: Triangles) -> dict[str, Any]:
        """Keep a mesh as an OBJ file beside the problem file, and return the shape."""
        file = mesh_file(name, "{}.obj", self.files)
        self.files[file] = obj_text(np.asarray(vertices, float), np.asarray(triangles, int)).encode()
        return {"mesh": {"file": file}}
