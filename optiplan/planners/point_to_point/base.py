"""Base of the point-to-point planners: check each goal's motion against limits, obstacles and motor torques."""

from abc import abstractmethod
from typing import Protocol, TypeVar

from optiplan.arrays import Array
from optiplan.collision.kept_models import kept_planning_model
from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.planners.base import Budget, Failure, Planner, PlanResult, Progress
from optiplan.planners.common.context import PlanContext
from optiplan.planners.common.continuous_collision import Touch, first_contact
from optiplan.planners.common.failures import out_of_time, path_too_heavy
from optiplan.planners.common.goal_ranking import ranked_goals
from optiplan.planners.common.limit_violations import acceleration_steps, beyond_limits, beyond_torque, excess
from optiplan.planners.common.path_timing import within_torque
from optiplan.planners.option_schema import PlannerOptions, option
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.robot.robot import Limits
from optiplan.trajectory.profiles.synchronisation import Synchronisation
from optiplan.trajectory.trajectory import Trajectory

STEPS = "the acceleration jumps, which a finite jerk limit forbids; `limits: {jerk: none}` in the problem allows it"
SIZE = {"least": 1e-6, "most": 1e7}
"""Range of options that are a time, a velocity or an acceleration; beyond it rounding would show in the polynomials."""

_LONGER = 1e-9
"""Share of the duration stated by which a motion may take longer: rounding."""


@dataclass(frozen=True)
class MotionOptions(PlannerOptions):
    """Options of every planner of this family."""

    duration: float | None = option(
        None, "s; None is the shortest within velocity, acceleration, jerk and torque limits.", **SIZE
    )
    goals: int = option(8, "how many goal configurations to try, the quickest to reach first.", above=0)


@dataclass(frozen=True)
class ProfileOptions(MotionOptions):
    """Also how the joints share the time."""

    motion: Synchronisation = option(
        "synchronised", "all joints share one law; or each is as fast as it can; or one moves after another."
    )


class Profile(Protocol):
    """A motion to one goal, still of any duration."""

    @property
    def limits(self) -> Limits:
        """Limits that the motion has to keep."""
        ...

    @property
    def stretchable(self) -> bool:
        """Whether it may be slowed down as a whole."""
        ...

    @property
    def shortest(self) -> float:
        """Shortest duration within all limits but torque, s, or the nearest to it."""
        ...

    def trajectory(self, duration: float | None = None) -> Trajectory:
        """The motion, in that duration (s) or as fast as can be."""
        ...


Options = TypeVar("Options", bound=MotionOptions)


class PointToPoint(Planner[Options]):
    """A planner is this class and its `profile`: the goals are tried until a motion is free at all times."""

    def targets(self, problem: Problem, model: CollisionModel, budget: Budget) -> list[Array] | Failure:
        """Return the goal configurations (n,) to try, the quickest to reach first."""
        return ranked_goals(problem, model, budget, self.options.goals)

    @abstractmethod
    def profile(self, problem: Problem, goal: Array) -> Profile:
        """The motion from the problem's start to a goal configuration (n,), rad or m.

        Raises:
            InputError: the options make no sense for this motion.
        """

    def check(self, problem: Problem, budget: Budget) -> None:
        """Return the issues of the options known without planning; none with vias that are passed leg by leg.

        Raises:
            InputError: they make no sense for any of the goal configurations that the budget is enough to find.
        """
        if problem.vias and not self.passes_vias:
            return
        goals = self.targets(problem, kept_planning_model(problem.robot, problem.scene, problem.tracking_error), budget)
        refused: list[InputError] = []
        for goal in [] if isinstance(goals, Failure) else goals:
            try:
                self.profile(problem, goal)
            except InputError as error:
                refused.append(error)
            else:
                return
        if refused:
            raise refused[0]

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Plan within the budget; see `planners.base.Planner`."""
        work = PlanContext.of(problem, budget)
        watch = work.watch
        with watch.stage("goals"):
            goals = self.targets(problem, work.model, budget)
        if isinstance(goals, Failure):
            return PlanResult(None, goals, watch.seconds)
        refused: list[Failure | InputError] = []
        for k, goal in enumerate(goals):
            if budget.over:
                return PlanResult(None, out_of_time(budget, "trying goals"), watch.seconds)
            progress("goals", k / len(goals))
            try:
                found = self._attempt(work, self.profile(problem, goal))
            except InputError as error:
                refused.append(error)
                continue
            if isinstance(found, Trajectory):
                notes = {"note": STEPS} if acceleration_steps(found, problem) else {}
                return PlanResult(found, None, watch.seconds, {"goal": k, **notes})
            refused.append(found)
        if budget.over:
            return PlanResult(None, out_of_time(budget, "trying goals"), watch.seconds)
        if isinstance(refused[0], InputError):
            raise refused[0]
        return PlanResult(None, refused[0], watch.seconds)

    def _attempt(self, work: PlanContext, profile: Profile) -> Trajectory | Failure:
        """Return the motion to one goal, proved free and within limits, or why it is not."""
        model, limits, watch = work.model, work.problem.limits, work.watch
        with watch.stage("motion"):
            motion = profile.trajectory(self.options.duration)
            over = excess(motion, profile.limits)
        if over is not None:
            return beyond_limits(model.robot, over, motion, self._shortest(model, profile))
        duration = self.options.duration
        if duration is not None and motion.duration > duration * (1.0 + _LONGER):
            detail = f"no motion within limits takes {duration:.6g} s; the next longer takes {motion.duration:.6g} s"
            return Failure("limits", detail, {"shortest_duration": motion.duration, "motion": motion.to_dict()})
        with watch.stage("collision"):
            touch = first_contact(model, motion, lambda: work.budget.over)
        if touch is not None:
            return _collision(touch, motion)
        with watch.stage("torque"):
            slower = within_torque(model.robot, limits, motion)
        if slower is None:
            return path_too_heavy(model.robot, limits, motion)
        if slower is motion or slower.duration == motion.duration:
            return motion
        if self.options.duration is None and profile.stretchable:
            return slower
        return beyond_torque(model.robot, limits, motion, self._shortest(model, profile))

    def _shortest(self, model: CollisionModel, profile: Profile) -> float | None:
        """Return the shortest duration of this motion within all limits, torque included, s; None without one."""
        fastest = profile.trajectory()
        if excess(fastest, profile.limits) is not None:
            return None
        slower = within_torque(model.robot, profile.limits, fastest)
        if slower is None or (slower.duration > fastest.duration and not profile.stretchable):
            return None
        return slower.duration


def _collision(touch: Touch, motion: Trajectory) -> Failure:
    detail = f"the motion is not free: {touch.contact.meeting} at {touch.t:.3f} s"
    return Failure("collision", detail, touch.witness(motion))
