"""The URDF published with the SRRA report: a slightly different arm, read from the optional test data."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.kinematics.ik.closed_form import closed_form
from optiplan.robot.batched.kinematics import BatchKinematics
from optiplan.robot.dh.table import DhTable, forward
from optiplan.robot.robot import Robot, load_robot
from optiplan.workspace.reach import Reach
from optiplan.workspace.voxels import ring_coverage
from tests.reference.entries import entry
from tests.reference.poses import pose, tool_pose, turn

LINKS = ["base_link", *(f"link_{i}" for i in range(1, 7))]


@pytest.fixture(scope="module")
def srdf(shared) -> Path:
    return shared / "robots" / "srra_report" / "config" / "robot_2.srdf"


@pytest.fixture(scope="module")
def published(shared, srdf, tmp_path_factory) -> Robot:
    folder = shared / "robots" / "srra_report"
    file = tmp_path_factory.mktemp("srra") / "robot.yaml"
    keys = {"version": 1, "name": "srra_report", "urdf": folder / "urdf" / "robot_2.urdf", "srdf": srdf}
    text = "".join(f"{key}: {value}\n" for key, value in keys.items())
    file.write_text(f"{text}tool_frame: link_6\ncollision: mesh\n")
    return load_robot(str(file))


class Touch:
    """Which bodies of a robot touch: exact boolean queries on the meshes, all pairs of links."""

    def __init__(self, robot: Robot) -> None:
        self.model, self.geometry = robot.model, robot.geometry.copy()
        self.geometry.addAllCollisionPairs()
        bodies = [robot.link_of(i) for i in range(self.geometry.ngeoms)]
        self.names = ["-".join(sorted((bodies[p.first], bodies[p.second]))) for p in self.geometry.collisionPairs]
        self.data, self.placed = self.model.createData(), self.geometry.createData()

    def __call__(self, q: object) -> dict[str, bool]:
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.placed, np.asarray(q, dtype=float))
        hits = [pin.computeCollision(self.geometry, self.placed, k) for k in range(len(self.names))]
        return dict(zip(self.names, hits, strict=True))


@pytest.fixture(scope="module")
def touch(published) -> Touch:
    return Touch(published)


def test_srra_urdf_parameters(published):
    """The eight rows of the report's table with other dimensions, offsets of the joints and a base that is raised."""
    size, table = entry("srra.urdf.parameters"), load_robot("srra").dh
    changed = {0: {"a": size["a1"]}, 1: {"d": size["d2"]}, 2: {"a": size["a3"]}, 3: {"a": size["a_d"]}}
    changed |= {4: {"d": size["d4"]}, 7: {"d": size["d7_flange_joint"]}}
    other = DhTable("standard", tuple(replace(row, **changed.get(i, {})) for i, row in enumerate(table.rows)))
    X_WB = pose(np.eye(3), size["base_xyz"])
    for q in np.random.default_rng(2).uniform(-np.pi, np.pi, (40, 6)):
        expected = X_WB @ forward(other, np.multiply(size["signs"], q) + size["joint_offsets"])
        assert np.abs(tool_pose(published, q) - expected).max() <= size.tolerance
    reach = published.geometry.geometryObjects[-1].geometry
    assert np.abs(np.asarray(reach.vertices())).max() >= size["link6_length"] - 1e-5
    for key, value in size.printed.items():
        assert abs({"d7": size["d7_flange_joint"]}.get(key, size.value.get(key)) - value) > 9e-3


def test_srra_urdf_closed_form(published):
    solver, size = closed_form(published), entry("srra.urdf.closed_form")
    assert solver is not None
    Q = np.random.default_rng(3).uniform(-np.pi, np.pi, (1000, 6))
    X = np.array([tool_pose(published, q) for q in Q])
    found = solver.solve(X)
    assert (np.where(found.valid, turn(found.q, Q[:, None, :]), np.inf).min(axis=1) < 1e-6).all()
    assert 0.97 < (found.valid.sum(axis=1) == 8).mean() < 1.0  # 4929 of 5000: the shoulder offset leaves a void
    for k in range(0, 1000, 5):
        for q in found.q[k][found.valid[k]]:
            assert np.abs(tool_pose(published, q) - X[k]).max() <= size.tolerance


def test_srra_urdf_limits(published):
    expected, limits = entry("srra.urdf.limits"), published.limits
    assert expected["acceleration"] is None
    for j in range(6):
        expected.check([limits.lower[j], limits.upper[j]], "position")
        expected.check(limits.velocity[j], "velocity")
        expected.check(limits.torque[j], "effort")
    assert any("acceleration" in note for note in published.notes)  # the file has none: assumed, and said so


