"""A wrong argument is an `InputError` that names it, what was found and what would be valid."""

import copy
import pickle
import re

import numpy as np
import pytest

import optiplan as op
from optiplan.planners.registry import make_planner

ITSELF: list[object] = []
ITSELF.append(ITSELF)

SHELF = ("shelf", (1, 1, 1))
CASES = {
    "box size": (lambda p: op.Box("b", size=(1, 2)), "op.Box: size", "3 values"),
    "box size negative": (lambda p: op.Box("b", size=(1, 2, -1)), r"op.Box: size\[2\]", "> 0"),
    "box name": (lambda p: op.Box(3, size=(1, 2, 1)), "op.Box: name", "text"),
    "both rotations": (lambda p: op.Box(*SHELF, rpy=(0, 0, 0), quaternion=(0, 0, 0, 1)), "op.Box", "at most one"),
    "both of a pose": (lambda p: op.Pose((0, 0, 0), rpy=(0, 0, 1), rpy_deg=(0, 0, 1)), "op.Pose: both rpy", "at most"),
    "quaternion": (lambda p: op.Pose((0, 0, 0), quaternion=(0, 0, 0, 2)), "op.Pose: quaternion", "unit length"),
    "position": (lambda p: op.Pose("here"), "op.Pose: position", "list"),
    "position NaN": (lambda p: op.Pose((0, 0, np.nan)), r"op.Pose: position\[2\]", "finite"),
    "matrix": (lambda p: op.Pose.from_matrix(np.ones((4, 4))), "op.Pose.from_matrix: X_WG", "rotation"),
    "matrix of text": (lambda p: op.Pose.from_matrix([["a"] * 4] * 4), "op.Pose.from_matrix: X_WG", "rotation"),
    "radius": (lambda p: op.Sphere("s", radius="big"), "op.Sphere: radius", "a number"),
    "cylinder": (lambda p: op.Cylinder("c", radius=0, length=1), "op.Cylinder: radius", "> 0"),
    "mesh": (lambda p: op.Mesh("m", "nowhere.stl"), "op.Mesh: file", "a mesh file"),
    "normal": (lambda p: op.HalfSpace("h", normal=(1, 1, 1)), "op.HalfSpace: normal", "unit length"),
    "scene": (lambda p: op.Scene([op.Box(*SHELF), 3]), r"op.Scene: obstacles\[1\]", "op.Box"),
    "scene of one": (lambda p: op.Scene(op.Box(*SHELF)), "op.Scene: obstacles", "obstacles in a list"),
    "allowed": (lambda p: op.Scene([], [], ["ab"]), "op.Scene: allowed", "pairs of two names"),
    "moved": (lambda p: p.scene.moved("shelf"), "op.Scene: name", "wall"),
    "moved by": (lambda p: p.scene.moved("wall", z="up"), "op.Scene.moved: z", "finite number"),
    "without": (lambda p: p.scene.without("shelf"), "op.Scene: name", "wall"),
    "robot": (lambda p: op.Problem(3, [0, 0], [1, 1]), "op.Problem: robot", "op.load_robot"),
    "robot name": (lambda p: op.Problem("pandda", [0, 0], [1, 1]), "op.Problem: robot", "panda"),
    "start name": (lambda p: op.Problem(p.robot, "redy", [1, 1]), "op.Problem: start", "ready"),
    "start size": (lambda p: op.Problem(p.robot, [0, 0, 0], [1, 1]), "op.Problem: start", "2 values"),
    "start kind": (lambda p: op.Problem(p.robot, None, [1, 1]), "op.Problem: start", "name of a configuration"),
    "goal kind": (lambda p: op.Problem(p.robot, [0, 0], 3.5), "op.Problem: goal", "op.Pose"),
    "goal none": (lambda p: op.Problem(p.robot, [0, 0], []), "op.Problem: goal", "at least one"),
    "goal matrix": (lambda p: p.with_goal(np.eye(4)), "op.Problem: goal: found a matrix", "op.Pose.from_matrix"),
    "step matrix": (lambda p: op.Task().move(np.eye(4)), "op.Task.move: to: found a matrix", "op.Pose.from_matrix"),
    "huge matrix": (lambda p: p.with_goal([[10**400] * 4] * 4), "op.Problem: goal", "op.Pose"),
    "goal limits": (lambda p: op.Problem(p.robot, [0, 0], [0, 99]), "op.Problem: goal", "a value in"),
    "frame": (lambda p: p.with_goal(op.Pose((1, 0, 0), frame="hand")), "op.Problem: goal.pose.frame", "one of"),
    "vias": (lambda p: p.with_vias({}), "op.Problem: via", "joints"),
    "vias kind": (lambda p: op.Problem(p.robot, [0, 0], [1, 1], vias=3), "op.Problem: vias", "op.ViaPoint"),
    "limits": (lambda p: p.with_limits(velocity=2.0), "op.Problem: limits.velocity", "1.0"),
    "limit name": (lambda p: p.with_limits(speed=0.5), "op.Problem: limits.speed", "velocity"),
    "limits kind": (lambda p: op.Problem(p.robot, [0, 0], [1, 1], limits=0.5), "op.Problem: limits", "velocity"),
    "objective": (lambda p: op.Problem(p.robot, [0, 0], [1, 1], objective=3), "op.Problem: objective", "op.Objective"),
    "constraint": (lambda p: p.with_constraint(3), r"op.Problem: path_constraints\[0\]", "op.OnLine"),
    "constraint of text": (lambda p: p.with_constraint(op.PositionBox("t", 1, "x")), "constraints", "PositionBox"),
    "constraint of a step": (lambda p: op.Task().dwell(1, path_constraints=[3]), r"constraints\[0\]", "op.OnLine"),
    "constraints of a step": (lambda p: op.Task().dwell(1, path_constraints=3), "op.Task.dwell: path_constr", "a list"),
    "seed of a problem": (lambda p: op.Problem(p.robot, [0, 0], [1, 1], seed=-1), "op.Problem: seed", "≥ 0"),
    "scene kind": (lambda p: p.with_scene(3), "op.Problem: scene", "op.Scene"),
    "collision": (lambda p: p.with_scene([op.Box(*SHELF)]), "op.Problem: start", "apart"),
    "planner": (lambda p: op.plan(p, "trajoptt"), "op.plan: planner", "did you mean 'trajopt'"),
    "planner kind": (lambda p: op.plan(p, 3), "op.plan: planner", "op.planners"),
    "option": (lambda p: op.plan(p, "quintic", {"duratoin": 3}), "op.plan: options", "duration"),
    "option value": (lambda p: op.plan(p, "quintic", {"duration": -3}), "duration", "a number from"),
    "options kind": (lambda p: op.plan(p, "quintic", 3), "op.plan: options", "by name"),
    "budget": (lambda p: op.plan(p, budget=0), "op.plan: budget", "above 0"),
    "budget kind": (lambda p: op.plan(p, budget="long"), "op.plan: budget", "seconds"),
    "progress": (lambda p: op.plan(p, progress=3), "op.plan: progress", "a function"),
    "joint tolerance": (lambda p: p.with_goal(op.JointGoal(np.ones(2), 0.5)), "op.Problem: goal", "1e-06"),
    "seed": (lambda p: op.plan(p, seed=0.5), "op.plan: seed", "whole number"),
    "warm start": (lambda p: op.plan(p, warm_start=3), "op.plan: warm_start", "a Run"),
    "not a problem": (lambda p: op.plan("01_reach"), "op.plan: problem", "op.load_problem"),
    "motion": (lambda p: op.verify(p, 3), "op.verify: motion", "Trajectory"),
    "no file": (lambda p: op.verify(p, "nowhere.json"), "nowhere.json", "a run folder or file"),
    "waypoints": (lambda p: op.retime(p, [[0, 0, 0]]), "op.retime: waypoints", r"\(k, 2\)"),
    "waypoint by name": (lambda p: op.retime(p, [{j: 0.1 for j in p.robot.joint_names}]), "waypoints", "k >= 2"),
    "voxels": (lambda p: op.workspace(p.robot, voxels=10**400), "op.workspace: voxels", "from 2 to 100"),
    "configurations": (lambda p: op.workspace(p.robot, samples=10**400), "workspace: samples", "from 1 to 50000000"),
    "flag": (lambda p: op.ik(p.robot, np.eye(4), all=np.array([True, False])), "op.ik: all", "True or False"),
    "waypoints limits": (
        lambda p: op.retime(p, [[0, 0], [0, 99]]),
        r"retime: waypoints\[1\]\[1\]",
        "a value in .* rad$",
    ),
    "waypoint limits": (lambda p: op.retime(p, [[0, 0], [99, 0], [1, 1]]), r"waypoints\[1\]\[0\]", "a value in"),
    "samples": (lambda p: op.verify(p, op.Samples(None, [0, 1], [[0, 0], [1, 1]])), "joint_names", "names"),
    "samples text": (lambda p: op.verify(p, op.Samples(("a", "b"), "x", [[0, 0]])), "samples: t", "numbers"),
    "retimed task": (
        lambda p: op.retime(op.Problem(p.robot, p.start, task=op.Task().dwell(1.0)), [[0, 0], [0, 1]]),
        "op.retime: problem",
        "one with a goal",
    ),
    "deviation": (lambda p: op.retime(p, [[0, 0], [0, 1]], deviation=-1), "op.retime: deviation", ">= 0"),
    "runs": (lambda p: op.view(), "op.view: runs", "at least one"),
    "run": (lambda p: op.view(3), "op.view: runs", "op.plan"),
    "problem name": (lambda p: op.load_problem("01_rech"), "01_rech", "did you mean '01_reach'"),
    "problem kind": (lambda p: op.load_problem(3), "op.load_problem: source", "path"),
    "robot to load": (lambda p: op.load_robot("panda2"), "op.load_robot: source", "panda"),
    "group": (lambda p: op.load_robot("baxter", group="middle"), "op.load_robot: group", "left"),
    "urdf": (lambda p: op.Robot.from_urdf("nowhere.urdf"), "nowhere.urdf", "a readable URDF"),
    "urdf key": (lambda p: op.Robot.from_urdf("a.urdf", tol_frame="x"), "op.Robot.from_urdf: tol_frame", "tool_frame"),
    "folder": (lambda p: op.load_run("nowhere"), "nowhere", "a run folder"),
    "mesh kind": (lambda p: op.Mesh("m", None), "op.Mesh: file", "path of a mesh file"),
    "urdf kind": (lambda p: op.Robot.from_urdf(3), "op.Robot.from_urdf: path", "path of a URDF"),
    "save kind": (lambda p: p.save(None), "op.Problem.save: path", "path of a file"),
    "save nothing": (lambda p: p.save(""), "op.Problem.save: path", "path of a file"),
    "save null": (lambda p: p.save("a\0b"), "op.Problem.save: path", "path of a file"),
    "save surrogate": (lambda p: p.save("\ud800"), "op.Problem.save: path", "path of a file"),
    "moved array": (lambda p: p.scene.moved(np.zeros((2, 2))), "op.Scene: name", "wall"),
    "moved far": (lambda p: p.scene.moved("wall", z=10**400), "op.Scene.moved: z", "finite number"),
    "planner of a problem": (lambda p: op.Problem(p.robot, [0, 0], [1, 1], planner=0), "op.Problem: planner", "text"),
    "options of a problem": (lambda p: op.Problem(p.robot, [0, 0], [1, 1], options=[]), "op.Problem: options", "name"),
    "with seed": (lambda p: p.with_seed(-1), "op.Problem.with_seed: seed", ">= 0"),
    "with seed NaN": (lambda p: p.with_seed(np.nan), "op.Problem.with_seed: seed", "whole number"),
    "joint goal": (lambda p: p.with_goal(op.JointGoal("x")), "op.Problem: goal", "values of the joints"),
    "joint goal within": (lambda p: p.with_goal(op.JointGoal([1, 1], None)), "op.Problem: goal", "tolerance"),
    "pose goal": (lambda p: p.with_goal(op.PoseGoal("tool", [1, 1])), "op.Problem: goal", "op.Pose"),
    "seconds": (lambda p: op.Budget("long"), "op.Budget: seconds", ">= 0"),
    "seconds NaN": (lambda p: op.Budget(np.nan), "op.Budget: seconds", ">= 0"),
    "budget huge": (lambda p: op.plan(p, budget=10**400), "op.plan: budget", "above 0"),
    "option kind": (lambda p: op.plan(p, "quintic", {1: 2}), "op.plan: options", "duration"),
    "motion huge": (lambda p: op.verify(p, ([0, 10**400], [[0, 0], [1, 1]])), "op.verify: motion", "times"),
    "waypoints huge": (lambda p: op.retime(p, 10**400), "op.retime: waypoints", r"\(k, 2\)"),
    "group of a URDF": (lambda p: op.load_robot("arm.urdf", group="left"), "op.load_robot: group", "no groups"),
    "group kind": (lambda p: op.load_robot("baxter", group=[]), "op.load_robot: group", "name of a group"),
    "locked kind": (lambda p: op.load_robot("baxter", locked=3), "op.load_robot: locked", "by joint"),
    "locked NaN": (lambda p: op.load_robot("baxter", locked={"right_s0": np.nan}), "locked.*right_s0", "finite"),
    "pose times a number": (lambda p: op.Pose((0, 0, 1)) @ 2.0, "op.Pose: @", r"op\.Pose"),
    "list in itself": (lambda p: op.Box("b", ITSELF), "op.Box: size", "number"),
    "array of one number": (lambda p: op.Problem(p.robot, [0, 0], np.array(0.5)), "op.Problem: goal", "joints"),
    "bodies in an array of one": (lambda p: op.Scene(np.array(0.5)), "op.Scene: obstacles", "in a list"),
    "bodies of no names": (lambda p: op.SafePairs(np.array(0.5), ("a",), 0.1), "op.SafePairs: of", "name"),
    "vias of a step": (lambda p: op.Task().move([1, 1], vias=3), "op.Task.move: vias", "op.ViaPoint"),
    "vias of an approach": (lambda p: op.Task().approach(op.Pose((0, 0, 1)), 0.1, vias=3), "approach: vias", "list"),
    "touch of a step": (
        lambda p: op.Problem(p.robot, [0, 0], task=op.Task().attach("b", "hand", touch="tool")),
        "attach.touch: 'tool'",
        "list",
    ),
    "during of an expression": (lambda p: op.Expression("e", abs, 0.0, during=None), "op.Expression: during", "from"),
    "upper of an expression": (lambda p: op.Expression("e", abs, 0.0, 10**400), "op.Expression: upper", "a number"),
    "frame of arrays": (lambda p: op.ik(p.robot, np.eye(4), frame=np.zeros(2)), "op.ik: frame", "tool"),
    "aim of arrays": (lambda p: op.ik(p.robot, np.eye(4), prefer=np.zeros(2)), "op.ik: prefer", "middle"),
    "pose huge": (lambda p: op.ik(p.robot, 10**400), "op.ik: pose", r"\(4, 4\)"),
    "solver of arrays": (lambda p: op.Controller(p.robot, [], solver=np.zeros(2)), "op.Controller: solver", "native"),
    "problems in an array of one": (lambda p: op.plan_many(np.array(0.5)), "op.plan_many: problems", "list"),
    "folder of a long name": (lambda p: op.place(p, out=300 * "x"), "out: file name too long", "can be written"),
    "where of arrays": (lambda p: op.place(p, where=np.zeros(2)), "op.place: where", "op.PlaceRange"),
    "planner of a client": (lambda p: op.Client("http://127.0.0.1:9").plan(p, np.eye(2)), "planner", "name"),
    "run of a client": (lambda p: op.Client("http://127.0.0.1:9").status(np.eye(2)), "op.Client.status: run", "id"),
    "state huge": (lambda p: op.State([10**400]), "op.State: q", "number"),
    "task cost huge": (lambda p: op.PositionTask("tool", cost=10**400), "op.PositionTask: cost", ""),
    "task target huge": (lambda p: op.PoseTask("tool", target=10**400), "op.PoseTask: target", ""),
    "speed limit huge": (lambda p: op.ToolSpeedLimit("tool", linear=10**400), "op.ToolSpeedLimit: linear", ""),
    "region of arrays": (lambda p: op.Region(np.zeros((2, 2, 2))), "op.Region: position", ""),
    "region along arrays": (lambda p: op.Region([0, 0, 0], along=np.zeros(3)), "op.Region: along", ""),
    "reaction of arrays": (lambda p: op.Policy(np.zeros(2)), "op.Policy: reaction", "one of"),
    "form of arrays": (lambda p: op.Controller(p.robot, [], form=np.zeros(2)), "op.Controller: form", "one of"),
    "safe pairs": (lambda p: op.Safety(pairs=None), "op.Safety: pairs", "op.SafePairs"),
    "shapes of a tool": (lambda p: op.Tool("t", "link", shapes=None), "op.Tool: shapes", "a list"),
    "touch of a tool": (lambda p: op.Tool("t", "link", touch=None), "op.Tool: touch", "a list"),
    "targets null": (lambda p: op.Tour("a\0b"), "op.Tour: targets", "a CSV file"),
    "points null": (lambda p: op.Path("a\0b", 0.1), "op.Path: points", "a CSV file"),
    "save": (lambda p: p.save("/proc/nowhere/p.yaml"), "op.Problem.save: path", "can be written"),
}


