"""Mink's three benchmark scenes (UR5e, G1, ALOHA) with our controller, pink and mink: time, error, jerk, violations.

    python benchmarks/control_scenes.py --mink MINK [--steps 2000] [--markdown scenes.md]   # 2 minutes on one core

MINK is a checkout of github.com/kevinzakka/mink. MuJoCo reads the models in its `examples`; the others get them as
URDFs. Motions, costs, gains and limits are those of its `benchmarks/scenes.py`, with three changes. G1's pelvis is
fixed, since floating bases are not supported, and the tasks of its feet, pelvis and centre of mass are left out. Its
forearms stand for its hands in pairs with the thighs, because models before 2025 have no bodies for these. ALOHA's
bodies keep 1 cm instead of 5, since some are nearer than that at the start. Clearance in mink is of those
pairs of geoms, in ours of all pairs of links that have them; pink has none. The last line is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import gc
import logging
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import trimesh
from published import finish, table_parser
from qpsolvers import available_solvers

import optiplan as op
from optiplan.collision.model import CollisionModel

DT, SPEED = 0.002, np.pi
SOLVER = "daqp" if "daqp" in available_solvers else "proxqp"
"""Of pink and mink: what mink's own benchmark takes."""
AT_LEAST, VIEW = 0.01, 0.1
"""m, in scenes with clearance: distance kept, and distance from which on pairs count."""
Step = Callable[[list[pin.SE3]], np.ndarray]
"""From the targets of all frames to the configuration at the end of the step."""


@dataclass(frozen=True)
class Hand:
    """A frame that follows a target: costs, share of the error that goes in a step, and its motion in time.

    `root`: its target is a pose in this body's frame; None: in the world. `shift` (3,), m, of the target: along the
    axes of the world, or of the target's own where there is a root.
    """

    site: str
    shift: Callable[[float], list[float]]
    position: float = 1.0
    orientation: float = 1.0
    gain: float = 1.0
    root: str | None = None


@dataclass(frozen=True)
class MinkScene:
    """A scene: file, keyframe, tasks and pairs of bodies that keep clear."""

    file: str
    key: str
    hands: list[Hand]
    upright: dict[str, float] = field(default_factory=dict)
    posture: float = 0.0
    clear: Callable[[mujoco.MjModel], list[tuple[list[int], list[int]]]] = lambda model: []
    damping: float = 1e-6


def inward(t: float) -> float:
    """How far ALOHA's hands have come together, 0 to 1."""
    return 0.5 * (1.0 - np.cos(2.0 * np.pi * 0.4 * t))


def circle(radius: float, rate: float) -> Callable[[float], list[float]]:
    """In the plane x-z, so many rounds a second."""
    return lambda t: [radius * np.cos(2.0 * np.pi * rate * t), 0.0, radius * np.sin(2.0 * np.pi * rate * t)]


def wave(t: float) -> list[float]:
    """Of G1's left hand."""
    w = 2.0 * np.pi * 0.8 * t
    return [0.0, 0.05 + 0.04 * np.sin(w), 0.04 * np.cos(w)]


def aloha_hand(side: float) -> Callable[[float], list[float]]:
    """In to the middle and down, and back."""
    return lambda t: [side * (0.03 + 0.13 * inward(t)), -0.04 * (1.0 - inward(t)), -0.24 * inward(t)]


def aloha_pairs(model: mujoco.MjModel) -> list[tuple[list[int], list[int]]]:
    """Wrist and wrist; arms, and frame and table."""
    import mink

    wrists = [mink.get_subtree_geom_ids(model, model.body(f"{side}/wrist_link").id) for side in ("left", "right")]
    arms = [mink.get_subtree_geom_ids(model, model.body(f"{side}/upper_arm_link").id) for side in ("left", "right")]
    frame = mink.get_body_geom_ids(model, model.body("metal_frame").id)
    return [(wrists[0], wrists[1]), (arms[0] + arms[1], [*frame, model.geom("table").id])]


def g1_pairs(model: mujoco.MjModel) -> list[tuple[list[int], list[int]]]:
    """Forearm and thigh of each side."""
    import mink

    found = []
    for side in ("left", "right"):
        bodies = model.body(f"{side}_elbow_roll_link").id, model.body(f"{side}_hip_yaw_link").id
        found.append((mink.get_body_geom_ids(model, bodies[0]), mink.get_body_geom_ids(model, bodies[1])))
    return found


