"""YAML and Python build the same problem, with the same hash."""

import re

import numpy as np
import pytest
from ruamel.yaml import YAML

import optiplan as op
from optiplan.config.document import read_yaml
from optiplan.problem.from_data import in_one_form
from optiplan.resources import problems_dir

EXAMPLES = sorted(problems_dir().glob("*.yaml"))


def stated(path):
    """The problem of a file, said by the front door's objects."""
    data = YAML(typ="safe").load(path.read_text())
    if "tasks" in data or re.search(r"\bin: ", path.read_text()) or isinstance(data["start"].get("joints"), dict):
        robots = {"robots": data["robots"]} if "robots" in data else {}
        data = {**in_one_form(read_yaml(path), path.parent).data, **robots}  # Python has loops, and `pose @ pose`
    scene = data.get("scene", {})
    held = [
        body(one).attached_to(
            one["link"],
            touch=one.get("touch", ()),
            **{key: one[key] for key in ("mass", "centre", "inertia") if key in one},
        )
        for one in moved_to(path, scene.get("attached", []))
    ]
    around = op.Scene(
        [moving(one) for one in moved_to(path, scene.get("obstacles", []))], held, scene.get("allowed_collisions", [])
    )
    goal = data.get("goal", {})
    labels = {"name", "seed", "limits", "objective", "planner", "path_constraints", "task", "base", "gravity"}
    labels |= {"tool", "tools", "frames"}
    labels = {key: data[key] for key in labels if key in data}
    labels |= {f"start_{key}": data["start"][key] for key in ("velocity", "acceleration") if key in data["start"]}
    if goal:
        labels["goal"] = [end(one) for one in goal["any_of"]] if "any_of" in goal else end(goal)
    keys = {"group": data.get("group"), "locked": data.get("locked")}
    return op.Problem(
        op.Robot.side_by_side(data["robots"], **keys) if "robots" in data else op.load_robot(data["robot"], **keys),
        start=end(data["start"]),
        scene=around,
        vias=[via(one) for one in data.get("via", [])],
        **labels,
    )


def moved_to(path, bodies):
    """Meshes with their whole paths."""
    for one in bodies:
        if "mesh" in one["shape"]:
            one["shape"]["mesh"]["file"] = path.parent / one["shape"]["mesh"]["file"]
    return bodies


def moving(data):
    return body(data).moving(**data["motion"]) if "motion" in data else body(data)


def body(data):
    (kind, shape), pose = *data["shape"].items(), data.get("pose", {})
    match kind:
        case "box":
            return op.Box(data["name"], size=shape, **pose)
        case "sphere":
            return op.Sphere(data["name"], radius=shape, **pose)
        case "cylinder":
            return op.Cylinder(data["name"], **shape, **pose)
        case "capsule":
            return op.Capsule(data["name"], **shape, **pose)
        case "half_space":
            return op.HalfSpace(data["name"], **shape)
        case "mesh":
            return op.Mesh(data["name"], **shape, **pose)


def end(data):
    rates = {key: data[key] for key in ("velocity", "acceleration") if key in data}
    if "joints" in data and rates:
        return op.JointGoal(np.array(data["joints"], float), **{key: np.array(v, float) for key, v in rates.items()})
    if "configuration" in data:
        return data["configuration"]
    if "region" in data:
        return op.Region(**data["region"])
    if "all_of" in data:
        return op.AllOf([pose({**one["pose"], "frame": one["frame"]}) for one in data["all_of"]])
    if "joints_deg" in data:
        return {"joints_deg": data["joints_deg"]}
    return np.array(data["joints"], float) if "joints" in data else pose(data["pose"])


def pose(data):
    tolerance = {f"{key}_tolerance": value for key, value in data.pop("tolerance", {}).items()}
    return op.Pose(**data, **tolerance)


def via(data):
    wishes = {key: data.pop(key) for key in ("tolerance", "velocity", "time") if key in data}
    return op.ViaPoint(end(data), **wishes)


@pytest.fixture(scope="module", params=EXAMPLES, ids=lambda path: path.stem)
def path(request):
    """The file of an example, for all tests of it before those of the next one."""
    return request.param


@pytest.fixture(scope="module")
def read(path):
    """Its problem."""
    return op.load_problem(path)


def test_every_example_stated_in_python_is_the_same_problem(path, read, tmp_path, monkeypatch):
    monkeypatch.chdir(path.parent)  # lists of targets are files beside it
    said = stated(path)
    assert said.hash == read.hash != ""
    assert said.source == read.source
    said.save(tmp_path / "again.yaml")
    assert op.load_problem(tmp_path / "again.yaml").hash == read.hash


def test_parts_put_back_unchanged_change_nothing(read):
    assert read.with_scene(read.scene).hash == read.hash
    assert read.with_seed(7).hash == read.hash
