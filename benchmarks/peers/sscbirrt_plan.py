"""sscbirrt: CBiRRT, its smoothing and its own timing, in MuJoCo's scene (links as convex hulls).

Needs: pip install 'sscbirrt[mujoco]==3.15.0'. Settings: `resolution`, its edge_resolution, rad, 0.05 by default as
there; `clearance`, m, which its scene keeps, 0 by default; `timing=ours`: waypoints instead of its trajectory.
"""

import time
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
from common import answer, locked_urdf, question, refuse
from sscbirrt import CBiRRTConfig, TrajectoryOptions
from sscbirrt.mujoco import Arm, plan


def world(asked):
    """The robot among its obstacles, with pairs that are allowed to touch left out, and the site at its end."""
    root = ET.fromstring(locked_urdf(asked))
    for link in root.findall("link"):
        for unused in link.findall("visual") + link.findall("inertial"):  # Fetch's inertias are refused
            link.remove(unused)
    for mesh in root.iter("mesh"):
        mesh.set("filename", mesh.get("filename").removeprefix("file://"))
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(options, "compiler", fusestatic="false", strippath="false", inertiafromgeom="true")
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    bodies = {body.name for body in spec.bodies}
    links = [link.get("name") for link in root.findall("link")]
    world_link = next(name for name in links if name not in bodies) if set(links) - bodies else "world"
    for a, b in asked["allowed"]:
        names = ["world" if name == world_link else name for name in (a, b)]
        if set(names) <= bodies | {"world"}:
            spec.add_exclude(bodyname1=names[0], bodyname2=names[1])
    for body in asked["obstacles"]:
        add(spec, body)
    ends = [joint for joint in root.findall("joint") if joint.get("name") == asked["joints"][-1]]
    last = next(body for body in spec.bodies if body.name == ends[0].find("child").get("link"))
    last.add_site(name="end")
    return spec.compile()


def add(spec, body):
    """Add an obstacle, as a body of its own at rest."""
    ((kind, value),) = body["shape"].items()
    pose = np.array(body["pose"])
    turned = np.empty(4)
    mujoco.mju_mat2Quat(turned, pose[:3, :3].ravel())
    if kind == "box":
        shape, size = mujoco.mjtGeom.mjGEOM_BOX, [x / 2 for x in value]
    elif kind == "sphere":
        shape, size = mujoco.mjtGeom.mjGEOM_SPHERE, [value, 0, 0]
    elif kind == "cylinder":
        shape, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [value["radius"], value["length"] / 2, 0]
    else:
        refuse(f"a body of kind {kind}")
    spec.worldbody.add_geom(name=body["name"], type=shape, size=size, pos=pose[:3, 3], quat=turned)


def samples(trajectory):
    """Its pieces have constant accelerations: q and dq/dt where any changes, which cubics join exactly."""
    times, since = [0.0], 0.0
    for piece in trajectory.pieces:
        inside = {round(since + t, 12) for ramp in piece.ramps for t in np.cumsum([d for d, _ in ramp.pieces])}
        since += piece.duration
        times += [*sorted(t for t in inside if times[-1] + 1e-9 < t < since - 1e-9), since]
    q, v, _ = trajectory.evaluate(np.array(times))
    return {"times": times, "positions": np.array(q).tolist(), "velocities": np.array(v).tolist()}


def main():
    """Answer one question."""
    asked = question()
    model = world(asked)
    data = mujoco.MjData(model)
    settings, limits = asked["settings"], (np.array(asked["lower"]), np.array(asked["upper"]))
    arm = Arm(model, asked["joints"], "end", joint_limits=limits)
    data.qpos[arm._qpos] = asked["start"]
    mujoco.mj_forward(model, data)
    config = CBiRRTConfig(timeout=0.8 * asked["budget"], edge_resolution=float(settings.get("resolution", 0.05)))
    timed = TrajectoryOptions(np.array(asked["velocity"]), np.array(asked["acceleration"]))
    ours = settings.get("timing") == "ours"
    began = time.perf_counter()
    try:
        found = plan(
            model,
            data,
            arm,
            goal=[np.array(goal) for goal in asked["goals"]],
            config=config,
            seed=asked["seed"],
            trajectory=None if ours else timed,
            clearance=float(settings.get("clearance", 0.0)),
        )
    except Exception as error:  # its PlanningError and others: the reason, in its own words
        refuse(f"{type(error).__name__}: {error}")
    seconds = time.perf_counter() - began
    if not found.success:
        refuse(found.failure_reason)
    if ours:
        return answer(waypoints=np.array(found.path).tolist(), seconds=seconds)
    return answer(samples=samples(found.trajectory), seconds=seconds)


main()
