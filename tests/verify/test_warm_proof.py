"""The proof in the core beside the verifier: what it proves, the verifier accepts; little else is refused."""

import numpy as np
import pytest

import optiplan as op
from optiplan._core import core
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.problem.goals_and_vias import JointGoal
from optiplan.problem.problem import derived
from optiplan.verify.warm_proof import Polynomials, WarmProof
from tests.checks import named
from tests.verify.bodies_around import among_bodies

ROBOTS = ("panda", "ur5", "srra", "baxter_left")


def motion(problem, rng, size=1.0):
    """A motion from rest to rest through random set-points, and its state at the start."""
    n, limits = problem.robot.n, problem.limits
    state = np.array([problem.start, np.zeros(n), np.zeros(n)])
    low, high = np.maximum(limits.lower, problem.start - size), np.minimum(limits.upper, problem.start + size)
    Q = rng.uniform(low, high, (3, n))
    rows = np.array([limits.lower, limits.upper, *limits.rates])
    return Polynomials(*core.chunk_curve(state, Q, core.chunk_times(state, Q, rows), True, rows)), state


def verified(problem, found, state):
    trajectory = op.Trajectory(problem.robot.joint_names, *found)
    same = derived(problem, start=state[0], goal=(JointGoal(trajectory.end),))
    return op.verify(same, trajectory)


@pytest.mark.parametrize("name", ROBOTS)
def test_it_agrees_with_the_verifier(name):
    problem = among_bodies(name, 12, 3)
    proof, rng = WarmProof(problem), np.random.default_rng(1)
    verdicts = []
    for k in range(24):
        found, state = motion(problem, rng, (0.1, 0.3, 1.0)[k % 3])
        ours, theirs = proof.prove(found, state), verified(problem, found, state)
        assert theirs.verified or not ours.proved, (ours, theirs)
        verdicts.append((ours.proved, theirs.verified))
        if ours.proved:
            near = named(theirs, "collision").witness["met_clearance"]
            assert near is None or min(ours.clearance) <= near + 1e-9
    assert sum(a for a, _ in verdicts) >= 3
    assert sum(not a for a, _ in verdicts) >= 3
    assert sum(b and not a for a, b in verdicts) <= 1


@pytest.mark.parametrize("depth", [1e-3, 1e-5, 3e-6, -3e-6, -1e-5, -1e-3])
def test_grazing_motions(depth):
    """An obstacle is pushed along the nearest normal until the motion misses it by `depth`, m; below 0 it touches."""
    problem = among_bodies("panda", 6, 5)
    rng, judged = np.random.default_rng(2), 0
    rows = np.array([problem.limits.lower, problem.limits.upper, *problem.limits.rates])
    state = np.array([problem.start, np.zeros(7), np.zeros(7)])
    while judged < 2:
        Q = problem.start + rng.uniform(-0.3, 0.3, (2, 7))
        found = Polynomials(*core.chunk_curve(state, Q, core.chunk_times(state, Q, rows), True, rows))
        trajectory = op.Trajectory(problem.robot.joint_names, *found)
        if not WarmProof(problem).prove(found, state).proved:
            continue
        moved = grazing(problem, trajectory, depth)
        if moved is None:
            continue
        judged += 1
        ours, theirs = WarmProof(moved).prove(found, state), verified(moved, found, state)
        assert theirs.verified == (depth > 0.0), theirs
        assert ours.proved == (depth > 0.0), ours