SCENES = {
    "UR5e": MinkScene(
        "universal_robots_ur5e/scene.xml", "home", [Hand("attachment_site", circle(0.08, 0.5))], damping=1e-6
    ),
    "G1, pelvis fixed": MinkScene(
        "unitree_g1/scene.xml",
        "stand",
        [
            Hand("right_palm", circle(0.04, 0.8), 5.0, 0.5, 0.5),
            Hand("left_palm", wave, 5.0, 0.5, 0.5, root="torso_link"),
        ],
        upright={"torso_link": 5.0},
        posture=0.1,
        clear=g1_pairs,
        damping=1e-2,
    ),
    "ALOHA": MinkScene(
        "aloha/scene.xml",
        "neutral_pose",
        [Hand("left/gripper", aloha_hand(1.0), 5.0, 1.0), Hand("right/gripper", aloha_hand(-1.0), 5.0, 1.0)],
        clear=aloha_pairs,
        damping=1e-4,
    ),
}


class Loaded:
    """A scene in MuJoCo and as our robot, with where everything is at the start."""

    def __init__(self, scene: MinkScene, examples: Path, folder: Path) -> None:
        spec = mujoco.MjSpec.from_file(str(examples / scene.file))
        key = spec.compile().key(scene.key).qpos.copy()
        whole = spec.compile()
        self.fixed = mujoco.mjtJoint(int(whole.jnt_type[0])) == mujoco.mjtJoint.mjJNT_FREE
        if self.fixed:
            spec.delete(next(joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE))
            for frame in list(spec.keys):
                spec.delete(frame)
            root = spec.body(whole.body(int(whole.jnt_bodyid[0])).name)
            root.pos, root.quat = key[:3], key[3:7]
            key = key[7:]
        self.scene, self.model = scene, spec.compile()
        touching = set(np.flatnonzero(self.model.geom_contype).tolist())
        pairs = scene.clear(self.model)
        self.groups = [([g for g in a if g in touching], [g for g in b if g in touching]) for a, b in pairs]
        self.joints = [self.model.joint(j).name for j in range(self.model.njnt)]
        sites = [hand.site for hand in scene.hands]
        urdf = write_urdf(self.model, sites, {g for pair in self.groups for side in pair for g in side}, folder)
        bare = {} if self.groups else {"collision": "none"}
        order = list(pin.buildModelFromUrdf(str(urdf)).names)[1:]  # of pinocchio: branches by their names
        self.robot = op.Robot.from_urdf(urdf, tool_frame=sites[0], group=order, **bare)
        self.order = [self.joints.index(name) for name in self.robot.joint_names]
        self.q = np.clip(key[self.order], self.robot.limits.lower, self.robot.limits.upper)
        c = op.Controller(self.robot, []).configuration(op.State(self.q))
        self.start = [pin.SE3(c.pose(self.robot.frame_id(site))) for site in sites]
        roots = [None if hand.root is None else pin.SE3(c.pose(self.robot.frame_id(hand.root))) for hand in scene.hands]
        self.start = [X if R is None else R.actInv(X) for X, R in zip(self.start, roots, strict=True)]

    @property
    def pairs(self) -> int:
        """Of geoms, in mink."""
        return sum(len(a) * len(b) for a, b in self.groups)

    def targets(self, t: float) -> list[pin.SE3]:
        """Of all hands at a time, s."""
        found = []
        for hand, X in zip(self.scene.hands, self.start, strict=True):
            shift = np.array(hand.shift(t))
            found.append(pin.SE3(X.rotation, X.translation + (shift if hand.root is None else X.rotation @ shift)))
        return found

    def to_mujoco(self, q: np.ndarray) -> np.ndarray:
        """The same configuration in MuJoCo's order."""
        found = np.empty(len(q))
        found[self.order] = q
        return found


