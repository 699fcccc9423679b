"""No check made is a failed check: what the verifier does not know is refused, whatever it is a part of."""

from dataclasses import dataclass, fields, make_dataclass, replace
from typing import ClassVar

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.geometry.obstacle_motion import ObstacleMotion
from optiplan.geometry.safety import SafePairs, Safety
from optiplan.geometry.scene import Attachment, Box, Obstacle, Scene, Sphere
from optiplan.problem.constraints.balance import TipOver
from optiplan.problem.constraints.base import WHOLE, Statement
from optiplan.problem.constraints.motions import PairClearance, ToolAcceleration, ToolSpeed
from optiplan.problem.constraints.points import OnPlane
from optiplan.problem.constraints.statements import KINDS
from optiplan.problem.goals_and_vias import AllOfGoal, JointGoal, PoseGoal, Via
from optiplan.problem.objectives.objective import Objective
from optiplan.problem.problem import Problem, derived
from optiplan.problem.regions.region import RegionGoal
from optiplan.problem.seams.actions import Passing, PathEvent, SeamPart, SeamPath, Transit
from optiplan.problem.seams.curve import SeamCurve
from optiplan.problem.task.rides import Mover, Ride, WaitUntil
from optiplan.problem.task.steps import (
    Attach,
    ChangeTool,
    Detach,
    Dwell,
    Move,
    Process,
    StraightLine,
    Target,
    TargetTour,
    TaskStep,
)
from optiplan.problem.tools.tool import MountedTool, ToolBody
from optiplan.robot.limits import Limits
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import constraint_check, limit_checks, statements, via_check
from optiplan.verify import verify as verifier
from optiplan.verify.constraint_check import _checks_of, _poses, path_constraints
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.tasks import tool_check
from optiplan.verify.tasks.task_check import _collision
from optiplan.verify.verify import verify
from tests.checks import failed
from tests.verify.motions import problem_of, quintic, within_limits


@dataclass(frozen=True, eq=False)
class Fresh(Statement):
    """A kind of constraint that nobody taught the verifier."""

    KEY: ClassVar[str] = "fresh_kind"
    frame: str
    during: tuple[float, float] = WHOLE

    @classmethod
    def of(cls, data, frame, during):
        return cls(frame, during)

    def to_data(self):
        return {}


_AROUND = np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])


@pytest.fixture
def swing(planar):
    return within_limits(quintic(planar.joint_names, [1.0, 0.0], [-1.0, 0.0], 1.0), planar.limits)


@pytest.fixture
def problem(planar, swing):
    return problem_of(planar, swing, Scene())


def task_of(problem, *steps):
    return derived(problem, goal=(), task=tuple(steps))


def in_time(motion, *steps):
    """The motion with a segment a step, each as long as the others; events take no time."""
    T, lasting = motion.duration, [not step.event for step in steps]
    ends = np.cumsum(lasting) / sum(lasting) * T
    begins = np.concatenate([[0.0], ends[:-1]])
    segments = [
        Segment(step.number, step.kind, step.name, float(a), float(b))
        for step, a, b in zip(steps, begins, ends, strict=True)
    ]
    return Trajectory(motion.joint_names, motion.breakpoints, motion.coefficients, tuple(segments))


def move(planar, goal, **keys):
    return TaskStep(1, "move", "move", Move(planar.joint_names, (JointGoal(np.array(goal)),)), **keys)


def test_a_verified_report_counts_its_statements(problem, swing):
    check = verify(problem, swing).checks[-1]
    assert (check.name, check.passed) == ("statements", True)
    assert check.detail == f"{len(list(statements.statements(problem)))} statements of the problem, each with a check"


@pytest.mark.parametrize("task", [None, op.Task().move([-1.0, 0.0])], ids=["goal", "task"])
def test_a_body_that_is_stated_and_not_in_the_scene_is_refused(task):
    """Whoever lost it: what a file states is counted by the file itself."""
    goal = {"goal": [-1.0, 0.0]} if task is None else {"task": task}
    stated = op.Problem("planar2r", [1.0, 0.0], scene=[op.Box("far", (0.1, 0.1, 0.1), position=(9, 9, 9))], **goal)
    run = op.plan(stated, "quintic")
    assert run.verified
    report = verify(Problem.of({**vars(stated), "scene": Scene()}), run.trajectory)
    assert failed(report) == ["statements"]
    assert "scene.far" in report.failures[0].detail


def test_two_bodies_of_one_name_are_refused(problem, swing):
    """What may touch, and what was checked, is said by names."""
    balls = tuple(Obstacle("ball", Sphere(0.1), pin.SE3(np.eye(3), np.full(3, x))) for x in (8.0, 9.0))
    report = verify(derived(problem, scene=Scene(balls)), swing)
    assert failed(report) == ["statements"]
    assert "scene.ball, of which there are 2" in report.failures[0].detail


