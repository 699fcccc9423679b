"""A small picture of a scene with its robot, drawn without a browser, onto which tool paths can be laid."""

import base64
import io
from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.geometry.shapes import build_geometry
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.run_data.curves import tool_points
from optiplan.viewer.scene import obstacle_colour
from optiplan.viewer.surfaces import Surface, body_triangles, hull_surface

WIDTH, HEIGHT = 144, 104
LARGE = (288, 180)
"""px, of small pictures and of those in lists."""
POINTS = 60
"""Of a path."""
PATH = "#1769aa"
FINER = 2
"""Pixels drawn for one that is kept, in a row."""
TURN, RISE = np.radians(-128.0), np.radians(24.0)
"""Where it is seen from, rad: about the vertical from the x axis, and above the horizon."""
MARGIN = 0.05
MOST_FACES = 1500
"""Of a body; one of more is drawn by its hull."""
ROBOT = (0.86, 0.88, 0.90)
HELD = (0.90, 0.62, 0.25)
LIGHT = np.array([0.45, -0.55, 0.70])


@dataclass(frozen=True, eq=False)
class Thumbnail:
    """A picture, and how points of the world lie in it.

    Attributes:
        png: PNG, transparent where nothing is.
        axes: (2, 3), from points of the world, m, to px right and down.
        origin: (2,), px, of the world's origin.
    """

    png: bytes
    axes: Array
    origin: Array

    @property
    def address(self) -> str:
        """The picture as a data: address."""
        return f"data:image/png;base64,{base64.b64encode(self.png).decode('ascii')}"

    def project(self, points: Array) -> Array:
        """Points (k, 3), m, in the picture: (k, 2), px."""
        return np.asarray(points @ self.axes.T + self.origin)


def drawn_path(points: Array, radius: float, line: str = "", dot: str = "") -> str:
    """Return SVG elements of a path (k, 2), px, with a dot where it ends; `line`, `dot`: their attributes, if any."""
    through = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    end = f'cx="{points[-1, 0]:.1f}" cy="{points[-1, 1]:.1f}" r="{radius:g}"'
    return f'<polyline points="{through}"{line}/><circle {end}{dot}/>'


def scene_picture(problem: Problem, trajectory: Trajectory | None = None) -> str:
    """Return an SVG of a problem and, if there is one, of a motion: each tool's path, with a dot where it ends."""
    paths: list[Array] = []
    if trajectory is not None and trajectory.joint_names == problem.robot.joint_names:
        Q = trajectory(np.linspace(0.0, trajectory.duration, POINTS))
        paths = list(tool_points(problem.robot, Q).values())
    picture = thumbnail(problem, size=LARGE, also=np.concatenate(paths) if paths else None)
    line, dot = f' fill="none" stroke="{PATH}" stroke-width="2.2"', f' fill="{PATH}"'
    drawn = "".join(drawn_path(picture.project(path), 4.0, line, dot) for path in paths)
    width, height = LARGE
    image = f'<image href="{picture.address}" width="{width}" height="{height}"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">{image}{drawn}</svg>'


def thumbnail(problem: Problem, size: tuple[int, int] = (WIDTH, HEIGHT), also: Array | None = None) -> Thumbnail:
    """Picture of a problem's scene with its robot at the start, seen from behind it, from the right and above.

    Without perspective; framed by the robot and the obstacles; half-spaces are left out.

    Args:
        problem: robot and scene.
        size: of the picture, px.
        also: points (k, 3), m, of the world that have to be within the frame.
    """
    triangles, colours = _triangles(problem)
    away = np.array([np.cos(RISE) * np.cos(TURN), np.cos(RISE) * np.sin(TURN), np.sin(RISE)])
    right = np.cross([0.0, 0.0, 1.0], away) / np.cos(RISE)
    down = -np.cross(away, right)
    framed = triangles.reshape(-1, 3) if also is None else np.concatenate([triangles.reshape(-1, 3), also])
    flat = framed @ np.stack([right, down]).T
    low, high = flat.min(axis=0, initial=-1e-3), flat.max(axis=0, initial=1e-3)
    area = np.array(size)
    scale = float(((1.0 - 2.0 * MARGIN) * area / np.maximum(high - low, 1e-6)).min())
    axes, origin = scale * np.stack([right, down]), 0.5 * area - 0.5 * scale * (low + high)
    seen = np.concatenate([triangles @ axes.T + origin, (triangles @ away)[..., None]], axis=2)
    return Thumbnail(_png(_drawn(seen, _shaded(triangles, colours), size)), axes, origin)


