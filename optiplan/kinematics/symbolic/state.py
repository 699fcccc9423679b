"""A robot at one instant, as CasADi expressions: what terms of the optimiser and users' own expressions are made of."""

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import UnknownChoiceError
from optiplan.kinematics.symbolic.compiled import as_machine_code, load_casadi
from optiplan.kinematics.symbolic.functions import ALL_ROWS, SymbolicRobot
from optiplan.records import dataclass
from optiplan.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class SymbolicPose:
    """Pose of a frame: rotation `R` (3, 3) and position `p` (3,), m."""

    R: Any
    p: Any


@dataclass(frozen=True, eq=False)
class SymbolicMotion:
    """Rate of a frame's pose in the world's axes: `linear` (3,) of its origin, `angular` (3,)."""

    linear: Any
    angular: Any


class SymbolicState:
    """Configuration, velocity and acceleration of a robot at one instant, and what follows from them.

    All results are CasADi expressions (SX): `casadi.fmax`, `@`, indices and the like apply to them.

    Attributes:
        q: (n,) rad or m.
        v: (n,) rad/s or m/s.
        a: (n,) rad/s² or m/s².
    """

    def __init__(self, robot: Robot) -> None:
        casadi = load_casadi()
        self.robot, self._twin = robot, SymbolicRobot(robot.model, machine_code=False)
        self.q, self.v, self.a = (casadi.SX.sym(name, robot.n) for name in "qva")
        self.constants: list[tuple[Any, Array]] = []

    def joint(self, name: str) -> Any:
        """Return the position of a joint by name, rad or m.

        Raises:
            UnknownChoiceError: there is no such planned joint.
        """
        names = list(self.robot.joint_names)
        if name not in names:
            raise UnknownChoiceError("joint", name, names)
        return self.q[names.index(name)]

    def pose(self, frame: str) -> SymbolicPose:
        """Return the pose of a frame in the world; `tool` is the robot's tool frame."""
        return SymbolicPose(*self._twin.frame_expression(self.q, self._named(frame)))

    def relative_pose(self, frame: str, to: str) -> SymbolicPose:
        """Return the pose of a frame in the frame `to`."""
        own, other = self.pose(frame), self.pose(to)
        return SymbolicPose(other.R.T @ own.R, other.R.T @ (own.p - other.p))

    def twist(self, frame: str) -> SymbolicMotion:
        """Return the velocity of a frame's origin, m/s, and its angular velocity, rad/s."""
        return self._split(self._twist(frame))

    def acceleration(self, frame: str) -> SymbolicMotion:
        """Return the acceleration of a frame's origin, m/s², and its angular acceleration, rad/s²."""
        rate = load_casadi().jtimes(self._twist(frame), self.q, self.v)
        return self._split(self._twin.jacobian_expression(self.q, self._named(frame)) @ self.a + rate)

    def torque(self, *, at_rest: bool = False) -> Any:
        """Return the torques of the joints (n,), N m or N, by inverse dynamics with all masses carried.

        With `at_rest` those that hold the robot still.
        """
        gravity, still = np.array(self.robot.model.gravity.linear), load_casadi().SX.zeros(self.robot.n)
        v, a = (still, still) if at_rest else (self.v, self.a)
        return self._twin.torque_expression(self.q, v, a, gravity)

    def base_wrench(self) -> Any:
        """Return the wrench [F; M] (6,) of the ground on the base about the world's origin, in world axes, N, N·m."""
        gravity, fixed = np.array(self.robot.model.gravity.linear), self.robot.model.inertias[0]
        weight = -fixed.mass * gravity
        still = np.concatenate([weight, np.cross(np.array(fixed.lever), weight)])
        return self._twin.wrench_expression(self.q, self.v, self.a, gravity) + still

    def manipulability(self, frame: str, rows: tuple[int, ...] = ALL_ROWS) -> Any:
        """Return Yoshikawa's measure of a frame's Jacobian; `rows` as of `SymbolicRobot.manipulability`."""
        return self._twin.manipulability_expression(self.q, self._named(frame), rows)

    def constant(self, value: Any) -> Any:
        """Return a number, (k,) or (k, l) as an expression whose values are no part of the compiled function."""
        array = np.asarray(value, float)
        symbol = load_casadi().SX.sym(f"p{len(self.constants)}", *array.shape)
        self.constants.append((symbol, array))
        return symbol

    def sin(self, x: Any) -> Any:
        """Return the sine of an expression, rad."""
        return load_casadi().sin(x)

    def cos(self, x: Any) -> Any:
        """Return the cosine of an expression, rad."""
        return load_casadi().cos(x)

    def atan2(self, y: Any, x: Any) -> Any:
        """Return the angle of the point (x, y), rad."""
        return load_casadi().atan2(y, x)

    def norm(self, x: Any) -> Any:
        """Return the length of a vector (k,); it has no derivative at 0."""
        return load_casadi().norm_2(x)

    def _named(self, frame: str) -> str:
        return self.robot.tool_frame if frame == "tool" else frame

    def _twist(self, frame: str) -> Any:
        return self._twin.jacobian_expression(self.q, self._named(frame)) @ self.v

    @staticmethod
    def _split(twist: Any) -> SymbolicMotion:
        return SymbolicMotion(twist[:3], twist[3:])


