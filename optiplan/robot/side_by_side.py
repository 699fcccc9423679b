"""Arms side by side: several robots, each with a base of its own, as one robot.

Names of links, joints, frames and groups begin with the name of the arm: `left/panda_joint1`. The joints of all arms
stand in the order of the arms' names. Pairs of links within an arm go unchecked for the arm's own reasons; pairs of two
arms are checked like any others.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar

import coal
import numpy as np
import pinocchio as pin
from pydantic import Field

from optiplan import cache
from optiplan.config.document import Document, Strict, plain, validate
from optiplan.config.messages import choices
from optiplan.config.simple_yaml import Place
from optiplan.config.values import FileName, FileVersion, Name
from optiplan.errors import InputError, Issue, UnknownChoiceError, described, errors_about, os_reason, wrong_argument
from optiplan.geometry.pose import Pose, PoseSpec, place_data
from optiplan.geometry.poses import pose_from_data, pose_to_data
from optiplan.robot.limits import Limits
from optiplan.robot.mimic_joints import Mimic
from optiplan.robot.read_robot import RobotParts
from optiplan.robot.reference import DESCRIPTION, ROBOTS, Reference, several_robots
from optiplan.robot.self_collision.pair_survey import link_pairs, survey_pairs
from optiplan.robot.self_collision.pairs import PROVED, fixed_pairs, set_pairs
from optiplan.robot.spec import MecanumSpec
from optiplan.robot.urdf.elements import origin_element
from optiplan.robot.urdf.srdf import LinkPair, link_pair

if TYPE_CHECKING:
    from optiplan.robot.robot import Robot

ALL = "all"
"""The group of the joints of all arms."""
ROOT = "common_base"
"""The link of the composed URDF that carries the bases."""
LEAST, MOST = 2, 8
"""Arms."""

ArmName = Annotated[str, Field(strict=True, pattern=r"^[A-Za-z][A-Za-z0-9_]{0,39}$")]
T = TypeVar("T")


class ArmSpec(Strict):
    """One of several robots: `use`, as `robot` of a problem, and the pose of its root in the frame of the whole."""

    use: FileName | dict[str, Any]
    base: PoseSpec = PoseSpec.model_construct()


class SideBySideSpec(Strict):
    """A robot.yaml that has several robots."""

    version: FileVersion
    name: Name | None = None
    robots: Annotated[dict[ArmName, ArmSpec], Field(min_length=LEAST, max_length=MOST)]


class _Arm(NamedTuple):
    """One of the robots: its name, the pose of its root, and the robot without and with joints that stand still."""

    name: str
    X_WB: pin.SE3
    whole: "Robot"
    robot: "Robot"

    def named(self, values: Mapping[str, T]) -> dict[str, T]:
        """Return a mapping by the names of this arm as one by the names of the whole."""
        return {self.of(key): value for key, value in values.items()}

    def of(self, name: str) -> str:
        """Return a name of this arm as one of the whole."""
        return f"{self.name}/{name}"


def load_arms(robots: Any, keys: Mapping[str, Any], load: "Callable[..., Robot]") -> "Robot":
    """Load the robots of `Robot.side_by_side`; errors are about its arguments.

    Raises:
        InputError: not arms by name, an arm that is no robot, no such group, and as `read_side_by_side`.
    """
    function = "Robot.side_by_side"
    if not isinstance(robots, Mapping):
        expected = "arms by name, such as {'left': {'use': 'panda', 'base': op.Pose(…)}, 'right': …}"
        raise wrong_argument(function, ROBOTS, described(robots), expected)
    if unknown := [key for key in keys if key not in ("group", "locked")]:
        raise wrong_argument(function, unknown[0], "an argument that there is not", "`group` or `locked`")
    try:
        with errors_about(DESCRIPTION, f"op.{function}"):
            arms = {str(name): _arm_data(str(name), arm, function) for name, arm in robots.items()}
            return load({ROBOTS: arms}, **keys)
    except UnknownChoiceError as error:
        raise error.of_argument(function, error.kind) from None


def _arm_data(name: str, arm: Any, function: str) -> dict[str, Any]:
    said = dict(arm) if isinstance(arm, Mapping) and "use" in arm else {"use": arm}
    use, base = said["use"], said.get("base")
    ref = getattr(use, "reference", None)
    if isinstance(ref, Reference):
        own = ref.group is not None or ref.locked or use.held or use.tool_frame != ref.tool_frame
        if ref.robot == "" or own:
            found = f"a robot {use.name} with a group, locked joints or tool of its own"
            raise wrong_argument(
                function, f"{ROBOTS}[{name!r}]", found, "one as its files say; `group` is of the whole"
            )
        said["use"] = ref.robot
    elif isinstance(use, str | Path) and Path(use).suffix.lower() == ".urdf":
        said["use"] = {"urdf": use}
    elif not isinstance(use, str | Path | Mapping):
        expected = "op.load_robot(…), the name of a robot or the path of a robot.yaml"
        raise wrong_argument(function, f"{ROBOTS}[{name!r}]", described(use), expected)
    if isinstance(base, pin.SE3 | Pose):
        said["base"] = place_data(base, function, f"{ROBOTS}[{name!r}].base")
    data: dict[str, Any] = plain(said)
    return data


def read_side_by_side(
    document: Document, locked: Mapping[str, float] | None, group: str | None, load: "Callable[..., Robot]"
) -> RobotParts:
    """Read several robots as one; see `load_robot`.

    Args:
        document: with the key `robots`.
        locked: positions of joints that are not planned, rad or m, by the names of the whole.
        group: `all`, the name of an arm, `arm/group` of an arm's own group, or several joined by `+`; None: `all`.
        load: `load_robot`.

    Raises:
        InputError: an arm that cannot be loaded, a joint that there is not, arms that stand in each other.
        UnknownChoiceError: there is no such group.
    """
    spec = _spec(document)
    wanted = dict(locked or {})
    first = {name: _loaded(document, name, spec, load) for name in sorted(spec.robots)}
    _refuse_unknown(document, first, wanted)
    groups = _groups(first)
    chosen = ALL if group is None else group
    for name in chosen.split("+"):
        if name not in groups:
            raise UnknownChoiceError("group", name, groups)
    arms = [_arm(document, name, spec, first[name], wanted, chosen, load) for name in first]
    model, geometry = _composed(arms, lambda robot: robot.geometry)
    _refuse_meeting_arms(document, arms)
    limits = Limits(*(np.concatenate([getattr(arm.robot.limits, one.name) for arm in arms]) for one in fields(Limits)))
    allowed = _allowed(arms, model, geometry, limits)
    set_pairs(model, geometry, allowed)
    tools = {name: tool for arm in arms for name, tool in _tools(arm, groups).items()}
    tool = tools.get(chosen.partition("+")[0], arms[0].of(arms[0].whole.tool_frame))
    inline = document.path.name == DESCRIPTION
    entries = {arm.name: {"use": first[arm.name].reference.robot, "base": dict(pose_to_data(arm.X_WB))} for arm in arms}
    content = [[arm.name, arm.whole.fingerprint, pose_to_data(arm.X_WB)] for arm in arms]
    return RobotParts(
        name=spec.name or "+".join(arm.whole.name for arm in arms),
        source=document.path,
        model=model,
        geometry=geometry,
        limits=limits,
        joint_names=tuple(arm.of(joint) for arm in arms for joint in arm.robot.joint_names),
        tool_frame=tool,
        configurations=_configurations(arms),
        link_geometry=_merged(arms, lambda robot: robot.link_geometry),
        build_visual=lambda: _composed(arms, lambda robot: robot.visual)[1],
        notes=tuple(f"{arm.name}: {note}" for arm in arms for note in arm.whole.notes),
        locked=_merged(arms, lambda robot: robot.locked),
        allowed=allowed,
        files=tuple(
            dict.fromkeys([*([] if inline else [document.path]), *(f for arm in arms for f in arm.robot.files)])
        ),
        fingerprint=cache.digest([repr(content).encode()]),
        group=chosen,
        groups=groups,
        tool_frames=tools,
        urdf=_urdf(arms),
        followers={
            arm.of(name): Mimic(arm.of(mimic.source), mimic.multiplier, mimic.offset)
            for arm in arms
            for name, mimic in arm.robot.followers.items()
        },
        over_cover=_merged(arms, lambda robot: robot.over_cover),
        mecanum=_mecanum(document, arms),
        reference=Reference({ROBOTS: entries} if inline else str(document.path), group, wanted, tool),
    )


def _spec(document: Document) -> SideBySideSpec:
    spec = validate(SideBySideSpec, document)
    if ALL in spec.robots:
        expected = f"another name, since `{ALL}` is the group of all arms"
        raise InputError([document.issue((ROBOTS, ALL), f"an arm called '{ALL}'", expected)])
    return spec


def _loaded(document: Document, name: str, spec: SideBySideSpec, load: "Callable[..., Robot]") -> "Robot":
    """Return an arm as it is by itself, with its default group.

    Raises:
        InputError: it cannot be loaded, or is several robots, by which a file could use itself without end.
    """
    use, base = spec.robots[name].use, document.path.parent
    if _about(document, name, lambda: several_robots(use, base)) is not None:
        raise InputError([document.issue((ROBOTS, name, "use"), "several robots", "one robot; name each of them here")])
    return _about(document, name, lambda: load(use, base))


def _about(document: Document, name: str, made: Callable[[], T]) -> T:
    """Return what is made of an arm; what is wrong with it is reported at its place in the document."""
    place: Place = (ROBOTS, name, "use")
    try:
        return made()
    except UnknownChoiceError as error:
        found = f"unknown {error.kind} '{error.found}'"
        raise InputError([document.issue(place, found, choices(error.found, error.choices))]) from None
    except OSError as error:  # a name that no file can have
        found = os_reason(error)
        raise InputError([document.issue(place, found, "the name or the path of a robot")]) from None
    except InputError as error:
        raise InputError([_placed(document, name, issue) for issue in error.issues]) from None


def _placed(document: Document, name: str, issue: Issue) -> Issue:
    """Attribute an arm's issues about its inline keys and its locked joints to the document of the whole."""
    if issue.path[:1] == ("locked",) and len(issue.path) == 2:
        return document.issue(("locked", f"{name}/{issue.path[1]}"), issue.found, issue.expected)
    if Path(issue.file).name == DESCRIPTION:
        return document.issue((ROBOTS, name, "use", *issue.path), issue.found, issue.expected)
    return issue


