"""Planners by name, imported on first use so that listing them is cheap."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from optiplan.errors import UnknownChoiceError
from optiplan.planners.base import Planner
from optiplan.planners.option_schema import Option, make_options, options_of
from optiplan.planners.third_party import PlannerClass, checked_class, planner_class
from optiplan.records import dataclass

_BUNDLED = {
    "optimisation": {
        "casadi": (
            "trajopt.nonlinear.planner:CasadiPlanner",
            "the curves of trajopt by nonlinear programs of CasADi, with a solver of your choice (IPOPT, fatrop, …)",
        ),
        "trajopt": (
            "trajopt.planner:TrajOpt",
            "minimum-time B-spline by sequential quadratic programming with exact collision distances; the default",
        ),
    },
    "sampling": {
        "bitstar": (
            "sampling.tree_planners:BitStar",
            "sampled path that shortens batch by batch (OMPL's BIT*; it does not bind AIT*)",
        ),
        "informed_rrtstar": (
            "sampling.tree_planners:InformedRrtStar",
            "RRT* that samples only where a shorter path can pass (OMPL's Informed RRT*)",
        ),
        "kpiece": (
            "sampling.tree_planners:Kpiece",
            "two trees guided by how well they cover the work space (OMPL's LBKPIECE1)",
        ),
        "prm": ("sampling.prm:Prm", "lazy roadmap of the scene; from Python, one object reuses it for later queries"),
        "rrtconnect": (
            "sampling.tree_planners:RrtConnect",
            "sampled path (RRT-Connect of the native core, else OMPL's), shortened, with rounded corners, then timed",
        ),
        "rrtstar": ("sampling.tree_planners:RrtStar", "sampled path that shortens as its tree grows (OMPL's RRT*)"),
    },
    "polynomial": {
        "bangbang": (
            "point_to_point.bangbang:BangBangPlanner",
            "least time under acceleration and velocity bounds: full acceleration, then full deceleration",
        ),
        "cubic": ("point_to_point.polynomials:Cubic", "one polynomial of degree three a joint"),
        "lspb": (
            "point_to_point.lspb:Lspb",
            "trapezoid in velocity, by velocity, blend time or acceleration, or the fastest",
        ),
        "quintic": (
            "point_to_point.quintic:Quintic",
            "one polynomial of degree five a joint, straight to the goal; the planner to read first",
        ),
        "scurve": (
            "point_to_point.scurve:SCurvePlanner",
            "fastest straight line in joint space with limited jerk",
        ),
        "septic": (
            "point_to_point.polynomials:Septic",
            "one polynomial of degree seven a joint, with any jerk at the ends",
        ),
    },
    "via points": {
        "parabolic": (
            "vias.parabolic:Parabolic",
            "constant velocities between vias, changed at constant rates around them (linear with parabolic blends)",
        ),
        "rounded": (
            "vias.rounded:Rounded",
            "straight joint-space lines between vias, corners rounded within a stated deviation, timed along the path",
        ),
        "spline": (
            "vias.spline:Spline",
            "cubic or quintic spline through all vias without stopping: given, heuristic or smoothest velocities",
        ),
    },
    "Cartesian": {
        "arc": ("cartesian.arc:Arc", "tool along a circle to the goal, through a point or about a centre (moveC)"),
        "circle": ("cartesian.circle:Circle", "tool once round and back to the start, whose pose is the goal"),
        "line": ("cartesian.line:Line", "tool straight to the goal, turning evenly about one axis (moveL)"),
        "sclerp": (
            "sclerp.planner:Sclerp",
            "the tool moves along a screw: dual quaternions, every step a quadratic program within limits",
        ),
        "screw": (
            "cartesian.screw:Screw",
            "tool along one screw to the goal: turning about an axis while sliding along it",
        ),
        "taskspace": (
            "cartesian.taskspace:TaskSpace",
            "the task-space controller rolled out, led along a sampled path where it stands still",
        ),
    },
}
"""By family and name: module and class below `optiplan.planners`, and a summary of the planner."""

FAMILIES = tuple(_BUNDLED)
"""Families of planners: how they find their motion."""

LIBRARIES = {"optimisation": ("ompl.geometric",), "sampling": ("ompl.geometric",)}
"""Libraries by family that are slow to import and not always needed."""


@dataclass(frozen=True)
class PlannerEntry:
    """Registry entry of a planner.

    Attributes:
        name: what problem files and commands call it.
        family: one of `FAMILIES`, in whose order planners are listed; `outside` of a third-party planner.
        summary: what it does, in one line.
        where: `package.module:Class`.
    """

    name: str
    family: str
    summary: str
    where: str

    def load(self) -> PlannerClass:
        """Import the planner's class."""
        return planner_class(self.where)

    def option_list(self) -> tuple[Option, ...]:
        """Return the options with their defaults."""
        return options_of(self.load().Options)


PLANNERS = {
    name: PlannerEntry(name, family, summary, f"optiplan.planners.{where}")
    for name, family, where, summary in sorted(
        (name, family, *entry) for family, planners in _BUNDLED.items() for name, entry in planners.items()
    )
}
"""The bundled planners by name, in alphabetical order."""


def planner_entry(name: str) -> PlannerEntry:
    """Return the entry of that name; `package.module:Class` names a third-party planner, which need not be listed.

    Such a class has the interface of `Planner`, preferably by deriving from it. Its attribute `Options` is a frozen
    dataclass; it is constructed from an instance of that.

    Raises:
        UnknownChoiceError: no such planner.
        InputError: a third-party planner that cannot be imported, or has no `Options`.
    """
    if ":" in name:
        return PlannerEntry(name, "outside", (checked_class(name).__doc__ or "").partition("\n")[0], name)
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
    """Import the libraries that a planner may need, so that no later call waits for them."""
    for module in LIBRARIES.get(PLANNERS[name].family, ()) if name in PLANNERS else ():
        import_module(module)
