"""The wheels of a mecanum base in MuJoCo: free rollers on a floor, driven at their rates."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import wrong_argument
from optiplan.kinematics.mecanum import WHEELS, Mecanum, wheel_matrix
from optiplan.robot.robot import Robot
from optiplan.simulation.log import WheelLog

ROLLERS = 12
"""Of each wheel."""

ROLLER_RADIUS = 7.0 / 30.0
"""Share of the wheel's radius."""

WHEEL_MASS, ROLLER_MASS = 0.1, 0.005
"""kg; they add to the mass of the base."""

FRICTION = "1.0 1.0 0.001 0.0001 0.0001"
"""Of rubber on a floor."""

FLOOR = "floor of the wheels"
"""Name of its geom; geoms of the wheels have no `SEPARATOR`, and their contacts are not reported."""

HANDS = {"front_left": -1.0, "front_right": 1.0, "rear_left": 1.0, "rear_right": -1.0}
"""Direction (1, hand, 0) of the axis of the roller that stands on the floor, in the base."""

STIFFNESS, POSE_GAIN = 0.5, 10.0
"""N·m·s/rad of the control of the wheels' rates; 1/s of the feedback of the base's pose."""


class MecanumWheels:
    """Four wheels with free rollers, which carry the base and move it; nothing else holds its joints.

    The base can heave, pitch and roll on its wheels. With q and v of the base's joints and M its `wheel_matrix`, wheels
    have the torque

        tau = M (M^T M)^-1 F + k (M (v_ref + g (q_ref - q)) - w),

    F the force that the controller wants of the base, w the measured rates. A roller is an ellipsoid whose outline is
    the wheel's circle to the second order: half length L = sqrt(2 d r), with r its radius and d the distance of axes.
    """

    def __init__(self, robot: Robot) -> None:
        """Prepare the wheels of a robot.

        Raises:
            InputError: its planned joints have no mecanum base.
        """
        if robot.mecanum is None:
            found = f"the robot '{robot.name}', whose planned joints have no mecanum base"
            raise wrong_argument("execute", "wheels", found, "a robot with `mecanum`, such as delbot, or wheels=False")
        self._robot, self._spec = robot, robot.mecanum
        self._base = np.array([robot.joint_names.index(name) for name in robot.mecanum.joints])
        self._aim: tuple[Array, Array] | None = None

    @property
    def turning(self) -> str:
        """Name of the joint that turns the base."""
        return self._spec.joints[2]

    def add(self, world: ET.Element, base: ET.Element, contact: ET.Element) -> None:
        """Add wheels to the body of the base, a floor to the world, and their contacts."""
        spec = self._spec
        for name, kind, axis in (("heave", "slide", "0 0 1"), ("pitch", "hinge", "0 1 0"), ("roll", "hinge", "1 0 0")):
            ET.SubElement(base, "joint", name=f"base {name}", type=kind, axis=axis, limited="false")
        apart = {"contype": "0", "conaffinity": "0"}
        ET.SubElement(world, "geom", {"name": FLOOR, "type": "plane", "size": "100 100 1", **apart})
        r = ROLLER_RADIUS * spec.radius
        d = spec.radius - r
        for wheel in WHEELS:
            front, left = 1.0 if "front" in wheel else -1.0, 1.0 if "left" in wheel else -1.0
            place = f"{front * spec.half_wheelbase} {left * spec.half_track} {spec.radius}"
            hub = ET.SubElement(base, "body", name=f"wheel {wheel}", pos=place)
            joint = ET.SubElement(hub, "joint", name=f"wheel {wheel}", type="hinge", axis="0 1 0", limited="false")
            joint.set("damping", repr(STIFFNESS))  # the part -k w of the torque, which MuJoCo integrates implicitly
            _add_inertia(hub, WHEEL_MASS, 0.5 * WHEEL_MASS * spec.radius**2)
            for k in range(ROLLERS):
                s, c = np.sin(2.0 * np.pi * k / ROLLERS), np.cos(2.0 * np.pi * k / ROLLERS)
                name = f"{wheel} {k}"
                roller = ET.SubElement(hub, "body", name=f"roller {name}", pos=f"{-d * s} 0 {-d * c}")
                axis = f"{c} {HANDS[wheel]} {-s}"
                ET.SubElement(roller, "joint", name=f"roller {name}", type="hinge", axis=axis, limited="false")
                _add_inertia(roller, ROLLER_MASS, 0.5 * ROLLER_MASS * r**2)
                shape = {"type": "ellipsoid", "size": f"{r} {r} {np.sqrt(2.0 * d * r)}", "zaxis": axis}
                ET.SubElement(roller, "geom", {"name": f"roller {name}", **shape, **apart})
                pair = {"geom1": FLOOR, "geom2": f"roller {name}", "condim": "3", "friction": FRICTION}
                hard = {"solref": "0.002 1", "solreffriction": "0.0005 1", "solimp": "0.99 0.999 0.001 0.5 2"}
                ET.SubElement(contact, "pair", {**pair, **hard})

    def start(self, model: Any, q: Array, v: Array, data: Any) -> None:
        """Take the model; the wheels begin at the rates of the base's velocity, v (n,) at q (n,)."""
        self._dof = np.array([model.joint(f"wheel {wheel}").dofadr[0] for wheel in WHEELS])
        self._lifted = np.array([model.joint(f"base {name}").qposadr[0] for name in ("heave", "pitch", "roll")])
        data.qvel[self._dof] = self._matrix(q) @ v
        self._odometry = np.array(q[self._base], float)
        self._drift, self._travel, self._lift = np.zeros(3), 0.0, 0.0

    def _matrix(self, q: Array) -> Array:
        matrix = wheel_matrix(self._robot, q)
        assert matrix is not None
        return matrix

    def aim(self, q: Array, v: Array) -> None:
        """Let the next commands follow q and v (n,), rad or m and per second."""
        self._aim = q, v

    def drive(self, q: Array, applied: Array, data: Any) -> Array:
        """Give the wheels their torques, and return what acts on the joints (n,): none on those of the base."""
        M = self._matrix(q)[:, self._base]
        torque = M @ np.linalg.solve(M.T @ M, applied[self._base])
        if self._aim is not None:
            wanted, rate = (part[self._base] for part in self._aim)
            torque += STIFFNESS * (M @ (rate + POSE_GAIN * (wanted - q[self._base])))
        data.qfrc_applied[self._dof] = torque
        rest = np.array(applied)
        rest[self._base] = 0.0
        return rest

    def note(self, q: Array, dt: float, data: Any) -> None:
        """Follow the base by its wheels' rates alone, over the last `dt`, s, at whose end the joints are at q (n,)."""
        spec = self._spec
        twist = Mecanum(spec.radius, spec.half_wheelbase, spec.half_track).base_twist(data.qvel[self._dof])
        heading = self._odometry[2] + 0.5 * dt * twist[2]
        c, s = np.cos(heading), np.sin(heading)
        step = dt * np.array([c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], twist[2]])
        self._odometry = self._odometry + step
        self._travel += float(np.hypot(step[0], step[1]))
        self._drift = np.array(self._odometry - q[self._base])
        self._lift = max(self._lift, float(np.abs(data.qpos[self._lifted[0]])))

    def log(self) -> WheelLog:
        """Return what the wheels did."""
        return WheelLog(float(np.hypot(*self._drift[:2])), float(self._drift[2]), self._travel, self._lift)


def _add_inertia(body: ET.Element, mass: float, moment: float) -> None:
    ET.SubElement(body, "inertial", pos="0 0 0", mass=repr(mass), diaginertia=f"{moment} {moment} {moment}")