@pytest.mark.parametrize("name", CASES)
def test_a_wrong_argument_is_named(problem, name):
    call, where, expected = CASES[name]
    with pytest.raises(op.InputError, match=where) as caught:
        call(problem)
    text = str(caught.value)
    assert re.search(expected, text), text
    for foreign in ("pydantic", "Traceback", ".cpp", "<problem>", "<robot>", "validation error"):
        assert foreign not in text


MOTION_CASES = {
    "coast for ever": (lambda run: op.Executor(run).coast(np.inf), "op.Executor.coast: duration", ">= 0"),
    "coast for ages": (lambda run: op.Executor(run).coast(1e300), "op.Executor.coast: duration", r"<= 1e\+06"),
    "engine of arrays": (lambda run: op.execute(run, engine=np.zeros(2)), "op.execute: engine", "one of"),
    "driver of arrays": (lambda run: op.driver("sim", run, engine=np.zeros(2)), "op.driver: engine", "one of"),
    "time": (lambda run: run.trajectory("x"), "Trajectory: t", "times"),
    "time outside": (lambda run: run.trajectory(99.0), "Trajectory: t", "clamp=True"),
    "times in rows": (lambda run: run.trajectory(np.zeros((2, 2))), "Trajectory: t", r"\(k,\)"),
    "picture nowhere": (lambda run: op.plot(run, out="/proc/no/a.png"), "op.plot: out", "a file that can be written"),
    "picture as a folder": (lambda run: op.plot(run, out="figures"), "op.plot: figures: out: no ending", r"\.csv$"),
    "share": (lambda run: op.plot(run, share=np.zeros(2)), "op.plot: share", "True or False"),
    "warm start of a client": (
        lambda run: op.Client("http://127.0.0.1:9").plan(run.problem, warm_start=run),
        "op.Client: warm_start",
        "id of a run",
    ),
    "scaled": (lambda run: run.trajectory.scaled(None), "Trajectory: duration", "seconds"),
    "rate of samples": (lambda run: run.trajectory.to_dict(rate="x"), "Trajectory: rate", "samples a second"),
    "rate of 0": (lambda run: run.trajectory.sample_times(0), "Trajectory: rate", "above 0"),
    "speeds in an array of one": (lambda run: op.execute(run, speeds=np.array(0.5)), "op.execute: speeds", "pairs"),
    "order": (lambda run: run.trajectory(0.1, None), "Trajectory: order", "whole number"),
    "state": (lambda run: run.trajectory.state("x"), "Trajectory: t", "a time"),
    "order below 0": (lambda run: run.trajectory(0.1, -1), "Trajectory: order", "0 or more"),
    "save": (lambda run: run.save(None), "op.Run.save: folder", "path of a folder"),
    "save here": (lambda run: run.save(""), "op.Run.save: folder", "path of a folder"),
    "export": (lambda run: run.export(3), "op.Run.export: path", "path of a file"),
    "format": (lambda run: run.export("a.csv", []), "op.Run.export: format", "csv"),
    "rate": (lambda run: run.export("a.csv", rate=10**400), "op.Run.export: rate", "samples a second"),
}


