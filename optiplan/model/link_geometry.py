"""What is checked for each link: its mesh, the mesh's hull, or convex pieces."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from optiplan.errors import InputError, Issue, plain_reason
from optiplan.files import read_bytes
from optiplan.model.convex import hull_of, pieces_of, vertices_of
from optiplan.model.robot_spec import CollisionSpec, Treatment
from optiplan.model.shapes import FARTHEST
from optiplan.yaml_lines import Document
from optiplan.yaml_words import choices

PRIMITIVE = "primitive"
KINDS: tuple[Treatment, ...] = ("hull", "mesh", "convex_pieces")


def treat(
    model: pin.Model, geometry: pin.GeometryModel, collision: Treatment | CollisionSpec, document: Document
) -> tuple[pin.GeometryModel, dict[str, str], list[str]]:
    """Collision geometry with the meshes replaced by what the robot.yaml asks for.

    Returns:
        The geometry; what each link became (hull, mesh, convex_pieces or primitive); notes on the pieces.

    Raises:
        InputError: a link that is not there, is named twice, or has a mesh that cannot be hulled.
    """
    spec = CollisionSpec(default=collision) if isinstance(collision, str) else collision
    named = _named(spec, [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY], document)
    result = pin.GeometryModel()
    done: dict[str, str] = {}
    notes: list[str] = []
    for item in geometry.geometryObjects:
        link = model.frames[item.parentFrame].name
        kind = named.get(link, spec.default) if isinstance(item.geometry, coal.BVHModelBase) else PRIMITIVE
        if done.get(link, PRIMITIVE) == PRIMITIVE:
            done[link] = kind
        try:
            for part in _parts(item, kind, notes):
                result.addGeometryObject(part)
        except (ValueError, RuntimeError) as error:  # qhull has errors of its own
            found = f"{plain_reason(error)} ({item.meshPath})"
            raise InputError(
                [document.issue(("collision",), f"link {link}: {found}", "a mesh with vertices")]
            ) from error
    return result, done, notes


def _parts(item: pin.GeometryObject, kind: str, notes: list[str]) -> Iterator[pin.GeometryObject]:
    if kind != PRIMITIVE and not (np.abs(vertices_of(item.geometry)) <= FARTHEST).all():  # NaN is refused too
        raise ValueError(f"a mesh without finite vertices, or with one beyond {FARTHEST:g} m")
    if kind == "hull":
        yield _copy(item, item.name, hull_of(vertices_of(item.geometry)))
    elif kind == "convex_pieces":
        identity = read_bytes(Path(item.meshPath)) + np.asarray(item.meshScale).tobytes()
        pieces = pieces_of(item.geometry, identity)
        count, growth = len(pieces.vertices), f"{pieces.growth * 1e3:.2g} mm"
        made = (
            f"{count} convex pieces, grown by at most {growth}" if count > 1 else "its hull, which pieces nearly fill"
        )
        notes.append(f"{item.name}: {made}")
        for index, vertices in enumerate(pieces.vertices):
            yield _copy(item, f"{item.name}_piece{index}", hull_of(vertices))
    else:
        yield item.copy()


def _copy(item: pin.GeometryObject, name: str, shape: coal.CollisionGeometry) -> pin.GeometryObject:
    part = item.copy()
    part.name, part.geometry = name, shape
    return part


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
