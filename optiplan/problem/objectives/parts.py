"""What a motion costs by each part of an objective, from the motion itself."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array, Flags
from optiplan.collision.model import CollisionModel
from optiplan.geometry.scene import Scene
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.problem.objectives.objective import PLAIN, Objective
from optiplan.robot.batched.dynamics import inverse_dynamics
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.quadrature import gauss_points
from optiplan.trajectory.trajectory import States, Trajectory

CLEAR = 0.1
"""m: two bodies that are farther apart cost nothing."""

SINGULAR = 1e-3
"""Added to the manipulability, so that a singular configuration has a finite cost."""


class ObjectiveParts:
    """Parts of the objective of one problem; data that depend only on the problem are built once.

    Integrals are sums over `gauss_points`; the duration and squared jerk are exact.
    """

    def __init__(self, robot: Robot, scene: Scene, objective: Objective) -> None:
        self.objective, self._robot = objective, robot
        wanted = objective.weights.keys() - PLAIN
        if not wanted:
            self._rates: dict[str, Callable[[States], Array]] = {}
            return
        self._data, self._tool = robot.model.createData(), ToolKinematics(robot)
        self._model = CollisionModel(robot, scene) if "clearance" in wanted else None
        rates: dict[str, Callable[[States], Array]] = {
            "energy": self._energy,
            "joint_path": lambda states: np.linalg.norm(states.v, axis=1),
            "tool_path": self._tool_speed,
            "tool_smoothness": self._tool_acceleration,
            "clearance": self._nearness,
            "manipulability": self._singularity,
            "centring": self._off_centre,
        }
        self._rates = {name: rates[name] for name in objective.weights if name in wanted}

    def values(self, trajectory: Trajectory) -> dict[str, float]:
        """Return what each part with a weight comes to, unweighted, in its unit (`objective.UNITS`)."""
        found: dict[str, float] = {}
        if self.objective.time:
            found["time"] = trajectory.duration
        if self.objective.jerk:
            found["jerk"] = trajectory.squared_jerk()
        if self._rates:
            t, weights = gauss_points(trajectory)
            states = States(trajectory(t), trajectory(t, 1), trajectory(t, 2))
            found |= {name: float(weights @ rate(states)) for name, rate in self._rates.items()}
        return found

    def cost(self, trajectory: Trajectory) -> float:
        """Return the weighted sum, s."""
        if not self._rates:
            return self.objective.cost(trajectory)
        weights = self.objective.weights
        return float(sum(weights[name] * value for name, value in self.values(trajectory).items()))

    def _energy(self, states: States) -> Array:
        return np.asarray((inverse_dynamics(self._robot, *states) ** 2).sum(axis=1))

    def _tool_speed(self, states: States) -> Array:
        J = self._tool.evaluate(states.q)[1]
        return np.asarray(np.linalg.norm(np.einsum("kij,kj->ki", J[:, :3], states.v), axis=1))

    def _tool_acceleration(self, states: States) -> Array:
        model, data = self._robot.model, self._data
        frame, found = self._robot.frame_id(self._robot.tool_frame), np.empty(len(states.q))
        for k, state in enumerate(zip(*states, strict=True)):
            pin.forwardKinematics(model, data, *state)
            pin.updateFramePlacement(model, data, frame)
            linear = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
            found[k] = linear @ linear
        return found

    def _nearness(self, states: States) -> Array:
        found = np.full(len(states.q), CLEAR)
        if self._model is not None:
            near = self._model.near(states.q, CLEAR)
            outside = of_obstacles(self._model)[near.pairs]
            np.minimum.at(found, near.rows[outside], near.distance[outside])
        return CLEAR - found

    def _singularity(self, states: States) -> Array:
        J = self._tool.evaluate(states.q)[1]
        return np.asarray(1.0 / (SINGULAR + np.prod(np.linalg.svd(J, compute_uv=False), axis=1)))

    def _off_centre(self, states: States) -> Array:
        limits = self._robot.limits
        limited = has_range(limits)
        low, high = limits.lower[limited], limits.upper[limited]
        share = (states.q[:, limited] - 0.5 * (low + high)) / (0.5 * (high - low))
        return np.asarray((share**2).sum(axis=1))


def has_range(limits: Limits) -> Flags:
    """Return which joints (n,) have a middle to be off: two finite limits of position that differ."""
    return np.isfinite(limits.lower) & np.isfinite(limits.upper) & (limits.lower < limits.upper)


def of_obstacles(model: CollisionModel) -> Flags:
    """Return which pairs (P,) of a model are of an obstacle: neighbouring links are always near each other."""
    obstacles = {body.name for body in model.scene.obstacles}
    return np.array([pair.name_a in obstacles or pair.name_b in obstacles for pair in model.pairs], dtype=bool)
