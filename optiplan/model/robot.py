"""The robot: kinematics, collision geometry and limits of the planned joints, loaded once and never changed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.data import robots_dir
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.model.joints import Reduced, open_endless_limits, planned_joints, reduce_to
from optiplan.model.limits import Limits, build_limits
from optiplan.model.link_geometry import treat
from optiplan.model.robot_spec import PackageSource, RobotSpec
from optiplan.model.pairs import Kinematics, generate_allowed, joined_links, rigid_pairs, set_pairs
from optiplan.model.srdf import LinkPair, Srdf, read_srdf, srdf_text
from optiplan.model.urdf import UrdfSource, build_models, read_urdf
from optiplan.yaml_lines import Document, read_yaml, validate
from optiplan.yaml_words import choices

__all__ = ["Limits", "Robot", "load_robot", "robot_file", "robot_names", "write_srdf"]


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot reduced to its planned joints; a configuration q is of shape (n,), in the order of `joint_names`.

    `load_robot(str(robot.source), locked=robot.locked)` builds the same robot again, in another process too.
    """

    name: str
    source: Path
    model: pin.Model
    geometry: pin.GeometryModel
    visual: pin.GeometryModel
    limits: Limits
    joint_names: tuple[str, ...]
    tool_frame: str
    configurations: Mapping[str, Array]
    link_geometry: Mapping[str, str]
    notes: tuple[str, ...] = ()
    locked: Mapping[str, float] = field(default_factory=dict)
    allowed: Mapping[LinkPair, str] = field(default_factory=dict)
    files: tuple[Path, ...] = ()

    @property
    def n(self) -> int:
        """Number of planned joints."""
        return len(self.joint_names)

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
        UnknownChoiceError: neither a name nor a path.
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
    path = robot_file(ref, base).resolve()
    document = read_yaml(path)
    spec = validate(RobotSpec, document)
    urdf_path, srdf_path = _sources(spec, path.parent)
    urdf = read_urdf(urdf_path, path.parent)
    full = build_models(urdf)
    open_endless_limits(full[0])
    planned = planned_joints(spec, document, urdf, full[0])
    wanted = {**spec.locked, **(locked or {})}
    _check_locked(wanted, planned, urdf, document)
    reduced = reduce_to(planned, wanted, urdf, full)
    limits, limit_notes = build_limits(spec.limits, document, reduced.model)
    link_geometry = treat(reduced.model, reduced.geometry, spec.collision)
    srdf = None if srdf_path is None else read_srdf(srdf_path)
    configurations = _configurations(spec, document, srdf, planned)
    default = next(iter(configurations.values()), np.clip(np.zeros(len(planned)), limits.lower, limits.upper))
    allowed = _allow(reduced, limits, srdf, default, urdf)
    return Robot(
        name=spec.name,
        source=path,
        model=reduced.model,
        geometry=reduced.geometry,
        visual=reduced.visual,
        limits=limits,
        joint_names=planned,
        tool_frame=_tool_frame(spec, document, reduced.model),
        configurations=configurations,
        link_geometry=link_geometry,
        notes=(*urdf.notes, *reduced.notes, *limit_notes),
        locked=reduced.locked,
        allowed=allowed,
        files=(path, urdf_path, *((srdf_path,) if srdf_path else ()), *urdf.meshes),
    )


def write_srdf(robot: Robot, path: Path) -> None:
    """Write the pairs of links that are not checked as an SRDF."""
    path.write_text(srdf_text(robot.name, robot.allowed), encoding="utf-8")


def _sources(spec: RobotSpec, folder: Path) -> tuple[Path, Path | None]:
    if isinstance(spec.urdf, PackageSource):
        raise NotImplementedError
    return folder / spec.urdf, None if spec.srdf is None else folder / spec.srdf


def _check_locked(wanted: Mapping[str, float], planned: tuple[str, ...], urdf: UrdfSource, document: Document) -> None:
    issues: list[Issue] = []
    for name in wanted:
        if name not in urdf.joint_types:
            issues.append(
                document.issue(("locked", name), f"unknown joint '{name}'", choices(name, list(urdf.joint_types)))
            )
        elif name in planned:
            issues.append(document.issue(("locked", name), f"the planned joint '{name}'", "a joint outside the group"))
    if issues:
        raise InputError(issues)


def _allow(
    reduced: Reduced, limits: Limits, srdf: Srdf | None, default: Array, urdf: UrdfSource
) -> dict[LinkPair, str]:
    """Set the pairs that are checked; returns those that are not, with their reasons."""
    if srdf is not None:
        allowed = {**srdf.disabled, **rigid_pairs(reduced.model, reduced.geometry)}
        set_pairs(reduced.model, reduced.geometry, allowed)
        return allowed
    solid = frozenset(reduced.model.frames[item.parentFrame].name for item in reduced.geometry.geometryObjects)
    joined = joined_links(urdf.edges, solid)
    sampled = Kinematics(reduced.model, reduced.geometry, joined, limits.lower, limits.upper)
    return generate_allowed(sampled, default, np.random.default_rng(0))


def _tool_frame(spec: RobotSpec, document: Document, model: pin.Model) -> str:
    frames = [frame.name for frame in model.frames]
    if spec.tool_frame is None:
        return str([frame.name for frame in model.frames if frame.type == pin.FrameType.BODY][-1])
    if spec.tool_frame not in frames:
        found = f"unknown frame '{spec.tool_frame}'"
        raise InputError([document.issue(("tool_frame",), found, choices(spec.tool_frame, frames))])
    return spec.tool_frame


def _configurations(
    spec: RobotSpec, document: Document, srdf: Srdf | None, planned: tuple[str, ...]
) -> dict[str, Array]:
    result: dict[str, Array] = {}
    for name, values in ({} if srdf is None else srdf.states).items():
        if set(planned) <= set(values):
            result[name] = np.array([values[joint] for joint in planned])
    issues = []
    for name, given in spec.configurations.items():
        if len(given) != len(planned):
            found, expected = f"a list of {len(given)} values", f"{len(planned)}, one a planned joint"
            issues.append(document.issue(("configurations", name), found, expected))
        result[name] = np.array(given, dtype=np.float64)
    if issues:
        raise InputError(issues)
    return result
