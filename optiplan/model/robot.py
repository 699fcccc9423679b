"""The robot: kinematics, collision geometry and limits of the planned joints, loaded once and never changed."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.data import robots_dir
from optiplan.errors import InputError, UnknownChoiceError
from optiplan.model import cache
from optiplan.model.joints import Reduced, check_locked, planned_joints, reduce_to
from optiplan.model.limits import Limits, build_limits
from optiplan.model.link_geometry import treat
from optiplan.model.pairs import Kinematics, generate_allowed, joined_links, rigid_pairs, set_pairs
from optiplan.model.robot_spec import RobotSpec
from optiplan.model.sources import find_sources
from optiplan.model.srdf import LinkPair, Srdf, read_srdf, srdf_text
from optiplan.model.urdf import UrdfSource, read_urdf
from optiplan.yaml_lines import Document, read_yaml, validate
from optiplan.yaml_words import choices

__all__ = ["Limits", "Robot", "load_robot", "robot_file", "robot_names", "write_srdf"]

PAIRS_VERSION = 1
"""Counted up when pairs are generated in another way, so that cached ones are made again."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot reduced to its planned joints; a configuration q is of shape (n,), in the order of `joint_names`.

    `link_geometry` says what is checked for each link: hull, mesh, convex_pieces or primitive. `locked` holds where the
    joints stand that are not planned (rad, m), `allowed` the pairs of links that are not checked, with the reason, and
    `files` all that the robot was read from. `load_robot(str(robot.source), locked=robot.locked)` builds the same robot
    again, in another process too: so it is pickled.
    """

    name: str
    source: Path
    model: pin.Model
    geometry: pin.GeometryModel
    limits: Limits
    joint_names: tuple[str, ...]
    tool_frame: str
    configurations: Mapping[str, Array]
    link_geometry: Mapping[str, str]
    build_visual: Callable[[], pin.GeometryModel]
    notes: tuple[str, ...] = ()
    locked: Mapping[str, float] = field(default_factory=dict)
    allowed: Mapping[LinkPair, str] = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    @property
    def n(self) -> int:
        """Number of planned joints."""
        return len(self.joint_names)

    @cached_property
    def visual(self) -> pin.GeometryModel:
        """What the robot looks like; read at the first use, since nothing but a viewer needs it."""
        return self.build_visual()

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256, in hex, of the contents of `files`, whatever their names."""
        return cache.digest(path.read_bytes() for path in self.files)

    def link_of(self, index: int) -> str:
        """Name of the link that geometry object `index` of `geometry` belongs to."""
        return str(self.model.frames[self.geometry.geometryObjects[index].parentFrame].name)

    def __reduce__(self) -> tuple[object, tuple[str, dict[str, float]]]:
        """Pickled as the call that loads it: models of pinocchio and coal do not travel whole."""
        return _reload, (str(self.source), dict(self.locked))


def _reload(source: str, locked: dict[str, float]) -> Robot:
    return load_robot(source, locked=locked)


def robot_names() -> list[str]:
    """Names of the robots that come with OptiPlan."""
    return sorted(path.parent.name for path in robots_dir().glob("*/robot.yaml"))


def robot_file(ref: str, base: Path | None = None) -> Path:
    """The robot.yaml that `ref` means: a name of `robot_names()`, or a path relative to `base`.

    Raises:
        UnknownChoiceError: `ref` is neither a name nor a path.
    """
    if ref in robot_names():
        return robots_dir() / ref / "robot.yaml"
    path = Path(base or ".") / ref
    if path.is_dir():
        return path / "robot.yaml"
    if path.suffix not in (".yaml", ".yml") and not path.is_file():
        raise UnknownChoiceError("robot", ref, [*robot_names(), "a path to a robot.yaml"])
    return path


