"""Show that the verifier refuses statements without a check, and that sliding joints read metres and newtons.

A motion that is verified is judged again with statements that the verifier does not know, or that come to nothing: a
new kind of path constraint, an unknown goal, via and action, a clearance of no pairs, a mass that the robot does not
carry, checks that are left out. Then the units of every check of Delbot's base, which slides along two axes.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar
from unittest.mock import patch

import numpy as np
import pinocchio as pin
from asked import Figures

import optiplan as op
from optiplan.geometry.scene import Attachment, Scene, Sphere
from optiplan.problem.constraints.base import WHOLE, During, Statement
from optiplan.problem.constraints.motions import PairClearance, ToolSpeed
from optiplan.problem.constraints.points import OnPlane
from optiplan.problem.goals_and_vias import Via
from optiplan.problem.problem import derived
from optiplan.problem.task.steps import TaskStep
from optiplan.trajectory.segments import Segment
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import verify as verifier
from optiplan.verify.verify import verify


@dataclass(frozen=True, eq=False)
class Fresh(Statement):
    """A kind of constraint that nobody taught the verifier."""

    KEY: ClassVar[str] = "fresh_kind"
    frame: str
    during: During = WHOLE

    @classmethod
    def of(cls, data: Any, frame: str, during: During) -> "Fresh":
        """Return the constraint of an entry of a file."""
        return cls(frame, during)

    def to_data(self) -> dict[str, Any]:
        """Return its values."""
        return {}


def refused(problem: op.Problem, motion: Trajectory) -> str:
    """Return the verdict and the checks that failed."""
    report = verify(problem, motion)
    return "verified" if report.verified else "refused: " + ", ".join(check.name for check in report.failures)


def with_action(problem: op.Problem, motion: Trajectory, action: object) -> tuple[op.Problem, Trajectory]:
    """Return a task of this one action, which stands still for as long as the motion lasts."""
    still = Trajectory(
        motion.joint_names, np.array([0.0, 1.0]), motion.start[None, None], (Segment(1, "x", "x", 0, 1),)
    )
    return derived(problem, goal=(), task=(TaskStep(1, "x", "x", action),)), still  # type: ignore[arg-type]


def unknown(figures: Figures) -> None:
    """Judge a motion with statements that no check is known of."""
    problem = op.Problem("planar2r", [0.5, 1.0], [-0.5, 1.2])
    motion = op.plan(problem, "quintic").trajectory
    assert motion is not None
    figures.tell("the motion as it was asked for", "verified", refused(problem, motion))
    nothing: list[tuple[str, Any, str]] = [
        ("a new kind of constraint", Fresh("tool"), "fresh kind constraint"),
        ("a clearance of no pairs", PairClearance((), 0.1), "clearance constraint"),
        ("a tool speed without a limit", ToolSpeed("tool"), "tool speed constraint"),
        ("a plane during nothing", OnPlane("tool", np.eye(3)[1], 0.0, 9.0, during=(0.7, 0.2)), "plane constraint"),
    ]
    for what, one, name in nothing:
        figures.tell(what, f"refused: {name}", refused(derived(problem, path_constraints=(one,)), motion))
    figures.tell("an unknown goal", "refused: goal", refused(derived(problem, goal=(object(),)), motion))
    figures.tell("an unknown via", "refused: via", refused(derived(problem, vias=(Via(object()),)), motion))  # type: ignore[arg-type]
    figures.tell("an unknown action", "refused: statements", refused(*with_action(problem, motion, object())))
    held = Attachment("load", Sphere(0.01), "tip", pin.SE3.Identity(), frozenset({"forearm", "tip"}), mass=0.1)
    heavy = derived(problem, scene=Scene((), (held,)))
    figures.tell("a mass that the robot does not carry", "refused: statements", refused(heavy, motion))
    left_out(figures, problem, motion)


def left_out(figures: Figures, problem: op.Problem, motion: Trajectory) -> None:
    """Take each part out of the verifier in turn."""
    ball = op.Sphere("ball", 0.05, position=(3.0, 0.0, 0.0)).moving([[0], [0.1], [0]])
    limit, via = ToolSpeed("tool", 50.0), Via(op.JointGoal(motion(0.5 * motion.duration)))
    whole = derived(problem, scene=op.Scene([ball]), path_constraints=(limit,), vias=(via,))
    figures.tell("a moving ball, a tool speed and a via", "verified", refused(whole, motion))
    for name in ("collision", "loaded_torque", "path_constraints"):
        original: Callable[..., Any] = getattr(verifier, name)

        def bare(*given: Any, original: Callable[..., Any] = original) -> Any:
            found = original(*given)
            return [] if isinstance(found, list) else replace(found, covers=())

        with patch.object(verifier, name, bare):
            figures.tell(f"the same without the check of {name}", "refused: statements", refused(whole, motion))


def units(figures: Figures) -> None:
    """Compare the units of a motion of Delbot's base, along x and about z, with the types of its joints."""
    base = op.load_robot("delbot", group="base")
    names = base.joint_names
    for j, slides in ((0, True), (2, False)):
        goal = np.zeros(base.n)
        goal[j] = 0.4
        problem = op.Problem(base, np.zeros(base.n), goal)
        motion = op.plan(problem, "quintic").trajectory
        assert motion is not None
        unit = "m" if slides else "rad"
        expected = {"position": unit, "velocity": f"{unit}/s", "acceleration": f"{unit}/s²", "jerk": f"{unit}/s³"}
        far = derived(problem, goal=(op.JointGoal(-goal),), start=goal)
        quick = motion.scaled(0.01)
        found = {check.name: check.unit for check in verify(far, quick).checks if check.place == names[j]}
        expected = {"start": unit, "goal": unit} | {key: expected[key] for key in ("velocity", "acceleration", "jerk")}
        for name, asked in expected.items():
            figures.tell(f"unit of {name} of {names[j]}", asked, found.get(name))
    figures.tell("unit of the drive of a slide", "N", base.unit("torque", 0))
    run = op.plan(op.Problem(base, [0, 0, 0], [3.0, 0, 0]), "quintic", {"duration": 0.5})
    detail = "" if run.failure is None else run.failure.detail
    figures.tell("a message about a limit names m and not rad", (True, False), ("m/s" in detail, "rad" in detail))


def main() -> int:
    """Print every figure; 1 where one is missed."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    figures = Figures()
    for part in (unknown, units):
        print(f"{part.__name__} …", file=sys.stderr)
        part(figures)
    return figures.exit_code


if __name__ == "__main__":
    sys.exit(main())
