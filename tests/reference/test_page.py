"""Figures of docs/theory/reports.md that no entry holds: each is computed, and looked for as the page writes it."""

from collections.abc import Callable
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import HalfSpace, Obstacle, Scene
from optiplan.robot.dh.table import forward, frames
from optiplan.robot.robot import load_robot
from optiplan.workspace.sampling import RINGS, Workspace, WorkspaceOptions, robot_with_meshes, study_workspace
from optiplan.workspace.voxels import Coverage, ring_coverage
from tests.reference.entries import entry
from tests.reference.poses import rot

PAGE = (Path(__file__).parents[2] / "docs" / "theory" / "reports.md").read_text(encoding="utf-8")


def delbot_jacobian() -> str:
    """Linear part with the axes of frames 4, 5, 6 instead of 3, 4, 5: largest error of a column."""
    table = load_robot("delbot", group="arm").dh
    used = np.array([[0, 1, 2, 3, 4, 5], [0, 1, 2, 4, 5, 6]])

    def worst(q: np.ndarray) -> float:
        X = frames(table, q)
        right, printed = (np.cross(X[k, :3, 2], X[6, :3, 3] - X[k, :3, 3]) for k in used)
        return float(np.linalg.norm(printed - right, axis=1).max())

    home = worst(np.zeros(6))
    assert home == pytest.approx(table.rows[4].d + table.rows[5].d, abs=1e-12)
    rng = np.random.default_rng(1)
    assert max(worst(q) for q in rng.uniform(-np.pi, np.pi, (2000, 6))) <= home + 1e-12  # nowhere by more
    return f"wrong by up to d5 + d6 = {home:.5f} m, already at home"


def delbot_mount() -> str:
    """The matrix labelled T_eff^0 does not hold the arm: at home the arm's own is another."""
    label, arm = np.array(entry("delbot.base_to_arm").value), load_robot("delbot", group="arm").dh
    assert np.abs(label - forward(arm, np.zeros(6))).max() > 0.4
    return "| T_eff^0 | T_0^b |"


def baxter_signs() -> str:
    J1 = entry("sclerp.J1")
    differing = [
        sum(a != b for a, b in zip(right, printed, strict=True))
        for right, printed in zip(J1["spatial"], J1.printed, strict=True)
    ]
    assert differing == [2, 2, 2]
    return "six signs of it, two a row"


def srra_theta5() -> str:
    r33 = entry("srra.ik.R47")[2][2]
    assert f"{r33:.5f}" in PAGE
    return f"or {np.arctan(np.sqrt(1.0 - r33**2) / r33):+.4f} with the right r33"


def srra_theta3_star() -> str:
    """From the inputs as printed, and with the misprint of r."""
    printed, a3 = entry("srra.ik.intermediates").printed, entry("srra.params")["a3"]
    x, y, z = printed["wrist_centre"]
    angles = [
        np.arccos((r**2 + z**2 - a3**2 - printed["a4"] ** 2) / (2.0 * a3 * printed["a4"]))
        for r in (printed["r"], np.hypot(x - 1e-4, y))
    ]
    assert np.abs(np.subtract(angles, printed["theta3_star"])).min() > 1e-4  # neither is what is printed
    return "the printed inputs give {:.5f}, and {:.5f} with 730.25 in r".format(*angles)


def srra_h2() -> str:
    steps, a3 = entry("srra.ik.intermediates"), entry("srra.params")["a3"]
    along = a3 + entry("srra.params")["a4"] * steps["cos_theta3_star"]
    across = entry("srra.params")["a4"] * np.sin(steps["theta3_star"])
    assert np.arctan2(across, along) == pytest.approx(steps["h2"], abs=1e-9)
    assert abs(steps.printed["h2"] - steps["h2"]) < 1e-3  # of the right order, though rounded
    return f"swapped, it gives {np.arctan2(along, across):.5f}"


def srra_r() -> str:
    steps = entry("srra.ik.intermediates")
    x, y, _ = np.array(steps.printed["wrist_centre"]) * 1000.0
    assert (f"{x:.2f}", np.hypot(x, y)) == ("730.35", pytest.approx(steps.printed["r"] * 1000.0, abs=0.015))
    return f"with 730.25 the wrist is at {np.hypot(730.25, y):.2f} mm"


