"""SDF worlds of Gazebo as obstacles: the collision shapes of all models, where the file puts them.

Poses: `relative_to` names a model, a link or a frame; without it a pose is in the parent element. Frames may lie in
`<frame attached_to>`; `placement_frame` names the frame of a model that its pose is of. `<include>` takes
`model://NAME` from the folders above the file. Source: sdformat.org, SDF 1.4 to 1.12.
"""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from optiplan.errors import InputError, Issue
from optiplan.files import is_file
from optiplan.geometry.meshes.reading import open_mesh, read_mesh
from optiplan.importers.robots.polyhedra import ellipsoid_hull
from optiplan.importers.scenes.imported import ImportedScene
from optiplan.robot.urdf.elements import parsed_xml

DEEPEST = 8
"""Models within models."""

UP = 4
"""Folders above a file in which models are looked for."""


def read_sdf_scene(path: Path) -> ImportedScene:
    """Read an SDF file: a world, or one model.

    Raises:
        InputError: no SDF, a shape without its sizes, a model or mesh that is not found, a frame that is not known.
    """
    scene = ImportedScene(path)
    root = parsed_xml(path, "sdf")
    worlds = root.findall("world")
    for parent in worlds or [root]:
        _read_models(parent, _Frames(parent, pin.SE3.Identity(), _Place(path, "", 0)), scene)
    if len(worlds) > 1:
        scene.notes.append(f"{len(worlds)} worlds lie in one scene")
    for tag in ("actor", "population", "road"):
        count = len(list(root.iter(tag)))
        if count:
            scene.notes.append(f"left out: {count} <{tag}>")
    if root.find("world/state") is not None:
        scene.notes.append("left out: <state>; models stand where their own <pose> puts them")
    return scene


class _Place:
    """Where an element stands: its file, the names of the models around it, and how deep that is."""

    def __init__(self, file: Path, prefix: str, depth: int) -> None:
        self.file, self.prefix, self.depth = file, prefix, depth

    def inside(self, name: str, file: Path | None = None) -> "_Place":
        return _Place(file or self.file, f"{self.prefix}{name}::", self.depth + 1)

    def issue(self, element: ET.Element, found: str, expected: str) -> InputError:
        name = f"{self.prefix}{element.get('name', element.tag)}"
        return InputError([Issue(str(self.file), None, name, found, expected)])


def _read_models(parent: ET.Element, frames: "_Frames", scene: ImportedScene) -> None:
    for model in parent.findall("model"):
        _read_model(model, frames.pose(model), frames.place.inside(model.get("name", "model")), scene)
    for include in frames.includes:
        _read_model(include.model, frames.included(include), include.place, scene)


class _Include(NamedTuple):
    """An <include>, the model that it takes, and where that one stands."""

    element: ET.Element
    model: ET.Element
    name: str
    place: _Place


def _include(element: ET.Element, place: _Place) -> _Include:
    file = _model_file((element.findtext("uri") or "").strip(), place, element)
    if place.depth >= DEEPEST:
        raise place.issue(element, f"models nested more than {DEEPEST} deep", "a world")
    model = parsed_xml(file, "sdf").find("model")
    if model is None:
        raise place.issue(element, f"no <model> in {file}", "a model")
    name = (element.findtext("name") or model.get("name") or "model").strip()
    return _Include(element, model, name, place.inside(name, file))


def _read_model(model: ET.Element, X_WM: pin.SE3, place: _Place, scene: ImportedScene) -> None:
    frames = _Frames(model, X_WM, place)
    moving = [joint for joint in model.findall("joint") if joint.get("type") != "fixed"]
    if moving:
        scene.notes.append(f"{place.prefix[:-2]} has {len(moving)} joints that move: it stands as it is drawn")
    for link in model.findall("link"):
        X_WL = frames.pose(link)
        for collision in link.findall("collision"):
            X_WC = frames.pose(collision, X_WL)
            _read_shape(collision, f"{place.prefix}{link.get('name', 'link')}", X_WC, place, scene)
    _read_models(model, frames, scene)