def test_srra_urdf_masses(published, shared):
    expected = entry("srra.urdf.masses")
    model = pin.buildModelFromUrdf(str(shared / "robots" / "srra_report" / "urdf" / "robot_2.urdf"))
    inertias = [model.inertias[i] for i in range(model.njoints)]
    for name, inertia in zip(LINKS, inertias, strict=True):
        expected.check(inertia.mass, name)
    gyration = [np.sqrt(np.linalg.eigvalsh(part.inertia) / part.mass) for part in inertias]
    assert gyration[2].max() > 3.5  # m, of a link of 1.05 m
    assert gyration[5].min() > 0.3  # m, of a link of 0.1 m


def test_srra_urdf_collision_rates(touch):
    expected, samples = entry("srra.urdf.collision_rates"), 5000
    count = dict.fromkeys(touch.names, 0)
    for q in np.random.default_rng(4).uniform(-np.pi, np.pi, (samples, 6)):
        for name, hit in touch(q).items():
            count[name] += hit
    assert set(count) == set(expected.value)
    for name, hits in count.items():
        expected.check(hits / samples, name)
    for a, b in pairwise(LINKS):
        assert count[f"{a}-{b}"] == samples


def edge(hit: object, free: float, blocked: float) -> float:
    """Between a free and a blocked joint value, where it changes, to 1e-6 rad."""
    while abs(free - blocked) > 1e-6:
        middle = 0.5 * (free + blocked)
        free, blocked = (free, middle) if hit(middle) else (middle, blocked)
    return 0.5 * (free + blocked)


def test_srra_urdf_joint2_full_turn(touch):
    expected = entry("srra.urdf.joint2_full_turn")

    def hit(angle: float, turned: float = 0.0) -> bool:
        return touch([turned, angle, 0.0, 0.0, 0.0, 0.0])["base_link-link_2"]

    scan = np.linspace(-np.pi, np.pi, 721)
    blocked = scan[[hit(angle) for angle in scan]]
    found = [edge(hit, blocked.min() - 0.01, blocked.min()), edge(hit, blocked.max() + 0.01, blocked.max())]
    expected.check(found, "colliding_joint_1_interval_at_joint_0_zero")
    assert np.degrees(found[1] - found[0]) == pytest.approx(11.2, abs=0.05)
    assert len(blocked) == pytest.approx((found[1] - found[0]) / (scan[1] - scan[0]), abs=1.0)  # one band
    assert not any(hit(angle, turned) for angle in scan for turned in (1.0, 2.0))
    assert np.mean([hit(angle, -2.5) for angle in scan]) == pytest.approx(0.055, abs=0.004)


def test_srra_urdf_joint4_clash(touch):
    expected = entry("srra.urdf.joint4_clash")

    def hit(angle: float) -> bool:
        return touch([0.0, 0.0, 0.0, 0.0, angle, 0.0])["link_4-link_6"]

    scan = np.linspace(-np.pi, np.pi, 361)
    blocked = [hit(angle) for angle in scan]
    expected.check([edge(hit, 0.0, -2.5), edge(hit, 0.0, 2.5)], "free_joint_4_interval")
    assert np.mean(blocked) == pytest.approx(entry("srra.urdf.collision_rates")["link_4-link_6"], abs=0.005)


def test_srra_urdf_workspace(published):
    """The claim of a full sphere holds for the kinematics; the published base and floor take some of it."""
    expected, size = entry("srra.urdf.workspace"), entry("srra.urdf.parameters")
    radius = size["a3"] + np.hypot(size["a_d"], size["d4"]) + size["d7_flange_joint"] + size["link6_length"]
    expected.check(radius, "sphere_radius")
    Q = np.random.default_rng(3).uniform(-np.pi, np.pi, (40_000, 6))
    flange = BatchKinematics(published.model).poses(Q)[:, -1]
    tips = flange[:, :3, 3] + size["link6_length"] * flange[:, :3, 2] - size["base_xyz"]
    bodies = CollisionModel(published, Scene())
    free = ~np.array([bodies.collides(q) for q in Q])
    expected.check(free.mean(), "free_fraction_of_random_configurations")
    ball = Reach(np.zeros(3), 0.0, radius)
    everywhere, held = (ring_coverage(ball, points, 0.1) for points in (tips, tips[free]))
    expected.check(everywhere[0], "coverage_no_collision")
    for share, key in zip(held, ("with_collision", "upper_half", "lower_half"), strict=True):
        expected.check(share, f"coverage_{key}")
    expected.check(tips[free, 2].min(), "lowest_tip_below_shoulder")


def test_srra_moveit_states(published, srdf):
    """Both states and the straight line between them are free: no planner may return a longer path."""
    expected = entry("srra.moveit.states")
    home, goal = (np.array(expected[key], dtype=float) for key in ("home", "goal"))
    for name, q in (("home", home), ("goal", goal)):
        expected.check(published.configurations[name], name)
        assert (published.limits.lower <= q).all()
        assert (q <= published.limits.upper).all()
    bodies = CollisionModel(published, Scene())
    assert not any(bodies.collides(home + s * (goal - home)) for s in np.linspace(0.0, 1.0, 2001))
