"""The robot: kinematics, collision geometry and limits of the planned joints, loaded once and never changed."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.data import robots_dir
from optiplan.errors import UnknownChoiceError
from optiplan.model import cache
from optiplan.model.dh import DhTable
from optiplan.model.joints import Group, Reduced, check_locked, planned_joints, reduce_to
from optiplan.model.limits import Limits, build_limits
from optiplan.model.link_geometry import treat
from optiplan.model.pairs import Kinematics, generate_allowed, joined_links, rigid_pairs, set_pairs
from optiplan.model.robot_spec import RobotSpec
from optiplan.model.settings import configurations, tool_frame
from optiplan.model.sources import read_sources
from optiplan.model.srdf import LinkPair, Srdf, srdf_text
from optiplan.model.urdf import UrdfSource
from optiplan.yaml_lines import read_yaml, validate

__all__ = ["Limits", "Robot", "load_robot", "robot_file", "robot_names", "write_srdf"]

PAIRS_VERSION = 1
"""Counted up when pairs are generated in another way, so that cached ones are made again."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot reduced to its planned joints; a configuration q is of shape (n,), in the order of `joint_names`.

    `link_geometry` says what is checked for each link: hull, mesh, convex_pieces or primitive, and `over_cover` how far
    (m) that reaches beyond the link's meshes at most, measured. `locked` holds where the
    joints stand that are not planned (rad, m), `allowed` the pairs of links that are not checked, with the reason, and
    `files` all that the robot was read from. `dh` is the Denavit–Hartenberg table, if it was given as one, `group` the
    name of the group of `groups` that is planned, `urdf` the whole robot as pinocchio reads it. `load_robot` with
    `source`, `locked` and `group` builds the same robot again, in another process too: so it is pickled.
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
    dh: DhTable | None = None
    group: str | None = None
    groups: Mapping[str, Sequence[str]] = field(default_factory=dict)
    urdf: str = ""
    over_cover: Mapping[str, float] = field(default_factory=dict)

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

    def frame_id(self, name: str) -> int:
        """Index of a frame in `model.frames`.

        Raises:
            UnknownChoiceError: there is none of that name.
        """
        if not self.model.existFrame(name):
            raise UnknownChoiceError("frame", name, [frame.name for frame in self.model.frames[1:]])
        return int(self.model.getFrameId(name))

    def with_tool(self, frame: str) -> "Robot":
        """The same robot with another tool frame.

        Raises:
            UnknownChoiceError: there is no such frame.
        """
        self.frame_id(frame)
        return replace(self, tool_frame=frame)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickled as the call that loads it: models of pinocchio and coal do not travel whole."""
        return _reload, (str(self.source), dict(self.locked), self.group, self.limits, self.tool_frame)


def _reload(source: str, locked: dict[str, float], group: str | None, limits: Limits, tool_frame: str) -> Robot:
    return replace(load_robot(source, locked=locked, group=group), limits=limits, tool_frame=tool_frame)


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


def load_robot(
    ref: str, base: Path | None = None, locked: Mapping[str, float] | None = None, group: str | None = None
) -> Robot:
    """Load a robot by name or by the path of its robot.yaml, relative to `base`.

    Args:
        ref: a name of `robot_names()` or a path.
        base: folder that a relative path starts from; the working directory without it.
        locked: positions (rad, m) of joints that are not planned; they go before those of the robot.yaml.
        group: the joints to plan, a name of the robot.yaml's `groups`; its default group without one.

    Raises:
        InputError: anything in the robot.yaml or its URDF, SRDF and meshes that cannot be used.
        UnknownChoiceError: `ref` is neither a robot's name nor a path, or there is no such group.
    """
    document = read_yaml(robot_file(ref, base).resolve())
    spec = validate(RobotSpec, document)
    urdf, srdf, srdf_path = read_sources(spec, document)
    planned = planned_joints(spec, document, urdf, group)
    wanted = _wanted(spec, planned, locked or {})
    check_locked(wanted, planned.joints, urdf, document)
    reduced = reduce_to(planned.joints, wanted, urdf)
    limits, limit_notes = build_limits(spec.limits, document, reduced.model, planned)
    treated = treat(reduced.model, reduced.geometry, spec.collision, document)
    named = configurations(spec, document, srdf, planned)
    files = tuple(dict.fromkeys((document.path, urdf.path, *((srdf_path,) if srdf_path else ()), *urdf.meshes)))
    if srdf is None:
        kinematics = Kinematics(reduced.model, treated.geometry, _joined(urdf, reduced), limits.lower, limits.upper)
        allowed = _generated(kinematics, named, (planned, reduced.locked), files)
    else:
        allowed = {**srdf.disabled, **rigid_pairs(reduced.model, treated.geometry)}
    set_pairs(reduced.model, treated.geometry, allowed)
    return Robot(
        name=spec.name,
        source=document.path,
        model=reduced.model,
        geometry=treated.geometry,
        limits=limits,
        joint_names=planned.joints,
        tool_frame=tool_frame(spec, document, reduced.model, planned),
        configurations=named,
        link_geometry=treated.kinds,
        over_cover=treated.over_cover,
        build_visual=reduced.build_visual,
        notes=(*urdf.notes, *reduced.notes, *limit_notes, *treated.notes, *_pair_notes(allowed, srdf)),
        locked=reduced.locked,
        allowed=allowed,
        files=files,
        dh=None if spec.dh is None else spec.dh.table(),
        group=planned.name,
        groups=spec.groups,
        urdf=urdf.xml,
    )


def _wanted(spec: RobotSpec, planned: Group, locked: Mapping[str, float]) -> dict[str, float]:
    """Where joints stand that are not planned; a robot.yaml of several groups locks what another group plans."""
    own = {joint: q for joint, q in spec.locked.items() if not (spec.groups and joint in planned.joints)}
    return {**own, **locked}


def write_srdf(robot: Robot, path: Path) -> None:
    """Write the pairs of links that are not checked as an SRDF."""
    path.write_text(srdf_text(robot.name, robot.allowed), encoding="utf-8")


def _joined(urdf: UrdfSource, reduced: Reduced) -> frozenset[LinkPair]:
    solid = frozenset(reduced.model.frames[item.parentFrame].name for item in reduced.geometry.geometryObjects)
    return joined_links(urdf.edges, solid)


def _generated(
    kinematics: Kinematics,
    configurations: Mapping[str, Array],
    chosen: tuple[Group, Mapping[str, float]],
    files: tuple[Path, ...],
) -> dict[LinkPair, str]:
    """Pairs that need no check, by sampling; kept on disk, since it takes seconds."""
    group, locked = chosen
    state = json.dumps([PAIRS_VERSION, group.joints, dict(locked)], sort_keys=True).encode()
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