def grazing(problem, trajectory, depth):
    """The problem with the nearest obstacle moved until the motion misses it by `depth`; None where there is none."""
    times, scene = np.linspace(0.0, trajectory.duration, 400), problem.scene
    for _ in range(12):
        model = NativeCollisionModel(problem.robot, scene)
        first = len(model.names) - len(scene.obstacles)
        near = model.near(trajectory(times), 0.25)
        of_scene = np.flatnonzero([model.pairs[k].b >= first for k in near.pairs])
        if not len(of_scene):
            return None
        k = of_scene[np.argmin(near.distance[of_scene])]
        missing = depth - near.distance[k]
        if abs(missing) < 3e-7:
            return derived(problem, scene=scene)
        scene = scene.moved(model.pairs[near.pairs[k]].name_b, *(missing * near.normals[k]))
        around = times[near.rows[k]] + np.linspace(-0.01, 0.01, 41)
        times = np.unique(np.clip(np.append(times, around), 0.0, trajectory.duration))
    return None


@pytest.mark.parametrize("floor", [(0.0, 0.0, 1.0), (0.0, 0.6, 0.8)])
def test_what_is_held_by_a_link_at_rest_is_as_far_from_the_floor_as_it_is(floor):
    """Neither of both bodies moves: nothing but the distance is proved of them, 3 mm."""
    crate = op.Box("crate", size=(0.1, 0.1, 0.1), position=(0.0, 0.0, -0.747))
    below = -0.747 * floor[2] - 0.05 * sum(floor) - 0.003
    scene = op.Scene([op.HalfSpace("floor", normal=floor, offset=below)], attached=[crate.attached_to("panda_link0")])
    problem = op.Problem("panda", "ready", "ready", scene=scene)
    found, state = motion(problem, np.random.default_rng(1), 0.1)
    ours = WarmProof(problem).prove(found, state)
    assert ours.proved, ours
    assert 0.002 < ours.clearance[1] <= 0.003 + 1e-9


def test_a_body_inside_a_mesh_is_not_apart(tmp_path):
    import trimesh

    shell = trimesh.creation.icosphere(subdivisions=2, radius=0.6)
    shell.vertices[:, 2] *= 1.2
    file = tmp_path / "shell.stl"
    shell.export(file)
    problem = op.Problem("planar2r", [0.1, 0.2], [0.1, 0.2])
    inside = derived(problem, scene=op.Scene([op.Mesh("shell", file=file, convex=False, position=(0.5, 0.0, 0.0))]))
    found, state = motion(problem, np.random.default_rng(1), 0.2)
    assert WarmProof(problem).prove(found, state).proved
    verdict, theirs = WarmProof(inside).prove(found, state), verified(inside, found, state)
    assert not theirs.verified
    assert not verdict.proved, verdict


@pytest.mark.parametrize("breakpoints", [[0.0], [0.0, 0.0], [0.0, -1.0], [0.0, np.nan]])
def test_a_curve_needs_pieces_that_last(breakpoints):
    problem = op.Problem("planar2r", [0.1, 0.2], [0.1, 0.2])
    proof, b, c = WarmProof(problem)._core, np.array(breakpoints), np.zeros((len(breakpoints) - 1, 1, 2))
    for prove in (lambda: proof.limits(b, c, np.zeros((3, 2))), lambda: proof.apart(b, c, 0.0)):
        with pytest.raises(ValueError, match="breakpoints"):
            prove()


@pytest.mark.parametrize("spoil", ["start", "step", "end", "jerk", "nan"])
def test_a_motion_that_is_none_is_refused(spoil):
    problem = among_bodies("panda", 4, 1)
    proof = WarmProof(problem)
    found, state = motion(problem, np.random.default_rng(3), 0.1)
    while not proof.prove(found, state).proved:
        found, state = motion(problem, np.random.default_rng(4), 0.1)
    c = found.coefficients.copy()
    match spoil:
        case "start":
            state = state + 1e-6
        case "step":
            c[2, 0, 1] += 1e-6
        case "end":
            c[-1, 3, 0] += 1e-3 / (found.breakpoints[-1] - found.breakpoints[-2]) ** 2
        case "jerk":
            c[1, 3, 0] = 2e3
        case "nan":
            c[1, 1, 3] = np.nan
    verdict = proof.prove(Polynomials(found.breakpoints, c), state)
    assert not verdict.proved
    assert verdict.reason