def srra_euler_matrix() -> str:
    a, b, c = np.random.default_rng(2).uniform(-np.pi, np.pi, 3)
    R = rot("z", a) @ rot("y", b) @ rot("z", c)
    assert R[0, 2] == pytest.approx(np.cos(a) * np.sin(b), abs=1e-15)
    assert R[1, 0] == pytest.approx(np.sin(a) * np.cos(b) * np.cos(c) + np.cos(a) * np.sin(c), abs=1e-15)
    return "r13 = CΦSΘ, r21 = SΦCΘCΨ + CΦSΨ"


def lecture_cubic() -> str:
    """With the printed a3 the end is missed by -2 (v0 + v1) T: not at all if v0 = -v1, whatever both are."""
    q0, qf, v0, T = 0.3, 1.1, 0.7, 2.0
    for v1, hits in ((-v0, True), (0.2, False)):
        a2 = (3.0 * (qf - q0) - (2.0 * v0 + v1) * T) / T**2
        a3 = (2.0 * (q0 - qf) - (v0 + v1) * T) / T**3
        assert (abs(np.polyval([a3, a2, v0, q0], T) - qf) < 1e-12) == hits
    return "so it holds for v0 = −v1 only"


FIGURES = (
    delbot_jacobian,
    delbot_mount,
    baxter_signs,
    srra_theta5,
    srra_theta3_star,
    srra_h2,
    srra_r,
    srra_euler_matrix,
    lecture_cubic,
)


@pytest.mark.parametrize("figure", FIGURES)
def test_the_page_has_the_figure_as_computed(figure: Callable[[], str]):
    assert figure() in PAGE


@pytest.mark.parametrize(
    ("robot", "floor", "words"),
    [
        ("ur5", None, "UR5 {:.1f} %"),
        ("puma560", None, "PUMA 560 {:.1f} %"),
        ("srra", -1.5, "| SRRA, at the height of the published floor plate | −1.5 | {:.1f} % |"),
        ("srra", -2.0, "| SRRA, where the base of `robots/srra` ends | −2.0 | {:.1f} % |"),
        ("puma560", 0.0, "| PUMA 560, at its foot | 0 | {:.1f} % |"),
        ("ur5", 0.0, "| UR5, at its foot | 0 | {:.1f} % |"),
    ],
)
def test_the_page_has_the_workspace_that_the_command_prints(robot, floor, words):
    """With 20,000 samples, as the page says, and in this process: others would take longer to begin than to sample."""
    found = study(robot, 20_000)
    assert words.format(100.0 * (found.rings if floor is None else above(found, floor)).lower) in PAGE


@pytest.mark.parametrize(("robot", "floor"), [("srra", -1.5), ("puma560", 0.0), ("ur5", 0.0)])
def test_above_a_floor_is_what_is_free_without_it_and_does_not_touch_it(robot, floor):
    """So the page is held against one study a robot."""
    found = study_workspace(robot_with_meshes(robot), WorkspaceOptions(samples=500, floor=floor), processes=1)
    expected = above(study(robot, 500), floor)
    assert found.free_fraction < study(robot, 500).free_fraction
    assert found.rings == expected


@cache
def study(robot: str, samples: int) -> Workspace:
    return study_workspace(robot_with_meshes(robot), WorkspaceOptions(samples=samples), processes=1)


def above(found: Workspace, height: float) -> Coverage:
    """Coverage of the rings by those configurations of a study in which no moving link touches a floor at a height."""
    robot, samples = found.robot, found.samples
    floor = Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), height), pin.SE3.Identity())
    bodies = {robot.link_of(k): body.parentJoint for k, body in enumerate(robot.geometry.geometryObjects)}
    standing = {frozenset({"floor", link}) for link, joint in bodies.items() if joint == 0}
    own = {frozenset(pair) for pair in combinations(bodies, 2)}
    model = CollisionModel(robot, Scene((floor,), allowed=frozenset(standing | own)))
    free = samples.free.copy()
    free[free] = [not model.collides(q) for q in samples.q[free]]
    return ring_coverage(found.reach, samples.position[free], found.reach.largest / RINGS)


def test_the_base_of_the_srra_ends_where_the_page_says():
    robot = load_robot("srra")
    base = [
        body for body in robot.geometry.geometryObjects if body.parentJoint == 0 and hasattr(body.geometry, "halfSide")
    ]
    assert min(body.placement.translation[2] - body.geometry.halfSide[2] for body in base) == pytest.approx(-2.0)
