"""Where nothing is required 5 mm are wished: kept where that costs at most 2 %, and else the answer stays."""

import io
from dataclasses import dataclass

import numpy as np
import pytest
from rich.console import Console

import optiplan as op
from optiplan.cli.printing.report import show_run
from optiplan.geometry.safety import WISHED
from optiplan.planners.base import Budget
from optiplan.problem.problem import derived
from optiplan.runs.pipeline import plan_and_verify_once
from optiplan.runs.wished_clearance import LONGER, wished
from optiplan.trajectory.trajectory import Trajectory

BUDGET = 5.0

pytestmark = pytest.mark.usefixtures("processor_clock")


@pytest.fixture(scope="module")
def shelf() -> op.Problem:
    return op.load_problem("02_shelf")


@pytest.fixture(scope="module")
def shaving(shelf: op.Problem, processor_clock: None) -> op.Run:
    return op.plan(shelf.with_parts(clearance=0), budget=BUDGET)


@pytest.fixture(scope="module")
def clear(shelf: op.Problem, processor_clock: None) -> op.Run:
    return op.plan(shelf, budget=BUDGET)


def least(problem: op.Problem, motion: Trajectory) -> float:
    """The least of distances, m, at dense samples."""
    return float(np.min(problem.clearance(motion(np.linspace(0.0, motion.duration, 1000)))))


def words(run: op.Run) -> str:
    out = io.StringIO()
    show_run(Console(file=out, width=200), run)
    return out.getvalue()


@dataclass
class Stub(op.Planner):
    """Finds one motion, and another near it."""

    first: Trajectory | None = None
    other: Trajectory | None = None

    def plan(self, problem, budget, progress):
        return op.PlanResult(self.first)

    def near(self, problem, earlier, budget):
        assert earlier is self.first
        assert problem.safety.scene == problem.safety.own == WISHED
        return self.other


def test_a_wish_is_kept_and_proved_where_it_costs_little(shelf: op.Problem, shaving: op.Run, clear: op.Run) -> None:
    assert shelf.wished_clearance == WISHED
    assert least(shelf, shaving.trajectory) < WISHED <= least(shelf, clear.trajectory)
    assert clear.verified
    assert op.verify(shelf.with_parts(clearance=WISHED), clear).verified
    assert not op.verify(shelf.with_parts(clearance=WISHED), shaving).verified
    wish = clear.info["wish"]
    assert wish["kept"]
    assert wish["longer"] <= LONGER - 1.0
    assert clear.duration == pytest.approx((1.0 + wish["longer"]) * shaving.duration, rel=1e-9)
    assert clear.improvements[-1][1] == clear.duration
    assert [when for when, _ in clear.improvements] == sorted(when for when, _ in clear.improvements)
    assert "the wished clearance of 5 mm is kept, for " in words(clear)


def test_a_clearance_that_is_stated_wishes_nothing(shelf: op.Problem, shaving: op.Run) -> None:
    assert "wish" not in shaving.info
    assert "wished" not in words(shaving)
    for stated in (0, 0.003, {"scene": 0.0, "self": 0.0}):
        assert shelf.with_parts(clearance=stated).wished_clearance == 0.0
    again = op.Problem.of(vars(shelf.with_parts(clearance=0))).with_start(shelf.start)
    assert again.wished_clearance == 0.0


def test_a_motion_that_keeps_it_already_is_the_answer(shelf: op.Problem, clear: op.Run) -> None:
    run = op.plan(shelf, Stub(first=clear.trajectory), budget=BUDGET)
    assert run.trajectory is clear.trajectory
    assert run.info["wish"] == {"clearance": WISHED, "kept": True, "longer": 0.0}
    assert words(run).rstrip().splitlines()[-2].endswith("the wished clearance of 5 mm is kept")


def test_no_other_motion_takes_the_place_of_the_answer(shelf: op.Problem, shaving: op.Run, clear: op.Run) -> None:
    """Neither one that takes too long, nor one that comes near as well, nor one that ends elsewhere."""
    first, slow = shaving.trajectory, clear.trajectory.scaled(1.05 * clear.trajectory.duration)
    others = {
        "2 %": slow,
        "near": first.scaled(1.01 * first.duration),
        "none": None,
        "early": clear.trajectory.scaled(0.5),
    }
    for name, other in others.items():
        run = op.plan(shelf, Stub(first=first, other=other), budget=BUDGET)
        assert run.verified
        assert run.trajectory is first, name
        assert not run.info["wish"]["kept"]
        assert (run.info["wish"]["longer"] is None) == (other is not slow)
        assert "`clearance: 0.005` requires it" in words(run)