def test_a_fresh_kind_of_constraint_is_refused(problem, swing):
    report = verify(derived(problem, path_constraints=(Fresh("tool"),)), swing)
    assert failed(report) == ["fresh kind constraint"]
    assert "nothing was checked of it" in report.failures[0].detail


def test_a_fresh_kind_is_refused_in_a_task_and_its_steps(planar, problem, swing):
    for step, whole in (
        (move(planar, [-1.0, 0.0]), (Fresh("tool"),)),
        (move(planar, [-1.0, 0.0], constraints=(Fresh("tool"),)), ()),
    ):
        task = derived(task_of(problem, step), path_constraints=whole)
        assert failed(verify(task, in_time(swing, step))) == ["fresh kind constraint"]


@pytest.mark.parametrize(
    "one",
    [
        PairClearance((), 0.1),
        ToolSpeed("tool"),
        ToolAcceleration("tool"),
        OnPlane("tool", np.array([0.0, 1.0, 0.0]), 0.0, 10.0, during=(0.7, 0.2)),
        ToolSpeed("tool", np.nan),
        TipOver(np.array([[-9.0, 0.0], [0.0, 0.0], [9.0, 0.0]])),
        TipOver(_AROUND, margin=np.nan),
        TipOver(_AROUND, margin=9.0),
        TipOver(_AROUND, height=np.nan),
        TipOver(_AROUND, during=(0.7, 0.2)),
    ],
)
def test_a_constraint_that_comes_to_nothing_is_refused(problem, swing, one):
    report = verify(derived(problem, path_constraints=(one,)), swing)
    assert not report.verified
    assert report.failures[0].name.endswith("constraint")


def test_every_kind_of_constraint_has_a_check():
    """Of poses by what they measure; `tests/verify/test_constraint_check.py` takes each."""
    for kind in KINDS.values():
        found = _checks_of(object.__new__(kind))
        assert found is not _poses or kind.__module__.endswith(("poses", "points"))


def test_constraints_hold_where_a_step_takes_no_time(planar, problem, swing):
    far = OnPlane("tool", np.array([1.0, 0.0, 0.0]), 50.0, 0.1)
    event = TaskStep(1, "dwell", "dwell", Dwell(0.0), constraints=(far,))
    step = replace(move(planar, [-1.0, 0.0]), number=2)
    motion = in_time(swing, step)
    T = swing.duration
    segments = (Segment(1, "dwell", "dwell", 0.0, 0.0), Segment(2, "move", "move", 0.0, T))
    motion = Trajectory(motion.joint_names, motion.breakpoints, motion.coefficients, segments)
    assert "plane constraint" in failed(verify(task_of(problem, event, step), motion))


@pytest.mark.parametrize("goal", [(), (object(),)])
def test_goals_that_are_unknown_or_missing_are_not_reached(problem, swing, goal):
    assert failed(verify(derived(problem, goal=goal), swing)) == ["goal"]


def test_a_region_without_bounds_and_tolerances_that_are_no_numbers_are_not_met(problem, planar, swing):
    X = pin.SE3.Identity()
    free = RegionGoal("tool", X, X, np.full(6, -np.inf), np.full(6, np.inf))
    assert failed(verify(derived(problem, goal=(free,)), swing)) == ["goal"]
    data = planar.model.createData()
    pin.framesForwardKinematics(planar.model, data, swing.end)
    X_WT = data.oMf[planar.frame_id("tool")].copy()
    for position, orientation in ((1e-3, np.nan), (np.nan, 1e-3)):
        assert "goal" in failed(verify(derived(problem, goal=(PoseGoal("tool", X_WT, position, orientation),)), swing))
        via = (Via(PoseGoal("tool", X_WT, position, orientation)),)
        assert "via" in failed(verify(derived(problem, vias=via), swing))


def test_an_unknown_via_is_not_passed(problem, swing):
    assert failed(verify(derived(problem, vias=(Via(object()),)), swing)) == ["via"]


def test_an_unknown_action_is_not_done(planar, problem, swing):
    @dataclass(frozen=True)
    class Weld:
        seconds: float

    first, second = move(planar, [-1.0, 0.0]), TaskStep(2, "weld", "weld", Weld(1.0))
    motion = in_time(swing, first, second)
    moved = Trajectory(
        motion.joint_names,
        np.append(motion.breakpoints, motion.duration + 1.0),
        np.concatenate([motion.coefficients, np.pad(swing.end[None, None], ((0, 0), (0, 5), (0, 0)))]),
        (
            replace(motion.segments[0], end=swing.duration),
            Segment(2, "weld", "weld", swing.duration, swing.duration + 1),
        ),
    )
    report = verify(task_of(problem, first, second), moved)
    assert failed(report) == ["statements"]
    assert "task[1].Weld" in report.failures[0].detail


