"""`workspace`: where a robot's tool can be, how dexterous it is there, and how exact."""

from collections.abc import Callable
from pathlib import Path

from optiplan.arrays import number_argument
from optiplan.errors import described, flag_argument, text_argument, whole_argument, wrong_argument
from optiplan.robot.robot import Robot
from optiplan.runs.run_folder import folder_argument
from optiplan.viewer.workspaces.export import save_workspaces
from optiplan.workspace.accuracy import joint_resolution
from optiplan.workspace.sampling import (
    MOST,
    MOST_VOXELS,
    Workspace,
    WorkspaceOptions,
    robot_with_meshes,
    study_workspace,
)


def workspace(  # noqa: PLR0913  # one keyword for each option of the command
    robot: Robot | str | Path,
    out: Path | str | None = None,
    *,
    samples: int = 200_000,
    grid: int | None = None,
    group: str | None = None,
    frame: str | None = None,
    collision: bool = True,
    floor: float | None = None,
    resolution: str | None = None,
    voxels: int = 10,
    seed: int = 0,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Workspace:
    """Sample where a robot's tool can be, on all cores: what `optiplan workspace ROBOT` does.

    The reach sphere lies about the shoulder, where the first two axes meet; its radius is the largest reach. Covered is
    the share of its voxels in which a sample without collision lies, a lower bound.

    Args:
        robot: a name of `op.robots()` or the path of a robot.yaml, whose links are checked as their meshes, also where
            the file says hull; or a `Robot`, which is taken as it is.
        out: folder for NPZ, PLY, a page and a picture; None: nothing is written.
        samples: random configurations, uniform within the limits.
        grid: instead, so many values per joint: grid**n configurations.
        group: of the joints that move, of a robot that is a name or a path; None: that of its file.
        frame: whose positions are counted; None: the tool frame.
        collision: leave out configurations where links touch each other, or the floor.
        floor: height of a floor, m; None: none.
        resolution: of the joints, whose error at the tool is mapped: encoder bits per turn (`17bit`) or a step in rad
            (`1e-4`); None: no such map.
        voxels: in a radius of the reach.
        seed: of the samples; the same arguments give the same numbers on any machine.
        progress: called with the fraction done, 0 to 1.

    Returns:
        The study: `reach` (m), `voxels.coverage` and `rings` (shares), `samples` with arrays `q` (N, n), `position`
        (N, 3), m, `free` (N,), and `values`, (N,) each: manipulability, condition, error at the tool.

    Raises:
        InputError: an argument that does not fit.
        OptiPlanError: there is no such robot or frame, a sliding joint has no limits, or too many configurations.

    A script that calls it guards its own start with `if __name__ == "__main__":`, since the processes import it.

    Example:
        >>> import optiplan as op
        >>> op.workspace("planar2r", samples=2000)
        Workspace: planar2r, reach 1.102 m, 7.3% of the voxels covered, 100.0% free
    """
    folder = folder_argument("workspace", out)
    whole_argument("workspace", "samples", samples, 1, most=MOST)
    whole_argument("workspace", "grid", 2 if grid is None else grid, 2, most=MOST)
    whole_argument("workspace", "voxels", voxels, 2, most=MOST_VOXELS)
    whole_argument("workspace", "seed", seed, 0)
    text_argument("workspace", "group", group, "the name of a group of joints")
    text_argument("workspace", "frame", frame, "the name of a link or fixed frame")
    flag_argument("workspace", "collision", collision)
    if not callable(progress):
        raise wrong_argument("workspace", "progress", described(progress), "a function of a fraction")
    if floor is not None:
        number_argument("workspace", "floor", floor, "a height in m")
        if not collision:
            raise wrong_argument(
                "workspace", "floor", "a floor with collision=False", "none where no touch is looked for"
            )
    if resolution is not None and not isinstance(resolution, str):
        raise wrong_argument("workspace", "resolution", described(resolution), "text, such as '17bit' or '1e-4'")
    if not isinstance(robot, Robot | str | Path):
        raise wrong_argument(
            "workspace", "robot", described(robot), "op.load_robot(…), a name of op.robots() or a path"
        )
    arm = robot if isinstance(robot, Robot) else robot_with_meshes(str(robot), group)
    arm = arm if frame is None else arm.with_tool(frame)
    steps = None if resolution is None else joint_resolution(arm, resolution)
    options = WorkspaceOptions(samples, grid, collision, floor, steps, voxels, seed)
    found = study_workspace(arm, options, progress)
    if folder is not None:
        save_workspaces([found], folder)
    return found
