"""Wrist, elbow and shoulder singularity of an arm with a spherical wrist, with the ellipsoid that becomes flat.

Seen from the wrist's centre c the Jacobian is block triangular: joints 1 to 3 move c, joints 4 to 6 turn the hand. At a
shoulder or elbow singularity the velocity ellipsoid of the first block loses an axis, at a wrist singularity that of
the second.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import InputError, Issue
from optiplan.figure_style import COLOURS, INK, LIMIT, line_style, sheet
from optiplan.kinematics.manipulability import ellipsoids
from optiplan.kinematics.singularities import NAMES, SingularityModel, singularity_model
from optiplan.records import dataclass
from optiplan.robot.robot import Robot, load_robot
from optiplan.viewer.plots.runs import PlottedRun

ARM = "puma560"
"""The lecture's, drawn without a run."""
SHOWN = ("wrist", "elbow", "shoulder")
TURNED = {"shoulder": 1, "elbow": 2, "wrist": 4}
"""Index of the joint that leads into the singularity, the others at rest."""
SAYS = {
    "wrist": "axes 4 and 6 in line",
    "elbow": "stretched or folded",
    "shoulder": "wrist above axis 1",
}

_STEPS = 721  # of a joint's range, in the search and in the curves
_COARSE = 25  # values a joint where the most regular posture is looked for
_SIZE = 0.3  # of the largest semi-axis of an ellipsoid, in shares of what is shown


@dataclass(frozen=True, eq=False)
class SingularPosture:
    """A singularity on the way of one joint.

    Attributes:
        name: of `SHOWN`.
        q: (6,) rad, where the factor of that name is 0.
        angles: (k,) rad, of the joint that leads there.
        semi_axes: (k, 3) of the block's ellipsoid there: m/s of c, or rad/s of the hand, for joint speeds of norm 1.
    """

    name: str
    q: Array
    angles: Array
    semi_axes: Array


def singular_postures(robot: Robot, model: SingularityModel) -> list[SingularPosture]:
    """The three singularities, each the nearest one to the most regular posture along its joint.

    Raises:
        InputError: a joint's limits keep the arm from one.
    """
    regular = _regular(robot, model)
    found = []
    for name in SHOWN:
        joint, k = TURNED[name], NAMES.index(name)
        angles = np.linspace(*_range(robot, joint), _STEPS)
        Q = np.tile(regular, (_STEPS, 1))
        Q[:, joint] = angles
        sine = model.factors(Q).sines[:, k]
        crossed = np.flatnonzero(np.sign(sine[1:]) != np.sign(sine[:-1]))
        if not len(crossed):
            raise _refused(robot, f"whose limits exclude the {name} singularity")
        at = crossed[np.abs(angles[crossed] - regular[joint]).argmin()]
        q = _bisected(model, Q[at], Q[at + 1], k)
        found.append(SingularPosture(name, q, angles, ellipsoids(_block(model, name, Q)).velocity))
    return found


def draw_singularities(runs: Sequence[PlottedRun]) -> Any:
    """The figure: the arm at each singularity with its flat ellipsoid; red is the direction lost.

    Below, the semi-axes of the ellipsoid along the joint that leads there.

    Raises:
        InputError: the robot has no spherical wrist behind an elbow.
    """
    robot = runs[0].problem.robot if runs else load_robot(ARM)
    model = singularity_model(robot)
    if model is None or model.wrist != "spherical":
        raise _refused(robot, "without a spherical wrist behind three joints")
    figure = sheet(6.6, width=9.2)
    grid = figure.add_gridspec(2, len(SHOWN), height_ratios=(1.35, 1.0))
    for column, posture in enumerate(singular_postures(robot, model)):
        space = figure.add_subplot(grid[0, column], projection="3d")
        _draw_arm(space, robot, model, posture)
        _draw_axes_of(figure.add_subplot(grid[1, column]), robot, posture)
    figure.suptitle(f"Singularities of {robot.name}; red: the direction in which nothing moves", fontsize=10)
    return figure


