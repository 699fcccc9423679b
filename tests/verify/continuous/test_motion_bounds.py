"""The lemmas under the certificate, each against random cases and, where there is one, another engine."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from optiplan.collision.model import CollisionModel
from optiplan.geometry.enclosure import winding_number
from optiplan.geometry.scene import Attachment, Box, Capsule, Cylinder, HalfSpace, Obstacle, Scene, Sphere
from optiplan.geometry.shapes import shape_of_body
from optiplan.verify.continuous.bodies import Bodies, support, support_vertices
from optiplan.verify.continuous.intervals import Intervals, boxes, step_sizes
from optiplan.verify.continuous.motion_bounds import Motion, MotionQuery
from optiplan.verify.continuous.separating_planes import PairDistances
from tests.verify.motions import smooth

seeds = st.integers(0, 2**31)
EVERY = (
    Obstacle("box", Box((0.2, 0.1, 0.3)), pin.SE3(np.eye(3), np.array([0.6, 0.3, 0.5]))),
    Obstacle("ball", Sphere(0.07), pin.SE3(np.eye(3), np.array([0.5, -0.4, 0.4]))),
    Obstacle("can", Cylinder(0.05, 0.3), pin.SE3(pin.exp3(np.array([0.5, 0.2, 0.0])), np.array([0.3, 0.5, 0.8]))),
    Obstacle("pill", Capsule(0.04, 0.2), pin.SE3(pin.exp3(np.array([1.0, 0.0, 0.3])), np.array([-0.4, 0.4, 0.6]))),
    Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), -0.02), pin.SE3.Identity()),
)
HELD = Attachment("held", Box((0.05, 0.05, 0.2)), "panda_hand", pin.SE3(np.eye(3), np.array([0, 0, 0.2])))


@pytest.fixture(scope="module")
def model(panda):
    return CollisionModel(panda, Scene(EVERY, (HELD,)))


def random_q(rng, robot):
    return rng.uniform(robot.limits.lower, robot.limits.upper)


@settings(max_examples=40)
@given(seeds)
def test_travel_bounds_every_change_of_distance(model, panda, seed):
    rng = np.random.default_rng(seed)
    Q, D = random_q(rng, panda), rng.uniform(0.0, 0.3, 7) * rng.integers(0, 2, 7)
    travel = model.travel(Q[None], D[None])[0]
    before = distances(model, Q)
    corner = np.where(rng.random(7) < 0.5, 1.0, -1.0)
    for share in (corner, rng.uniform(-1, 1, 7)):
        after = distances(model, Q + D * share)
        apart = (before > 0) & (after > 0)  # depths are not distances
        assert (np.abs(after - before) <= travel + 1e-4)[apart].all()  # coal errs by 1e-4 at times


def distances(model, q):
    model.place(q)
    return np.array([model.pair_distance(pair.index).distance for pair in model.pairs])


@settings(max_examples=30)
@given(seeds, st.floats(0.01, 0.2), st.sampled_from([0.0, 0.0, 1e-3, 0.03]))
def test_approach_bounds_the_gap_over_the_whole_interval(model, panda, seed, width, error):
    """Also with joints off the motion by an error, and by that alone in the middle."""
    rng = np.random.default_rng(seed)
    off = error * rng.integers(0, 2, 7)
    points = random_q(rng, panda) + np.cumsum(rng.normal(size=(3, 7)), axis=0) * 0.1
    trajectory = smooth(panda.joint_names, points, 3 * width)
    bodies = Bodies(model)
    b = boxes(trajectory, Intervals.whole(3), step_sizes(trajectory, 0.0) + off)
    pairs = np.arange(len(model.pairs))
    rows = np.zeros(len(pairs), dtype=np.intp)
    poses = bodies.kinematics.poses(b.q)
    placed = bodies.place(poses, rows, pairs)
    asked_of = PairDistances(model, bodies)
    found = asked_of.query(pairs, placed)
    motion, query = Motion(bodies), MotionQuery(rows, pairs, placed, *bodies.kinematics.axes(poses))
    travel = motion.travel(b, query)
    chosen = np.flatnonzero(rng.random(len(pairs)) < 0.7)
    near = motion.along_normals(b, query, travel, found.normals, chosen)
    low = found.bound - travel.total
    low[chosen] = np.maximum(low[chosen], near.linear - near.loss)
    middle = np.full(len(pairs), -np.inf)
    middle[chosen] = found.bound[chosen] - near.step
    for t in np.linspace(0.0, trajectory.breakpoints[1], 9):
        q = trajectory(np.array([t])) + off * np.sign(rng.uniform(-1, 1, 7))
        later = bodies.place(bodies.kinematics.poses(q), rows, pairs)
        exact = asked_of.query(pairs, later)
        apart = exact.measured > 0
        assert (exact.measured >= low - 1e-8)[apart].all()
        if t == 0.5 * trajectory.breakpoints[1]:
            assert (exact.measured >= middle - 1e-8)[apart].all()
        assert (low <= 1e-8)[~apart].all()  # bodies that touch are never bounded away from each other


@settings(max_examples=30)
@given(seeds, st.integers(0, 7), st.integers(0, 6))
def test_boxes_hold_the_motion(seed, degree, level):
    rng = np.random.default_rng(seed)
    trajectory = smooth(("a", "b"), rng.normal(size=(4, 2)), 2.0)
    c = rng.normal(size=(len(trajectory.coefficients), degree + 1, 2))
    trajectory = type(trajectory)(("a", "b"), trajectory.breakpoints, c)
    whole = Intervals.whole(len(c))
    items = whole.split(np.full(len(c), level))
    b = boxes(trajectory, items, np.zeros((len(c), 2)))
    width = items.widths(trajectory)
    start = trajectory.breakpoints[items.piece] + items.index * width
    assert np.isclose(width.sum(), trajectory.duration)
    for share in (1e-9, 0.3, 1 - 1e-9):
        t = start + share * width
        assert (np.abs(trajectory(t) - b.q) <= b.reach + 1e-12).all()
        assert (np.abs(trajectory(t, 1)) <= b.speed + 1e-9).all()
        assert (np.abs(trajectory(t, 2)) <= b.acceleration + 1e-8).all()


def test_grouping_keeps_every_item():
    rng = np.random.default_rng(0)
    items = Intervals(*rng.integers(0, 3, (4, 50)))
    ordered, unique, rows = items.grouped()
    key = lambda i: np.stack([i.piece, i.level, i.index])  # noqa: E731
    np.testing.assert_array_equal(key(unique)[:, rows], key(ordered))
    assert len(np.unique(key(unique), axis=1).T) == len(unique.piece)
    assert sorted(zip(*key(items), items.pair, strict=True)) == sorted(zip(*key(ordered), ordered.pair, strict=True))


@settings(max_examples=40)
@given(seeds)
def test_plane_bounds_meet_the_measured_distance(model, panda, seed):
    """Never above it by more than rounding; below it by no more than GJK leaves."""
    q = random_q(np.random.default_rng(seed), panda)[None]
    bodies = Bodies(model)
    pairs = np.arange(len(model.pairs))
    rows = np.zeros_like(pairs)
    placed = bodies.place(bodies.kinematics.poses(q), rows, pairs)
    found = PairDistances(model, bodies).query(pairs, placed)
    apart = found.measured > 1e-6
    assert not found.gjk_only.any()
    assert (found.bound <= found.measured + 1e-8)[apart].all()
    assert (found.bound >= found.measured - 1e-6)[apart].all()
    assert (found.bound <= 1e-6)[~apart].all()


def test_cylinders_almost_touching_get_a_tight_plane(planar):
    """Two links of a Baxter, 24 um apart, where coal's normals cost every third plane up to 0.4 mm."""
    poses = np.array(
        [
            [
                [0.99275661503, -0.11317011427, 0.04033396265, 0.11400639806],
                [0.07987718654, 0.87250160296, 0.48203795276, 0.58671886119],
                [-0.08974373726, -0.47532460284, 0.87522144829, 0.73990692380],
            ],
            [
                [0.07213696006, -0.99660291718, 0.03973517909, 0.07938536802],
                [0.87293332369, 0.08235669653, 0.48083758893, 0.44487693870],
                [-0.48247660191, 0.0, 0.87590885862, 0.61325980707],
            ],
        ]
    )
    X_WA, X_WB = (pin.SE3(pose[:, :3], pose[:, 3]) for pose in poses)
    data = planar.model.createData()
    pin.framesForwardKinematics(planar.model, data, np.zeros(2))
    X_WL = data.oMf[planar.model.getFrameId("tip")]
    held = Attachment("held", Cylinder(0.06, 0.088), "tip", X_WL.actInv(X_WA))
    model = CollisionModel(planar, Scene((Obstacle("other", Cylinder(0.06, 0.273), X_WB),), (held,)))
    bodies = Bodies(model)
    Q = np.linspace(-3e-6, 3e-6, 300)[:, None] * np.ones(2)
    rows = np.arange(len(Q))
    pairs = np.full(len(Q), next(p.index for p in model.pairs if {p.name_a, p.name_b} == {"held", "other"}))
    found = PairDistances(model, bodies).query(pairs, bodies.place(bodies.kinematics.poses(Q), rows, pairs))
    assert found.measured.min() > 1e-5
    assert (found.bound >= found.measured - 1e-6).all()


