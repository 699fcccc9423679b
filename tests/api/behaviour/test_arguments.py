"""Every argument of every public function: a value of a wrong kind is an error that names the call and the argument."""

import inspect

import pytest

import optiplan as op


class Odd:
    """A value that fits nowhere."""

    def __repr__(self):
        return "<odd>"


def valid(name):
    """Arguments with which a function would go on to work."""
    problem = op.load_problem("12_planar")
    solid = {"name": "b", "radius": 0.1}
    return {
        "assign": lambda: {"source": {}},
        "bench": lambda: {"suite": "nowhere.yaml"},
        "bound": lambda: {"problem": problem, "budget": 0.1},
        "check": lambda: {"file": "12_planar"},
        "execute": lambda: {"run": op.plan(op.load_problem("01_reach"), "quintic")},
        "ik": lambda: {"robot": "ur5", "pose": op.Pose((0.3, 0.2, 0.5))},
        "import_scene": lambda: {"source": "nowhere.sdf", "out": "nowhere.yaml", "robot": "planar2r"},
        "init_robot": lambda: {"urdf": "nowhere.urdf"},
        "load_problem": lambda: {"source": "12_planar"},
        "load_robot": lambda: {"source": "panda"},
        "load_run": lambda: {"folder": "nowhere"},
        "design": lambda: {"study": {}},
        "plan": lambda: {"problem": problem},
        "place": lambda: {"problem": problem, "budget": 0.1},
        "plan_batch": lambda: {"problems": ["nowhere.yaml"], "out": "nowhere"},
        "plan_many": lambda: {"problems": [problem]},
        "retime": lambda: {"problem": problem, "waypoints": [[0.0, 0.0], [0.1, 0.1]]},
        "simulate": lambda: {"source": {}},
        "verify": lambda: {"problem": problem, "motion": "nowhere"},
        "workspace": lambda: {"robot": "planar2r", "samples": 100},
        "Budget": lambda: {"seconds": 1.0},
        "Controller": lambda: {"robot": op.load_robot("planar2r"), "tasks": [op.PostureTask()]},
        "Problem": lambda: {"robot": "planar2r", "start": [0.0, 0.0], "goal": [0.1, 0.1]},
        "Replanner": lambda: {"problem": problem},
        "State": lambda: {"q": [0.0]},
        "Pose": lambda: {"position": (0.0, 0.0, 0.0)},
        "Region": lambda: {"position": (0.0, 0.0, 0.0)},
        "ViaPoint": lambda: {"at": [0.0, 0.0]},
        "Scene": dict,
        "Box": lambda: {"name": "b", "size": (1.0, 1.0, 1.0)},
        "Sphere": lambda: solid,
        "Cylinder": lambda: solid | {"length": 1.0},
        "Capsule": lambda: solid | {"length": 1.0},
        "HalfSpace": lambda: {"name": "b"},
    }[name]()


CALLS = (
    *(
        "assign",
        "bench",
        "bound",
        "check",
        "design",
        "execute",
        "ik",
        "import_scene",
        "init_robot",
        "load_problem",
        "load_robot",
        "load_run",
        "place",
        "plan",
        "plan_batch",
        "plan_many",
    ),
    *("retime", "simulate", "verify", "workspace", "Budget", "Controller", "Problem", "Replanner", "State"),
    *("Pose", "Region", "ViaPoint", "Scene", "Box", "Sphere", "Cylinder", "Capsule", "HalfSpace"),
)
OTHERWISE = {"plot", "view", "planners", "robots", "casadi_problem", "certify", "driver"}
"""Functions with `*runs` or without arguments, and those with cases of their own."""

FIELD = {("Problem", "start_velocity"): "start.velocity", ("Problem", "start_acceleration"): "start.acceleration"}


def arguments(name):
    """Names of all arguments that can be given by name."""
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return [one.name for one in inspect.signature(getattr(op, name)).parameters.values() if one.kind in kinds]


@pytest.mark.parametrize(("name", "argument"), [(name, one) for name in CALLS for one in arguments(name)])
def test_an_argument_of_a_wrong_kind_is_named(name, argument):
    with pytest.raises(op.InputError) as caught:
        getattr(op, name)(**(valid(name) | {argument: Odd()}))
    assert str(caught.value).startswith(f"op.{name}: {FIELD.get((name, argument), argument)}")


@pytest.mark.parametrize(
    ("name", "argument"),
    [
        *(("assign", "source"), ("bench", "suite"), ("design", "study"), ("import_scene", "source")),
        *(("init_robot", "urdf"), ("load_problem", "source"), ("load_robot", "source"), ("load_run", "folder")),
        *(("simulate", "source"), ("verify", "motion"), ("plan_batch", "problems")),
    ],
)
def test_the_text_of_a_file_is_no_path_of_one(name, argument):
    """It is longer than the name of a file can be."""
    with pytest.raises(op.InputError):
        getattr(op, name)(**(valid(name) | {argument: "version: 1\nrobot: panda\n" * 30}))


@pytest.mark.parametrize(("name", "argument"), [("view", "block"), ("view", "port"), ("plot", "figure")])
def test_functions_of_several_runs_do_so_too(name, argument):
    run = op.plan(op.load_problem("01_reach"), "quintic")
    with pytest.raises(op.InputError, match=rf"^op\.{name}: {argument}: "):
        getattr(op, name)(run, **{argument: Odd()})


def test_every_function_has_its_case():
    functions = {name for name in op.__all__ if name.islower() and not name.startswith("_")}
    assert functions <= {*CALLS, *OTHERWISE}
