"""The check `tool`: what a motion with tools is judged by, and where tools are changed."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.problem.problem import derived
from optiplan.simulation.real_time.sim_driver import SimDriver
from optiplan.viewer.moving_objects import moved_by, object_stays
from tests.checks import named


@pytest.fixture(scope="module")
def problem():
    """The planar arm leaves a probe in its rack, and takes a pen that is nowhere before."""
    arm = op.load_robot("planar2r")
    rack = op.Pose.from_matrix(arm.fk([0.5, 0.3], "tip").matrix)
    bead = op.Sphere("probe", radius=0.02, position=(0, 0, 0))
    cap = op.Sphere("cap", radius=0.02, position=(0, 0, 0))
    probe = op.Tool("probe", "tip", tcp=op.Pose((0.1, 0, 0)), shapes=[bead], mass=0.4, touch=["forearm"], parked=rack)
    pen = op.Tool("pen", "tip", tcp=op.Pose((0.2, 0, 0)), shapes=[cap], mass=0.1, touch=["forearm"])
    task = op.Task().move([0.5, 0.3]).tool("none", allowed_collisions=[("probe", "tip"), ("probe", "forearm")])
    task = (
        task.move([-1.0, 0.3], allowed_collisions=[("probe", "tip"), ("probe", "forearm")]).tool("pen").move([-1.2, 0])
    )
    return op.Problem(arm, [0.9, 0.3], task=task, tools=[probe, pen], tool="probe")


@pytest.fixture(scope="module")
def run(problem):
    return op.plan(problem, budget=20.0)


def with_first(problem, tool):
    """The problem whose first tool is another, also where its steps change it."""
    steps = [
        replace(step, action=replace(step.action, leaves=tool)) if getattr(step.action, "leaves", None) else step
        for step in problem.task
    ]
    return derived(problem, tools=(tool, problem.tools[1]), task=tuple(steps))


def test_a_task_with_two_tools_is_proved(problem, run):
    assert run.verified
    check = named(op.verify(problem, run.trajectory), "tool")
    assert check.passed
    assert {"tools.probe", "tools.pen", "task[1].tool", "task[3].tool"} == set(check.covers)
    assert any("probe of 0.4 kg at first; none from" in words for words in run.report.scope)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda tool: replace(tool, X_LT=pin.SE3(np.eye(3), np.array([0.1, 0, 1e-6]))), "TCP of 'probe'"),
        (lambda tool: replace(tool, bodies=(replace(tool.bodies[0], X_LO=tool.X_LT),)), "not on 'tip' as stated"),
        (lambda tool: replace(tool, mounted=False), "not mounted"),
    ],
)
def test_what_is_not_as_stated_is_refused(problem, run, change, words):
    report = op.verify(with_first(problem, change(problem.tools[0])), run.trajectory)
    assert "tool" in [check.name for check in report.failures]
    assert words in named(report, "tool").detail


def test_an_obstacle_named_like_a_body_of_a_tool_stays_and_is_refused(problem, run):
    wall = op.Box("cap", size=(0.1, 0.1, 0.1), position=(9, 9, 9))
    pen, scene = problem.tools[1], op.Scene(obstacles=[wall])
    assert pen.off(pen.on(scene)).obstacles == pen.on(scene).obstacles == (wall,)
    twice = derived(problem, scene=replace(problem.scene, obstacles=(*problem.scene.obstacles, wall)))
    report = op.verify(twice, run.trajectory)
    assert [check.name for check in report.failures] == ["tool"]
    assert "two bodies called 'cap'" in named(report, "tool").detail


def test_a_tool_is_left_in_its_rack_alone(problem, run):
    """Where the link stands 3 mm beside the rack the planner says so, and the verifier refuses the motion."""
    far = replace(problem.tools[0], X_WP=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.003])) * problem.tools[0].X_WP)
    check = named(op.verify(with_first(problem, far), run.trajectory), "tool")
    assert not check.passed
    assert check.worst == pytest.approx(0.003, rel=1e-3)
    lost = problem.with_task(op.Task().move([0.6, 0.3]).tool("none").move([0.5, 0.0]))
    failure = op.plan(lost, budget=5.0).failure
    assert "is parked" in failure.detail
    assert failure.witness["step"] == 2


def test_the_page_shows_tools_where_they_are(problem, run):
    assert moved_by(problem.task) == {"probe", "cap"}
    probe, cap = sorted(object_stays(problem, run.trajectory, ["probe", "cap"]), key=lambda one: one.name != "probe")
    assert [(stay.body > 0, stay.absent) for stay in probe.stays] == [(True, False), (False, False)]
    assert [stay.absent for stay in cap.stays] == [True, False]
    assert cap.stays[1].begin > probe.stays[1].begin > 0.0


def test_the_closed_loop_carries_each_tool(problem, run):
    assert op.execute(run).tracking.tool_peak < 1e-3
    for refused in (lambda: op.execute(run, "mujoco"), lambda: op.driver("sim", run, engine="mujoco")):
        with pytest.raises(InputError, match="changes tools"):
            refused()


def test_the_simulated_robot_changes_tools_where_nobody_names_an_engine(run, monkeypatch):
    """In MuJoCo the tool that was taken hit the one that was left."""
    made = []
    monkeypatch.setattr(SimDriver, "_start", lambda self, setup: made.append(setup.engine))
    op.driver("sim", run)
    assert made == ["own"]
