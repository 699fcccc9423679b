"""What planning and proving ask of a robot alone: made once in a process, before a budget begins."""

from optiplan.collision.native_model import make_links
from optiplan.collision.passing_neighbours import apart_neighbours
from optiplan.libraries import clock
from optiplan.robot.robot import Robot
from optiplan.verify.continuous.kept_clearance import kept_clearances
from optiplan.verify.planes.plane_search import make_shapes

_TOLD = 0.1
"""s that are worth a word."""


def make_ready(robot: Robot) -> None:
    """Give both collision models the bodies of the robot, and reports what they say of it: some milliseconds, once."""
    make_links(robot)
    make_shapes(robot)
    _ = robot.massless_links, robot.bare_links


def prepare(robot: Robot) -> dict[str, float]:
    """Prove and survey also what is kept of the robot's links; the seconds as a run tells them, if there are many."""
    began = clock()
    make_ready(robot)
    kept_clearances(robot)
    apart_neighbours(robot)
    took = clock() - began
    return {"robot": took} if took > _TOLD else {}