def write_urdf(model: mujoco.MjModel, sites: list[str], geoms: set[int], folder: Path) -> Path:
    """The bodies, hinges and slides of a model, with the requested geoms, meshes as their hulls."""
    root = ET.Element("robot", name="scene")
    names = {b: model.body(b).name or f"body {b}" for b in range(model.nbody)}
    for b in range(model.nbody):
        link = ET.SubElement(root, "link", name=names[b])
        if b and model.body_mass[b] > 0.0:
            inertial = ET.SubElement(link, "inertial")
            _origin(inertial, model.body_ipos[b], model.body_iquat[b])
            ET.SubElement(inertial, "mass", value=repr(float(model.body_mass[b])))
            x, y, z = (repr(float(i)) for i in model.body_inertia[b])
            ET.SubElement(inertial, "inertia", ixx=x, iyy=y, izz=z, ixy="0", ixz="0", iyz="0")
        for g in sorted(geoms & set(np.flatnonzero(model.geom_bodyid == b).tolist())):
            _collision(model, g, link, folder)
        if b:
            _joint(model, b, names, root)
    for name in sites:
        site = model.site(name)
        ET.SubElement(root, "link", name=name)
        joint = ET.SubElement(root, "joint", name=f"{name} fixed", type="fixed")
        ET.SubElement(joint, "parent", link=names[int(site.bodyid[0])])
        ET.SubElement(joint, "child", link=name)
        _origin(joint, site.pos, site.quat)
    file = folder / "scene.urdf"
    ET.ElementTree(root).write(file)
    return file


def _joint(model: mujoco.MjModel, b: int, names: dict[int, str], root: ET.Element) -> None:
    count, j = int(model.body_jntnum[b]), int(model.body_jntadr[b])
    if count > 1 or (count and np.abs(model.jnt_pos[j]).max() > 0.0):
        raise ValueError(f"body {names[b]}: several joints, or one beside its frame")
    slides = count and mujoco.mjtJoint(int(model.jnt_type[j])) == mujoco.mjtJoint.mjJNT_SLIDE
    kind = "fixed" if not count else "prismatic" if slides else "revolute"
    joint = ET.SubElement(root, "joint", name=model.joint(j).name if count else f"{names[b]} fixed", type=kind)
    ET.SubElement(joint, "parent", link=names[int(model.body_parentid[b])])
    ET.SubElement(joint, "child", link=names[b])
    _origin(joint, model.body_pos[b], model.body_quat[b])
    if count:
        ET.SubElement(joint, "axis", xyz=_text(model.jnt_axis[j]))
        low, high = (repr(float(end)) for end in model.jnt_range[j])
        ET.SubElement(joint, "limit", lower=low, upper=high, velocity=repr(SPEED), effort="1000")


def _collision(model: mujoco.MjModel, g: int, link: ET.Element, folder: Path) -> None:
    size, kind = model.geom_size[g], mujoco.mjtGeom(int(model.geom_type[g]))
    X = pin.SE3(pin.Quaternion(*model.geom_quat[g]).normalized().matrix(), model.geom_pos[g])
    parts: list[tuple[str, dict[str, str], pin.SE3]] = []
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[g]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        file = folder / f"geom_{g}.stl"
        trimesh.Trimesh(model.mesh_vert[first : first + count]).convex_hull.export(file)
        parts = [("mesh", {"filename": str(file)}, X)]
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        parts = [("box", {"size": _text(2.0 * size)}, X)]
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        parts = [("sphere", {"radius": repr(float(size[0]))}, X)]
    elif kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER):
        radius = repr(float(size[0]))
        parts = [("cylinder", {"radius": radius, "length": repr(float(2.0 * size[1]))}, X)]
        if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            ends = [X * pin.SE3(np.eye(3), np.array([0.0, 0.0, z])) for z in (-size[1], size[1])]
            parts += [("sphere", {"radius": radius}, end) for end in ends]
    else:
        raise ValueError(f"geom {g}: a kind that no URDF has")
    for shape, attributes, at in parts:
        collision = ET.SubElement(link, "collision")
        ET.SubElement(ET.SubElement(collision, "geometry"), shape, attributes)
        _origin(collision, at.translation, np.roll(pin.Quaternion(at.rotation).coeffs(), 1))