def _draw_arm(space: Any, robot: Robot, model: SingularityModel, posture: SingularPosture) -> None:
    """Axes' points as a chain to the tool, the ellipsoid about c, and the direction lost."""
    Q = posture.q[None]
    axis, point = robot.kinematics.axes(robot.kinematics.poses(Q))
    centre = model.blocks(Q).centre[0]
    tool = np.asarray(robot.fk(posture.q).position)
    chain = np.vstack([point[0, 0] * [1.0, 1.0, 0.0], point[0, :3], centre, tool])
    half = 0.5 * float(np.ptp(chain, axis=0).max())
    space.plot(*chain.T, "-o", color=INK, linewidth=3.0, markersize=4)
    shown = (3, 5) if posture.name == "wrist" else (TURNED[posture.name] - (posture.name == "shoulder"),)
    for j in shown:
        through = centre if posture.name == "wrist" else point[0, j]
        ends = through + np.outer([-0.9, 0.9], axis[0, j]) * half
        space.plot(*ends.T, linestyle="--", color=COLOURS[4], linewidth=1.2)
    e = ellipsoids(_block(model, posture.name, Q))
    size = _SIZE * 2.0 * half / e.velocity[0, 0]
    surface = _surface(centre, e.axes[0], size * e.velocity[0])
    space.plot_surface(*surface, color=COLOURS[0], alpha=0.35, linewidth=0, gid="ellipsoid")
    lost = centre + np.outer([-1.0, 1.0], e.axes[0, :, 2]) * size * e.velocity[0, 0]
    space.plot(*lost.T, color=LIMIT, linewidth=2.0, gid="lost")
    drawn = np.vstack([chain, lost, surface.reshape(3, -1).T])
    low, high = drawn.min(axis=0) - 0.05 * half, drawn.max(axis=0) + 0.05 * half
    space.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    space.set(xlabel="x, m", ylabel="y, m", zlabel="z, m")
    space.set_box_aspect(high - low, zoom=0.95)  # no cube about the chain: the arm fills its panel
    space.locator_params(nbins=2)
    space.tick_params(labelsize=7)
    space.set_title(f"{posture.name}: {SAYS[posture.name]}")


def _draw_axes_of(panel: Any, robot: Robot, posture: SingularPosture) -> None:
    joint = TURNED[posture.name]
    for k in range(3):
        panel.plot(posture.angles, posture.semi_axes[:, k], label=f"semi-axis {k + 1}", **line_style(k))
    panel.axvline(posture.q[joint], color=LIMIT, linestyle="--", linewidth=1.0, gid="singular")
    unit = "rad/s of the hand" if posture.name == "wrist" else "m/s of the wrist"
    panel.set(xlabel=f"{robot.joint_names[joint]}, rad", ylabel=unit, ylim=(0.0, None))
    panel.set_title(f"singular at {posture.q[joint]:.4f} rad".replace("-0.0000", "0"))
    if posture.name == SHOWN[0]:
        panel.legend(loc="best", fontsize=7)


def _block(model: SingularityModel, name: str, Q: Array) -> Array:
    blocks = model.blocks(Q)
    return blocks.wrist if name == "wrist" else blocks.arm


def _range(robot: Robot, joint: int) -> tuple[float, float]:
    """The joint's limits within half a turn of 0, rad."""
    low, high = float(robot.limits.lower[joint]), float(robot.limits.upper[joint])
    if high < -np.pi or low > np.pi:
        return low, high
    return max(low, -np.pi), min(high, np.pi)


def _regular(robot: Robot, model: SingularityModel) -> Array:
    """The configuration (6,) whose least sine is the largest, over a grid of joints 2, 3 and 5."""
    rest = np.array([np.clip(0.0, *_range(robot, joint)) for joint in range(6)])
    grid = [np.linspace(*_range(robot, TURNED[name]), _COARSE) for name in NAMES]
    Q = np.tile(rest, (_COARSE**3, 1))
    Q[:, [TURNED[name] for name in NAMES]] = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(Q[np.abs(model.factors(Q).sines).min(axis=1).argmax()])


def _bisected(model: SingularityModel, a: Array, b: Array, k: int) -> Array:
    """Where sine k is 0 between two configurations (6,) at which its signs differ."""
    positive = model.factors(a[None]).sines[0, k] > 0.0
    for _ in range(60):
        middle = 0.5 * (a + b)
        if (model.factors(middle[None]).sines[0, k] > 0.0) == positive:
            a = middle
        else:
            b = middle
    return np.asarray(0.5 * (a + b))


def _surface(centre: Array, axes: Array, semi: Array) -> Array:
    """Points (3, k, l), m, of an ellipsoid with `semi` axes along the columns of `axes`."""
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 33), np.linspace(0.0, np.pi, 17))
    ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    return np.asarray(centre[:, None, None] + np.einsum("ij,jkl->ikl", axes * semi, ball))


def _refused(robot: Robot, found: str) -> InputError:
    expected = "an arm of six joints with a spherical wrist, such as puma560 or srra"
    return InputError([Issue("plot", None, "singularities", f"'{robot.name}', {found}", expected)])