class BatchedExpression:
    """Values of an expression (m,) of the state and their exact derivatives, for many states in one call.

    Compiled and cached where a compiler is found, and CasADi's virtual machine otherwise; both give the same bits.

    Attributes:
        size: m.
        content: all that the expression states, constants included, as text.
        orders: which of q, v, a it depends on: 0, 1, 2.
    """

    def __init__(self, robot: Robot, name: str, build: Callable[[SymbolicState], Any], *, smooth: bool = False) -> None:
        """Build the expression; with `smooth`, one that steps is refused.

        Raises:
            ValueError: it steps: it rounds, compares or takes a sign.
        """
        casadi = load_casadi()
        state = SymbolicState(robot)
        value = casadi.vec(casadi.densify(casadi.SX(build(state))))
        if smooth:
            _require_no_steps(value, [state.q, state.v, state.a])
        parts = (state.q, state.v, state.a)
        self.size = int(value.shape[0])
        self.orders = tuple(
            order for order, part in enumerate(parts) if any(casadi.which_depends(value, part, 1, True))
        )
        slopes = [casadi.densify(casadi.jacobian(value, parts[order])) for order in self.orders]
        constants = casadi.vertcat(*(casadi.vec(symbol) for symbol, _ in state.constants))
        self._constants = np.concatenate([np.zeros(0), *(array.ravel(order="F") for _, array in state.constants)])
        inputs = [*(parts[order] for order in self.orders), constants]
        function = casadi.Function(name, inputs, [value, *slopes], {"cse": True})
        self.content = function.serialize() + repr(self._constants.tolist())
        self._function, self._n = as_machine_code(function), robot.n
        self._calls: dict[int, Any] = {}
        self._of_thread = threading.local()

    def __call__(self, motion: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Return values (N, m), and derivatives (N, m, n) by q, v and a, of states (N, n) of each."""
        count = len(motion[0])
        if not count:
            return np.zeros((0, self.size)), [np.zeros((0, self.size, self._n))] * 3
        if count == 1:
            return self._of_one(motion)
        if (function := self._calls.get(count)) is None:
            function = self._calls[count] = self._function.map(count)
        buffer, call = function.buffer()
        given = [np.ascontiguousarray(motion[order], float) for order in self.orders]
        given.append(np.tile(self._constants, count))
        found = [np.zeros((count, self.size)), *(np.zeros((count, self._n, self.size)) for _ in self.orders)]
        for k, array in enumerate(given):
            buffer.set_arg(k, memoryview(array.data))
        for k, array in enumerate(found):
            buffer.set_res(k, memoryview(array.data))
        call()
        slopes: list[Array] = [np.zeros((count, self.size, self._n)) for _ in range(3)]
        for order, slope in zip(self.orders, found[1:], strict=True):
            slopes[order] = slope.transpose(0, 2, 1)
        return found[0], slopes

    def _of_one(self, motion: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Return the same of one state, which planners ask a hundred thousand times: nothing is bound anew."""
        call: _SingleCall | None = getattr(self._of_thread, "call", None)
        if call is None:
            call = self._of_thread.call = _SingleCall(self._function, self._constants, len(self.orders), self._n)
        value, found = call([motion[order] for order in self.orders])
        slopes: list[Array] = [np.zeros((1, self.size, self._n)) for _ in range(3)]
        for order, slope in zip(self.orders, found, strict=True):
            slopes[order] = slope.transpose(0, 2, 1)
        return value, slopes


class _SingleCall:
    """A function of one state, bound to arrays of its own: for one thread at a time."""

    def __init__(self, function: Any, constants: Array, parts: int, n: int) -> None:
        buffer, self._call = function.buffer()
        size = function.size1_out(0)
        self._given = [*(np.zeros((1, n)) for _ in range(parts)), constants.copy()]
        self._found = [np.zeros((1, size)), *(np.zeros((1, n, size)) for _ in range(parts))]
        self._buffer = buffer  # which the arrays are bound to
        for k, array in enumerate(self._given):
            buffer.set_arg(k, memoryview(array.data))
        for k, array in enumerate(self._found):
            buffer.set_res(k, memoryview(array.data))

    def __call__(self, parts: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Return values (1, m), and derivatives (1, n, m) by each part (1, n) of the state."""
        for array, part in zip(self._given, parts, strict=False):  # constants follow
            array[:] = part
        self._call()
        value, *slopes = (array.copy() for array in self._found)
        return value, slopes


def _require_no_steps(value: Any, inputs: list[Any]) -> None:
    casadi = load_casadi()
    steps = {
        casadi.OP_FLOOR: "floor",
        casadi.OP_CEIL: "ceil",
        casadi.OP_SIGN: "sign",
        casadi.OP_LT: "<",
        casadi.OP_LE: "<=",
        casadi.OP_EQ: "==",
        casadi.OP_NE: "!=",
        casadi.OP_FMOD: "fmod",
        casadi.OP_REMAINDER: "remainder",
        casadi.OP_COPYSIGN: "copysign",
        casadi.OP_NOT: "not",
        casadi.OP_AND: "and",
        casadi.OP_OR: "or",
        casadi.OP_IF_ELSE_ZERO: "if_else",
    }
    function = casadi.Function("steps", inputs, [value], {"allow_free": True})
    found = {steps[code] for k in range(function.n_instructions()) if (code := function.instruction_id(k)) in steps}
    if found:
        raise ValueError(f"it is not smooth: it uses {', '.join(sorted(found))}")