def _origin(parent: ET.Element, position: Any, quaternion: Any) -> None:
    R = pin.Quaternion(*np.asarray(quaternion)).normalized().matrix()
    ET.SubElement(parent, "origin", xyz=_text(position), rpy=_text(pin.rpy.matrixToRpy(R)))


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def ours(loaded: Loaded) -> Step:
    """Our controller, each target reached in one step as far as the others' gains say."""
    scene, robot = loaded.scene, loaded.robot
    tasks: list[Any] = []
    for hand in scene.hands:
        costs = {"position_cost": hand.position, "orientation_cost": hand.orientation, "gain": hand.gain / DT}
        root = hand.root
        tasks.append(op.PoseTask(hand.site, **costs) if root is None else op.RelativePoseTask(hand.site, root, **costs))
    c = op.Controller(robot, []).configuration(op.State(loaded.q))
    for body, cost in scene.upright.items():
        tasks.append(op.OrientationTask(body, pin.SE3(c.pose(robot.frame_id(body))), cost=cost, gain=1.0 / DT))
    if scene.posture > 0.0:
        tasks.append(op.PostureTask(loaded.q, cost=scene.posture, gain=1.0 / DT))
    limits: list[Any] = [op.PositionLimit(), op.VelocityLimit(np.full(robot.n, SPEED))]
    if loaded.groups:
        limits.append(op.ClearanceLimit(op.Scene(), AT_LEAST, VIEW - AT_LEAST))
    controller = op.Controller(robot, tasks, limits=limits, response=0.0)
    state = op.State(loaded.q)

    def step(targets: list[pin.SE3]) -> np.ndarray:
        nonlocal state
        for task, X in zip(tasks, targets, strict=False):
            task.target = X
        state = controller.step(state, DT).state
        return state.q

    return step


def of_pink(loaded: Loaded) -> Step:
    """Pink with the same tasks, and limits of position and velocity."""
    import pink

    scene, robot = loaded.scene, loaded.robot
    model = robot.model.copy()
    model.lowerPositionLimit, model.upperPositionLimit = robot.limits.lower, robot.limits.upper
    model.velocityLimit = np.full(robot.n, SPEED)
    configuration = pink.Configuration(model, model.createData(), loaded.q.copy())
    hands = [
        pink.tasks.FrameTask(hand.site, hand.position, hand.orientation, gain=hand.gain)
        if hand.root is None
        else pink.tasks.RelativeFrameTask(hand.site, hand.root, hand.position, hand.orientation, gain=hand.gain)
        for hand in scene.hands
    ]
    others: list[Any] = [pink.tasks.FrameTask(body, 0.0, cost) for body, cost in scene.upright.items()]
    if scene.posture > 0.0:
        others.append(pink.tasks.PostureTask(scene.posture))
    for task in others:
        task.set_target_from_configuration(configuration)

    def step(targets: list[pin.SE3]) -> np.ndarray:
        for task, X in zip(hands, targets, strict=True):
            task.set_target(X)
        tasks = [*hands, *others]
        v = pink.solve_ik(configuration, tasks, DT, SOLVER, damping=scene.damping, safety_break=False)
        configuration.integrate_inplace(v, DT)
        return configuration.q

    return step


def of_mink(loaded: Loaded) -> Step:
    """Mink, as its own benchmark does it."""
    import mink

    scene, model = loaded.scene, loaded.model
    configuration = mink.Configuration(model, loaded.to_mujoco(loaded.q))
    hands: list[Any] = []
    for hand in scene.hands:
        costs = {"position_cost": hand.position, "orientation_cost": hand.orientation, "gain": hand.gain}
        if hand.root is None:
            hands.append(mink.FrameTask(hand.site, "site", **costs))
        else:
            hands.append(mink.RelativeFrameTask(hand.site, "site", hand.root, "body", **costs))
    others: list[Any] = [mink.FrameTask(body, "body", 0.0, cost) for body, cost in scene.upright.items()]
    if scene.posture > 0.0:
        others.append(mink.PostureTask(model, scene.posture))
    for task in others:
        task.set_target_from_configuration(configuration)
    limits: list[Any] = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, dict.fromkeys(loaded.joints, SPEED))]
    if loaded.groups:
        limits.append(
            mink.CollisionAvoidanceLimit(
                model,
                loaded.groups,
                minimum_distance_from_collisions=AT_LEAST,
                collision_detection_distance=VIEW,
            )
        )

    def step(targets: list[pin.SE3]) -> np.ndarray:
        for task, X in zip(hands, targets, strict=True):
            task.set_target(mink.SE3.from_matrix(X.homogeneous))
        v = mink.solve_ik(configuration, [*hands, *others], DT, SOLVER, damping=scene.damping, limits=limits)
        configuration.integrate_inplace(v, DT)
        return configuration.q[loaded.order]

    return step