class _Frames:
    """Poses of the models, links and frames of one world or model, by name; `A::b` is b of the model A."""

    def __init__(self, parent: ET.Element, X_WP: pin.SE3, place: _Place) -> None:
        self.place, self.X_WP = place, X_WP
        named = [*parent.findall("model"), *parent.findall("link"), *parent.findall("frame"), *parent.findall("joint")]
        self.elements = {element.get("name", ""): element for element in named}
        self.includes = [_include(element, place) for element in parent.findall("include")]
        self.found: dict[str, pin.SE3] = {"": X_WP, "__model__" if parent.tag == "model" else "world": X_WP}

    def pose(self, element: ET.Element, X_WD: pin.SE3 | None = None, within: tuple[str, ...] = ()) -> pin.SE3:
        """X of an element in the world; without `relative_to` its pose is in D, else in the parent."""
        pose = element.find("pose")
        relative = "" if pose is None else pose.get("relative_to", pose.get("frame", ""))
        relative = relative or element.get("attached_to", "")
        default = self.X_WP if X_WD is None else X_WD
        if element.tag == "joint" and not relative:
            relative = (element.findtext("child") or "").strip()
        X_WR = self.named(relative, element, within) if relative else default
        inside = _model_in(element.get("placement_frame", ""), element, self.place)
        return X_WR * _own_pose(element, self.place) * inside

    def named(self, name: str, element: ET.Element, within: tuple[str, ...] = ()) -> pin.SE3:
        """X of the frame called `name` in the world; errors are about `element`."""
        if name not in self.found:
            model, _, inner = (name, "", "") if name in self.elements else name.partition("::")
            include = next((one for one in self.includes if one.name == model), None)
            if (model not in self.elements and include is None) or name in within:
                known = ", ".join(sorted({*self.elements, *(one.name for one in self.includes)} - {""})) or "none"
                told = f"the frame '{name}'" if name not in within else f"the frame '{name}', which depends on itself"
                raise self.place.issue(element, told, f"one of: {known}")
            if inner:
                X_WM = self.named(model, element, (*within, name))
                place = self.place.inside(model) if include is None else include.place
                inside = self.elements[model] if include is None else include.model
                self.found[name] = _Frames(inside, X_WM, place).named(inner, element)
            elif include is not None:
                self.found[name] = self.included(include, (*within, name))
            else:
                self.found[name] = self.pose(self.elements[name], within=(*within, name))
        return self.found[name]

    def included(self, include: _Include, within: tuple[str, ...] = ()) -> pin.SE3:
        """X of an included model in the world: its own pose counts where the <include> has none."""
        element, model = include.element, include.model
        stated = element.find("pose") is not None
        X_WF = self.pose(element, within=within) if stated else self.X_WP * _own_pose(model, self.place)
        frame = (element.findtext("placement_frame") or model.get("placement_frame") or "").strip()
        return X_WF * _model_in(frame, model, include.place)


def _model_in(frame: str, model: ET.Element, place: _Place) -> pin.SE3:
    """Pose of a model in its `placement_frame`, which its <pose> places; the identity without one."""
    if not frame:
        return pin.SE3.Identity()
    return _Frames(model, pin.SE3.Identity(), place).named(frame, model).inverse()


def _own_pose(element: ET.Element, place: _Place) -> pin.SE3:
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return pin.SE3.Identity()
    values = _numbers(pose.text or "")
    if pose.get("rotation_format") == "quat_xyzw" and len(values) == 7:
        quaternion = np.array(values[3:]) / (np.linalg.norm(values[3:]) or 1.0)
        return pin.SE3(pin.Quaternion(quaternion).toRotationMatrix(), np.array(values[:3]))
    if len(values) != 6:
        raise place.issue(element, f"<pose> '{(pose.text or '').strip()}'", "x y z roll pitch yaw")
    turn = np.radians(values[3:]) if _is_true(pose.get("degrees")) else np.array(values[3:])
    return pin.SE3(pin.rpy.rpyToMatrix(*turn), np.array(values[:3]))