@settings(max_examples=15)
@given(seeds)
def test_a_positive_bound_is_confirmed_by_linear_programming(model, panda, seed):
    """Another engine: a plane between two polyhedra exists, or does not, by scipy's simplex."""
    q = random_q(np.random.default_rng(seed), panda)[None]
    bodies = Bodies(model)
    chosen = np.array([k for k, (a, b) in enumerate(bodies.pairs) if is_polyhedron(bodies, a, b)])
    rows = np.zeros_like(chosen)
    placed = bodies.place(bodies.kinematics.poses(q), rows, chosen)
    found = PairDistances(model, bodies).query(chosen, placed)
    model.place(q[0])
    nearest = np.argsort(np.abs(found.bound))[:12]
    for k in nearest:
        clouds = [corners(bodies, placed, k, side) for side in (0, 1)]
        assert separable(*clouds) is bool(found.bound[k] > 0)


def is_polyhedron(bodies, a, b):
    return all(isinstance(bodies.shapes[i], coal.Box | coal.ConvexBase) for i in (a, b))


def corners(bodies, placed, k, side):
    """Vertices in the world by pinocchio's pose of the body, not by the batch kinematics."""
    body = placed.bodies[k, side]
    shape = bodies.shapes[body]
    local = support_vertices(shape)
    if isinstance(shape, coal.Box):
        local = np.array(np.meshgrid(*[[-h, h] for h in shape.halfSide])).reshape(3, -1).T
    X = placed.poses[k, side]
    return local @ X[:3, :3].T + X[:3, 3]


