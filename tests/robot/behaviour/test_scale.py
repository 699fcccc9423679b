"""What grows with the number of bodies and joints grows no faster than the pairs do: operations are counted."""

import cProfile
import pstats

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.scale import write_chain, write_obstacles
from optiplan.collision import geometry_model
from optiplan.collision.model import CollisionModel
from optiplan.problem.load import load_problem
from optiplan.robot.robot import load_robot


def calls(work):
    """Calls of functions, Python's and others, that `work` makes, after a first run that fills caches."""
    work()
    profile = cProfile.Profile()
    profile.runcall(work)
    return pstats.Stats(profile).total_calls


def test_work_grows_with_the_number_of_obstacles(tmp_path):
    load_robot("panda")
    counts = []
    for size in (400, 800):
        folder = tmp_path / str(size)
        folder.mkdir()
        path = write_obstacles(folder, size)
        problem = load_problem(path)
        counts.append(calls(lambda problem=problem: CollisionModel(problem.robot, problem.scene)))
    assert counts[1] < 2.2 * counts[0]


def test_work_grows_with_the_pairs_of_a_chain(tmp_path):
    counts = []
    for size in (20, 40):
        folder = tmp_path / str(size)
        folder.mkdir()
        robot = str(write_chain(folder, size).with_name("chain_robot.yaml"))
        counts.append(calls(lambda robot=robot: load_robot(robot)))
    assert counts[1] < 4.5 * counts[0]


@pytest.mark.parametrize("count", [geometry_model.MANY - 1, geometry_model.MANY + 1])
def test_many_bodies_answer_like_few(count, tmp_path, monkeypatch):
    """The quick way to many bodies gives the model that adding them one by one gives."""
    problem = load_problem(write_obstacles(tmp_path, count))
    quick = CollisionModel(problem.robot, problem.scene)
    monkeypatch.setattr(geometry_model, "MANY", 10**9)
    slow = CollisionModel(problem.robot, problem.scene)
    assert [body.name for body in quick.geometry.geometryObjects] == [b.name for b in slow.geometry.geometryObjects]
    assert quick.geometry.collisionPairs.tolist() == slow.geometry.collisionPairs.tolist()
    np.testing.assert_array_equal(quick.geometry.collisionPairMapping, slow.geometry.collisionPairMapping)
    rng = np.random.default_rng(1)
    limits = problem.robot.limits
    for q in rng.uniform(limits.lower, limits.upper, (20, problem.robot.n)):
        assert quick.collides(q) == slow.collides(q)
        assert quick.clearance(q).distance == slow.clearance(q).distance


def test_other_archives_are_no_hindrance(monkeypatch):
    """Where pinocchio writes models in another form, bodies are added one by one."""
    monkeypatch.setattr(geometry_model, "_counting", lambda count: None)
    bodies = [pin.GeometryObject(f"b{k}", 0, pin.SE3.Identity(), pin.hppfcl.Sphere(1.0)) for k in range(301)]
    assert geometry_model.geometry_of(bodies).ngeoms == 301
