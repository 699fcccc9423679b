"""Forward kinematics of many configurations at once, in NumPy: link poses and joint axes."""

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array


class BatchKinematics:
    """Poses of all joints of a model with one degree of freedom a joint (revolute or prismatic), over N configurations.

    With X_PJ the fixed placement of a joint in its parent and [S] its unit screw,
    X_WJ(q) = X_WP(q) X_PJ exp([S] q).
    """

    def __init__(self, model: pin.Model) -> None:
        data = model.createData()
        J = pin.computeJointJacobians(model, data, pin.neutral(model)).reshape(6, -1)  # of one joint it is (6,)
        self._parents = [int(p) for p in model.parents]
        self._placements = [np.array(M.homogeneous) for M in model.jointPlacements]
        self._columns = [joint.idx_v for joint in model.joints]
        # A column of the Jacobian is the joint's screw seen from the world; seen from the joint it is constant.
        self._screws = [np.zeros(6)] + [
            data.oMi[j].actInv(pin.Motion(J[:, model.joints[j].idx_v])).vector for j in range(1, model.njoints)
        ]
        self.revolute: Array = np.zeros(model.nv)
        for j in range(1, model.njoints):
            self.revolute[self._columns[j]] = float(np.linalg.norm(self._screws[j][3:]) > 0.5)

    def poses(self, Q: Array) -> Array:
        """X_WJ of every joint (0 is the world) at configurations Q (N, n): array (N, n + 1, 4, 4)."""
        result = np.empty((len(Q), len(self._parents), 4, 4))
        result[:, 0] = np.eye(4)
        for j in range(1, len(self._parents)):
            fixed = result[:, self._parents[j]] @ self._placements[j]
            result[:, j] = fixed @ _screw_motion(self._screws[j], Q[:, self._columns[j]])
        return result

    def axes(self, poses: Array) -> tuple[Array, Array]:
        """Axis direction and a point on it, in the world, of each planned joint: two arrays (N, n, 3)."""
        direction = np.empty((len(poses), len(self._parents) - 1, 3))
        point = np.empty_like(direction)
        for j in range(1, len(self._parents)):
            screw, column = self._screws[j], self._columns[j]
            axis = screw[3:] if self.revolute[column] else screw[:3]
            direction[:, column] = poses[:, j, :3, :3] @ axis
            point[:, column] = poses[:, j, :3, 3]
        return direction, point

    def levers(self, joint: int, points: Array, stroke: Array) -> Array:
        """Bounds, m, on the distances of points (K, 3) fixed to a joint from the axes of all joints: (n,).

        Holds at: every configuration with |q_j| <= stroke_j; `stroke` (n,) matters for prismatic joints only, m. Seen
        from the frame of a joint, what the next joint carries stays within a ball about that joint's origin, which
        is fixed there. A prismatic joint has lever 1 (m of travel a m); one that does not carry the points has 0.
        """
        result = np.zeros(len(stroke))
        ball = 0.0
        while joint > 0:
            column = self._columns[joint]
            if self.revolute[column]:
                result[column] = np.linalg.norm(np.cross(points, self._screws[joint][3:]), axis=1).max() + ball
            else:
                result[column] = 1.0
                ball += float(stroke[column])
            ball += float(np.linalg.norm(points, axis=1).max())
            points = self._placements[joint][None, :3, 3]
            joint = self._parents[joint]
        return result


def _screw_motion(screw: Array, q: Array) -> Array:
    """exp([S] q) for a unit rotation about, or a unit translation along, an axis through the origin: (N, 4, 4)."""
    linear, angular = screw[:3], screw[3:]
    motion = np.zeros((len(q), 4, 4))
    motion[:, 3, 3] = 1.0
    skew = np.array([[0.0, -angular[2], angular[1]], [angular[2], 0.0, -angular[0]], [-angular[1], angular[0], 0.0]])
    sine, versine = np.sin(q)[:, None, None], (1.0 - np.cos(q))[:, None, None]
    motion[:, :3, :3] = np.eye(3) + sine * skew + versine * (skew @ skew)
    motion[:, :3, 3] = q[:, None] * linear
    return motion
