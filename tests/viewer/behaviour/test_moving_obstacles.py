"""Obstacles that move, in the page: where they are at any time of the motion is where the problem says."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.scene import Obstacle, Scene, Sphere
from optiplan.problem.problem import JointGoal
from optiplan.viewer.page import export_page
from optiplan.viewer.runs import ViewedRun
from tests.unchecked_problem import unchecked_problem
from tests.viewer.browsing import pixels
from tests.viewer.conftest import at

pytestmark = [pytest.mark.timeout(240)]

POLYNOMIAL, UNTIL = [[0.0, 0.2], [0.1, 0.0, -0.3], [0.0, -0.5]], 1.2
BALL = "optiplan.scene.layers.obstacle.children.find((mesh) => mesh.userData.motion)"


@pytest.fixture(scope="module")
def ball(panda) -> Obstacle:
    return Obstacle("ball", Sphere(0.08), at(0.4, -0.4, 0.9)).moving(POLYNOMIAL, UNTIL)


@pytest.fixture(scope="module")
def address(panda, ball, motion, tmp_path_factory) -> str:
    """A page of a motion of 2 s past a ball that falls and stops, and a board that stands."""
    goal = panda.configurations["ready"] + np.array([0.6, 0.2, 0.0, 0.3, 0.0, 0.0, 0.0])
    problem = unchecked_problem(
        name="falling",
        robot=panda,
        scene=Scene((ball,)),
        start=panda.configurations["ready"],
        goal=(JointGoal(goal),),
        limits=panda.limits,
    )
    path = tmp_path_factory.mktemp("page") / "page.html"
    export_page(problem, [ViewedRun("past", motion(problem, 2.0))], path)
    return path.as_uri()


def test_an_obstacle_is_where_the_problem_says_it_is(visit, address, ball):
    page = visit(address + "#t=0&paused")
    pictures = []
    for t in (0.0, 0.5, 1.2, 2.0, 0.25):
        page.evaluate("(t) => optiplan.seek(t)", t)
        pictures.append(pixels(page))
        found = page.evaluate(f"{BALL}.position.toArray()")
        assert found == pytest.approx(place(ball.X_WO, min(t, UNTIL)), abs=1e-6)
    assert np.abs(pictures[1] - pictures[0]).max() > 20.0


def place(X_WO: pin.SE3, t: float) -> np.ndarray:
    """The ball's centre at a time, s."""
    return X_WO.translation + [np.polynomial.polynomial.polyval(t, row) for row in POLYNOMIAL]
