"""The robot: kinematics, collision geometry and limits of the planned joints, loaded once and never changed."""

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array, is_finite, read_only
from optiplan.cache import MostRecent
from optiplan.config.document import plain
from optiplan.config.messages import choices
from optiplan.errors import OptiPlanError, UnknownChoiceError, described, errors_about, path_argument, wrong_argument
from optiplan.files import reading
from optiplan.geometry.pose import Pose, Values
from optiplan.records import dataclass
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.frames import frame_pose, geometric_jacobian, link_names
from optiplan.robot.given_configurations import configuration
from optiplan.robot.limits import Limits, joint_unit
from optiplan.robot.loaded_robots import LoadedRobots
from optiplan.robot.mimic_joints import held_parts, turning
from optiplan.robot.mounting import Mounting
from optiplan.robot.read_robot import RobotParts, read_robot
from optiplan.robot.reference import DESCRIPTION, Reference, robot_file, robot_names, several_robots
from optiplan.robot.self_collision.pair_bounds import LocalBox, local_box
from optiplan.robot.self_collision.pair_proof import BEYOND
from optiplan.robot.self_collision.pair_survey import PairSurvey, survey_pairs
from optiplan.robot.self_collision.pairs import PROVED, set_pairs
from optiplan.robot.urdf.srdf import LinkPair

__all__ = ["DESCRIPTION", "Limits", "Reference", "Robot", "load_robot", "robot_file", "robot_names"]

_MOST_MOUNTED = 4
"""Bases and loads for which one robot is kept."""


