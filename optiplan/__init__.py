"""OptiPlan: one problem in, one trajectory out that is proved collision-free and within limits.

Example:
    >>> import optiplan as op
    >>> run = op.plan(op.load_problem("01_reach"))
    >>> run.verified
    True

Names are loaded when they are first used, so that `import optiplan` itself costs next to nothing.
"""

import inspect
import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from optiplan.api.listings import planners, robots
    from optiplan.api.loading import load_problem, load_robot, load_run
    from optiplan.api.planning import plan, retime, verify
    from optiplan.api.viewing import View, view
    from optiplan.errors import InputError, OptiPlanError
    from optiplan.geometry.scene import Attachment, Obstacle, Scene
    from optiplan.planners.base import Budget, Failure, Planner, PlanResult
    from optiplan.problem.constraints.statements import (
        OnLine,
        OnPlane,
        OrientationCone,
        PairClearance,
        PositionBox,
        RelativePose,
        ToolSpeed,
    )
    from optiplan.problem.goals_and_vias import JointGoal, Objective, PoseGoal
    from optiplan.problem.obstacles import Box, Capsule, Cylinder, HalfSpace, Mesh, Sphere
    from optiplan.problem.problem import Problem
    from optiplan.problem.statement import Pose, ViaPoint
    from optiplan.robot.robot import Robot
    from optiplan.runs.run import Run
    from optiplan.service.client import Client
    from optiplan.trajectory.sample_file import Samples
    from optiplan.trajectory.trajectory import Trajectory
    from optiplan.verify.report import Check, Report

_ROOMS = {
    "api.listings": ("planners", "robots"),
    "api.loading": ("load_problem", "load_robot", "load_run"),
    "api.planning": ("plan", "retime", "verify"),
    "api.viewing": ("View", "view"),
    "errors": ("InputError", "OptiPlanError"),
    "geometry.scene": ("Attachment", "Obstacle", "Scene"),
    "planners.base": ("Budget", "Failure", "PlanResult", "Planner"),
    "problem.constraints.statements": (
        "OnLine",
        "OnPlane",
        "OrientationCone",
        "PairClearance",
        "PositionBox",
        "RelativePose",
        "ToolSpeed",
    ),
    "problem.obstacles": ("Box", "Capsule", "Cylinder", "HalfSpace", "Mesh", "Sphere"),
    "problem.goals_and_vias": ("JointGoal", "Objective", "PoseGoal"),
    "problem.problem": ("Problem",),
    "problem.statement": ("Pose", "ViaPoint"),
    "robot.robot": ("Robot",),
    "runs.run": ("Run",),
    "service.client": ("Client",),
    "trajectory.sample_file": ("Samples",),
    "trajectory.trajectory": ("Trajectory",),
    "verify.report": ("Check", "Report"),
}
_HOME = {name: f"optiplan.{room}" for room, names in _ROOMS.items() for name in names}

__all__ = [
    "Attachment",
    "Box",
    "Budget",
    "Capsule",
    "Check",
    "Client",
    "Cylinder",
    "Failure",
    "HalfSpace",
    "InputError",
    "JointGoal",
    "Mesh",
    "Objective",
    "Obstacle",
    "OnLine",
    "OnPlane",
    "OptiPlanError",
    "OrientationCone",
    "PairClearance",
    "PlanResult",
    "Planner",
    "Pose",
    "PoseGoal",
    "PositionBox",
    "Problem",
    "RelativePose",
    "Report",
    "Robot",
    "Run",
    "Samples",
    "Scene",
    "Sphere",
    "ToolSpeed",
    "Trajectory",
    "ViaPoint",
    "View",
    "__version__",
    "load_problem",
    "load_robot",
    "load_run",
    "plan",
    "planners",
    "retime",
    "robots",
    "verify",
    "view",
]


def __getattr__(name: str) -> Any:
    """A public name, from where it is at home; it is loaded once."""
    if name not in _HOME:
        raise AttributeError(f"module 'optiplan' has no attribute {name!r}")
    if name in _ROOMS_CALLED:
        return import_module(f"optiplan.{name}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    """The public names."""
    return sorted({*globals(), *__all__})


_ROOMS_CALLED = ("planners", "verify")
"""Rooms that have the name of a function: `op.verify(…)` is the function, `optiplan.verify.report` one of its files."""


class _CalledRoom(ModuleType):
    """A room that does, when it is called, what the function of its name does."""

    @property
    def _function(self) -> Any:
        name = self.__name__.rpartition(".")[2]
        return getattr(import_module(_HOME[name]), name)

    @property
    def __signature__(self) -> inspect.Signature:
        """That of the function."""
        return inspect.signature(self._function)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """The function."""
        return self._function(*args, **kwargs)


class _FrontDoor(ModuleType):
    """This module; rooms that are called become callable when they are imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _ROOMS_CALLED and isinstance(value, ModuleType):
            value.__class__ = _CalledRoom
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _FrontDoor