def separable(a, b):
    """Whether some (w, c) has w . x <= c - 1 on a and w . y >= c + 1 on b."""
    rows = np.vstack([np.c_[a, -np.ones(len(a))], np.c_[-b, np.ones(len(b))]])
    return linprog(np.zeros(4), rows, -np.ones(len(rows)), bounds=(None, None), method="highs").status == 0


def test_batch_kinematics_places_bodies_where_pinocchio_does(model, panda):
    rng = np.random.default_rng(5)
    bodies = Bodies(model)
    pairs = np.arange(len(model.pairs))
    data, placed_by_pin = panda.model.createData(), pin.GeometryData(model.geometry)
    for _ in range(5):
        q = random_q(rng, panda)
        pin.updateGeometryPlacements(panda.model, data, model.geometry, placed_by_pin, q)
        placed = bodies.place(bodies.kinematics.poses(q[None]), np.zeros_like(pairs), pairs)
        for k, (a, b) in enumerate(bodies.pairs[: len(pairs)]):
            expected = [placed_by_pin.oMg[int(i)].homogeneous for i in (a, b)]
            np.testing.assert_allclose(placed.poses[k], expected, atol=1e-12)


@pytest.mark.parametrize(
    "shape", [coal.Box(0.2, 0.3, 0.4), coal.Sphere(0.2), coal.Capsule(0.1, 0.4), coal.Cylinder(0.1, 0.4)]
)
def test_support_functions_against_points_of_the_body(shape):
    """The largest n . x over random points of the solid comes near h(n) and never passes it."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-0.5, 0.5, (200_000, 3))
    x = x[inside(shape, x)]
    n = rng.normal(size=(20, 3))
    h = support(shape_of_body(shape), support_vertices(shape), n)
    largest = (x @ n.T).max(axis=0)
    assert (largest <= h + 1e-12).all()
    assert (largest >= h - 0.03 * np.linalg.norm(n, axis=1)).all()


def inside(shape, x):
    match shape:
        case coal.Box():
            return (np.abs(x) <= shape.halfSide).all(axis=1)
        case coal.Sphere():
            return np.linalg.norm(x, axis=1) <= shape.radius
        case coal.Capsule():
            z = np.clip(x[:, 2], -shape.halfLength, shape.halfLength)
            return np.linalg.norm(x - np.c_[0 * z, 0 * z, z], axis=1) <= shape.radius
        case coal.Cylinder():
            return (np.hypot(x[:, 0], x[:, 1]) <= shape.radius) & (np.abs(x[:, 2]) <= shape.halfLength)


def test_support_of_a_half_space_and_of_an_unknown_shape():
    plane = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.3)
    n = np.array([[0.0, 0.0, 1.0], [0.0, 1e-3, 1.0]])
    np.testing.assert_array_equal(support(shape_of_body(plane), support_vertices(plane), n), [0.3, np.inf])
    cone = coal.Cone(0.1, 0.2)
    assert np.isinf(support(shape_of_body(cone), support_vertices(cone), n)).all()


def test_winding_number_of_a_tetrahedron():
    p = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = p[np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])]
    assert winding_number(faces, np.array([0.1, 0.2, 0.1])) == pytest.approx(1.0)
    assert winding_number(faces, np.array([0.5, 0.5, 0.5])) == pytest.approx(0.0, abs=1e-12)


def test_only_named_reasons_leave_a_pair_out(model, panda):
    """Every pair of bodies is checked, or is excused by the robot's SRDF, by touch links, or because it cannot move."""
    geometry, names = model.geometry.geometryObjects, model.names
    checked = {frozenset((pair.a, pair.b)) for pair in model.pairs}
    links = len(panda.geometry.geometryObjects)
    moving = [int(body.parentJoint) != 0 for body in geometry]
    for a in range(len(geometry)):
        for b in range(a):
            if frozenset((a, b)) in checked or not (moving[a] or moving[b]):
                continue
            pair = frozenset((names[a], names[b]))
            same_joint = geometry[a].parentJoint == geometry[b].parentJoint
            touching = "held" in pair and pair & {"panda_hand", "held"} == pair
            excused = {frozenset(known) for known in panda.allowed}
            assert same_joint or touching or (a < links and b < links and pair in excused), pair


def test_pairs_allowed_by_the_problem(panda):
    allowed = frozenset({frozenset({"panda_link5", "box"})})
    names = lambda scene: {frozenset((p.name_a, p.name_b)) for p in CollisionModel(panda, scene).pairs}  # noqa: E731
    assert names(Scene(EVERY)) - names(Scene(EVERY, allowed=allowed)) == allowed
