"""The symbolic twin of a robot: its kinematics and dynamics as CasADi functions, to be mapped and differentiated."""

from collections.abc import Callable
from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.errors import UnknownChoiceError
from optiplan.kinematics.symbolic import tree as expressions
from optiplan.kinematics.symbolic.compiled import compiled, load_casadi
from optiplan.records import dataclass
from optiplan.robot.mimic_joints import Unfolded, unfold

REFERENCES = ("local_world_aligned", "local")
ALL_ROWS = (0, 1, 2, 3, 4, 5)

SINGULAR = 1e-30
"""Of det(J J^T), below which it counts as this much."""


@dataclass(frozen=True, eq=False)
class SymbolicRobot:
    """CasADi functions of a pinocchio model with revolute, continuous, prismatic and planar joints, and with mimics.

    Each is built when it is first asked for, and equals pinocchio's to rounding. Inputs are a configuration q (nq,), a
    velocity v (nv,) and an acceleration a (nv,), in pinocchio's order and in rad, m and s. `function.map(N)` takes
    matrices of N columns; `function.jacobian()` and `casadi.jacobian` of a call differentiate. A derivative with
    respect to q is one with respect to the nq numbers; times `tangent()` it is pinocchio's, with respect to nv.

    Attributes:
        model: never changed; nothing is attached to it.
        machine_code: compile the functions, and keep them for the next time, if there is a C compiler.

    Raises:
        ValueError: the model has a joint of another type.
    """

    model: pin.Model
    machine_code: bool = True
    _made: dict[tuple[str, ...], Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        self._tree  # noqa: B018 — reports an unsupported joint at once

    def pose(self, frame: str) -> Any:
        """Pose of a frame: q -> X_WF (4, 4), homogeneous."""
        return self._function("pose", frame, "q", lambda q: _homogeneous(*self.frame_expression(q, frame)))

    def jacobian(self, frame: str, reference: str = "local_world_aligned") -> Any:
        """Jacobian of a frame: q -> J (6, nv), linear rows (m) first; J v is the velocity of the frame at its origin.

        Args:
            frame: name of a frame of the model.
            reference: the axes of the velocity: `local_world_aligned` for the world's, `local` for the frame's own.

        Raises:
            UnknownChoiceError: no such frame or reference.
        """
        if reference not in REFERENCES:
            raise UnknownChoiceError("reference", reference, list(REFERENCES))
        local = reference == "local"
        return self._function(f"jacobian_{reference}", frame, "q", lambda q: self.jacobian_expression(q, frame, local))

    def centre_of_mass(self) -> Any:
        """Centre of mass of all that moves with a joint: q -> p_WC (3,), m."""
        return self._function(
            "centre_of_mass", None, "q", lambda q: expressions.centre_of_mass(self._tree, self._poses(q))
        )

    def rnea(self) -> Any:
        """Inverse dynamics: (q, v, a) -> tau (nv,) = M(q) a + C(q, v) v + g(q), N m or N."""
        gravity = np.array(self.model.gravity.linear)
        return self._function("rnea", None, "qva", lambda q, v, a: self.torque_expression(q, v, a, gravity))

    def mass_matrix(self) -> Any:
        """Mass matrix: q -> M (nv, nv) = d tau / d a of the inverse dynamics, kg m², kg m or kg."""

        def build(q: Any) -> Any:
            casadi = load_casadi()
            a = casadi.SX.sym("a", self.model.nv)
            tau = self.torque_expression(q, casadi.SX.zeros(self.model.nv), a, np.zeros(3))
            return casadi.densify(casadi.jacobian(tau, a))

        return self._function("mass_matrix", None, "q", build)

    def manipulability(self, frame: str, rows: tuple[int, ...] = ALL_ROWS) -> Any:
        """Yoshikawa's measure: q -> w = sqrt(det(J J^T)), or sqrt(det(J^T J)) where J has fewer columns than rows.

        J holds the `rows` of the Jacobian in the world's axes (0 to 2 linear, m; 3 to 5 angular, rad). Not
        differentiable where w = 0. Source: Yoshikawa, "Manipulability of robotic mechanisms", IJRR 1985.
        """
        label = "manipulability_" + "".join(str(row) for row in rows)
        return self._function(label, frame, "q", lambda q: self.manipulability_expression(q, frame, rows))

    def manipulability_expression(self, q: Any, frame: str, rows: tuple[int, ...] = ALL_ROWS) -> Any:
        """Return Yoshikawa's measure at a symbolic configuration."""
        J = self.jacobian_expression(q, frame)[list(rows), :]
        gram = J @ J.T if J.shape[0] <= J.shape[1] else J.T @ J
        # Rounding may leave a singular determinant below zero, where the root is no number; at zero its slope is none.
        return load_casadi().sqrt(load_casadi().fmax(expressions.determinant(gram), SINGULAR))

    def tangent(self) -> Any:
        """Rate of the configuration: q -> G (nq, nv) with dq/dt = G(q) v (angles may be kept as cos, sin)."""

        def build(q: Any) -> Any:
            if self._follows:  # every joint of such a model has one degree of freedom
                return load_casadi().SX(np.eye(self.model.nv))
            return load_casadi().densify(expressions.tangent(self._tree, q, self.model.nv))

        return self._function("tangent", None, "q", build)

    @cached_property
    def _plain(self) -> Unfolded:
        return unfold(self.model)

    @property
    def _follows(self) -> bool:
        return self._plain.model is not self.model

    @cached_property
    def _tree(self) -> tuple[expressions.Joint, ...]:
        return expressions.read_tree(self._plain.model)

    @cached_property
    def _content(self) -> list[bytes]:
        """All numbers of the model that a function may depend on."""
        numbers = [np.array(self.model.gravity.linear).tobytes()]
        if self._follows:
            numbers += [self._plain.A.tobytes(), self._plain.b.tobytes()]
        for joint in self._tree:
            places = (joint.kind, joint.parent, joint.q, joint.v, joint.mass)
            arrays = (joint.R, joint.p, joint.screws, joint.lever, joint.inertia, joint.armature)
            numbers += [repr(places).encode(), *(np.ascontiguousarray(array).tobytes() for array in arrays)]
        return numbers

    def _function(self, name: str, frame: str | None, inputs: str, build: Callable[..., Any]) -> Any:
        """Return the function of some of q, v, a whose value `build` makes of their symbols."""
        key = (name, frame or "")
        if key not in self._made:
            parts = [*self._content] if frame is None else [*self._content, _frame_bytes(self._find(frame))]

            def make() -> Any:
                casadi, sizes = load_casadi(), {"q": self.model.nq, "v": self.model.nv, "a": self.model.nv}
                symbols = [casadi.SX.sym(letter, sizes[letter]) for letter in inputs]
                return casadi.Function(name, symbols, [build(*symbols)], list(inputs), ["value"], {"cse": True})

            self._made[key] = compiled(name, parts, make) if self.machine_code else make()
        return self._made[key]

    def _find(self, frame: str) -> pin.Frame:
        model = self._plain.model
        if not model.existFrame(frame):
            raise UnknownChoiceError("frame", frame, [item.name for item in model.frames])
        return model.frames[model.getFrameId(frame)]

    def _poses(self, q: Any) -> list[expressions.Placement]:
        """Return X_WJ of the world and of all joints, followers included, at positions A q + b."""
        positions = self._plain.A @ q + self._plain.b if self._follows else q
        return expressions.world_poses(self._tree, positions)

    def torque_expression(self, q: Any, v: Any, a: Any, gravity: Array) -> Any:
        """Return A^T tau(A q + b, A v, A a) of all joints: the generalised forces of the planned ones."""
        if not self._follows:
            return expressions.symbolic_inverse_dynamics(self._tree, q, v, a, gravity)
        A, b = self._plain.A, self._plain.b
        return A.T @ expressions.symbolic_inverse_dynamics(self._tree, A @ q + b, A @ v, A @ a, gravity)

    def wrench_expression(self, q: Any, v: Any, a: Any, gravity: Array) -> Any:
        """Return the wrench [F; M] (6,) that moves what the joints carry, about the world's origin, in world axes."""
        A, b = self._plain.A, self._plain.b
        joints = (A @ q + b, A @ v, A @ a) if self._follows else (q, v, a)
        return expressions.symbolic_forces(self._tree, *joints, gravity)[1]

    def frame_expression(self, q: Any, frame: str) -> tuple[Any, Any]:
        """Return R_WF (3, 3) and p_WF (3,), m, at a symbolic configuration."""
        return expressions.symbolic_frame_pose(self._poses(q), self._find(frame))

    def jacobian_expression(self, q: Any, frame: str, local: bool = False) -> Any:
        """Return J (6, nv), linear rows first, in the world's axes or the frame's own."""
        poses = self._poses(q)
        R, p = expressions.symbolic_frame_pose(poses, self._find(frame))
        J = expressions.frame_jacobian(self._tree, poses, int(self._find(frame).parentJoint), p)
        if self._follows:
            J = J @ self._plain.A
        casadi = load_casadi()
        return casadi.densify(casadi.vertcat(R.T @ J[:3, :], R.T @ J[3:, :]) if local else J)


def _homogeneous(R: Any, p: Any) -> Any:
    casadi = load_casadi()
    return casadi.densify(casadi.vertcat(casadi.horzcat(R, p), casadi.SX([[0.0, 0.0, 0.0, 1.0]])))


def _frame_bytes(frame: pin.Frame) -> bytes:
    return repr(int(frame.parentJoint)).encode() + np.ascontiguousarray(frame.placement.homogeneous).tobytes()