def _refuse_unknown(document: Document, robots: "Mapping[str, Robot]", wanted: Mapping[str, float]) -> None:
    """Refuse positions of joints of no arm; those of an arm's joints are checked where it is loaded."""
    known = [f"{name}/{joint}" for name, arm in robots.items() for joint in (*arm.joint_names, *arm.locked)]
    foreign = [joint for joint in wanted if joint.partition("/")[0] not in robots or "/" not in joint]
    issues = [document.issue(("locked", name), f"unknown joint '{name}'", choices(name, known)) for name in foreign]
    if issues:
        raise InputError(issues)


def _groups(robots: "Mapping[str, Robot]") -> dict[str, list[str]]:
    """Return the joints of all arms, of each arm's default group, and of each group of each arm, by name."""
    own = {name: [f"{name}/{joint}" for joint in robot.joint_names] for name, robot in robots.items()}
    parts = {
        f"{name}/{part}": [f"{name}/{joint}" for joint in joints]
        for name, robot in robots.items()
        for part, joints in robot.groups.items()
    }
    return {ALL: [joint for joints in own.values() for joint in joints], **own, **parts}


def _arm(
    document: Document,
    name: str,
    spec: SideBySideSpec,
    usual: "Robot",
    wanted: Mapping[str, float],
    chosen: str,
    load: "Callable[..., Robot]",
) -> _Arm:
    """Return an arm with the joints that the chosen groups plan; the others stand still.

    An arm that is not planned at all stands in its first configuration, or where `wanted` says.
    """
    names = chosen.split("+")
    parts = [part for one in names for arm, _, part in [one.partition("/")] if arm == name and part]
    whole = ALL in names or name in names
    default = [] if usual.group is None or not (whole or not parts) else [usual.group]
    groups = "+".join(dict.fromkeys([*default, *parts])) or None
    if parts and whole and usual.group is None:
        raise UnknownChoiceError("group", f"{name}/{parts[0]}", [name])
    locked = {joint.partition("/")[2]: q for joint, q in wanted.items() if joint.partition("/")[0] == name}
    still = {} if whole or parts else {joint: locked.pop(joint) for joint in usual.joint_names if joint in locked}
    base = document.path.parent
    robot = _about(document, name, lambda: load(spec.robots[name].use, base, locked, groups))
    if not (whole or parts):
        rest = next(iter(robot.configurations.values()), None)
        places = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper) if rest is None else rest
        held = {joint: still.get(joint, float(q)) for joint, q in zip(robot.joint_names, places, strict=True)}
        return _Arm(name, _base(spec, name), robot, robot.holding(held))
    return _Arm(name, _base(spec, name), robot, robot)


