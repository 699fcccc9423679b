"""Covers of a URDF's meshes, made in several processes before the robot is loaded, which then finds them."""

from contextlib import suppress
from pathlib import Path

from optiplan import cache
from optiplan.api.imports.robot_files import RobotSource
from optiplan.cores import cores
from optiplan.errors import InputError
from optiplan.geometry.convex import cover_name, cover_of
from optiplan.geometry.meshes.triangles import Soup
from optiplan.planners.base import Progress
from optiplan.records import dataclass
from optiplan.robot.urdf.reader import build_model, read_collisions, read_urdf
from optiplan.workspace.parallel import ChunkedWork, run_chunks


def make_covers(source: RobotSource, progress: Progress) -> None:
    """Put the covers of the collision meshes into the cache, as `cover_of` makes them, the largest mesh first.

    What is wrong with a mesh, or with the URDF, is left for the load to say, which names the link.

    Args:
        source: the robot; one whose meshes stand as their hulls needs no covers.
        progress: of the work.

    Raises:
        OptiPlanError: a worker process died.
    """
    if not cache.writable() or source.described.keys.get("collision") == "hull":
        return
    try:
        meshes = _meshes_to_cut(source.urdf)
    except InputError:
        return

    def tell(share: float) -> None:
        done = round(share * len(meshes))
        progress(f"cutting meshes into convex pieces, once: {done} of {len(meshes)}", share)

    if meshes:
        tell(0.0)
        run_chunks(_Cutting(meshes), len(meshes), cores(), tell)


def _meshes_to_cut(urdf: Path) -> list[Soup]:
    """Different meshes of which no cover is kept, the largest first."""
    source = read_urdf(urdf, urdf.parent)
    meshes = read_collisions(source, build_model(source)).meshes.values()
    named = {cover_name(mesh.vertices, mesh.triangles): mesh for mesh in meshes}
    missing = [mesh for name, mesh in named.items() if cache.load(name) is None]
    return sorted(missing, key=lambda mesh: len(mesh.triangles), reverse=True)


@dataclass(frozen=True)
class _Cutting(ChunkedWork[None]):
    """Chunk k makes the cover of mesh k, in m."""

    meshes: list[Soup]

    def prepare(self) -> "_Cutting":
        return self

    def __call__(self, k: int) -> None:
        with suppress(ValueError, RuntimeError):  # the load meets them again
            cover_of(self.meshes[k])
