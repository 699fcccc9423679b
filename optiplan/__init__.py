"""OptiPlan: one problem in, one trajectory out that is proved collision-free and within limits.

Example:
    >>> import optiplan as op
    >>> run = op.plan(op.load_problem("01_reach"))
    >>> run.verified
    True

Names are loaded when they are first used, so that `import optiplan` itself costs next to nothing.
"""

import gc
import inspect
import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from optiplan.api.batches import Batch, plan_batch
    from optiplan.api.bounding import bound
    from optiplan.api.casadi_problems import casadi_problem
    from optiplan.api.checking import check
    from optiplan.api.driving import driver
    from optiplan.api.imports.scenes import import_scene
    from optiplan.api.init_robot import init_robot
    from optiplan.api.kinematics import ik
    from optiplan.api.listings import planners, robots
    from optiplan.api.loading import load_problem, load_robot, load_run
    from optiplan.api.many import plan_many
    from optiplan.api.planning import plan, retime, verify
    from optiplan.api.plotting import plot
    from optiplan.api.replanning import Replanner
    from optiplan.api.simulating import execute, simulate
    from optiplan.api.studies.assigning import assign
    from optiplan.api.studies.designing import design
    from optiplan.api.studies.placing import Placement, place
    from optiplan.api.viewing import View, view
    from optiplan.api.workspaces import workspace
    from optiplan.bench.bench import BenchResults, bench
    from optiplan.control.control_problem import ControlProblem
    from optiplan.control.controller import Controller
    from optiplan.control.limits.clearance import ClearanceLimit
    from optiplan.control.limits.half_space import HalfSpaceLimit
    from optiplan.control.limits.joint_limits import AccelerationLimit, JerkLimit, PositionLimit, VelocityLimit
    from optiplan.control.limits.tool_speed import ToolSpeedLimit
    from optiplan.control.limits.torque import TorqueLimit
    from optiplan.control.limits.wheel_speed import WheelSpeedLimit
    from optiplan.control.step import ControlStep
    from optiplan.control.tasks.frame_tasks import OrientationTask, PoseTask, PositionTask
    from optiplan.control.tasks.joint_tasks import BaseMotionTask, DampingTask, JointCouplingTask, PostureTask
    from optiplan.control.tasks.other_frames import LookAtTask, RelativePoseTask
    from optiplan.control.tasks.whole_body import CentreOfMassTask, ManipulabilityTask
    from optiplan.errors import InputError, OptiPlanError
    from optiplan.execution.chunks.certify import certify
    from optiplan.execution.chunks.chunk import Chunk
    from optiplan.execution.drivers.base import Capabilities, Driver
    from optiplan.execution.executor import Executor
    from optiplan.execution.loop.execution import Execution
    from optiplan.execution.measurement import Measurement
    from optiplan.execution.scene.policy import Policy
    from optiplan.execution.scene.separation import Separation
    from optiplan.execution.status import KeptSeparation, Status, Stopping, Tick
    from optiplan.execution.tracking_monitor import TrackingPolicy
    from optiplan.geometry.pose import Pose
    from optiplan.geometry.safety import SafePairs, Safety
    from optiplan.geometry.scene import Attachment, Obstacle, Scene
    from optiplan.planners.base import Budget, Failure, Planner, PlanResult
    from optiplan.planners.tours.placing import PlaceRange
    from optiplan.planners.trajopt.nonlinear.trajectory_nlp import TrajectoryNlp
    from optiplan.problem.constraints.balance import TipOver
    from optiplan.problem.constraints.expression import Expression
    from optiplan.problem.constraints.motions import (
        JointCoupling,
        ManipulabilityAbove,
        PairClearance,
        ToolAcceleration,
        ToolSpeed,
        WheelSpeed,
    )
    from optiplan.problem.constraints.points import OnArc, OnCircle, OnLine, OnPlane, PositionBox
    from optiplan.problem.constraints.poses import FixedOrientation, LookAt, OnScrew, OrientationCone, RelativePose
    from optiplan.problem.goals_and_vias import JointGoal, PoseGoal
    from optiplan.problem.grasps.statement import Grasps
    from optiplan.problem.objectives.objective import Objective
    from optiplan.problem.obstacles import Box, Capsule, Cylinder, HalfSpace, Mesh, Octree, PointCloud, Sphere
    from optiplan.problem.problem import Problem
    from optiplan.problem.regions.region import RegionGoal
    from optiplan.problem.statement import AllOf, Region, ViaPoint
    from optiplan.problem.task.builder import Path, Task, Tour
    from optiplan.problem.tools.statement import Tool
    from optiplan.robot.robot import Robot
    from optiplan.runs.run import Run
    from optiplan.service.cell import RemoteExecution
    from optiplan.service.client import Client
    from optiplan.simulation.log import Log, ObjectLog, WheelLog
    from optiplan.simulation.plants.task_plant import FrictionGrip
    from optiplan.simulation.simulation import Simulation
    from optiplan.studies.assembly.result import Assignment
    from optiplan.studies.result import DesignResult
    from optiplan.trajectory.sample_file import Samples
    from optiplan.trajectory.state import State
    from optiplan.trajectory.trajectory import Trajectory
    from optiplan.verify.bounds.duration_bound import DurationBound
    from optiplan.verify.report import Check, Report

