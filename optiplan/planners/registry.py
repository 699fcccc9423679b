"""Planners by name, imported on first use so that listing them is cheap."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from inspect import isabstract
from operator import attrgetter
from typing import Any, TypeAlias

from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.planners.base import Budget, Planner, PlanResult, Progress
from optiplan.planners.option_schema import Option, make_options, options_of
from optiplan.problem.problem import Problem

PlannerClass: TypeAlias = type[Planner[Any]]

FAMILIES = ("optimisation", "sampling", "polynomial", "via points", "Cartesian")
"""What planners are listed under: how they find their motion."""

LIBRARIES = {
    "optimisation": ("ompl.geometric", "toppra.algorithm"),
    "sampling": ("ompl.geometric", "toppra.algorithm"),
    "Cartesian": ("toppra.algorithm",),
}
"""Slow to import, by family, and not always needed."""


@dataclass(frozen=True)
class PlannerEntry:
    """Registry entry of a planner; `load` imports its class.

    `family` is one of `FAMILIES`; `optiplan planners` lists them in that order.
    """

    name: str
    family: str
    summary: str
    load: Callable[[], PlannerClass]

    def option_list(self) -> tuple[Option, ...]:
        """Return the options with their defaults."""
        return options_of(self.load().Options)


PLANNERS: dict[str, PlannerEntry] = {}
"""The planners that come along, by name."""


def _listed(name: str, family: str, summary: str) -> Callable[[Callable[[], PlannerClass]], None]:
    """Register the planner whose class the decorated function imports."""

    def add(load: Callable[[], PlannerClass]) -> None:
        PLANNERS[name] = PlannerEntry(name, family, summary, load)

    return add


@_listed("arc", "Cartesian", "tool along a circle to the goal, through a point or about a centre (moveC)")
def _arc() -> PlannerClass:
    from optiplan.planners.cartesian.arc import Arc

    return Arc


@_listed(
    "bangbang",
    "polynomial",
    "least time under acceleration and velocity bounds: full acceleration, then full deceleration",
)
def _bangbang() -> PlannerClass:
    from optiplan.planners.point_to_point.bangbang import BangBangPlanner

    return BangBangPlanner


@_listed("bitstar", "sampling", "sampled path that shortens batch by batch (OMPL's BIT*; it does not bind AIT*)")
def _bitstar() -> PlannerClass:
    from optiplan.planners.sampling.bitstar import BitStar

    return BitStar


@_listed("circle", "Cartesian", "tool once round and back to the start, whose pose is the goal")
def _circle() -> PlannerClass:
    from optiplan.planners.cartesian.circle import Circle

    return Circle


@_listed("cubic", "polynomial", "one polynomial of degree three a joint")
def _cubic() -> PlannerClass:
    from optiplan.planners.point_to_point.cubic import Cubic

    return Cubic


@_listed("informed_rrtstar", "sampling", "RRT* that samples only where a shorter path can pass (OMPL's Informed RRT*)")
def _informed_rrtstar() -> PlannerClass:
    from optiplan.planners.sampling.rrtstar import InformedRrtStar

    return InformedRrtStar


@_listed("kpiece", "sampling", "two trees guided by how well they cover the work space (OMPL's LBKPIECE1)")
def _kpiece() -> PlannerClass:
    from optiplan.planners.sampling.kpiece import Kpiece

    return Kpiece


@_listed("line", "Cartesian", "tool straight to the goal, turning evenly about one axis (moveL)")
def _line() -> PlannerClass:
    from optiplan.planners.cartesian.line import Line

    return Line


@_listed("lspb", "polynomial", "trapezoid in velocity, by velocity, blend time or acceleration, or the fastest")
def _lspb() -> PlannerClass:
    from optiplan.planners.point_to_point.lspb import Lspb

    return Lspb


@_listed(
    "parabolic",
    "via points",
    "constant velocities between vias, changed at constant rates around them (linear with parabolic blends)",
)
def _parabolic() -> PlannerClass:
    from optiplan.planners.vias.parabolic import Parabolic

    return Parabolic


@_listed("prm", "sampling", "lazy roadmap of the scene; from Python, one object reuses it for later queries")
def _prm() -> PlannerClass:
    from optiplan.planners.sampling.prm import Prm

    return Prm


@_listed(
    "quintic",
    "polynomial",
    "one polynomial of degree five a joint, straight to the goal; the planner to read first",
)
def _quintic() -> PlannerClass:
    from optiplan.planners.point_to_point.quintic import Quintic

    return Quintic


@_listed(
    "rounded",
    "via points",
    "straight joint-space lines between vias, corners rounded within a stated deviation, timed along the path",
)
def _rounded() -> PlannerClass:
    from optiplan.planners.vias.rounded import Rounded

    return Rounded


@_listed("rrtconnect", "sampling", "sampled path (OMPL's RRT-Connect), shortened, with rounded corners, then timed")
def _rrtconnect() -> PlannerClass:
    from optiplan.planners.sampling.rrtconnect import RrtConnect

    return RrtConnect


@_listed("rrtstar", "sampling", "sampled path that shortens as its tree grows (OMPL's RRT*)")
def _rrtstar() -> PlannerClass:
    from optiplan.planners.sampling.rrtstar import RrtStar

    return RrtStar


@_listed(
    "sclerp",
    "Cartesian",
    "the tool moves along a screw: dual quaternions, every step a quadratic program within limits",
)
def _sclerp() -> PlannerClass:
    from optiplan.planners.sclerp.planner import Sclerp

    return Sclerp


@_listed("scurve", "polynomial", "fastest straight line in joint space with limited jerk (Ruckig)")
def _scurve() -> PlannerClass:
    from optiplan.planners.point_to_point.scurve import SCurvePlanner

    return SCurvePlanner


@_listed("screw", "Cartesian", "tool along one screw to the goal: turning about an axis while sliding along it")
def _screw() -> PlannerClass:
    from optiplan.planners.cartesian.screw import Screw

    return Screw


@_listed("septic", "polynomial", "one polynomial of degree seven a joint, with any jerk at the ends")
def _septic() -> PlannerClass:
    from optiplan.planners.point_to_point.septic import Septic

    return Septic


@_listed(
    "spline",
    "via points",
    "cubic or quintic spline through all vias without stopping: given, heuristic or smoothest velocities",
)
def _spline() -> PlannerClass:
    from optiplan.planners.vias.spline import Spline

    return Spline


@_listed(
    "taskspace", "Cartesian", "the task-space controller rolled out, led along a sampled path where it stands still"
)
def _taskspace() -> PlannerClass:
    from optiplan.planners.cartesian.taskspace import TaskSpace

    return TaskSpace


@_listed(
    "trajopt",
    "optimisation",
    "minimum-time B-spline by sequential quadratic programming with exact collision distances; the default",
)
def _trajopt() -> PlannerClass:
    from optiplan.planners.trajopt.planner import TrajOpt

    return TrajOpt


def planner_entry(name: str) -> PlannerEntry:
    """Return the entry of that name; `package.module:Class` names a third-party planner, which need not be listed.

    Such a class has the interface of `Planner`, preferably by deriving from it: it is constructed from its options, a
    frozen dataclass that it has as the attribute `Options`.

    Raises:
        UnknownChoiceError: no such planner.
        InputError: a third-party planner that cannot be imported, or has no `Options`.
    """
    if ":" in name:
        return _from_outside(name)
    if name not in PLANNERS:
        raise UnknownChoiceError("planner", name, PLANNERS)
    return PLANNERS[name]


def make_planner(name: str, options: Mapping[str, Any] | None = None) -> Planner[Any]:
    """Construct the planner of that name with these options, the others at their defaults.

    Raises:
        UnknownChoiceError: no such planner, or no such option; lists the valid ones with their types.
        InputError: values of the wrong type or out of range; holds all of the wrong type.
    """
    cls = planner_entry(name).load()
    return cls(make_options(name, cls.Options, options or {}))


def load_libraries(name: str) -> None:
    """Import what the planner of that name may need, so that no caller of a process that stays waits for it."""
    for module in LIBRARIES.get(PLANNERS[name].family, ()) if name in PLANNERS else ():
        import_module(module)


def planner_object(given: Any) -> Planner[Any] | None:
    """An object as a planner: itself, or what stands for one that has a method `plan` alone; None if it has none."""
    if isinstance(given, Planner):
        return given
    if isinstance(given, type) or not callable(getattr(given, "plan", None)):
        return None
    named: type[_StandIn] = type(type(given).__name__, (_StandIn,), {})
    return named(given)


def options_set(planner: Planner[Any]) -> dict[str, Any]:
    """The options of a planner object that are not at their defaults; of one that has none, none."""
    options = getattr(planner, "options", None)
    if not is_dataclass(options):
        return dict(options) if isinstance(options, Mapping) else {}
    return {f.name: value for f in fields(options) if (value := getattr(options, f.name)) != f.default}


class _StandIn(Planner[Any]):
    """Stands for an object whose class is not derived from `Planner`, under the name of that class."""

    def __init__(self, planner: Any) -> None:
        super().__init__(getattr(planner, "options", None))
        self.planner = planner
        self.passes_vias = bool(getattr(planner, "passes_vias", False))
        self.end_derivatives = int(getattr(planner, "end_derivatives", 0))
        self.times_obstacles = bool(getattr(planner, "times_obstacles", False))

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """What the object answers."""
        answer: PlanResult = self.planner.plan(problem, budget, progress)
        return answer


def _from_outside(name: str) -> PlannerEntry:
    module, path = name.split(":")
    try:
        cls = attrgetter(path)(import_module(module))
        fields(cls.Options)
        planner = _with_defaults(cls)
        if isabstract(planner):
            raise TypeError("no method plan")
    except (Exception, SystemExit) as error:  # whatever a third-party module raises on import
        found = f"{type(error).__name__}: {error}"
        expected = (
            "package.module:Class that can be imported, with a method plan and an options dataclass as its attribute "
            "Options"
        )
        raise InputError([Issue.of_option(name, "name", found, expected)]) from error
    return PlannerEntry(name, "outside", (cls.__doc__ or "").partition("\n")[0], lambda: planner)


def _with_defaults(cls: type[Any]) -> PlannerClass:
    """Return the class itself or, where it does not derive from `Planner`, a subclass with that class's defaults."""
    if issubclass(cls, Planner):
        return cls
    return type(cls.__name__, (cls, Planner), {"__module__": cls.__module__, "__doc__": cls.__doc__})
