"""pin-pink and mink following a tool path: their differential inverse kinematics, one step a tick.

Needs: pip install pin-pink==4.4.0 mink==1.3.0 daqp==0.11.0. `benchmarks/execution_rivals.py` asks: poses of `frame` and
postures, one a tick of `dt`. Tasks: a FrameTask at the pose of the next tick, gain 1, and a PostureTask at its posture,
with a hundredth of its cost. Limits: position and velocity; with pink's limit of acceleration its program often has no
solution here, and the tool leaves the path by decimetres. Both solve by DAQP. The answer holds positions and seconds of
every tick.
"""

import time
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
from common import answer, locked_urdf, question

COST = 1e-2  # of the posture, beside the frame's 1


def with_pink(asked):
    """A function of pose and posture that returns the next positions."""
    import pink
    from pink.limits import ConfigurationLimit, VelocityLimit

    model = pin.buildModelFromXML(locked_urdf(asked))
    order = [model.joints[model.getJointId(name)].idx_v for name in asked["joints"]]
    model.lowerPositionLimit[order], model.upperPositionLimit[order] = asked["lower"], asked["upper"]
    model.velocityLimit[order] = asked["velocity"]
    start = pin.neutral(model)
    start[order] = asked["postures"][0]
    configuration = pink.Configuration(model, model.createData(), start)
    tool, posture = pink.tasks.FrameTask(asked["frame"], 1.0, 1.0), pink.tasks.PostureTask(COST)
    limits, dt = [ConfigurationLimit(model), VelocityLimit(model)], asked["dt"]

    def step(X, q):
        tool.set_target(pin.SE3(X))
        target = start.copy()
        target[order] = q
        posture.set_target(target)
        v = pink.solve_ik(configuration, [tool, posture], dt, "daqp", limits=limits, safety_break=False)
        configuration.integrate_inplace(v, dt)
        return configuration.q[order]

    return step


def with_mink(asked):
    """The same by mink, for whose MuJoCo the URDF has no meshes."""
    import mink
    import mujoco

    root = ET.fromstring(locked_urdf(asked))
    for link in root.findall("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            link.remove(part)
    text = ET.tostring(root, encoding="unicode")
    extra = '<mujoco><compiler fusestatic="false" balanceinertia="true"/></mujoco></robot>'
    model = mujoco.MjSpec.from_string(text.replace("</robot>", extra)).compile()
    order = [int(model.jnt_qposadr[model.joint(name).id]) for name in asked["joints"]]
    for name, low, high in zip(asked["joints"], asked["lower"], asked["upper"], strict=True):
        model.jnt_range[model.joint(name).id] = low, high
    start = np.zeros(model.nq)
    start[order] = asked["postures"][0]
    configuration = mink.Configuration(model, start)
    tool, posture = mink.FrameTask(asked["frame"], "body", 1.0, 1.0), mink.PostureTask(model, COST)
    velocities = {name: np.array([most]) for name, most in zip(asked["joints"], asked["velocity"], strict=True)}
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocities)]

    def step(X, q):
        tool.set_target(mink.SE3.from_matrix(X))
        target = start.copy()
        target[order] = q
        posture.set_target(target)
        v = mink.solve_ik(configuration, [tool, posture], asked["dt"], "daqp", limits=limits)
        configuration.integrate_inplace(v, asked["dt"])
        return configuration.q[order]

    return step


def main():
    """Follow."""
    asked = question()
    step = {"pink": with_pink, "mink": with_mink}[asked["library"]](asked)
    found, seconds = [asked["postures"][0]], [0.0]
    for X, q in zip(asked["poses"][1:], asked["postures"][1:], strict=True):
        began = time.thread_time()
        found.append(step(np.array(X), np.array(q)).tolist())
        seconds.append(time.thread_time() - began)
    answer(q=found, seconds=seconds)


if __name__ == "__main__":
    main()
