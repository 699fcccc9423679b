"""The workspace of an arm: joint space sampled or gridded, with self-collision, and counted in voxels."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.collision.model import CollisionModel
from optiplan.config.document import read_yaml
from optiplan.cores import cores
from optiplan.errors import OptiPlanError
from optiplan.geometry.scene import HalfSpace, Obstacle, Scene
from optiplan.kinematics.manipulability import ToolKinematics, manipulability_measures, scaled
from optiplan.records import dataclass
from optiplan.robot.reference import robot_file
from optiplan.robot.robot import Robot, load_robot
from optiplan.workspace.accuracy import tool_error
from optiplan.workspace.parallel import ChunkedWork, run_chunks
from optiplan.workspace.reach import Reach, reach, sampling_range
from optiplan.workspace.voxels import Coverage, VoxelMap, ring_coverage, voxelise

CHUNK = 2000
"""Configurations a chunk: each chunk has its own generator, so that the number of processes changes nothing."""
MOST, MOST_VOXELS = 50_000_000, 100
RINGS = 20
"""Rings a radius in `Workspace.rings`."""


@dataclass(frozen=True, eq=False)
class WorkspaceOptions:
    """Options of a workspace study.

    Attributes:
        samples: uniform configurations within the limits, when `grid` is None.
        grid: values a joint, ends included: grid**n configurations.
        collision: leave out configurations where links touch each other, or the floor.
        floor: height, m, of a floor that the moving links must not touch; None for none.
        resolution: (n,) joint steps, rad or m, whose error at the tool is mapped; None for no such map.
        voxels: voxels in a radius of the reach sphere.
        seed: of the samples.
    """

    samples: int = 200_000
    grid: int | None = None
    collision: bool = True
    floor: float | None = None
    resolution: Array | None = None
    voxels: int = 10
    seed: int = 0


@dataclass(frozen=True, eq=False)
class WorkspaceSamples:
    """N configurations and what holds there.

    Attributes:
        q: (N, n) rad or m.
        position: (N, 3) m, world, of the tool.
        axis: (N, 3) the tool's z axis, world.
        free: (N,) nothing touches.
        values: each (N,): `yoshikawa`, `asada`, `smallest` of the full Jacobian with lengths in units of the largest
            reach, so that arms of any size compare, and with a resolution `error_worst`, `error_rms`, m, see
            `accuracy.ToolError`.
    """

    q: Array
    position: Array
    axis: Array
    free: npt.NDArray[np.bool_]
    values: dict[str, Array]


@dataclass(frozen=True, eq=False, repr=False)
class Workspace:
    """Result of a workspace study.

    Attributes:
        voxels: made of the configurations that are free.
        rings: the coverage in (rho, z) cells of a twentieth of the reach.
    """

    robot: Robot
    options: WorkspaceOptions
    reach: Reach
    samples: WorkspaceSamples
    voxels: VoxelMap
    rings: Coverage

    @property
    def free_fraction(self) -> float:
        """Share of the configurations in which nothing touches."""
        return float(self.samples.free.mean())

    def __repr__(self) -> str:
        """Robot, reach and coverage in one line."""
        shares = f"{self.voxels.coverage.whole:.1%} of the voxels covered, {self.free_fraction:.1%} free"
        return f"Workspace: {self.robot.name}, reach {self.reach.largest:.4g} m, {shares}"


def robot_with_meshes(name: str, group: str | None = None) -> Robot:
    """Load a robot with the meshes of its links where its robot.yaml checks their convex hulls.

    A hull fills what a link is bent around: 59 % of a UR5's configurations touch as hulls, 25 % as meshes, and the map
    of hulls shows a hole below its base that is not there. Planning keeps the hulls, which are quicker to prove.

    Raises:
        InputError, UnknownChoiceError: as `load_robot`.
    """
    robot = load_robot(name, group=group)
    file = robot_file(name)
    description = read_yaml(file.resolve()).data
    if description.get("collision") != "hull":
        return robot
    return load_robot({**description, "collision": "mesh"}, file.resolve().parent, group=group)


def study_workspace(
    robot: Robot,
    options: WorkspaceOptions,
    progress: Callable[[float], None] = lambda _: None,
    processes: int | None = None,
) -> Workspace:
    """Sample the workspace of a robot's tool frame on `processes` cores, all of them by default.

    The result depends on the options alone, not on the number of processes.

    Raises:
        OptiPlanError: a sliding joint without limits, a tool that stays at the shoulder, or more configurations than
            `MOST`.
    """
    size = options.samples if options.grid is None else options.grid**robot.n
    if size > MOST:
        raise OptiPlanError(f"workspace: found {size:,} configurations; expected at most {MOST:,}")
    sphere = reach(robot)
    chunks = -(-size // CHUNK)
    parts = run_chunks(_Sampling(robot, options, size, sphere.largest), chunks, processes or cores(), progress)
    samples = _join(parts)
    free = samples.free
    values = {name: value[free] for name, value in samples.values.items()}
    voxels = voxelise(sphere, options.voxels, samples.position[free], samples.axis[free], values)
    rings = ring_coverage(sphere, samples.position[free], sphere.largest / RINGS)
    return Workspace(robot, options, sphere, samples, voxels, rings)


def sample_configurations(robot: Robot, options: WorkspaceOptions, start: int, stop: int) -> Array:
    """Configurations number `start` to `stop` (not included) of the study, (stop - start, n); a chunk at most."""
    lower, upper = sampling_range(robot)
    if options.grid is None:
        rng = np.random.default_rng([options.seed, start // CHUNK])
        return rng.uniform(lower, upper, (stop - start, robot.n))
    places = np.stack(np.unravel_index(np.arange(start, stop), (options.grid,) * robot.n), axis=1)
    return np.asarray(lower + (upper - lower) * places / max(options.grid - 1, 1))


@dataclass(frozen=True, eq=False)
class _Sampling(ChunkedWork[WorkspaceSamples]):
    robot: Robot
    options: WorkspaceOptions
    size: int
    length: float

    def prepare(self) -> Callable[[int], WorkspaceSamples]:
        robot, options = self.robot, self.options
        tool = ToolKinematics(robot)
        checked = CollisionModel(robot, _scene(robot, options.floor)) if options.collision else None

        def sample(chunk: int) -> WorkspaceSamples:
            start = chunk * CHUNK
            Q = sample_configurations(robot, options, start, min(start + CHUNK, self.size))
            X_WT, J = tool.evaluate(Q)
            found = vars(manipulability_measures(scaled(J, length=self.length)))
            if options.resolution is not None:
                error = tool_error(J, options.resolution)
                found = {**found, "error_worst": error.position_worst, "error_rms": error.position_rms}
            free = np.ones(len(Q), bool) if checked is None else np.array([not checked.collides(q) for q in Q])
            return WorkspaceSamples(Q, X_WT[:, :3, 3], X_WT[:, :3, 2], free, found)

        return sample


def _scene(robot: Robot, floor: float | None) -> Scene:
    if floor is None:
        return Scene()
    bodies = enumerate(robot.geometry.geometryObjects)
    standing = frozenset(frozenset({"floor", robot.link_of(k)}) for k, body in bodies if body.parentJoint == 0)
    return Scene((Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), floor), pin.SE3.Identity()),), allowed=standing)


def _join(parts: list[WorkspaceSamples]) -> WorkspaceSamples:
    def column(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    free = np.concatenate([part.free for part in parts])
    values = {name: np.concatenate([part.values[name] for part in parts]) for name in parts[0].values}
    return WorkspaceSamples(column("q"), column("position"), column("axis"), free, values)