def test_vias_and_goals_beside_a_task_are_not_passed_over(planar, problem, swing):
    step = move(planar, [-1.0, 0.0])
    task = task_of(problem, step)
    assert verify(task, in_time(swing, step)).verified
    beside = derived(task, goal=problem.goal, vias=(Via(JointGoal(np.zeros(2))),))
    report = verify(beside, in_time(swing, step))
    assert failed(report) == ["statements"]
    assert report.failures[0].detail.endswith("goal, vias[0]")


def test_a_mass_that_the_robot_does_not_carry_is_not_checked(planar, problem, swing):
    held = Attachment(
        "load", Sphere(0.01), "tip", pin.SE3(np.eye(3), np.array([0.0, 0, 0])), frozenset({"forearm", "tip"}), mass=0.1
    )
    report = verify(derived(problem, scene=Scene((), (held,))), swing)
    assert failed(report) == ["statements"]
    assert report.failures[0].detail == "no check was made of scene.load.mass"
    carried = op.Problem(planar, swing.start, swing.end, Scene((), (held,)))
    assert verify(carried, swing).verified


@pytest.mark.parametrize(
    ("module", "lost"),
    [
        (verifier, "collision"),
        (limit_checks, "loaded_torque"),
        (constraint_check, "path_constraints"),
        (via_check, "vias"),
        (tool_check, "tool_checks"),
    ],
)
def test_a_check_that_is_left_out_is_missed(planar, problem, swing, monkeypatch, module, lost):
    """Whatever part of the verifier returns a check of nothing, or none, the verdict is not `verified`."""
    crate = Obstacle("crate", Box((0.1, 0.1, 0.1)), pin.SE3(np.eye(3), np.array([3.0, 0, 0])))
    cart = crate.moving([[0.0], [0.1], [0.0]])
    knob = ToolBody("knob", Sphere(0.01), "tip", pin.SE3.Identity(), frozenset({"forearm"}))
    knobbed = MountedTool("probe", "tip", pin.SE3.Identity(), (knob,), mounted=True)
    with_probe = planar.mounted(replace(planar.mounting, frames=(knobbed.frame,)))
    whole = derived(
        problem,
        robot=with_probe,
        tools=(knobbed,),
        scene=knobbed.on(Scene((replace(crate, name="still"), cart))),
        path_constraints=(ToolSpeed("tool", 100.0),),
        vias=(Via(JointGoal(np.array(swing(0.5 * swing.duration)))),),
    )
    assert verify(whole, swing).verified
    original = getattr(module, lost)

    def bare(*given):
        found = original(*given)
        return [] if isinstance(found, list) else replace(found, covers=())

    monkeypatch.setattr(module, lost, bare)
    if lost == "vias":
        monkeypatch.setattr(verifier, "covering", lambda check, *_: check)
    report = verify(whole, swing)
    assert failed(report) == ["statements"]


def test_a_field_that_nobody_knows_is_a_statement_without_a_check(problem):
    known = {field.name for field in fields(problem)}
    wider = make_dataclass("Wider", [(name, object) for name in (*known, "noise_limit")], frozen=True)
    found = wider(**{name: getattr(problem, name) for name in known}, noise_limit=1.0)
    assert set(statements.statements(found)) - set(statements.statements(problem)) == {"noise_limit"}