def test_a_motion_at_hand_is_no_way_round_the_wish(shelf: op.Problem, shaving: op.Run) -> None:
    run = op.plan(shelf, warm_start=shaving, budget=BUDGET)
    assert run.info["warm_start"] in ("kept", "beaten")
    assert run.info["wish"]["kept"]
    assert least(shelf, run.trajectory) >= WISHED


def test_a_planner_that_fails_at_the_wish_leaves_the_answer(shelf: op.Problem, shaving: op.Run) -> None:
    class Failing(Stub):
        def near(self, problem, earlier, budget):
            raise ArithmeticError("nothing near")

    run = op.plan(shelf, Failing(first=shaving.trajectory), budget=BUDGET)
    assert run.verified
    assert run.trajectory is shaving.trajectory
    assert run.info["fault"]["error"] == "ArithmeticError: nothing near"


def test_comparisons_do_not_wish(shelf: op.Problem) -> None:
    run = plan_and_verify_once(shelf, "trajopt", {}, Budget(1.0), lambda stage, share: None)
    assert run.verified
    assert "wish" not in run.info


@pytest.mark.parametrize("kind", ["task", "vias"])
def test_tasks_and_motions_past_vias_are_planned_anew(
    kind: str, shelf: op.Problem, clear: op.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    most = 1.1  # planned anew, a motion may be longer by luck
    monkeypatch.setattr("optiplan.runs.wished_clearance.LONGER", most)
    end = clear.trajectory.end
    if kind == "task":
        step = {"name": "over", "move": {"joints": end.tolist()}}
        problem = op.Problem("panda", start=shelf.start, scene=shelf.scene, task=[step])
    else:
        problem = shelf.with_parts(goal=op.JointGoal(end), vias=[clear.trajectory(0.1 * clear.duration)])
    shaves = op.plan(problem.with_parts(clearance=0), budget=BUDGET)
    told = []
    keeps = op.plan(problem, budget=BUDGET, progress=lambda stage, share: told.append(stage))
    assert least(problem, shaves.trajectory) < WISHED <= least(problem, keeps.trajectory)
    assert op.verify(problem.with_parts(clearance=WISHED), keeps).verified
    assert keeps.info["wish"]["kept"]
    assert keeps.duration <= most * shaves.duration
    assert any(stage.endswith("with the wished clearance") for stage in told)


def test_among_what_moves_an_answer_that_is_clear_keeps_the_wish() -> None:
    problem = op.load_problem("38_falling_ball")
    run = op.plan(problem, budget=BUDGET)
    assert run.info["wish"] == {"clearance": WISHED, "kept": True, "longer": 0.0}
    assert op.verify(problem.with_parts(clearance=WISHED), run).verified


def test_who_replans_does_not_wait_for_a_wish(shelf: op.Problem) -> None:
    run = op.Replanner(shelf).plan(budget=1.0)
    assert run.verified
    assert "wish" not in run.info


def test_the_wish_is_of_links_of_two_arms_that_are_proved_apart_as_well() -> None:
    """The tip of the left arm passes the base of the right one at 10 mm."""
    left = {"use": "planar2r", "base": op.Pose((1.18, 0.18, 0.0), rpy=(0.0, 0.0, np.pi))}
    robot = op.Robot.side_by_side({"left": left, "right": "planar2r"})
    assert robot.allowed["left/tip", "right/base"] == "proved"
    problem = op.Problem(robot, [-0.5, 0.0, -1.5, 0.0], [0.5, 0.0, -1.5, 0.0])
    motion = op.plan(problem.with_parts(clearance=0), "scurve").trajectory
    assert motion is not None
    for clearance in (0.005, 0.02):
        asking = derived(problem, wished_clearance=clearance)
        found = wished(asking, motion, 0.0, lambda problem, budget: None, Budget(BUDGET))
        assert found is not None
        assert found.kept == op.verify(problem.with_parts(clearance=clearance), motion).verified == (clearance < 0.01)
