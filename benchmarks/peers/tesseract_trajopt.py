"""Tesseract's TrajOptPipeline with the profile of its examples (`create_trajopt_default_profiles`); our timing.

Needs: pip install tesseract-robotics-nanobind==0.35.0.8, and the C++ library of GCC 13 or newer (GLIBCXX_3.4.31).

From the straight line, links as hulls; distances of 0 as constraint and of 5 mm as cost, along segments of 0.1 rad. It
takes one goal, the first, and does not start again: it has no random part.
"""

import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from common import answer, locked_urdf, question, refuse
from tesseract_robotics.planning import (
    JointTarget,
    MotionProgram,
    Pose,
    Robot,
    TaskComposer,
    box,
    create_obstacle,
    cylinder,
    sphere,
)
from tesseract_robotics.planning.profiles import create_trajopt_default_profiles

PIPELINE = "TrajOptPipeline"
SRDF = """<robot name="{name}"><group name="arm"><chain base_link="{root}" tip_link="{tip}"/></group>
<kinematics_plugin_config filename="{kinematics}"/>
<contact_managers_plugin_config filename="package://tesseract/support/urdf/contact_manager_plugins.yaml"/>
{pairs}</robot>"""
KINEMATICS = """kinematic_plugins:
  search_libraries: [tesseract_kinematics_kdl_factories]
  fwd_kin_plugins: {{arm: {{default: KDL, plugins: {{KDL: {{class: KDLFwdKinChainFactory, config: {ends}}}}}}}}}
  inv_kin_plugins: {{arm: {{default: KDL, plugins: {{KDL: {{class: KDLInvKinChainLMAFactory, config: {ends}}}}}}}}}
"""


def scene_of(asked):
    """The robot in its scene, and the ends of its arm."""
    tree = ET.fromstring(locked_urdf(asked))
    for mesh in tree.iter("mesh"):
        mesh.set("filename", "file://" + mesh.get("filename"))
    below = {joint.get("name"): joint.find("child").get("link") for joint in tree.findall("joint")}
    (root,) = (link.get("name") for link in tree.findall("link") if link.get("name") not in below.values())
    tip = below[asked["joints"][-1]]
    urdf = ET.tostring(tree, encoding="unicode").replace("<robot ", '<robot tesseract:make_convex="true" ', 1)
    pairs = "".join(f'<disable_collisions link1="{a}" link2="{b}" reason=""/>' for a, b in asked["allowed"])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kinematics = folder / "kinematics.yaml"
        kinematics.write_text(KINEMATICS.format(ends=f"{{base_link: {root}, tip_link: {tip}}}"))
        srdf = SRDF.format(name=tree.get("name"), root=root, tip=tip, pairs=pairs, kinematics=f"file://{kinematics}")
        (folder / "robot.urdf").write_text(urdf)
        (folder / "robot.srdf").write_text(srdf)
        robot = Robot.from_files(folder / "robot.urdf", folder / "robot.srdf")
    for body in asked["obstacles"]:
        pose = np.array(body["pose"])
        place = Pose.from_matrix_position(pose[:3, :3], pose[:3, 3])
        if not create_obstacle(robot, body["name"], obstacle(body), place, root):
            refuse(f"obstacle {body['name']} is not taken")
    return robot, root, tip


def obstacle(body):
    """A body of the scene."""
    ((kind, value),) = body["shape"].items()
    if kind == "box":
        return box(*value)
    if kind == "sphere":
        return sphere(value)
    if kind == "cylinder":
        return cylinder(value["radius"], value["length"])
    return refuse(f"a body of kind {kind}")


def main():
    """Answer one question."""
    asked = question()
    robot, root, tip = scene_of(asked)
    composer = TaskComposer.from_config(num_threads=1, warmup=[PIPELINE])
    joints, (start, goal) = asked["joints"], (asked["start"], asked["goals"][0])
    began = time.perf_counter()
    robot.set_joints(start, joints)
    program = MotionProgram("arm", tip, root).set_joint_names(joints)
    program.move_to(JointTarget(start)).move_to(JointTarget(goal))
    result = composer.plan(robot, program, PIPELINE, create_trajopt_default_profiles())
    seconds = time.perf_counter() - began
    if not result.successful:
        refuse(result.message)
    points = [[point.as_dict()[name] for name in joints] for point in result.trajectory]
    answer(waypoints=points, seconds=seconds)


main()
