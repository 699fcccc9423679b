"""Collision geometry of each link: its mesh, the mesh's hull, or convex pieces."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.document import Document
from optiplan.config.messages import choices, some
from optiplan.config.values import LARGEST_COORDINATE
from optiplan.errors import InputError, Issue, plain_reason
from optiplan.geometry.convex import body_of, cover_of, hull_of, over_cover_of, pieces_of
from optiplan.geometry.file_shapes import triangle_mesh
from optiplan.geometry.meshes.triangles import Soup
from optiplan.records import dataclass
from optiplan.robot.frames import link_names
from optiplan.robot.spec import CollisionSpec, Treatment
from optiplan.robot.urdf.mesh_geometries import UrdfBodies

PRIMITIVE = "primitive"

LONG = 10.0
"""m; no link of an arm is as long, and one of 10 mm is, if its numbers are taken for metres."""

KINDS: tuple[Treatment, ...] = ("auto", "hull", "mesh", "convex_pieces")


@dataclass(frozen=True, eq=False)
class LinkGeometry:
    """Collision geometry with the meshes replaced as the robot.yaml requests.

    Attributes:
        geometry: the bodies.
        kinds: hull, mesh, convex_pieces or primitive, by link.
        over_cover: how far (m) each link's bodies reach beyond its meshes at most, measured; links with meshes only.
        notes: for the user, on replaced meshes.
    """

    geometry: pin.GeometryModel = field(default_factory=pin.GeometryModel)
    kinds: dict[str, str] = field(default_factory=dict)
    over_cover: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def treat(
    model: pin.Model, bodies: UrdfBodies, collision: Treatment | CollisionSpec, document: Document
) -> LinkGeometry:
    """Replace the meshes of a robot as its robot.yaml requests.

    Raises:
        InputError: a link that is unknown, is named twice, or has a mesh without a hull.
    """
    spec = CollisionSpec(default=collision) if isinstance(collision, str) else collision
    named = _named(spec, link_names(model), document)
    result = LinkGeometry()
    for item in bodies.geometry.geometryObjects:
        link = model.frames[item.parentFrame].name
        wanted = named.get(link, spec.default)
        try:
            treated = _treated(item, bodies.meshes.get(item.name), wanted, result.notes)
            for part in treated.bodies:
                result.geometry.addGeometryObject(part)
        except (ValueError, RuntimeError) as error:  # qhull has errors of its own
            found = f"{plain_reason(error)} ({item.meshPath})"
            raise InputError(
                [document.issue(("collision",), f"link {link}: {found}", "a mesh with vertices")]
            ) from error
        if treated.kind != PRIMITIVE:
            result.over_cover[link] = max(treated.over_cover, result.over_cover.get(link, 0.0))
        result.kinds[link] = max(treated.kind, result.kinds.get(link, treated.kind), key=_EXACTNESS.index)
    lengths = [(name.rpartition("_")[0], np.ptp(mesh.vertices, axis=0).max()) for name, mesh in bodies.meshes.items()]
    if long := [f"{link} ({length:.3g} m)" for link, length in lengths if length > LONG]:
        scale = 'scale="0.001 0.001 0.001" of a <mesh> turns millimetres into metres'
        result.notes.append(f"meshes that look like millimetres: those of {some(long, 3)}; {scale}")
    return result


_EXACTNESS = (PRIMITIVE, "mesh", "convex_pieces", "hull")
"""Kinds by accuracy; the kind of a link is that of its roughest shape."""


class _Treated(NamedTuple):
    """Treatment of a shape, how far (m) its bodies reach beyond it at most, and these bodies."""

    kind: str
    over_cover: float
    bodies: Iterable[pin.GeometryObject]


def _treated(item: pin.GeometryObject, mesh: Soup | None, wanted: Treatment, notes: list[str]) -> _Treated:
    if mesh is None:
        return _Treated(PRIMITIVE, 0.0, [item.copy()])
    vertices = mesh.vertices
    if not (len(vertices) and (np.abs(vertices) <= LARGEST_COORDINATE).all()):  # NaN is refused too
        raise ValueError(f"a mesh without finite vertices, or with one beyond {LARGEST_COORDINATE:g} m")
    match wanted:
        case "auto":
            cover = cover_of(mesh)
            if cover.kind == "mesh":
                notes.append(f"{item.name}: the mesh itself, since its hull reaches {_mm(cover.hull)} beyond it")
                return _Treated("mesh", 0.0, [_triangles(item, mesh)])
            if cover.kind == "convex_pieces":
                count, reach = len(cover.pieces), _mm(cover.over_cover)
                notes.append(f"{item.name}: {count} convex pieces, which reach at most {reach} beyond it")
            return _Treated(cover.kind, cover.over_cover, _bodies(item, cover.pieces))
        case "hull":
            hull = body_of(vertices)
            if hull.over_cover > 0.0:
                notes.append(f"{item.name}: a body around its hull, farther out by at most {_mm(hull.over_cover)}")
            return _Treated("hull", over_cover_of(mesh, [hull.vertices]), _bodies(item, [vertices]))
        case "convex_pieces":
            pieces = pieces_of(mesh)
            beyond, count = over_cover_of(mesh, pieces.vertices), len(pieces.vertices)
            made = f"{count} convex pieces" if count > 1 else "its hull, which pieces nearly fill"
            made += f", grown by at most {_mm(pieces.growth)}" if count > 1 else ""
            notes.append(f"{item.name}: {made}; reaches at most {_mm(beyond)} beyond the mesh")
            return _Treated("convex_pieces", beyond, _bodies(item, pieces.vertices))
    return _Treated("mesh", 0.0, [_triangles(item, mesh)])


def _triangles(item: pin.GeometryObject, mesh: Soup) -> pin.GeometryObject:
    """Return a copy of an object with the mesh itself as its shape."""
    part = item.copy()
    part.geometry = triangle_mesh(mesh.vertices, mesh.triangles)
    return part


def _mm(distance: float) -> str:
    return f"{distance * 1e3:.2g} mm"


def _bodies(item: pin.GeometryObject, bodies: Iterable[Array]) -> Iterator[pin.GeometryObject]:
    """Yield copies of an object, each with the hull of points (k, 3) as its shape; a single one keeps the name."""
    several = tuple(bodies)
    for index, vertices in enumerate(several):
        part = item.copy()
        part.name = f"{item.name}_piece{index}" if len(several) > 1 else item.name
        part.geometry = hull_of(vertices)
        yield part


def _named(spec: CollisionSpec, links: list[str], document: Document) -> Mapping[str, Treatment]:
    named: dict[str, Treatment] = {}
    issues: list[Issue] = []
    for kind in KINDS:
        for index, link in enumerate(getattr(spec, kind)):
            place = ("collision", kind, index)
            if link not in links:
                issues.append(document.issue(place, f"unknown link '{link}'", choices(link, links)))
            elif link in named:
                issues.append(document.issue(place, f"link '{link}', which is under {named[link]} too", "it once"))
            named[link] = kind
    if issues:
        raise InputError(issues)
    return named