def load_robot(ref: str, base: Path | None = None, locked: Mapping[str, float] | None = None) -> Robot:
    """Load a robot by name or by the path of its robot.yaml, relative to `base`.

    Args:
        ref: a name of `robot_names()` or a path.
        base: folder that a relative path starts from; the working directory without it.
        locked: positions (rad, m) of joints that are not planned; they go before those of the robot.yaml.

    Raises:
        InputError: anything in the robot.yaml or its URDF, SRDF and meshes that cannot be used.
        UnknownChoiceError: `ref` is neither a robot's name nor a path.
    """
    document = read_yaml(robot_file(ref, base).resolve())
    spec = validate(RobotSpec, document)
    urdf_path, srdf_path = find_sources(spec, document)
    urdf = read_urdf(urdf_path, document.path.parent)
    srdf = None if srdf_path is None else read_srdf(srdf_path, urdf.renamed)
    planned = planned_joints(spec, document, urdf)
    wanted = {**spec.locked, **(locked or {})}
    check_locked(wanted, planned, urdf, document)
    reduced = reduce_to(planned, wanted, urdf)
    limits, limit_notes = build_limits(spec.limits, document, reduced.model)
    geometry, link_geometry, geometry_notes = treat(reduced.model, reduced.geometry, spec.collision, document)
    configurations = _configurations(spec, document, srdf, planned)
    files = (document.path, urdf_path, *((srdf_path,) if srdf_path else ()), *urdf.meshes)
    if srdf is None:
        kinematics = Kinematics(reduced.model, geometry, _joined(urdf, reduced), limits.lower, limits.upper)
        allowed = _generated(kinematics, configurations, reduced.locked, files)
    else:
        allowed = {**srdf.disabled, **rigid_pairs(reduced.model, geometry)}
    set_pairs(reduced.model, geometry, allowed)
    return Robot(
        name=spec.name,
        source=document.path,
        model=reduced.model,
        geometry=geometry,
        limits=limits,
        joint_names=planned,
        tool_frame=_tool_frame(spec, document, reduced.model),
        configurations=configurations,
        link_geometry=link_geometry,
        build_visual=reduced.build_visual,
        notes=(*urdf.notes, *reduced.notes, *limit_notes, *geometry_notes, *_pair_notes(allowed, srdf)),
        locked=reduced.locked,
        allowed=allowed,
        files=files,
    )


def write_srdf(robot: Robot, path: Path) -> None:
    """Write the pairs of links that are not checked as an SRDF."""
    path.write_text(srdf_text(robot.name, robot.allowed), encoding="utf-8")


def _joined(urdf: UrdfSource, reduced: Reduced) -> frozenset[LinkPair]:
    solid = frozenset(reduced.model.frames[item.parentFrame].name for item in reduced.geometry.geometryObjects)
    return joined_links(urdf.edges, solid)


def _generated(
    kinematics: Kinematics, configurations: Mapping[str, Array], locked: Mapping[str, float], files: tuple[Path, ...]
) -> dict[LinkPair, str]:
    """Pairs that need no check, by sampling; kept on disk, since it takes seconds."""
    state = json.dumps([PAIRS_VERSION, dict(locked)], sort_keys=True).encode()
    name = f"pairs/{cache.digest([state, *(path.read_bytes() for path in files)])}.json"
    content = cache.load(name)
    if content is not None:
        return {(a, b): reason for a, b, reason in json.loads(content)}
    middle = np.clip(np.zeros(len(kinematics.lower)), kinematics.lower, kinematics.upper)
    default = next(iter(configurations.values()), middle)
    allowed = generate_allowed(kinematics, default, np.random.default_rng(0))
    cache.store(name, json.dumps([[*pair, reason] for pair, reason in allowed.items()]).encode())
    return allowed


def _pair_notes(allowed: Mapping[LinkPair, str], srdf: Srdf | None) -> list[str]:
    """Say which pairs are left out although they can touch."""
    if srdf is not None:
        return []
    notes = ["no SRDF: the pairs of links that need no check are found by sampling"]
    for reason, words in (("Default", "in the default configuration"), ("Always", "in every sample")):
        pairs = [f"{a}-{b}" for (a, b), why in allowed.items() if why == reason]
        if pairs:
            notes.append(f"not checked since they touch {words}: {', '.join(pairs)}")
    return notes


def _tool_frame(spec: RobotSpec, document: Document, model: pin.Model) -> str:
    """The frame named in the robot.yaml, or the last link that the last planned joint moves."""
    frames = [frame.name for frame in model.frames]
    if spec.tool_frame is None:
        moved = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
        last = max(frame.parentJoint for frame in moved)
        return str([frame.name for frame in moved if frame.parentJoint == last][-1])
    if spec.tool_frame not in frames:
        found = f"unknown frame '{spec.tool_frame}'"
        raise InputError([document.issue(("tool_frame",), found, choices(spec.tool_frame, frames))])
    return spec.tool_frame


def _configurations(
    spec: RobotSpec, document: Document, srdf: Srdf | None, planned: tuple[str, ...]
) -> dict[str, Array]:
    """Named configurations, each (n,): the robot.yaml's, then those of the SRDF that it does not have."""
    result: dict[str, Array] = {}
    issues = []
    for name, given in spec.configurations.items():
        if len(given) != len(planned):
            found, expected = f"a list of {len(given)} values", f"{len(planned)}, one a planned joint"
            issues.append(document.issue(("configurations", name), found, expected))
        result[name] = np.array(given, dtype=np.float64)
    if issues:
        raise InputError(issues)
    for name, values in ({} if srdf is None else srdf.states).items():
        if set(planned) <= set(values):
            result.setdefault(name, np.array([values[joint] for joint in planned]))
    return result