@dataclass(frozen=True, eq=False, repr=False)
class Robot(RobotParts):
    """A robot reduced to its planned joints; a configuration q is of shape (n,), in the order of `joint_names`.

    Pickling stores the call of `load_robot`; unpickling is refused if the files have changed.

    Attributes:
        name: of the robot.
        source: the file that it was loaded from.
        model: pinocchio's model of the planned joints and their followers.
        geometry: collision bodies of the links, with the pairs that are checked.
        limits: of the planned joints.
        joint_names: planned joints, base to tip.
        tool_frame: the frame that poses are about.
        tool_frames: the tools of groups that have one of their own.
        configurations: named ones, (n,), rad or m.
        link_geometry: kind of collision geometry by link: hull, mesh, convex_pieces or primitive.
        build_visual: reads the visual geometry; see `visual`.
        notes: assumptions and omissions, in words.
        locked: positions of the joints that are not planned, rad or m.
        allowed: pairs of links that are not checked, with the reason (see `robot.self_collision.pairs`).
        files: all files of the robot.
        fingerprint: SHA-256 of the contents of `files`.
        dh: the Denavit–Hartenberg table, if it was given as one.
        group: name of the group of `groups` that is planned.
        groups: joints by the name of their group.
        urdf: the whole robot as pinocchio reads it.
        followers: joints of `model` that move with a planned one.
        over_cover: how far the geometry of a link reaches beyond its meshes at most, m, measured.
        mecanum: the wheels represented by planned joints.
        reference: the arguments of `load_robot`.
        mounting: base, gravity and payload; `model` and the bodies include them.
        bare: the robot without its mounting; None where there is none.
        held: positions of planned joints fixed by `holding`, rad or m.

    Example:
        >>> import optiplan as op
        >>> op.load_robot("panda")
        Robot: panda, 7 joints, tool frame panda_hand_tcp, configurations: ready, extended
          joints: panda_joint1, panda_joint2, panda_joint3, panda_joint4, panda_joint5, panda_joint6, panda_joint7
    """

    mounting: Mounting = field(default_factory=Mounting)
    bare: "Robot | None" = None
    held: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def from_urdf(cls, path: Path | str, *, tool_frame: str | None = None, **keys: Any) -> "Robot":
        """Return a robot from its URDF alone; `notes` list the values that were found or assumed.

        Args:
            path: the URDF; meshes are searched beside it.
            tool_frame: the link or fixed frame of poses; by default a link behind the last planned joint.
            keys: further keys of a robot.yaml (docs/reference/problem-file.md): `name`, `group`, `groups`, `locked`,
                `configurations`, `limits`, `srdf`, `collision`, `allowed_collisions`, `tool_frames`.

        Raises:
            InputError: the URDF or its meshes cannot be used, or a key has an invalid value.

        Example:
            >>> import optiplan as op
            >>> op.Robot.from_urdf("my_arm.urdf", tool_frame="tool0", limits={"jerk": 50.0})  # doctest: +SKIP
            Robot: my_arm, 6 joints, tool frame tool0, configurations: none
              joints: joint_1, joint_2, joint_3, joint_4, joint_5, joint_6
        """
        file = path_argument("Robot.from_urdf", "path", path, "the path of a URDF")
        given = {"tool_frame": tool_frame, **keys}
        description = {"urdf": str(file), **{key: value for key, value in given.items() if value is not None}}
        with errors_about(DESCRIPTION, "op.Robot.from_urdf"):
            return load_robot(plain(description))

    @classmethod
    def side_by_side(cls, robots: Mapping[str, Any], **keys: Any) -> "Robot":
        """Return several robots as one, with names such as `left/panda_joint1`; `robots` of a problem file.

        Args:
            robots: two to eight arms by name: a robot, or a mapping of `use` (a robot) and `base` (its `Pose`).
            keys: `group` and `locked`, as of `op.load_robot`: `all`, an arm, or `left/hand`; several by `+`.

        Raises:
            InputError: a robot that cannot be loaded, arms that stand in each other.

        Example:
            >>> import optiplan as op
            >>> arms = {"left": {"use": "ur5", "base": op.Pose((0, 0.5, 0))}, "right": "ur5"}
            >>> op.Robot.side_by_side(arms).n
            12
        """
        from optiplan.robot.side_by_side import load_arms

        return load_arms(robots, keys, load_robot)

    @property
    def n(self) -> int:
        """Number of planned joints."""
        return len(self.joint_names)

    @property
    def unmounted(self) -> "Robot":
        """The robot without base and load: the same bodies in the frames of the same joints."""
        return self if self.bare is None else self.bare

    @cached_property
    def revolute(self) -> npt.NDArray[np.bool_]:
        """Which planned joints turn, (n,); the others slide."""
        own = [self.model.getJointId(name) - 1 for name in self.joint_names]
        return read_only(turning(self.model)[own])

    @cached_property
    def whole_turns(self) -> npt.NDArray[np.bool_]:
        """Which planned joints, (n,), return every link to its place after a whole turn: followers turn wholly too."""
        turns = zip(self.model.names[1:], turning(self.model), strict=True)
        sliding = {name for name, revolute in turns if not revolute}
        follow = self.followers.items()
        broken = {one.source for name, one in follow if name in sliding or not float(one.multiplier).is_integer()}
        return read_only(self.revolute & np.array([name not in broken for name in self.joint_names]))

    @cached_property
    def endless(self) -> npt.NDArray[np.bool_]:
        """Which planned joints, (n,), have `whole_turns` and no limits of position."""
        return read_only(self.whole_turns & np.isinf(self.limits.lower) & np.isinf(self.limits.upper))

    def unit(self, quantity: str, joint: int) -> str:
        """Return the unit of a joint's `position`, `velocity`, `acceleration`, `jerk` or `torque`, by its type."""
        return joint_unit(quantity, bool(self.revolute[joint]))

    @cached_property
    def massless_links(self) -> tuple[str, ...]:
        """Moving links with collision geometry that have no mass in the URDF: torque leaves them out."""
        masses = {link.get("name"): link.find("inertial/mass") for link in ET.fromstring(self.urdf).iter("link")}
        heavy = {name for name, mass in masses.items() if mass is not None and float(mass.get("value", "0")) > 0.0}
        moving = [self.link_of(i) for i, body in enumerate(self.geometry.geometryObjects) if body.parentJoint != 0]
        return tuple(dict.fromkeys(link for link in moving if link not in heavy))

    @property
    def has_inertia(self) -> bool:
        """Whether any moving link has a mass; without one, torques are unknown."""
        return any(inertia.mass > 0.0 for inertia in list(self.model.inertias)[1:])

    @cached_property
    def kinematics(self) -> BatchKinematics:
        """Forward kinematics of many configurations at once."""
        return BatchKinematics(self.model)

    @cached_property
    def link_boxes(self) -> tuple[LocalBox, ...]:
        """Bounding volumes of the bodies of `geometry`."""
        if self.bare is not None:
            return self.bare.link_boxes
        return tuple(local_box(body.geometry) for body in self.geometry.geometryObjects)

    @cached_property
    def visual(self) -> pin.GeometryModel:
        """Visual geometry, read at the first use, since only viewers need it."""
        return self.build_visual()

    @cached_property
    def survey(self) -> PairSurvey:
        """Contact frequency of pairs of links, and pairs proved apart; made at the first use, or read from disk."""
        if self.bare is not None:
            return self.bare.survey
        return survey_pairs(self.model, self.geometry, (self.limits.lower, self.limits.upper))

    @cached_property
    def bare_links(self) -> tuple[str, ...]:
        """Links without collision geometry, which are not checked."""
        return tuple(link for link in link_names(self.model) if link not in self.link_geometry)

    def link_of(self, index: int) -> str:
        """Return the link of geometry object `index` of `geometry`."""
        return str(self.model.frames[self.geometry.geometryObjects[index].parentFrame].name)

    def frame_id(self, name: str) -> int:
        """Return the index of a frame in `model.frames`.

        Raises:
            UnknownChoiceError: an unknown frame.
        """
        if not isinstance(name, str) or not self.model.existFrame(name):
            raise UnknownChoiceError("frame", name, [frame.name for frame in self.model.frames[1:]])
        return int(self.model.getFrameId(name))

    def fk(self, q: Values | Mapping[str, float] | str, frame: str | None = None) -> Pose:
        """Return the pose X_WF of a frame in the world.

        X_WF = X_W1(q_1) … X_(k-1)k(q_k) X_kF: the product of the placements and motions of the joints that carry F.

        Args:
            q: (n,), rad or m; values by joint, `{joint: value}`; or the name of a configuration.
            frame: a link, joint or fixed frame; None: the tool frame.

        Returns:
            The pose: `position`, m, `quaternion` [x, y, z, w], and `matrix` (4, 4). It is a goal of `op.Problem`, too.

        Raises:
            InputError: other values than one a joint, or no such frame.

        Example:
            >>> import optiplan as op
            >>> op.load_robot("planar2r").fk([0.0, 0.0]).position
            (1.1, 0.18, 0.5)
        """
        values = configuration(self.joint_names, self.configurations, q, "Robot.fk")
        name = self._frame(frame, "Robot.fk")
        return Pose.of(frame_pose(self, values, name), name)

    def jacobian(self, q: Values | Mapping[str, float] | str, frame: str | None = None) -> Array:
        """Return the geometric Jacobian J (6, n) of a frame: [v; w] = J q̇, along the axes of the world.

        v is the velocity of the frame's origin, m/s, w its angular velocity, rad/s. The column of a joint that turns
        about the axis z through p is [z × (p_F - p); z], that of one that slides along z is [z; 0].

        Args:
            q: as of `fk`.
            frame: as of `fk`.

        Raises:
            InputError: as `fk`.

        Example:
            >>> import optiplan as op
            >>> op.load_robot("panda").jacobian("ready").shape
            (6, 7)
        """
        values = configuration(self.joint_names, self.configurations, q, "Robot.jacobian")
        return geometric_jacobian(self, values, self._frame(frame, "Robot.jacobian"))

    def _frame(self, name: str | None, function: str) -> str:
        if name is None:
            return self.tool_frame
        if not isinstance(name, str) or not self.model.existFrame(name):
            frames = [str(frame.name) for frame in self.model.frames[1:]]
            raise wrong_argument(function, "frame", f"'{name}'", choices(str(name), frames))
        return name

    def with_tool(self, frame: str) -> "Robot":
        """Return the same robot with another tool frame.

        Raises:
            UnknownChoiceError: there is no such frame.
        """
        self.frame_id(frame)
        return replace(self, tool_frame=frame)

    def mounted(self, mounting: Mounting) -> "Robot":
        """Return the same robot with another mounting."""
        bare = self._dismounted()
        return bare if mounting.usual else bare._mounted.get(mounting.key, lambda: bare._standing(mounting))

    def _dismounted(self) -> "Robot":
        """Return `unmounted` with the tool frame and the limits that this one has."""
        bare = self.unmounted
        if bare.tool_frame == self.tool_frame and bare.limits is self.limits:
            return bare
        return replace(bare, tool_frame=self.tool_frame, limits=self.limits)

    @cached_property
    def _mounted(self) -> "MostRecent[Robot]":
        return MostRecent(_MOST_MOUNTED)

    def _standing(self, mounting: Mounting) -> "Robot":
        return replace(
            self,
            model=mounting.model(self.model),
            geometry=mounting.geometry(self.geometry),
            build_visual=mounting.visual(self.build_visual),
            mounting=mounting,
            bare=self,
        )

    def holding(self, values: Mapping[str, float]) -> "Robot":
        """Return the robot with these planned joints fixed, rad or m, and the others planned.

        Its configurations are among those of this robot, so the proofs for pairs of links remain valid. Where a joint
        is fixed beyond its limits they do not, and these pairs are checked.

        Raises:
            UnknownChoiceError: a name that is no planned joint.
            InputError: a value that is no finite number.
        """
        for name, value in values.items():
            if name not in self.joint_names:
                raise UnknownChoiceError("joint", name, self.joint_names)
            if not is_finite(value):
                raise wrong_argument("Robot.holding", f"values['{name}']", described(value), "a number, rad or m")
        if not values:
            return self
        bare, fixed = self._dismounted(), {name: float(value) for name, value in values.items()}
        own = self.limits.of_joints([self.joint_names.index(name) for name in fixed])
        q = np.array(list(fixed.values()))
        if own.outside(q, -BEYOND).any():
            bare = bare.with_proved_checked()
        return replace(bare, **held_parts(bare, fixed)).mounted(self.mounting)

    def with_proved_checked(self, only: Collection[LinkPair] | None = None) -> "Robot":
        """Return the same robot with pairs checked that are proved apart, all or `only` some, for larger distances."""
        if self.bare is not None:
            return self._dismounted().with_proved_checked(only).mounted(self.mounting)
        kept = [pair for pair, why in self.allowed.items() if why != PROVED or (only is not None and pair not in only)]
        allowed = {pair: self.allowed[pair] for pair in kept}
        geometry = self.geometry.copy()
        set_pairs(self.model, geometry, allowed)
        return replace(self, geometry=geometry, allowed=allowed)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Return the call that loads it: models of pinocchio and coal cannot be pickled completely."""
        locked = {name: q for name, q in self.locked.items() if name not in self.held}
        parts = locked, self.group, self.fingerprint, dict(self.held), frozenset(self.allowed)
        by = self.reference.robot
        ref = by if isinstance(by, Mapping) else str(self.source)
        return _reload, (ref, parts, self.limits, self.tool_frame, self.mounting)

    def __repr__(self) -> str:
        """Return name, tool frame and named configurations in one line, and the names of the joints in another."""
        named = ", ".join(self.configurations) or "none"
        head = f"Robot: {self.name}, {self.n} joints, tool frame {self.tool_frame}, configurations: {named}"
        return f"{head}\n  joints: {', '.join(self.joint_names)}"


def _reload(
    source: str | Mapping[str, Any],
    parts: tuple[dict[str, float], str | None, str, dict[str, float], frozenset[LinkPair]],
    limits: Limits,
    tool_frame: str,
    mounting: Mounting,
) -> Robot:
    locked, group, fingerprint, held, allowed = parts
    robot = load_robot(source, locked=locked, group=group)
    if robot.fingerprint != fingerprint:
        raise OptiPlanError(f"robot {robot.name} is not what it was when it was loaded: its files have changed")
    if checked := robot.allowed.keys() - allowed:
        robot = robot.with_proved_checked(checked)
    return replace(robot.holding(held), limits=limits, tool_frame=tool_frame).mounted(mounting)


_loaded = LoadedRobots()


@reading()
def load_robot(
    ref: str | Mapping[str, Any],
    base: Path | None = None,
    locked: Mapping[str, float] | None = None,
    group: str | None = None,
) -> Robot:
    """Load a robot by name, by the path of its robot.yaml relative to `base`, or by the content of a robot.yaml.

    A robot loaded before is returned again while its files do not change.

    Args:
        ref: a name of `robot_names()`, a path, or the keys of a robot.yaml with paths relative to `base`; `version` and
            `name` are optional there.
        base: folder that a relative path starts from; the working directory without it.
        locked: positions, rad or m, of joints that are not planned; they override those of the robot.yaml.
        group: the joints to plan, a name of the robot.yaml's `groups`, or several joined by `+`; its default group
            without one.

    Raises:
        InputError: anything in the robot.yaml or its URDF, SRDF and meshes that cannot be used.
        UnknownChoiceError: `ref` is neither a robot's name nor a path, or there is no such group.
    """
    locked = {joint: float(q) if is_finite(q) else q for joint, q in (locked or {}).items()}  # numpy's, too
    key, began = _loaded.key(ref, base, locked, group), _loaded.now()
    robot = _loaded.get(key)
    if robot is None:
        if (arms := several_robots(ref, base)) is None:
            parts = read_robot(ref, base, locked, group)
        else:
            from optiplan.robot.side_by_side import read_side_by_side

            parts = read_side_by_side(arms, locked, group, load_robot)
        robot = Robot(**vars(parts))
        _loaded.keep(key, robot, began)
    return robot
