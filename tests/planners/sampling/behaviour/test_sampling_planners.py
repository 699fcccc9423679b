"""The sampling planners: proved, repeatable, interruptible; better with more effort; a roadmap that is found again."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from optiplan._core import core
from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.geometry.safety import Safety
from optiplan.geometry.scene import Scene
from optiplan.planners.base import Budget
from optiplan.planners.common.continuous_collision import first_contact
from optiplan.planners.registry import make_planner
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_search import search
from optiplan.planners.sampling.ompl_space import SearchSpace, search_bounds
from optiplan.planners.sampling.prm import Prm, PrmOptions, world_key
from optiplan.planners.sampling.roadmap import Roadmap
from optiplan.planners.sampling.sample_path import SamplingOptions, path_check, sample_path
from optiplan.planners.sampling.search import SearchOptions
from optiplan.planners.sampling.shortcutting import path_time, path_times
from optiplan.planners.sampling.smoothing import smooth_path, spline_along
from optiplan.problem.load import load_problem
from optiplan.problem.problem import derived
from optiplan.runs.pipeline import run
from tests.planners import cases
from tests.planners.polyline import polyline_contact

pytestmark = pytest.mark.usefixtures("processor_clock")

QUICK = {
    "rrtconnect": {},
    "rrtstar": {"iterations": 120},
    "informed_rrtstar": {"iterations": 120},
    "bitstar": {"batches": 2},
    "kpiece": {},
    "prm": {"vertices": 60},
}
SEARCHES = {
    "rrtconnect": SearchOptions("rrtconnect"),
    "rrtstar": SearchOptions("rrtstar", 0.8, 120),
    "informed_rrtstar": SearchOptions("informed_rrtstar", 0.8, 120),
    "bitstar": SearchOptions("bitstar", effort=2),
    "kpiece": SearchOptions("kpiece"),
}


def quiet(stage, fraction):
    pass


def plan(planner, problem, budget=None):
    return planner.plan(problem, budget or Budget(30.0), quiet)


def bar():
    """The planar arm has to fold its elbow to pass over a bar."""
    goal = cases.JointGoal(np.array([3.0, 0.2]))
    return cases.problem("planar2r", [0.0, 0.3], [goal], cases.box("bar", (0.1, 0.6, 2.0), (0.0, 0.15, -1.2)))


def checked(problem):
    model = CollisionModel(problem.robot, problem.scene)
    return model, MotionCheck(model, problem.limits)


@pytest.mark.parametrize("name", sorted(QUICK))
def test_answers_are_verified_and_repeatable(name):
    problem = bar()
    first, again = (run(problem, name, QUICK[name], Budget(30.0), quiet) for _ in range(2))
    assert first.verified
    assert not first.info["cut_short"]
    assert first.info["states"] > 0
    assert np.array_equal(first.trajectory.coefficients, again.trajectory.coefficients)
    other = plan(make_planner(name, QUICK[name]), derived(problem, seed=1)).trajectory
    assert not np.array_equal(first.trajectory.coefficients, other.coefficients)


@pytest.mark.parametrize("kind", sorted(SEARCHES))
def test_searches_end_exactly_and_their_motions_are_free(kind):
    problem = cases.wall()
    model, check = checked(problem)
    goals = np.array([cases.LEFT, cases.LEFT + 0.05])
    found = search(check, (problem.start, goals), Budget(30.0), 3, SEARCHES[kind])
    assert np.array_equal(found.path[0], problem.start)
    assert any(np.array_equal(found.path[-1], goal) for goal in goals)
    assert polyline_contact(model, found.path) is None


@pytest.mark.parametrize("kind", ["rrtstar", "informed_rrtstar", "bitstar"])
def test_more_effort_gives_a_shorter_path(kind):
    problem = bar()
    _, check = checked(problem)
    ends = (problem.start, problem.goal[0].q[None])
    few, many = (2, 8) if kind == "bitstar" else (50, 300)
    costs = [
        path_time(search(check, ends, Budget(60.0), 2, how).path, problem.limits.velocity)
        for how in (SearchOptions(kind, 0.8, few), SearchOptions(kind, 0.8, many))
    ]
    assert costs[1].sum() < costs[0].sum()


@pytest.mark.parametrize("kind", ["rrtstar", "informed_rrtstar", "bitstar"])
def test_anytime_planners_improve_on_the_first_path(kind, problems):
    """Among them `rrtstar` on the SRRA, whose wide joints leave a uniform sample little chance to help."""
    problem = load_problem(problems / "15_srra.yaml")
    _, check = checked(problem)
    improving = partial(search, options=SEARCHES[kind])
    goals = [problem.goal[0].q]
    first, last = (
        sample_path(check, problem.start, goals, SamplingOptions(Budget(60.0), attempts=30, improve=how))
        for how in (None, improving)
    )
    assert last.cost < 0.97 * first.cost
    assert last.info["states"] > first.info["states"]
    assert not last.info["cut_short"]


def test_a_round_that_the_clock_ended_is_told_of():
    """Though later rounds have time enough to end by themselves: in a second run the first may have it, too."""
    problem, rounds = bar(), []

    def improving(*arguments, patience):
        rounds.append(search(*arguments, SEARCHES["bitstar"], patience=patience))
        return replace(rounds[-1], cut_short=len(rounds) == 1)

    _, check = checked(problem)
    path = sample_path(check, problem.start, [problem.goal[0].q], SamplingOptions(Budget(60.0), improve=improving))
    assert len(rounds) > 1
    assert path.info["cut_short"]


def test_most_of_the_budget_goes_to_improving_and_the_answer_says_so():
    for _ in range(3):
        result = plan(make_planner("rrtstar", {"iterations": 10**9}), bar(), Budget(0.5))
        assert result.trajectory is not None
        # Three rounds in a row that gain nothing end it too, which together are most of the budget.
        if result.info["cut_short"] or sum(result.timings.values()) > 0.15:
            break
    else:
        pytest.fail("it ended before its time")


def test_informed_samples_pass_where_a_shorter_path_can():
    problem = bar()
    _, check = checked(problem)
    ends = (problem.start, problem.goal[0].q[None])
    velocity = problem.limits.velocity
    plain, informed = (
        search(check, ends, Budget(60.0), 2, SearchOptions(kind, 0.8, 300)) for kind in ("rrtstar", "informed_rrtstar")
    )
    length = np.linalg.norm(np.diff(informed.path / velocity, axis=0), axis=1).sum()

    def inside(tree):  # share of the states at which the shortest detour is no longer than the path, nearly
        detours = sum(np.linalg.norm((tree - end) / velocity, axis=1) for end in (ends[0], ends[1][0]))
        return (detours <= 1.1 * length).mean()

    assert inside(plain.start_tree) < 0.6
    assert inside(informed.start_tree) > 0.9


def test_objective_is_path_time_and_cells_are_tool_positions():
    problem = cases.wall()
    _, check = checked(problem)
    space = SearchSpace(check, (problem.start, cases.LEFT[None]))
    a, b = space.information.allocState(), space.information.allocState()
    for state, q in ((a, cases.READY), (b, cases.LEFT)):
        for j, x in enumerate(q / problem.limits.velocity):
            state[j] = float(x)
    cost = path_times(cases.READY[None], cases.LEFT[None], problem.limits.velocity)[0]
    dx = np.abs(cases.LEFT - cases.READY) / problem.limits.velocity
    assert cost == pytest.approx(dx.max() + 0.1 * np.linalg.norm(dx))
    assert space.path_time().motionCost(a, b).value() == pytest.approx(cost)
    position = np.zeros(3)
    space.tool_cells().project(b, position)
    assert position == pytest.approx(cases.tool_pose("panda", cases.LEFT).translation)
    space.close()


def test_second_query_asks_less_and_finds_the_roadmap_again(monkeypatch):
    problem, planner, asked = cases.wall(), Prm(PrmOptions(vertices=800)), []
    free = MotionCheck.free
    monkeypatch.setattr(MotionCheck, "free", lambda self, a, b: asked.append(1) or free(self, a, b))

    def ask(start, goal):
        asked.clear()
        check = checked(problem)[1]
        found = planner.search(check, (start, goal[None]), Budget(30.0), 1)
        motions = len(asked)
        assert polyline_contact(check.model, found.path) is None
        return found.path, motions

    path, first = ask(cases.READY, cases.LEFT)
    (roadmap,) = planner.roadmaps.values()
    vertices, tried = roadmap.vertices.copy(), dict(roadmap.tried)
    again, second = ask(cases.READY, cases.LEFT)
    assert np.array_equal(again, path)
    assert roadmap.tried == tried, "no motion between vertices is proved twice"
    assert second < 0.5 * first
    _, third = ask(cases.LEFT, cases.READY + 0.02)
    assert third < first
    assert np.array_equal(roadmap.vertices[: len(vertices)], vertices)
    assert list(planner.roadmaps.values()) == [roadmap]


def test_roadmaps_belong_to_their_scene_and_few_are_kept():
    planner = Prm(PrmOptions(vertices=20, attempts=0))
    for k in range(5):
        problem = bar()
        plan(
            planner, derived(problem, scene=Scene((*problem.scene.obstacles, cases.box("far", (0.1,) * 3, (9, k, 0)))))
        )
    assert len(planner.roadmaps) == 4
    keys = {world_key(CollisionModel(p.robot, p.scene)) for p in (cases.wall(), cases.free(), cases.planar())}
    assert len(keys) == 3


@pytest.mark.skipif(core is None, reason="the native core was not built")
def test_another_clearance_or_tracking_error_is_another_roadmap():
    problem, keys = cases.wall(), []
    for safety in (None, Safety(0.01), Safety(0.02), Safety(0.2).ending_at([cases.READY])):
        for error in (None, 0.01, 0.02):
            scene, tube = replace(problem.scene, safety=safety), error and np.full(problem.robot.n, error)
            keys += [world_key(kept_planning_model(problem.robot, scene, tube)) for _ in range(2)]
    assert len(set(keys)) == len(keys) // 2 == 12


@pytest.mark.parametrize("name", ["lower", "upper", "velocity", "torque"])
def test_other_limits_are_another_roadmap(name):
    planner, problem = Prm(PrmOptions(vertices=20, attempts=0)), bar()
    for share in (1.0, 1.0, 0.99):
        changed = replace(problem.limits, **{name: share * getattr(problem.limits, name)})
        plan(planner, derived(problem, limits=changed))
    assert len(planner.roadmaps) == 2


def test_a_roadmap_stops_growing():
    planner = Prm(PrmOptions(vertices=50, most_vertices=120))
    result = plan(planner, cases.barred())
    (roadmap,) = planner.roadmaps.values()
    assert result.failure.kind == "no-path"
    assert len(roadmap.vertices) <= 122


def test_roadmap_finds_the_shortest_way_through_its_vertices():
    """Without obstacles nothing is ruled out: the path is the cheapest of the graph, here the direct edge."""
    problem = cases.planar()
    _, check = checked(problem)
    ends = (problem.start, problem.goal[0].q[None])
    roadmap = Roadmap(search_bounds(problem.limits, ends), problem.limits.velocity, 0)
    roadmap.grow(check, 5, ends, Budget(10.0))
    found = roadmap.query(check, ends, Budget(10.0))
    direct = path_time(np.vstack(ends), problem.limits.velocity).sum()
    assert path_time(found.path, problem.limits.velocity).sum() == pytest.approx(direct)


@pytest.mark.parametrize("smoothing", ["corners", "bspline"])
def test_smoothed_answers_are_verified(smoothing):
    answer = run(cases.wall(), "rrtconnect", {"smoothing": smoothing}, Budget(30.0), quiet)
    assert answer.verified
    assert answer.info["smooth"] == (smoothing == "bspline")


def test_smooth_path_is_free_keeps_its_ends_and_straight_lines():
    problem = cases.wall()
    model = CollisionModel(problem.robot, problem.scene)
    velocity = problem.limits.velocity
    path = sample_path(
        path_check(model, problem.limits), problem.start, [cases.LEFT], SamplingOptions(Budget(30.0), seed=1)
    )
    curve = smooth_path(model, path.waypoints, velocity, Budget(30.0))
    assert curve.start == pytest.approx(path.waypoints[0], abs=1e-12)
    assert curve.end == pytest.approx(path.waypoints[-1], abs=1e-12)
    assert first_contact(model, curve) is None
    straight = np.array([cases.READY, 0.5 * (cases.READY + cases.LEFT), cases.LEFT])
    line = spline_along(problem.robot.joint_names, np.array([0.0, 0.5, 1.0]), straight, 8)
    s = np.linspace(0.0, 1.0, 50)
    assert line(s) == pytest.approx(cases.READY + s[:, None] * (cases.LEFT - cases.READY), abs=1e-12)


def test_blocked_curves_fall_back_to_corners():
    """No curve of few spans is free here, and with no time left none is tried."""
    problem = cases.wall()
    model = CollisionModel(problem.robot, problem.scene)
    through = np.array([cases.READY, cases.LEFT])
    assert smooth_path(model, through, problem.limits.velocity, Budget(30.0)) is None
    assert smooth_path(model, through, problem.limits.velocity, Budget(0.0)) is None


@pytest.mark.parametrize("options", [{"iterations": 0}, {"reach": -1.0}, {"attempts": -1}, {"smoothing": "sand"}])
def test_options_out_of_range_are_input_errors(options):
    with pytest.raises(InputError, match=next(iter(options))):
        make_planner("rrtstar", options)


def test_any_search_serves_as_the_first_path():
    problem = bar()
    model = CollisionModel(problem.robot, problem.scene)
    for kind, how in SEARCHES.items():
        options = SamplingOptions(Budget(30.0), searcher=partial(search, options=how))
        path = sample_path(path_check(model, problem.limits), problem.start, [problem.goal[0].q], options)
        assert polyline_contact(model, path.waypoints) is None, kind