def test_fields_of_what_a_problem_states_are_known():
    """Who adds a field to one of these says in `verify.statements` or here what is required by it."""
    expected = {
        JointGoal: {"q", "tolerance", "velocity", "acceleration"},
        PoseGoal: {"frame", "X_WG", "position", "orientation"},
        RegionGoal: {"frame", "X_WR", "X_RF", "low", "high"},
        AllOfGoal: {"parts"},
        Via: {"at", "velocity", "time"},  # wishes
        Move: {"joints", "goal", "vias", "rests", "carried_by"},
        Target: {"name", "goal", "after", "cluster", "window"},
        Process: {"seconds", "name"},
        TargetTour: {"joints", "targets", "free", "first", "last", "closed", "at_each", "carried_by"},
        StraightLine: {"joints", "frame", "ends", "by", "in_tool", "speed", "blend", "X_GB", "region"},
        Attach: {"body", "link", "touch", "mass", "centre", "inertia", "framed"},
        ChangeTool: {"leaves", "takes"},
        MountedTool: {"name", "link", "X_LT", "bodies", "X_WP", "mounted"},
        Detach: {"body", "mover"},
        WaitUntil: {"mover", "axis", "relation", "value"},
        Ride: {"mover", "frame", "joints"},
        Mover: {"name", "motion", "X_WO"},
        ObstacleMotion: {"coefficients", "until", "axis", "point"},
        Dwell: {"seconds"},
        PathEvent: {"at", "name"},
        SeamPath: {
            *("joints", "frame", "curve", "speed", "within"),
            *("ramp", "cone", "position", "orientation", "events"),
        },
        SeamCurve: {"breakpoints", "position", "axis", "heading", "corners"},
        SeamPart: {"path", "low", "high"},
        Passing: {"path", "at"},
        Transit: {"joints"},  # to where a part of a path begins, whose check looks there
        TaskStep: {"number", "kind", "name", "action", "allowed", "constraints", "arm", "waits", "ride", "option"},
        Obstacle: {"name", "shape", "X_WO", "stated", "motion"},
        Attachment: {"name", "shape", "link", "X_LO", "touch", "stated", "mass", "centre", "inertia", "framed"},
        Limits: {"lower", "upper", "velocity", "acceleration", "jerk", "torque"},
        Scene: {"obstacles", "attached", "allowed", "safety", "unwished"},  # the last is a wish
        Safety: {"scene", "own", "pairs", "within", "ends", "built"},
        SafePairs: {"of", "others", "at_least"},
    }
    assert {kind: {field.name for field in fields(kind)} for kind in expected} == expected
    # Parts of the cost are weights: none promises a limit.
    assert all(field.type is float for field in fields(Objective))


def test_an_empty_list_of_checks_never_stands_for_a_constraint(problem, swing):
    for one in (Fresh("tool"), ToolSpeed("tool", 50.0), PairClearance((("upper_arm", "nothing"),), 0.1)):
        found = path_constraints(derived(problem, path_constraints=(one,)), swing, VerifyPolicy())
        assert found
        assert all(check.covers == ("path_constraints[0]",) for check in found)


@pytest.mark.parametrize(
    ("row", "T"), [([0.0, 1e308], 10.0), ([0.0, 1e308, 1e308], 1.0), ([0.0, 1e99], 1.0), ([0.1, 0.0, 0.0], 1e300)]
)
def test_numbers_that_overflow_within_a_piece_are_refused(planar, problem, row, T):
    c = np.tile(np.array(row)[None, :, None], (1, 1, 2))
    endless = replace(planar, limits=replace(planar.limits, lower=np.full(2, -np.inf), upper=np.full(2, np.inf)))
    ball = Obstacle("ball", Sphere(0.1), pin.SE3(np.eye(3), np.array([9.0, 0.0, 0.0])))
    steps = [move(planar, [-1.0, 0.0]), replace(move(planar, [1.0, 0.0]), number=2)]
    for one in (
        derived(problem, start_velocity=np.array([0.1, 0.0])),
        derived(problem, robot=endless, goal=(JointGoal(np.zeros(2), velocity=np.full(2, 0.1)),)),
        derived(problem, scene=Scene((ball.moving([[0.0, 0.1], [0.0], [0.0]], until=0.3 * T),))),
        task_of(problem, *steps),
    ):
        motion = Trajectory(planar.joint_names, np.array([0.0, T]), c)
        report = verify(one, in_time(motion, *steps) if one.task else motion)
        assert failed(report) == ["finite"]


def test_a_segment_without_end_is_refused(planar, problem, swing):
    one, two = move(planar, [-1.0, 0.0]), TaskStep(2, "dwell", "dwell", Dwell(0.0))
    T = swing.duration
    for begin, end in ((0.0, np.inf), (0.0, np.nan), (np.inf, np.inf)):
        segments = Segment(1, "move", "move", begin, end), Segment(2, "dwell", "dwell", T, T)
        motion = Trajectory(swing.joint_names, swing.breakpoints, swing.coefficients, segments)
        assert failed(verify(task_of(problem, one, two), motion)) == ["steps"]


def test_the_reason_of_a_part_that_is_refused_without_a_distance_is_told():
    work = {"intervals": 1, "queries": 1, "believed": 0, "pairs": 1, "proved_by_robot": 0}
    none = dict.fromkeys(("proved_clearance", "self_clearance", "scene_clearance", "met_clearance"))
    passed = Check("collision", "continuous", True, 0.01, 0.0, "m", detail="clear", witness=work | none)
    touches = replace(passed, passed=False, worst=-0.002, detail="touches")
    unbounded = replace(passed, passed=False, worst=None, detail="a shape without bounds")
    for found, reason in (
        ([passed, unbounded], "a shape without bounds"),
        ([touches, passed], "touches"),
        ([touches, unbounded], "a shape without bounds"),
        ([passed, replace(passed, worst=None)], "clear"),
    ):
        check = _collision(found)
        assert check.detail.endswith(reason)
        assert check.passed is all(one.passed for one in found)
