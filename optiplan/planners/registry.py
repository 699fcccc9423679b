"""Planners by name. They are imported when they are asked for: listing them costs nothing."""

import re
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from importlib import import_module
from inspect import cleandoc
from operator import attrgetter
from types import NoneType
from typing import Any, Literal, cast, get_args, get_origin, get_type_hints

from pydantic import ConfigDict, TypeAdapter, ValidationError

from optiplan.config.messages import describe
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.planners.base import Planner
from optiplan.planners.option_schema import in_words, out_of_range


@dataclass(frozen=True)
class Option:
    """One setting of a planner: its type in words (`float`, `list of float`, `a | b`), its default and its meaning.

    The meaning is what the `Attributes:` of the options' class say of it; empty when they do not.
    """

    name: str
    kind: str
    default: Any
    meaning: str = ""


@dataclass(frozen=True)
class PlannerEntry:
    """Where a planner lives: `planner` and `options` are `module:name` of its class and of its options dataclass.

    `family` is one of `FAMILIES`; `optiplan planners` lists them in that order.
    """

    name: str
    summary: str
    planner: str
    options: str
    family: str = "polynomial"

    def option_list(self) -> tuple[Option, ...]:
        """What can be set, with defaults; imports the options' module."""
        cls = _load(self.options)
        types = get_type_hints(cls)
        told = _meanings(cls)
        return tuple(
            Option(f.name, kind_of(types[f.name]), f.default, told.get(f.name, ""))
            for f in fields(cls)
            if f.default is not MISSING
        )


FAMILIES = ("optimisation", "sampling", "polynomial", "via points", "Cartesian")
"""What planners are listed under: how they find their motion."""

LIBRARIES = {
    "optimisation": ("ompl.geometric", "toppra.algorithm"),
    "sampling": ("ompl.geometric", "toppra.algorithm"),
    "Cartesian": ("toppra.algorithm",),
}
"""Slow to import, by family: when a planner is made, because loading them is no part of anybody's budget."""

PLANNERS: dict[str, PlannerEntry] = {
    entry.name: entry
    for entry in (
        PlannerEntry(
            "arc",
            "tool along a circle to the goal, through a point or about a centre (moveC)",
            "optiplan.planners.cartesian.arc:Arc",
            "optiplan.planners.cartesian.arc:ArcOptions",
            "Cartesian",
        ),
        PlannerEntry(
            "bangbang",
            "least time under acceleration and velocity bounds: full acceleration, then full deceleration",
            "optiplan.planners.point_to_point.bangbang:BangBangPlanner",
            "optiplan.planners.point_to_point.bangbang:BangBangOptions",
        ),
        PlannerEntry(
            "bitstar",
            "sampled path that shortens batch by batch (OMPL's BIT*; it does not bind AIT*)",
            "optiplan.planners.sampling.bitstar:BitStar",
            "optiplan.planners.sampling.bitstar:BitStarOptions",
            "sampling",
        ),
        PlannerEntry(
            "circle",
            "tool once round and back to the start, whose pose is the goal",
            "optiplan.planners.cartesian.circle:Circle",
            "optiplan.planners.cartesian.circle:CircleOptions",
            "Cartesian",
        ),
        PlannerEntry(
            "cubic",
            "one polynomial of degree three a joint",
            "optiplan.planners.point_to_point.cubic:Cubic",
            "optiplan.planners.point_to_point.polynomials:EndOptions",
        ),
        PlannerEntry(
            "informed_rrtstar",
            "RRT* that samples only where a shorter path can pass (OMPL's Informed RRT*)",
            "optiplan.planners.sampling.rrtstar:InformedRrtStar",
            "optiplan.planners.sampling.rrtstar:RrtStarOptions",
            "sampling",
        ),
        PlannerEntry(
            "kpiece",
            "two trees guided by how well they cover the work space (OMPL's LBKPIECE1)",
            "optiplan.planners.sampling.kpiece:Kpiece",
            "optiplan.planners.sampling.kpiece:KpieceOptions",
            "sampling",
        ),
        PlannerEntry(
            "line",
            "tool straight to the goal, turning evenly about one axis (moveL)",
            "optiplan.planners.cartesian.line:Line",
            "optiplan.planners.cartesian.base:ToolMotionOptions",
            "Cartesian",
        ),
        PlannerEntry(
            "lspb",
            "trapezoid in velocity, by velocity, blend time or acceleration, or the fastest",
            "optiplan.planners.point_to_point.lspb:Lspb",
            "optiplan.planners.point_to_point.lspb:LspbOptions",
        ),
        PlannerEntry(
            "parabolic",
            "constant velocities between vias, changed at constant rates around them (linear with parabolic blends)",
            "optiplan.planners.vias.parabolic:Parabolic",
            "optiplan.planners.vias.parabolic:ParabolicOptions",
            "via points",
        ),
        PlannerEntry(
            "prm",
            "lazy roadmap of the scene; from Python, one object reuses it for later queries",
            "optiplan.planners.sampling.prm:Prm",
            "optiplan.planners.sampling.prm:PrmOptions",
            "sampling",
        ),
        PlannerEntry(
            "quintic",
            "one polynomial of degree five a joint, straight to the goal; the planner to read first",
            "optiplan.planners.point_to_point.quintic:Quintic",
            "optiplan.planners.point_to_point.quintic:QuinticOptions",
        ),
        PlannerEntry(
            "rounded",
            "straight joint-space lines between vias, corners rounded within a stated deviation, timed along the path",
            "optiplan.planners.vias.rounded:Rounded",
            "optiplan.planners.vias.rounded:RoundedOptions",
            "via points",
        ),
        PlannerEntry(
            "rrtconnect",
            "sampled path (OMPL's RRT-Connect), shortened, with rounded corners, then timed",
            "optiplan.planners.sampling.rrtconnect:RrtConnect",
            "optiplan.planners.sampling.rrtconnect:RrtConnectOptions",
            "sampling",
        ),
        PlannerEntry(
            "rrtstar",
            "sampled path that shortens as its tree grows (OMPL's RRT*)",
            "optiplan.planners.sampling.rrtstar:RrtStar",
            "optiplan.planners.sampling.rrtstar:RrtStarOptions",
            "sampling",
        ),
        PlannerEntry(
            "sclerp",
            "the tool moves along a screw: dual quaternions, every step a quadratic program within limits",
            "optiplan.planners.sclerp.planner:Sclerp",
            "optiplan.planners.sclerp.options:SclerpOptions",
            "Cartesian",
        ),
        PlannerEntry(
            "scurve",
            "fastest straight line in joint space with limited jerk (Ruckig)",
            "optiplan.planners.point_to_point.scurve:SCurvePlanner",
            "optiplan.planners.point_to_point.base:ProfileOptions",
        ),
        PlannerEntry(
            "screw",
            "tool along one screw to the goal: turning about an axis while sliding along it",
            "optiplan.planners.cartesian.screw:Screw",
            "optiplan.planners.cartesian.screw:ScrewOptions",
            "Cartesian",
        ),
        PlannerEntry(
            "septic",
            "one polynomial of degree seven a joint, with any jerk at the ends",
            "optiplan.planners.point_to_point.septic:Septic",
            "optiplan.planners.point_to_point.septic:SepticOptions",
        ),
        PlannerEntry(
            "spline",
            "cubic or quintic spline through all vias without stopping: given, heuristic or smoothest velocities",
            "optiplan.planners.vias.spline:Spline",
            "optiplan.planners.vias.spline:SplineOptions",
            "via points",
        ),
        PlannerEntry(
            "trajopt",
            "minimum-time B-spline by sequential quadratic programming with exact collision distances; the default",
            "optiplan.planners.trajopt.planner:TrajOpt",
            "optiplan.planners.trajopt.options:TrajOptOptions",
            "optimisation",
        ),
    )
}


