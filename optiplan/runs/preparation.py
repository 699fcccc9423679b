"""Preparations of planning and proving: for a robot once in a process, for the work space of each problem."""

from optiplan.collision.kept_models import LARGE, collision_model, kept_planning_model
from optiplan.collision.native_model import make_links
from optiplan.collision.passing_neighbours import apart_neighbours
from optiplan.libraries import clock
from optiplan.planners.common.gravity import greatest_gravity
from optiplan.problem.problem import Problem
from optiplan.robot.batched.base_reaction import held_robot
from optiplan.robot.robot import Robot
from optiplan.verify.collision_check import checked_robot
from optiplan.verify.continuous.kept_clearance import clearances_are_kept, kept_clearances
from optiplan.verify.continuous.motion_tools import tools_of
from optiplan.verify.continuous.torque import bounds_of
from optiplan.verify.planes.plane_search import make_shapes, plane_search
from optiplan.verify.report import VerifyPolicy

_TOLD = 0.1
"""s that are worth a word."""


def make_ready(problem: Problem) -> None:
    """Make what a plan in this thread would make first, where it takes milliseconds: bodies in both collision models.

    Of a robot that was never planned for, the work space waits for `prepare`.
    """
    _make_robot_ready(problem.robot)
    if problem.task or not clearances_are_kept(problem.robot):
        return
    model = collision_model(checked_robot(problem, VerifyPolicy()), problem.scene)
    if len(model.pairs) <= LARGE:  # else it would be made again
        kept_planning_model(problem.robot, problem.scene, problem.tracking_error)
        plane_search(model, tools_of(model))


def prepare(robot: Robot) -> dict[str, float]:
    """Prove and survey also what is kept of the robot's links; the seconds as a run tells them, if there are many."""
    began = clock()
    _make_robot_ready(robot)
    kept_clearances(robot)
    apart_neighbours(robot)
    took = clock() - began
    return {"robot": took} if took > _TOLD else {}


def _make_robot_ready(robot: Robot) -> None:
    make_links(robot)
    make_shapes(robot)
    for made_of in (held_robot, greatest_gravity, bounds_of):
        made_of(robot)
    _ = robot.massless_links, robot.bare_links  # which reports name