@pytest.mark.parametrize("name", MOTION_CASES)
def test_a_wrong_argument_about_a_run_is_named(run, name):
    call, where, expected = MOTION_CASES[name]
    with pytest.raises(op.InputError, match=where) as caught:
        call(run)
    assert re.search(expected, str(caught.value)), str(caught.value)


@pytest.mark.parametrize(
    "call",
    [
        lambda run: op.Box("b", size=(1, 2)),
        lambda run: run.trajectory(99.0),
        lambda run: make_planner("trajoptt"),
    ],
)
def test_errors_come_back_from_other_processes(run, call):
    with pytest.raises(op.OptiPlanError) as caught:
        call(run)
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is type(caught.value)
    assert str(again) == str(caught.value)
    assert vars(again) == vars(caught.value)


def test_what_cannot_be_pickled_says_so(run):
    executor = op.Executor(run)
    assert repr(executor) == f"Executor: {run!r}; 0.000 s since the first tick"
    for own in (executor, op.Client("http://127.0.0.1:1")):
        for call in (pickle.dumps, copy.copy, copy.deepcopy):
            with pytest.raises(TypeError, match=f"op.{type(own).__name__} belongs to its process, and can be neither"):
                call(own)


@pytest.mark.parametrize("part", [{"joint_names": None}, {"breakpoints": "x"}, {"coefficients": [[10**400]]}])
def test_a_trajectory_names_what_is_no_part_of_one(part):
    parts = {"joint_names": ("a",), "breakpoints": [0, 1], "coefficients": np.zeros((1, 2, 1))} | part
    with pytest.raises(ValueError, match=f"{next(iter(part))}: found .*; expected"):
        op.Trajectory(**parts)


def test_a_derivative_of_any_order_ends(run):
    assert run.trajectory(0.1, 10**400).tolist() == [0.0, 0.0]


def test_numbers_of_numpy_are_numbers(problem, run, tmp_path):
    assert problem.scene.moved("wall", z=np.int64(1)).obstacles[0].X_WO.translation[2] == 1.0
    assert problem.with_seed(np.int64(3)).seed == 3
    assert op.retime(problem, [[0, 0], [0.1, 0.1]], np.float64(0.0)).verified
    run.export(tmp_path / "a.csv", rate=np.int64(100))


def test_formats_of_other_releases_are_not_promised(run, tmp_path):
    with pytest.raises(op.InputError, match=r"format: found 'krl'; expected one of: csv, json, npz, ros, urscript"):
        run.export(tmp_path / "program.src", "krl")
    with pytest.raises(op.InputError, match=r"program\.src"):
        run.export(tmp_path / "program.src")
    with pytest.raises(op.InputError, match=r"a motion of 2 joints .*; expected of urscript: one of the six joints"):
        run.export(tmp_path / "program.script")
    assert not list(tmp_path.iterdir())
