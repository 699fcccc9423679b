"""Parts of a motion in which the scene stays the same; a motion to a goal is one."""

from optiplan.geometry.scene import Scene
from optiplan.problem.problem import JointGoal, Problem, derived
from optiplan.records import dataclass
from optiplan.trajectory.joining import cut_trajectory, standstill
from optiplan.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class ScenePart:
    """A part of a motion in which bodies and what may touch stay the same.

    Attributes:
        problem: the task's own, with the scene and the payload of this part, and without a task.
        begin: s.
        end: s; `begin` of a part that is no more than an event at the end.
        steps: what is done in it, in words; empty for a motion to one goal.
    """

    problem: Problem
    begin: float
    end: float
    steps: str = ""

    def motion(self, trajectory: Trajectory) -> Trajectory:
        """Return this part of the motion; standing still for a second where it takes no time."""
        if self.end == self.begin:
            return standstill(trajectory.joint_names, trajectory(self.end), 1.0)
        whole = self.begin == 0.0 and self.end == trajectory.duration
        return trajectory if whole else cut_trajectory(trajectory, self.begin, self.end)


def whole_motion(problem: Problem, trajectory: Trajectory) -> ScenePart:
    """Return the only part of a motion of a problem without a task."""
    whole = problem if problem.scene.safety is None else derived(problem, scene=ending(problem, trajectory))
    return ScenePart(whole, 0.0, trajectory.duration)


def ending(problem: Problem, motion: Trajectory) -> Scene:
    """Return the scene of a problem without a task, about whose ends pairs may be nearer than its `Safety` asks.

    They are the ends of the motion and vias of joint values.
    """
    if problem.scene.safety is None:
        return problem.scene
    vias = [via.at.q for via in problem.vias if isinstance(via.at, JointGoal)]
    return problem.scene.ending_at(motion.start, motion.end, *vias)
