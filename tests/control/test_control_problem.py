"""`Controller.build`: the program of a step with names, which leaves the controller as it is."""

import numpy as np
import pytest
import qpsolvers

import optiplan as op

DT = 0.002
BALL = op.Sphere("ball", radius=0.06, position=(0.45, 0.12, 0.6))


def reaching(panda):
    """Return a controller that is drawn past a ball, with a posture for what is left over."""
    goal = op.PoseTask(panda.tool_frame, op.Pose(position=(0.45, 0.3, 0.55), rpy=(np.pi, 0.0, 0.0)))
    return op.Controller(panda, [goal, op.PostureTask("ready", cost=0.1)], scene=op.Scene([BALL]))


def test_it_leaves_the_controller_as_it_is_and_its_solution_is_the_step(panda):
    plain, asked = reaching(panda), reaching(panda)
    state, checked = op.State(panda.configurations["ready"]), 0
    for k in range(300):
        if k % 7 == 0:
            problem = asked.build(state, DT)
            asked.build(op.State(panda.configurations["ready"] + 0.3), 2 * DT)  # from elsewhere, of another length
        step = plain.step(state, DT)
        same = asked.step(state, DT)
        assert same.state.q.tobytes() == step.state.q.tobytes()
        assert same.state.v.tobytes() == step.state.v.tobytes()
        if k % 7 == 0 and step.status in ("tracking", "limited"):
            x = qpsolvers.solve_problem(problem.to_qpsolvers(), "proxqp", eps_abs=1e-10).x
            np.testing.assert_allclose(x, step.state.v, atol=1e-6)
            checked += 1
        state = step.state
    assert checked > 20


@pytest.mark.parametrize("form", ["velocity", "acceleration"])
def test_a_saved_program_is_the_same_for_qpsolvers(panda, form, tmp_path):
    controller = op.Controller(panda, [op.PostureTask("ready")], form=form)
    problem = controller.build(op.State(panda.configurations["ready"] + 0.1), DT)
    stored = qpsolvers.Problem.load(str(problem.save(tmp_path / "step.npz")))
    again = problem.to_qpsolvers()
    for name in ("P", "q", "G", "h", "lb", "ub"):
        kept, given = getattr(stored, name), getattr(again, name)
        assert (kept is None and given is None) or np.array_equal(kept, given), name
    with pytest.raises(op.InputError, match=r"^op\.ControlProblem\.save: path: found .*expected a file that ends with"):
        problem.save(tmp_path / "step.json")


def test_every_row_has_a_name(panda):
    problem = reaching(panda).build(op.State(panda.configurations["ready"]), DT)
    assert problem.joint_names == tuple(panda.joint_names)
    pose = f"pose of {panda.tool_frame}"
    components = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
    assert problem.task_names[:6] == tuple(f"{pose}: {component}" for component in components)
    assert problem.task_names[6:] == tuple(f"posture: {name}" for name in panda.joint_names)
    assert set(problem.lower_limits) == set(problem.upper_limits) == {"jerk"}  # from rest
    assert len(problem.row_names) == len(problem.C) > 0
    assert "clearance: panda_link5 and panda_link7" in problem.row_names
    np.testing.assert_allclose(problem.P - problem.P.T, 0.0, atol=1e-12)
    ridge = problem.P - problem.J.T @ problem.J
    np.testing.assert_allclose(ridge, np.diag(np.diag(ridge)), atol=1e-9)
    shown = repr(problem)
    assert shown.startswith(f"ControlProblem: 7 joints, 13 task rows, {len(problem.C)} limit rows, 0 equations\n")
    assert f"(jerk) <= {panda.joint_names[0]} <=" in shown
    assert f"{pose}: rotation z" in shown


def test_a_row_names_the_obstacle_that_is_near(panda):
    controller, state = reaching(panda), op.State(panda.configurations["ready"])
    named = set()
    for _ in range(400):
        named |= set(controller.build(state, DT).row_names)
        state = controller.step(state, DT).state
    assert any(name.startswith("clearance: ") and "ball" in name for name in named), named


def test_tasks_of_higher_priority_are_equations(panda):
    goal = op.PositionTask(panda.tool_frame, (0.45, 0.1, 0.5))
    controller = op.Controller(panda, [goal, op.PostureTask("ready", priority=1)])
    state = op.State(panda.configurations["ready"])
    problem = controller.build(state, DT)
    assert problem.equation_names == tuple(f"position of {panda.tool_frame}: {axis}" for axis in "xyz")
    assert problem.task_names == tuple(f"posture: {name}" for name in panda.joint_names)
    assert problem.A.shape == (3, 7)
    np.testing.assert_allclose(problem.A @ controller.step(state, DT).state.v, problem.b, atol=1e-6)


def test_rows_that_cannot_hold_are_relaxed_by_name(panda):
    probe = op.Controller(panda, []).configuration(op.State(panda.configurations["ready"]))
    x, y, z = probe.pose(panda.frame_id("panda_hand")).translation
    block = op.Box("block", size=(0.2, 0.2, 0.2), position=(x + 0.124, y, z))
    controller = op.Controller(panda, [op.PostureTask("ready")], scene=op.Scene([block]))
    problem = controller.build(op.State(panda.configurations["ready"]), DT)
    assert set(problem.slack) <= {name.split(":")[0] for name in problem.row_names}
    assert problem.slack
    assert "relaxed" in repr(problem)


@pytest.mark.parametrize(
    ("dt", "said"), [(0.0, "number of seconds > 0"), (0.2, "at most longest_step = 0.1 s"), (np.nan, "finite")]
)
def test_wrong_arguments_name_the_function(panda, dt, said):
    with pytest.raises(op.InputError, match=rf"Controller\.build.*dt.*{said}"):
        op.Controller(panda, []).build(op.State(panda.configurations["ready"]), dt)