def planner_entry(name: str) -> PlannerEntry:
    """The entry of that name; `package.module:Class` names a planner from outside, which need not be listed.

    Such a class is like ours: made from its options, a frozen dataclass that it has as the attribute `Options`.

    Raises:
        UnknownChoiceError: there is none.
        InputError: a planner from outside that cannot be imported, or has no `Options`.
    """
    if ":" in name:
        return _from_outside(name)
    if name not in PLANNERS:
        raise UnknownChoiceError("planner", name, PLANNERS)
    return PLANNERS[name]


def _from_outside(name: str) -> PlannerEntry:
    try:
        summary = (_load(name).__doc__ or "").partition("\n")[0]
        fields(_load(f"{name}.Options"))
    except (Exception, SystemExit) as error:  # whatever happens while a foreign module is imported
        found = f"{type(error).__name__}: {error}"
        expected = "package.module:Class that can be imported, with an options dataclass as its attribute Options"
        raise InputError([Issue(f"planner '{name}'", None, "name", found, expected)]) from error
    return PlannerEntry(name, summary, name, f"{name}.Options", "outside")


def make_planner(name: str, options: Mapping[str, Any] | None = None) -> Planner:
    """The planner of that name with these options, the others at their defaults.

    Raises:
        UnknownChoiceError: no such planner, or no such option; lists the valid ones with their types.
        InputError: values of the wrong type or out of range; holds all of them.
    """
    entry = planner_entry(name)
    valid = {option.name: option for option in entry.option_list()}
    types = get_type_hints(_load(entry.options))
    values: dict[str, Any] = {}
    issues = []
    for key, value in (options or {}).items():
        if key not in valid:
            described = [f"{o.name} ({o.kind}, default {o.default})" for o in valid.values()]
            raise UnknownChoiceError(f"option of planner '{name}'", key, described)
        try:
            values[key] = TypeAdapter(types[key], config=ConfigDict(strict=True)).validate_python(_frozen(value))
        except ValidationError:
            issues.append(Issue(f"planner '{name}'", None, key, describe(value), in_words(valid[key].kind)))
    if issues:
        raise InputError(issues)
    try:
        made = _load(entry.options)(**values)
    except ValueError as error:  # the dataclass checks ranges by itself
        raise InputError([out_of_range(name, valid, str(error))]) from None
    for module in LIBRARIES.get(entry.family, ()):
        import_module(module)
    return cast(Planner, _load(entry.planner)(made))


def kind_of(hint: Any) -> str:
    """An option's type in words; None, which stands for "not given", is left out."""
    if get_origin(hint) is Literal:
        return " | ".join(map(str, get_args(hint)))
    if get_origin(hint) is tuple:
        return f"list of {kind_of(get_args(hint)[0])}"
    parts = [part for part in get_args(hint) if part is not NoneType]
    return " | ".join(map(kind_of, parts)) if parts else str(hint.__name__)


def _frozen(value: Any) -> Any:
    """Lists of YAML as tuples, at any depth."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _meanings(cls: type) -> dict[str, str]:
    """Each attribute's lines in the docstrings of a class and its bases, as one."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        for name, text in re.findall(r"^ {4}(\w+): (.+(?:\n {5,}.+)*)", cleandoc(base.__doc__ or ""), re.MULTILINE):
            found[name] = " ".join(text.split())
    return found


def _load(target: str) -> Any:
    module, name = target.split(":")
    return attrgetter(name)(import_module(module))
