"""Checks of the steps that lead a tool along a path, and what the verdict on them is about."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from optiplan.arrays import Array
from optiplan.problem.problem import Problem
from optiplan.problem.seams.actions import Passing, SeamPart
from optiplan.problem.task.steps import TaskStep
from optiplan.robot.frames import frame_pose
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.seams.seam_proof import SeamProof
from optiplan.verify.statements import covering, step_place
from optiplan.verify.tolerances import POSITION_ROUNDING

_STATED = {"path": ".path", "path axis": ".axis", "path speed": ".speed"}
"""Statement of a part of a path that each check is one of."""


def seam_checks(
    k: int, step: TaskStep, problem: Problem, motion: tuple[Trajectory | None, Array], policy: VerifyPolicy
) -> Iterator[Check]:
    """Yield the checks of step k of a task, in the time of its own part of the motion; none of other steps.

    Args:
        k: number of the step, from 0.
        step: the step.
        problem: with the robot as it is then.
        motion: while the step is done, None where it takes no time; and the configuration (n,) in which it ends.
        policy: of the verifier.
    """
    action, (own, q) = step.action, motion
    if isinstance(action, Passing):
        yield _passing(k, action, problem, q)
    elif isinstance(action, SeamPart) and own is not None:
        for check in SeamProof(action, problem.robot, own, policy).checks():
            yield covering(check, f"{step_place(k)}{_STATED[check.name]}")
    elif isinstance(action, SeamPart):
        covers = [f"{step_place(k)}{one}" for one in _STATED.values()] if action.high == action.low else []
        detail = "no part of the path" if covers else "it takes no time"
        yield covering(Check("path", "exact", bool(covers), detail=detail), *covers)


def _passing(k: int, action: Passing, problem: Problem, q: Array) -> Check:
    """Check that the tool is at the place of an event in configuration q (n,)."""
    path = action.path
    place = path.curve.points(np.array([action.at]))[0]
    off = float(np.linalg.norm(frame_pose(problem.robot, q, path.frame).translation - place))
    found = Check("path event", "exact", off <= path.position + POSITION_ROUNDING, off, path.position, "m", 0.0)
    detail = f"at {action.at:.4g} m of the path"
    found = replace(found, place=path.frame, detail=detail, witness={"q": q.tolist()})
    return covering(found, f"{step_place(k)}.event")