def _triangles(problem: Problem) -> tuple[Array, Array]:
    """Triangles (m, 3, 3), m, in the world, and their colours (m, 3)."""
    found = [(surface.vertices[surface.faces], colour) for surface, colour in _surfaces(problem)]
    if not found:
        return np.zeros((0, 3, 3)), np.zeros((0, 3))
    return np.concatenate([t for t, _ in found]), np.concatenate([np.tile(c, (len(t), 1)) for t, c in found])


def _surfaces(problem: Problem) -> Iterator[tuple[Surface, Sequence[float]]]:
    robot = problem.robot
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, problem.start)
    for body in robot.geometry.geometryObjects:
        yield _placed(body_triangles(body.geometry), data.oMi[body.parentJoint] * body.placement), ROBOT
    for held in problem.scene.attached:
        X_WL = data.oMf[robot.model.getFrameId(held.link)]
        yield _placed(body_triangles(build_geometry(held.shape)), X_WL * held.X_LO), HELD
    for obstacle in problem.scene.obstacles:
        if not obstacle.shape.endless:
            surface = body_triangles(build_geometry(obstacle.shape))
            yield _placed(surface, obstacle.X_WO), obstacle_colour(obstacle.shape)[:3]


def _placed(surface: Surface, X_WB: pin.SE3) -> Surface:
    if len(surface.faces) > MOST_FACES:
        surface = hull_surface(surface.vertices)
    return Surface(surface.vertices @ X_WB.rotation.T + X_WB.translation, surface.faces)


def _shaded(triangles: Array, colours: Array) -> Array:
    """Colours (m, 3) as lit from one side; faces seen from behind are lit as from before."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    light = np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT))) / length
    return np.asarray(np.clip(colours * (0.5 + 0.55 * light)[:, None], 0.0, 1.0), dtype=np.float64)


def _drawn(triangles: Array, colours: Array, size: tuple[int, int] = (WIDTH, HEIGHT)) -> Array:
    """Draw triangles (m, 3, 3) of px and depth (larger is nearer) into an image (height, width, 4), nearest last."""
    width, height = size
    rows, columns = FINER * height, FINER * width
    depth, image = np.full((rows, columns), -np.inf), np.zeros((rows, columns, 4))
    scaled = triangles * np.array([FINER, FINER, 1.0])
    low = np.maximum(np.floor(scaled[:, :, :2].min(axis=1) - 0.5).astype(int), 0)
    high = np.minimum(np.ceil(scaled[:, :, :2].max(axis=1) + 0.5).astype(int), [columns, rows])
    for corners, colour, (x0, y0), (x1, y1) in zip(scaled, colours, low, high, strict=True):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if x1 <= x0 or y1 <= y0 or abs(area) < 1e-9:
            continue
        x, y = np.arange(x0, x1) + 0.5, (np.arange(y0, y1) + 0.5)[:, None]
        u = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area  # weights of b and c
        v = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
        z = az + u * (bz - az) + v * (cz - az)
        part = depth[y0:y1, x0:x1]
        nearer = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (z > part)
        part[nearer] = z[nearer]
        image[y0:y1, x0:x1][nearer] = [*colour, 1.0]
    blocks = image.reshape(height, FINER, width, FINER, 4)
    cover = blocks[..., 3:].sum(axis=(1, 3))
    mean = (blocks[..., :3] * blocks[..., 3:]).sum(axis=(1, 3)) / np.maximum(cover, 1e-9)
    return np.asarray(np.concatenate([mean, cover / FINER**2], axis=2), dtype=np.float64)


def _png(image: Array) -> bytes:
    from matplotlib.image import imsave

    buffer = io.BytesIO()
    imsave(buffer, np.round(24.0 * image) / 24.0, format="png")  # few shades, few bytes
    return buffer.getvalue()