_ROOMS = {
    "api.studies.assigning": ("assign",),
    "api.batches": ("Batch", "plan_batch"),
    "api.casadi_problems": ("casadi_problem",),
    "api.bounding": ("bound",),
    "api.checking": ("check",),
    "api.studies.designing": ("design",),
    "api.driving": ("driver",),
    "api.init_robot": ("init_robot",),
    "api.kinematics": ("ik",),
    "api.listings": ("planners", "robots"),
    "api.loading": ("load_problem", "load_robot", "load_run"),
    "api.many": ("plan_many",),
    "api.studies.placing": ("Placement", "place"),
    "api.planning": ("plan", "retime", "verify"),
    "planners.tours.placing": ("PlaceRange",),
    "api.replanning": ("Replanner",),
    "api.imports.scenes": ("import_scene",),
    "api.simulating": ("execute", "simulate"),
    "api.plotting": ("plot",),
    "api.viewing": ("View", "view"),
    "api.workspaces": ("workspace",),
    "bench.bench": ("BenchResults", "bench"),
    "control.controller": ("Controller",),
    "control.limits.clearance": ("ClearanceLimit",),
    "control.limits.half_space": ("HalfSpaceLimit",),
    "control.limits.joint_limits": ("AccelerationLimit", "JerkLimit", "PositionLimit", "VelocityLimit"),
    "control.limits.tool_speed": ("ToolSpeedLimit",),
    "control.limits.torque": ("TorqueLimit",),
    "control.limits.wheel_speed": ("WheelSpeedLimit",),
    "studies.assembly.result": ("Assignment",),
    "studies.result": ("DesignResult",),
    "trajectory.state": ("State",),
    "control.control_problem": ("ControlProblem",),
    "control.step": ("ControlStep",),
    "control.tasks.frame_tasks": ("OrientationTask", "PoseTask", "PositionTask"),
    "control.tasks.joint_tasks": ("BaseMotionTask", "DampingTask", "JointCouplingTask", "PostureTask"),
    "control.tasks.other_frames": ("LookAtTask", "RelativePoseTask"),
    "control.tasks.whole_body": ("CentreOfMassTask", "ManipulabilityTask"),
    "errors": ("InputError", "OptiPlanError"),
    "execution.chunks.certify": ("certify",),
    "execution.chunks.chunk": ("Chunk",),
    "execution.drivers.base": ("Capabilities", "Driver"),
    "execution.loop.execution": ("Execution",),
    "execution.executor": ("Executor",),
    "execution.measurement": ("Measurement",),
    "execution.tracking_monitor": ("TrackingPolicy",),
    "execution.scene.policy": ("Policy",),
    "execution.scene.separation": ("Separation",),
    "execution.status": ("KeptSeparation", "Status", "Stopping", "Tick"),
    "geometry.safety": ("SafePairs", "Safety"),
    "geometry.scene": ("Attachment", "Obstacle", "Scene"),
    "planners.base": ("Budget", "Failure", "PlanResult", "Planner"),
    "planners.trajopt.nonlinear.trajectory_nlp": ("TrajectoryNlp",),
    "problem.constraints.balance": ("TipOver",),
    "problem.constraints.expression": ("Expression",),
    "problem.constraints.motions": (
        "JointCoupling",
        "ManipulabilityAbove",
        "PairClearance",
        "ToolAcceleration",
        "ToolSpeed",
        "WheelSpeed",
    ),
    "problem.constraints.points": ("OnArc", "OnCircle", "OnLine", "OnPlane", "PositionBox"),
    "problem.constraints.poses": ("FixedOrientation", "LookAt", "OnScrew", "OrientationCone", "RelativePose"),
    "problem.obstacles": ("Box", "Capsule", "Cylinder", "HalfSpace", "Mesh", "Octree", "PointCloud", "Sphere"),
    "problem.goals_and_vias": ("JointGoal", "PoseGoal"),
    "problem.grasps.statement": ("Grasps",),
    "problem.regions.region": ("RegionGoal",),
    "problem.objectives.objective": ("Objective",),
    "problem.problem": ("Problem",),
    "geometry.pose": ("Pose",),
    "problem.statement": ("AllOf", "Region", "ViaPoint"),
    "problem.task.builder": ("Path", "Task", "Tour"),
    "problem.tools.statement": ("Tool",),
    "robot.robot": ("Robot",),
    "runs.run": ("Run",),
    "simulation.log": ("Log", "ObjectLog", "WheelLog"),
    "simulation.plants.task_plant": ("FrictionGrip",),
    "simulation.simulation": ("Simulation",),
    "service.cell": ("RemoteExecution",),
    "service.client": ("Client",),
    "trajectory.sample_file": ("Samples",),
    "trajectory.trajectory": ("Trajectory",),
    "verify.bounds.duration_bound": ("DurationBound",),
    "verify.report": ("Check", "Report"),
}
_HOME = {name: f"optiplan.{room}" for room, names in _ROOMS.items() for name in names}