def _read_shape(collision: ET.Element, name: str, X_WC: pin.SE3, place: _Place, scene: ImportedScene) -> None:
    geometry = collision.find("geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    if shape is None or shape.tag == "empty":
        return
    if shape.tag == "plane":
        normal = _sizes(shape, "normal", 3, place, collision, signed=True)
        scene.add_half_space(name, X_WC, normal)
    elif shape.tag == "box":
        scene.add(name, {"box": _sizes(shape, "size", 3, place, collision)}, X_WC)
    elif shape.tag == "sphere":
        scene.add(name, {"sphere": _sizes(shape, "radius", 1, place, collision)[0]}, X_WC)
    elif shape.tag in ("cylinder", "capsule", "cone"):
        radius, length = (_sizes(shape, key, 1, place, collision)[0] for key in ("radius", "length"))
        kind = "cylinder" if shape.tag == "cone" else shape.tag
        scene.add(name, {kind: {"radius": radius, "length": length}}, X_WC)
        if shape.tag == "cone":
            scene.notes.append(f"cone {name} became the cylinder around it")
    elif shape.tag == "ellipsoid":
        hull = scene.mesh(name, *ellipsoid_hull(*_sizes(shape, "radii", 3, place, collision)))
        scene.add(name, {"mesh": {**hull["mesh"], "convex": True}}, X_WC)
    elif shape.tag == "mesh":
        _add_mesh(shape, name, X_WC, place, scene)
    else:
        scene.notes.append(f"left out: the <{shape.tag}> of {name}, which is then not checked")


def _add_mesh(shape: ET.Element, name: str, X_WC: pin.SE3, place: _Place, scene: ImportedScene) -> None:
    """Add a mesh with its scale; as in Gazebo, lengths are in the unit of the file, and its axes are kept."""
    uri = (shape.findtext("uri") or "").strip()
    path = _found(uri, place)
    if path is None:
        raise place.issue(shape, f"the mesh {uri}, which is missing", "a mesh file near the SDF")
    scale = _numbers(shape.findtext("scale") or "1 1 1")
    if len(scale) != 3:
        raise place.issue(shape, f"<scale> '{shape.findtext('scale')}'", "three numbers")
    if _is_true(shape.findtext("submesh/center")):
        raise place.issue(shape, f"<center> of the submesh of {name}", "a submesh where its file has it")
    if shape.find("submesh") is not None:
        scene.notes.append(f"the submesh of {name} is not chosen: the whole mesh is taken")
    try:
        soup = read_mesh(open_mesh(path))
    except ValueError as error:
        raise place.issue(shape, f"the mesh {path}: {error}", "a mesh that can be read") from error
    scene.add(name, scene.mesh(name, soup.vertices * np.array(scale), soup.triangles), X_WC)


def _sizes(
    shape: ET.Element, key: str, count: int, place: _Place, collision: ET.Element, signed: bool = False
) -> list[float]:
    text = shape.findtext(key)
    values = _numbers(text if text is not None else "0 0 1" if shape.tag == "plane" else "")
    if len(values) != count or (not signed and not all(value > 0.0 for value in values)) or not any(values):
        found = f"no <{key}> in a <{shape.tag}>" if text is None else f"<{key}> '{text.strip()}' of a <{shape.tag}>"
        raise place.issue(collision, found, f"{count} numbers" + ("" if signed else " > 0"))
    return values


def _numbers(text: str) -> list[float]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return []
    return values if np.isfinite(values).all() else []


def _is_true(text: str | None) -> bool:
    return (text or "").strip().lower() in ("true", "1")


def _model_file(uri: str, place: _Place, include: ET.Element) -> Path:
    folder = _found(uri, place, folders=True)
    if folder is None:
        raise place.issue(include, f"the model {uri}, which is missing", "model://NAME in a folder above the file")
    if folder.is_file():
        return folder
    config = folder / "model.config"
    listed = [(parsed_xml(config, "sdf").findtext("sdf") or "").strip()] if is_file(config) else []
    for name in (*listed, "model.sdf"):
        if name and is_file(folder / name):
            return folder / name
    raise place.issue(include, f"no SDF in {folder}", "model.sdf, or model.config that names one")


def _found(uri: str, place: _Place, folders: bool = False) -> Path | None:
    rest = uri.partition("://")[2] or uri
    roots = [place.file.resolve().parent, *list(place.file.resolve().parents)[1:UP]]
    candidates = [root / part / rest for root in roots for part in ("", "models")] if rest else []
    return next((path for path in candidates if is_file(path) or (folders and path.is_dir())), None)
