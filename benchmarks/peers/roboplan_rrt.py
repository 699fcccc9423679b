"""roboplan: its RRT-Connect and its shortcutting, on its own scene with the links' triangle meshes.

Needs: pip install roboplan==0.7.0. Answers with waypoints: its TOPP-RA takes acceleration limits from a file of its own
kind, which this adapter does not write. Setting `step`: its collision_check_step_size, rad, 0.05 by default as there.
"""

import time
from contextlib import suppress

import numpy as np
from common import answer, locked_urdf, question, refuse
from roboplan import core, rrt

GREY = np.full(4, 0.5)


def scene_of(asked):
    """The robot among its obstacles; pairs that are allowed to touch left out."""
    scene = core.Scene("peer", core.loadUrdfSceneDescriptionFromXml(locked_urdf(asked)))
    scene.addGroup("arm", asked["joints"])
    scene.setRngSeed(asked["seed"])
    for a, b in asked["allowed"]:
        with suppress(RuntimeError):  # a link without a body
            scene.setCollisions([(a, b)], False)
    for body in asked["obstacles"]:
        ((kind, value),) = body["shape"].items()
        pose = np.asfortranarray(body["pose"], float)
        if kind == "box":
            scene.addBoxGeometry(body["name"], "universe", core.Box(*value), pose, GREY)
        elif kind == "sphere":
            scene.addSphereGeometry(body["name"], "universe", core.Sphere(value), pose, GREY)
        elif kind == "cylinder":
            scene.addCylinderGeometry(
                body["name"], "universe", core.Cylinder(value["radius"], value["length"]), pose, GREY
            )
        else:
            refuse(f"a body of kind {kind}")
    others = [body["name"] for body in asked["obstacles"]]
    scene.setCollisions([(a, b) for k, a in enumerate(others) for b in others[k + 1 :]], False)
    return scene


def main():
    """Answer one question."""
    asked = question()
    scene = scene_of(asked)
    step = float(asked["settings"].get("step", 0.05))
    began = time.perf_counter()
    options = rrt.RRTOptions(
        group_name="arm",
        rrt_connect=True,
        max_nodes=100_000,
        max_planning_time=0.8 * asked["budget"],
        collision_check_step_size=step,
    )
    planner = rrt.RRT(scene, options)
    planner.setRngSeed(asked["seed"])
    joints = asked["joints"]
    start = core.JointConfiguration(joints, np.array(asked["start"]))
    for values in asked["goals"]:  # it takes one goal at a time: the nearest first
        try:
            path = planner.plan(start, core.JointConfiguration(joints, np.array(values)))
        except RuntimeError as error:
            why = str(error)
            continue
        shorten = core.PathShortcuttingOptions(group_name="arm", max_step_size=step, seed=asked["seed"])
        path = core.PathShortcutter(scene, shorten).shortcut(path)
        points = np.array(path.positions).tolist()
        return answer(waypoints=points, seconds=time.perf_counter() - began)
    return refuse(why)


main()