HEADINGS = (
    "scene", "controller", "median ms", "99 %", "99.9 %", "error mm RMS", "peak jerk",
    "steps beyond position / velocity", "least distance mm",
)  # fmt: skip


def run(loaded: Loaded, step: Step, steps: int) -> list[str]:
    """Follow the targets; a row of the table."""
    robot, seconds, Q, errors = loaded.robot, [], [loaded.q], []
    data, hands = robot.model.createData(), loaded.scene.hands
    for k in range(steps):
        targets = loaded.targets(k * DT)
        if k % 100 == 0:
            gc.collect(1)
        begin = time.perf_counter()
        q = step(targets)
        seconds.append(time.perf_counter() - begin)
        Q.append(np.array(q))
        pin.framesForwardKinematics(robot.model, data, Q[-1])
        for hand, X in zip(hands, targets, strict=True):
            at = data.oMf[robot.frame_id(hand.site)]
            at = at if hand.root is None else data.oMf[robot.frame_id(hand.root)].actInv(at)
            errors.append(np.linalg.norm(at.translation - X.translation))
    times = [1e3 * float(np.quantile(seconds[steps // 10 :], p)) for p in (0.5, 0.99, 0.999)]
    path = np.array(Q)
    rates = np.diff(path, axis=0) / DT
    jerk = float(np.abs(np.diff(rates[steps // 4 :], 2, axis=0)).max()) / DT**2
    outside = (path < robot.limits.lower - 1e-6) | (path > robot.limits.upper + 1e-6)
    fast = np.abs(rates) > SPEED * (1.0 + 1e-6)
    check = CollisionModel(robot, op.Scene())
    least = min((found.distance for q in path[::20] if (found := check.clearance(q)) is not None), default=np.inf)
    late = np.array(errors[len(errors) // 4 :])
    return [
        *(f"{t:.3f}" for t in times),
        f"{1e3 * float(np.sqrt(np.mean(late**2))):.3f}",
        f"{jerk:.1e}",
        f"{int(outside.any(axis=1).sum())} / {int(fast.any(axis=1).sum())}",
        "–" if np.isinf(least) else f"{1e3 * least:.1f}",
    ]


def rows_of(name: str, scene: MinkScene, examples: Path, steps: int) -> Iterator[list[str]]:
    """Of one scene, by all three."""
    with tempfile.TemporaryDirectory() as folder:
        loaded = Loaded(scene, examples, Path(folder))
        own = len(CollisionModel(loaded.robot, op.Scene()).pairs)
        for controller, make in {
            f"optiplan, {own} pairs of bodies": ours,
            "pink, no clearance" if loaded.groups else "pink": of_pink,
            f"mink, {loaded.pairs} pairs of geoms" if loaded.groups else "mink": of_mink,
        }.items():
            title = f"{name}, {loaded.robot.n} joints"
            try:
                yield [title, controller, *run(loaded, make(loaded), steps)]
            except Exception as error:  # what peers do where their program has no solution
                yield [title, controller, f"gave up: {type(error).__name__}", *["–"] * (len(HEADINGS) - 3)]


def main() -> None:
    """Run, print, write."""
    parser = table_parser(__doc__)
    parser.add_argument("--mink", type=Path, required=True, help="a checkout of mink")
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--steps", type=int, default=2000)
    options = parser.parse_args()
    gc.freeze()
    gc.disable()
    logging.disable()  # pink warns in each step outside its limits
    rows = []
    for name in options.scenes:
        rows += list(rows_of(name, SCENES[name], options.mink / "examples", options.steps))
    finish(options.markdown, HEADINGS, rows, {"rows": [dict(zip(HEADINGS, row, strict=True)) for row in rows]})


if __name__ == "__main__":
    main()