# fmt: off
__all__ = [
    "AccelerationLimit", "AllOf", "Assignment", "Attachment",
    "BaseMotionTask", "Batch", "BenchResults", "Box", "Budget",
    "Capabilities", "Capsule", "CentreOfMassTask", "Check", "Chunk", "ClearanceLimit", "Client", "ControlProblem",
    "ControlStep", "Controller", "Cylinder",
    "DampingTask", "DesignResult", "Driver", "DurationBound",
    "Execution", "Executor", "Expression",
    "Failure", "FixedOrientation", "FrictionGrip",
    "Grasps",
    "HalfSpace", "HalfSpaceLimit",
    "InputError",
    "JerkLimit", "JointCoupling", "JointCouplingTask", "JointGoal",
    "KeptSeparation",
    "Log", "LookAt", "LookAtTask",
    "ManipulabilityAbove", "ManipulabilityTask", "Measurement", "Mesh",
    "ObjectLog", "Objective", "Obstacle", "Octree", "OnArc", "OnCircle", "OnLine", "OnPlane", "OnScrew",
    "OptiPlanError", "OrientationCone", "OrientationTask",
    "PairClearance", "Path", "PlaceRange", "Placement", "PlanResult", "Planner", "PointCloud", "Policy", "Pose",
    "PoseGoal", "PoseTask", "PositionBox", "PositionLimit", "PositionTask", "PostureTask", "Problem",
    "Region", "RegionGoal", "RelativePose", "RelativePoseTask", "RemoteExecution", "Replanner", "Report", "Robot",
    "Run",
    "SafePairs", "Safety", "Samples", "Scene", "Separation", "Simulation", "Sphere", "State", "Status", "Stopping",
    "Task", "Tick", "TipOver", "Tool", "ToolAcceleration", "ToolSpeed", "ToolSpeedLimit", "TorqueLimit", "Tour",
    "TrackingPolicy", "Trajectory", "TrajectoryNlp",
    "VelocityLimit", "ViaPoint", "View",
    "WheelLog", "WheelSpeed", "WheelSpeedLimit",
    "__version__",
    "assign", "bench", "bound", "casadi_problem", "certify", "check", "design", "driver", "execute", "ik",
    "import_scene", "init_robot", "load_problem", "load_robot", "load_run", "place", "plan", "plan_batch", "plan_many",
    "planners", "plot", "retime", "robots", "simulate", "verify", "view", "workspace",
]
# fmt: on


def __getattr__(name: str) -> Any:
    """A public name, from where it is at home; it is loaded once."""
    if name not in _HOME:
        raise AttributeError(f"module 'optiplan' has no attribute {name!r}")
    if name in _ROOMS_CALLED:
        return _imported(f"optiplan.{name}")
    if name in _LOADED_WITH:
        _imported(_LOADED_WITH[name])
    value = globals()[name] = getattr(_imported(_HOME[name]), name)
    return value


def _imported(module: str) -> ModuleType:
    """A module, imported without looks for garbage: all that is made stays, and looking takes a fifth of the time.

    What it made is old afterwards, as if it had been looked through: else the next two looks would take 0.03 s each.
    """
    looks = gc.isenabled()
    gc.disable()
    try:
        return import_module(module)
    finally:
        if looks:
            if gc.get_freeze_count() < 1000:  # nothing of somebody else's, which would thaw; Python 3.12 itself has 375
                gc.freeze()
                gc.unfreeze()
            gc.enable()


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)


_LOADED_WITH = {"plan": "optiplan.planners.trajopt.planner"}
"""What most first calls of a function would wait for: it is loaded with the name."""

_ROOMS_CALLED = ("bench", "planners", "verify", "workspace")
"""Rooms that have the name of a function: `op.verify(…)` is the function, `optiplan.verify.report` one of its files."""


class _CalledRoom(ModuleType):
    # A room that does, when it is called, what the function of its name does, and has its help.

    @property
    def __doc__(self) -> str | None:  # type: ignore[override]
        """That of the function."""
        return inspect.getdoc(self._function)

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