def _base(spec: SideBySideSpec, name: str) -> pin.SE3:
    return pose_from_data(spec.robots[name].base.model_dump(exclude_none=True))


def _merged(arms: Sequence[_Arm], part: "Callable[[Robot], Mapping[str, T]]") -> dict[str, T]:
    return {name: value for arm in arms for name, value in arm.named(part(arm.robot)).items()}


def _composed(
    arms: Iterable[_Arm], bodies: "Callable[[Robot], pin.GeometryModel]"
) -> tuple[pin.Model, pin.GeometryModel]:
    """Return one model of all arms with such bodies of each, without pairs."""
    model, geometry = pin.Model(), pin.GeometryModel()
    for arm in arms:
        own, around = arm.robot.model.copy(), bodies(arm.robot).copy()
        around.removeAllCollisionPairs()
        for joint in range(1, own.njoints):
            own.names[joint] = arm.of(own.names[joint])
        for index in range(1, own.nframes):
            own.frames[index].name = arm.of(own.frames[index].name)
        for body in around.geometryObjects:
            body.name = arm.of(body.name)
        model, geometry = pin.appendModel(model, own, geometry, around, 0, arm.X_WB)
    geometry.removeAllCollisionPairs()
    return model, geometry


def _allowed(
    arms: Sequence[_Arm], model: pin.Model, geometry: pin.GeometryModel, limits: Limits
) -> dict[LinkPair, str]:
    """Return the pairs of links that go unchecked: an arm's own, fixed ones, and those of two arms proved apart."""
    own = {link_pair(arm.of(a), arm.of(b)): reason for arm in arms for (a, b), reason in arm.robot.allowed.items()}
    between = {pair for pair in link_pairs(model, geometry) if pair[0].partition("/")[0] != pair[1].partition("/")[0]}
    survey = survey_pairs(model, geometry, (limits.lower, limits.upper), between)
    return {**own, **fixed_pairs(model, geometry), **dict.fromkeys(sorted(survey.proved), PROVED)}


