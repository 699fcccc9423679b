"""`Controller`: each step, the velocities that do the tasks best within the limits, and from which it can stop."""

import time
from collections.abc import Iterable, Mapping, Sequence
from copy import copy

import numpy as np

from optiplan.arrays import Array, number_argument
from optiplan.control.arguments import squares_are_finite
from optiplan.control.configuration import Configuration
from optiplan.control.control_problem import ControlProblem, control_problem
from optiplan.control.controller_arguments import (
    Form,
    all_of,
    check_options,
    check_step,
    followed_motion,
    relaxed_order,
    seen,
)
from optiplan.control.defaults import LONGEST_STEP, ORDER, default_limits
from optiplan.control.limits.base import ControlLimit
from optiplan.control.limits.clearance import ClearanceLimit
from optiplan.control.limits.joint_box import JointBox
from optiplan.control.limits.row_limit import KeptRowLimit, RowLimit
from optiplan.control.limits.stop_limits import StopLimit
from optiplan.control.objective import BASE_DAMPING, TaskObjective
from optiplan.control.qp.program import Program
from optiplan.control.qp.qp_sequence import QpSequence
from optiplan.control.qp.solvers import DEFAULT, NATIVE, ProxQp, QpSolver, make_solver
from optiplan.control.row_stack import RowStack
from optiplan.control.step import ControlStep
from optiplan.control.step_report import StepOutcome, StepReporter
from optiplan.control.stopping_guard import StoppingGuard
from optiplan.control.tasks.base import ControlTask
from optiplan.control.tasks.motion_task import FOLLOW_GAIN, MotionTask
from optiplan.control.tasks.tool_abilities import response_time
from optiplan.errors import wrong_argument
from optiplan.geometry.pose import Pose, Values
from optiplan.geometry.scene import Scene
from optiplan.robot.robot import Robot
from optiplan.trajectory.state import State

ON_MOTION = 1e-3
"""rad/s or m/s: how far the velocity of a motion at its limits may be from what steps allow."""

PLACES = 400
"""Places of a motion at which it is asked how near bodies come to each other on it."""

UNLIMITED = 1.0
"""rad/s or m/s: of a way out of joints without limits."""


class Controller:
    """A robot's tasks and limits as one quadratic program a step, never without an answer.

    With the velocities x (n,) at the end of the step as unknowns, minimise sum |cost (J x - rate)|² + damping² |x|²
    within bounds (position, velocity, acceleration, jerk of each joint) and rows (all other limits). Each step is
    checked before it is commanded: from its end the robot must be able to brake within its limits and without contact.
    Otherwise the robot follows, for as long as the step lasts, the stop that the step before has checked. So a command
    always exists, whatever the solver does, and however long the step is that comes.

    Args:
        robot: what is controlled.
        tasks: what it should do.
        scene: what it should keep clear of, where `limits` are the default ones; None: nothing, itself included.
        limits: None: position, velocity, acceleration and jerk of the joints, and with a scene clearance.
        form: `velocity`: tasks ask for velocities, and q' = q + dt x; `acceleration`: tasks ask for accelerations, and
            q' = q + dt (v + x) / 2. A step that brakes goes along the stop, in either form: (q' - q) / dt is its mean
            velocity.
        solver: `native`, an active set that begins at the limits of the last step, with ProxQP where that fails;
            `proxqp`, or another that qpsolvers finds, asked in every step. An answer is polished on the constraints
            that it touches, whoever gives it.
        damping: weight of all velocities, per rad/s or m/s; near singularities it grows by itself.
        response: s; time constant with which velocities follow what tasks ask for, in the form `velocity`; 0: at
            once; None: as short as the robot's jerk limits allow.
        relax: names of limits, the first given up first, where not all can hold; those not named come first.
        guess: deprecated; say `solver="native"` or name another.
        longest_step: s; steps may differ in length and be as long as this. In a longer one the robot goes on along its
            stop, and the step says so.

    Attributes:
        time: s since the motions of the scene's obstacles began; a step adds its own. Set it where another clock runs.

    Raises:
        InputError: an argument that does not fit.

    Example:
        >>> import optiplan as op
        >>> robot = op.load_robot("panda")
        >>> tool = op.PoseTask(robot.tool_frame)
        >>> controller = op.Controller(robot, [tool, op.PostureTask("ready")])
        >>> state = op.State(robot.configurations["ready"])
        >>> tool.set_target(op.Pose(position=(0.5, 0.2, 0.5), rpy=(3.14159, 0, 0)))
        >>> for _ in range(2000):
        ...     state = controller.step(state, 0.001).state
        >>> float(abs(tool.error(controller.configuration(state)))[:3].max()) < 1e-4
        True
    """

    def __repr__(self) -> str:
        """Robot, joints, tasks and limits."""
        limits = ", ".join(limit.name for limit in self.limits) or "none"
        return f"Controller: {self.robot.name}, tasks: {'; '.join(map(repr, self.tasks)) or 'none'}; limits: {limits}"

    def __init__(
        self,
        robot: Robot,
        tasks: Iterable[ControlTask],
        scene: Scene | None = None,
        limits: Iterable[ControlLimit] | None = None,
        form: Form = "velocity",
        solver: str | QpSolver = DEFAULT,
        damping: float = BASE_DAMPING,
        response: float | None = None,
        relax: Sequence[str] = ORDER,
        guess: bool | None = None,
        longest_step: float = LONGEST_STEP,
    ) -> None:
        check_options(robot, scene, form, damping, relax, guess, longest_step)
        self.robot = robot
        self.tasks = all_of(tasks, ControlTask, "tasks", "a task, such as op.PoseTask(…)")
        wanted = default_limits(scene) if limits is None else limits
        self.limits = all_of(wanted, ControlLimit, "limits", "a limit, such as op.VelocityLimit()")
        response = response_time(robot) if response is None else response
        number_argument("Controller", "response", response, "a finite number of seconds >= 0", 0.0)
        first = solver == NATIVE if guess is None else guess
        self._programs, self._longest = QpSequence(make_solver(solver), first), float(longest_step)
        for part in (*self.tasks, *self.limits):
            part.bind(robot)
        self._order = relaxed_order(relax, self.limits)
        self._damping, self._by_acceleration = float(damping), form == "acceleration"
        self._response, n = response, robot.n
        self._motion: MotionTask | None = None
        self._take_tasks()
        self._box = JointBox(self.limits, self._order, n, self._by_acceleration, self._longest)
        self._watches = [limit for limit in self.limits if isinstance(limit, ClearanceLimit)]
        stop_limits = [limit for limit in self.limits if isinstance(limit, StopLimit)]
        kept_limits = [limit for limit in self.limits if isinstance(limit, KeptRowLimit)]
        self._guard = StoppingGuard(robot, stop_limits, kept_limits, self._box)
        row_limits = [limit for limit in self.limits if isinstance(limit, RowLimit)]
        self._rows = RowStack(row_limits, self._order, n)
        for limit in row_limits:
            limit.meet(self._box, self._by_acceleration)
        self.time = 0.0
        self._configuration = Configuration(robot)
        self._report = StepReporter(robot, self._box, self._rows)
        self._no_equations = np.zeros((0, n)), np.zeros(0)

    def _take_tasks(self) -> None:
        """Group the tasks by priority."""
        levels = sorted({task.priority for task in self.tasks})
        groups = [[task for task in self.tasks if task.priority == level] for level in levels] or [[]]
        made = self.robot.n, self._by_acceleration, self._response, self._damping
        self._objectives = [TaskObjective(group, *made, first=k == 0) for k, group in enumerate(groups)]

    def follow(self, run: object, gain: float = FOLLOW_GAIN) -> MotionTask:
        """Follow the motion of a run from now on, in the place of all tasks: with its velocities as feed-forward.

        Where limits hold the robot back, the motion waits: see `MotionTask`.

        Args:
            run: with a trajectory of the same joints, or that trajectory.
            gain: 1/s; how quickly deviations fall.

        Returns:
            The task: `time`, s of the motion, and `done`.

        Raises:
            InputError: no motion, one of other joints, or a gain below 0.

        Example:
            >>> import optiplan as op
            >>> run = op.plan(op.load_problem("01_reach"))
            >>> controller = op.Controller(run.problem.robot, [], scene=run.problem.scene)
            >>> state, motion = run.trajectory.state(0.0), controller.follow(run)
            >>> while not motion.done:
            ...     state = controller.step(state, 0.002).state
            >>> float(abs(state.q - run.trajectory.end).max()) < 1e-3
            True
        """
        trajectory = followed_motion(self.robot, run)
        motion = MotionTask(trajectory, gain, self._by_acceleration)
        motion.bind(self.robot)
        times = np.linspace(0.0, trajectory.duration, PLACES)
        for limit in self._watches:
            limit.pass_along(trajectory(times), self.time + times)
        self.tasks, self._motion = (motion,), motion
        self._take_tasks()
        return motion

    def update_scene(self, poses: Mapping[str, Pose], velocities: Mapping[str, Values] | None = None) -> None:
        """Take where obstacles of the scene are now, and how they move, in place.

        An obstacle goes on with its velocity for 0.4 s, and is taken to stand still then, until it is seen again. The
        first time one moves, the model is made anew, which takes some milliseconds: call it before the loop.

        Args:
            poses: of obstacles, by name.
            velocities: (3,), m/s, of some of them; the others stand still.

        Raises:
            InputError: no limit of clearance knows an obstacle of that name, or a pose or velocity that cannot be.
        """
        X, v = seen({body.name for limit in self._watches for body in limit.scene.obstacles}, poses, velocities)
        for limit in self._watches:
            known = {body.name for body in limit.scene.obstacles}
            if limit.see({name: pose for name, pose in X.items() if name in known}, v, self.time):
                self._guard.forget()

    def step(self, state: State, dt: float) -> ControlStep:
        """What to do in the next dt seconds from a state.

        Args:
            state: of the robot now: the one that was commanded, `ControlStep.state`, or a measured one.
            dt: s.

        Raises:
            InputError: a state of another size or with NaN, a dt that is not > 0.
        """
        begin = time.perf_counter()
        check_step(self.robot, state, dt, "Controller.step")
        if dt > self._longest:
            return self._braking(
                state, dt, begin, f"the step of {dt:g} s is longer than {self._longest:g} s, as stated"
            )
        c = self._configuration
        c.update(state.q, state.v)
        outcome = self._linearise(c, state, dt)
        self._programs.solve_seconds = 0.0
        accepted = self._along_motion(c, outcome)
        if accepted is None:
            x = self._solve(c, state, outcome)
            accepted = None if x is None else self._accept(x, outcome) or self._way_out(outcome)
        outcome.solve_seconds = self._programs.solve_seconds
        if accepted is None:
            self._programs.reset()
            return self._brake(outcome, begin)
        outcome.how = self._programs.how
        self.time += dt
        return self._report.step(outcome, accepted, self._guard.nearest, begin)

    def build(self, state: State, dt: float) -> ControlProblem:
        """Return the quadratic program that `step` would solve, with a name for every row; nothing is commanded.

        The controller stays as it is: a later step gives the same answer as without the call. Of tasks with several
        priorities it is the program of the last one, whose equations keep what those before it reach. Its solution is
        the velocity `step` commands, unless the robot could not stop clear from there.

        Args:
            state: of the robot now.
            dt: s, at most `longest_step`.

        Raises:
            InputError: a state of another size or with NaN, a dt that is not > 0 or longer than `longest_step`.

        Example:
            >>> import optiplan as op
            >>> robot = op.load_robot("panda")
            >>> controller = op.Controller(robot, [op.PostureTask("ready")])
            >>> problem = controller.build(op.State(robot.configurations["ready"]), 0.002)
            >>> problem.task_names[0], problem.upper_limits[0]
            ('posture: panda_joint1', 'jerk')
        """
        check_step(self.robot, state, dt, "Controller.build")
        if dt > self._longest:
            expected = f"at most longest_step = {self._longest:g} s; a longer step brakes"
            raise wrong_argument("Controller.build", "dt", f"{dt:g} s", expected)
        preview = copy(self)  # with copies of everything that remembers earlier steps
        preview._guard, preview._programs = self._guard.copy(), QpSequence(ProxQp(), guess=True)
        preview._objectives = [objective.copy() for objective in self._objectives]
        c = self.configuration(state)
        outcome = preview._linearise(c, state, dt)
        preview._solve(c, state, outcome)
        return control_problem(outcome, preview._objectives, preview._box, preview._rows, self.robot.joint_names)

    def _linearise(self, c: Configuration, state: State, dt: float) -> StepOutcome:
        """Set bounds and rows of a step from a state, at which `c` is; return its empty outcome."""
        self._box.update(state, dt)
        self._rows.collect(c, state, dt, self._guard.rows(c, state, dt, self.time))
        for objective in self._objectives:
            objective.begin_step(state, dt)
        return StepOutcome(state, dt)

    def stop(self, state: State, dt: float) -> ControlStep:
        """Brake for the next dt seconds, whatever the tasks: as quickly as acceleration and jerk limits let the joints.

        Raises:
            InputError: a state of another size or with NaN, a dt that is not > 0.
        """
        begin = time.perf_counter()
        check_step(self.robot, state, dt, "Controller.stop")
        return self._braking(state, dt, begin, "as asked")

    def _braking(self, state: State, dt: float, begin: float, why: str) -> ControlStep:
        """A step along the stop."""
        return self._brake(StepOutcome(state, dt, why=why), begin)

    def _brake(self, outcome: StepOutcome, begin: float) -> ControlStep:
        """Go along the stop."""
        brake = self._box.brake(outcome.state, outcome.dt)
        self.time += outcome.dt
        self._guard.keep(outcome.state, brake, outcome.dt, self.time)
        return self._report.step(outcome, brake, self._guard.nearest, begin)

    def configuration(self, state: State) -> Configuration:
        """Kinematics at a state, to ask tasks for their errors; a new object."""
        c = Configuration(self.robot)
        c.update(state.q, state.v)
        return c

    def _along_motion(self, c: Configuration, outcome: StepOutcome) -> State | None:
        """The next state of a motion that is followed, where the robot is on it and can stop clear from there.

        Rows of distances are left out: they slow down what comes near, which a planned motion does where it is clear.
        """
        if self._motion is None or not self._motion.is_met:
            return None
        x = self._box_clip(self._motion.velocity)
        if (np.abs(x - self._motion.velocity) > ON_MOTION).any() or not self._rows.holds(x, own=True):
            return None
        outcome.demand = self._objectives[0].demand(c, outcome.state)
        self._programs.how = "motion"
        return self._if_clear(x, outcome)

    def _solve(self, c: Configuration, state: State, outcome: StepOutcome) -> Array | None:
        """The best velocities of all priorities; None where no answer can be accepted."""
        rows, witness = self._rows, self._box_clip(self._box.slowing)
        x: Array | None = None
        equations = self._no_equations
        C, low, high = rows.C, rows.low, rows.high
        for level, objective in enumerate(self._objectives):
            demand = objective.demand(c, state)
            program = Program(demand.H, demand.g, C, low, high, (self._box.low, self._box.high), *equations)
            if level == 0:
                outcome.demand = demand
                if rows.any and not rows.holds(witness):
                    groups = rows.by_importance()
                    program, witness, outcome.slack = self._programs.relaxed(program, groups, witness)
                    low, high = program.low, program.high
            outcome.program, outcome.level = program, level
            found = self._programs.find(program, witness, level)
            if found is None:
                return x
            x = witness = found
            objective.learn(demand, x)
            if level + 1 < len(self._objectives):
                A = np.vstack([equations[0], demand.A])
                equations = A, A @ x
        return x

    def _box_clip(self, x: Array) -> Array:
        return np.asarray(np.minimum(np.maximum(x, self._box.low), self._box.high))

    def _accept(self, x: Array, outcome: StepOutcome) -> State | None:
        """The state with velocities x (n,), or half or a quarter of them beyond braking, if the robot can stop clear.

        None where it cannot from any of these.
        """
        brake = self._box.slowing
        for share in (1.0, 0.5, 0.25):
            outcome.share = share
            accepted = self._if_clear(x if share == 1.0 else brake + share * (x - brake), outcome)
            if accepted is not None:
                return accepted
        outcome.share = 1.0
        return None

    def _if_clear(self, x: Array, outcome: StepOutcome) -> State | None:
        """The state at the end of the step with velocities x (n,); None where the robot could not stop clear of it."""
        dt = outcome.dt
        reached = self._next(outcome.state, x, dt)
        if not squares_are_finite(reached.q, reached.v, reached.a):
            return None
        clear = self._guard.accepts(reached, dt, self.time + dt, outcome.state, outcome.slack)
        return reached if clear else None

    def _way_out(self, outcome: StepOutcome) -> State | None:
        """A state away from what is too near, where the robot stands and can stop clear from there; None otherwise.

        `why` of the outcome then says what stands in the way, and what was tried.
        """
        outcome.why = "no command was found that keeps all limits and can be stopped clear"
        if outcome.state.v.any():
            return None
        tried: list[str] = []
        low, high = self._box.low, self._box.high
        for name, direction in self._guard.ways_out():
            size = float(np.abs(direction).max())
            tried.append(name)
            if size < 1e-9:
                continue
            d = direction / size
            # As fast as the bounds allow in this direction; a quarter of it where the way bends.
            ends = np.where(d > 0.0, high, low)
            most = float((ends[np.abs(d) > 1e-3] / d[np.abs(d) > 1e-3]).min())
            most = most if np.isfinite(most) else UNLIMITED
            for share in (1.0, 0.25):
                found = self._if_clear(self._box_clip(share * most * d), outcome)
                if found is not None:
                    self._programs.how, outcome.share = "way out", share
                    return found
        nearest = self._guard.nearest
        if nearest is not None and tried:
            outcome.why += (
                f"; '{nearest.a}' and '{nearest.b}' are {1e3 * nearest.distance:.3g} mm apart; ways that were tried: "
                f"that of the tasks, whole, half and a quarter, and straight away from {', from '.join(tried)}"
            )
        return None

    def _next(self, state: State, x: Array, dt: float) -> State:
        """The state at the end of the step."""
        a = (x - state.v) / dt
        q = state.q + (0.5 * dt) * (state.v + x) if self._by_acceleration else state.q + dt * x
        return State.of(q, x, a)