def _refuse_meeting_arms(document: Document, arms: Sequence[_Arm]) -> None:
    """Refuse arms with links that no planned joint moves and that collide: as a fixed pair they are never checked."""
    request = coal.CollisionRequest()
    issues = []
    for one, other in combinations(arms, 2):
        meeting = [
            (a, b)
            for a in _standing(one)
            for b in _standing(other)
            if coal.collide(
                a.geometry,
                one.X_WB * a.placement,
                b.geometry,
                other.X_WB * b.placement,
                request,
                coal.CollisionResult(),
            )
        ]
        if meeting:
            a, b = meeting[0]
            found = f"an arm that stands in {one.name}: {one.of(a.name)} and {other.of(b.name)} collide"
            expected = "arms that are apart where no planned joint moves them (`base`, `locked`)"
            issues.append(document.issue((ROBOTS, other.name, "base"), found, expected))
    if issues:
        raise InputError(issues)


def _standing(arm: _Arm) -> list[pin.GeometryObject]:
    return [body for body in arm.robot.geometry.geometryObjects if body.parentJoint == 0]


def _tools(arm: _Arm, groups: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return the tool frame of the arm, of each of its groups, by the name of the group."""
    usual = arm.of(arm.whole.tool_frame)
    own = {name: usual for name in groups if name.partition("/")[0] == arm.name}
    return {**own, **{arm.of(group): arm.of(tool) for group, tool in arm.whole.tool_frames.items()}}


def _configurations(arms: Sequence[_Arm]) -> dict[str, Any]:
    """Return the configurations of a name that every planned arm has."""
    planned = [arm.robot for arm in arms if arm.robot.n]
    shared = [name for name in planned[0].configurations if all(name in robot.configurations for robot in planned)]
    return {name: np.concatenate([robot.configurations[name] for robot in planned]) for name in shared}


def _mecanum(document: Document, arms: Sequence[_Arm]) -> MecanumSpec | None:
    wheeled = [arm for arm in arms if arm.robot.mecanum is not None]
    if len(wheeled) > 1:
        found = f"{' and '.join(arm.name for arm in wheeled)}, which both have mecanum wheels"
        raise InputError([document.issue((ROBOTS,), found, "at most one robot with `mecanum`")])
    specs = [(arm, arm.robot.mecanum) for arm in wheeled if arm.robot.mecanum is not None]
    return next(
        (spec.model_copy(update={"joints": [arm.of(joint) for joint in spec.joints]}) for arm, spec in specs), None
    )


def _urdf(arms: Sequence[_Arm]) -> str:
    """Return one URDF of all arms, whose bases are fixed to the link `ROOT`."""
    root = ET.Element("robot", name="+".join(arm.name for arm in arms))
    ET.SubElement(root, "link", name=ROOT)
    for arm in arms:
        own = ET.fromstring(arm.whole.urdf)
        root.set("version", max(root.get("version", "1.0"), own.get("version", "1.0")))
        links = [link.get("name", "") for link in own.findall("link")]
        carried = {child.get("link", "") for child in own.findall("joint/child")}
        for element in _renamed(own, arm):
            root.append(element)
        joint = ET.SubElement(root, "joint", name=f"{arm.name}_base", type="fixed")  # all others have a "/"
        origin_element(joint, arm.X_WB)
        ET.SubElement(joint, "parent", link=ROOT)
        ET.SubElement(joint, "child", link=arm.of(next(link for link in links if link not in carried)))
    return ET.tostring(root, encoding="unicode")


def _renamed(robot: ET.Element, arm: _Arm) -> Iterator[ET.Element]:
    """Yield links, joints and materials of a URDF by the names of the whole."""
    for material in robot.iterfind(".//material[@name]"):  # links refer to those of the root by name
        material.set("name", arm.of(material.get("name", "")))
    for element in robot:
        if element.tag == "material":
            yield element
        if element.tag not in ("link", "joint") or (element.tag == "joint" and element.find("parent") is None):
            continue
        element.set("name", arm.of(element.get("name", "")))
        for end in ("parent", "child"):
            for one in element.findall(end):
                one.set("link", arm.of(one.get("link", "")))
        for mimic in element.findall("mimic"):
            mimic.set("joint", arm.of(mimic.get("joint", "")))
        yield element
