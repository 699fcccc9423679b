"""Third-party planners: classes named as `package.module:Class`, and objects with a method `plan`."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from inspect import isabstract
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np

from optiplan.errors import InputError, Issue, described
from optiplan.planners.base import Budget, Planner, PlanResult, Progress
from optiplan.planners.option_schema import default_of, in_words, option_error
from optiplan.problem.problem import Problem

PlannerClass: TypeAlias = type[Planner[Any]]


def planner_class(where: str) -> PlannerClass:
    """Import the class at `package.module:Class`; one not derived from `Planner` as a subclass with its defaults."""
    return _derived(_imported(where))


def checked_class(where: str) -> PlannerClass:
    """Import the class at `package.module:Class`.

    Raises:
        InputError: it cannot be imported, or has no method `plan` or no `Options`.
    """
    try:
        cls = _imported(where)
        fields(cls.Options)
        planner = _derived(cls)
        if isabstract(planner):
            raise TypeError("no method plan")
    except (Exception, SystemExit) as error:  # whatever a third-party module raises on import
        found = f"{type(error).__name__}: {error}"
        expected = (
            "package.module:Class that can be imported, with a method plan and an options dataclass as its attribute "
            "Options"
        )
        raise InputError([Issue.of_option(where, "name", found, expected)]) from error
    return planner


def _imported(where: str) -> Any:
    module, _, path = where.partition(":")
    return attrgetter(path)(import_module(module))


def _derived(cls: type[Any]) -> PlannerClass:
    if issubclass(cls, Planner):
        return cls
    return type(cls.__name__, (cls, Planner), {"__module__": cls.__module__, "__doc__": cls.__doc__})


def planner_object(given: Any) -> Planner[Any] | None:
    """Return an object as a planner: itself, or an adapter of one that only has a method `plan`; None without one."""
    if isinstance(given, Planner):
        return given
    if isinstance(given, type) or not callable(getattr(given, "plan", None)):
        return None
    named: type[_Adapter] = type(type(given).__name__, (_Adapter,), {})
    return named(given)


def options_set(planner: Planner[Any]) -> dict[str, Any]:
    """Return the options of a planner object that differ from their defaults."""
    options = getattr(planner, "options", None)
    if not is_dataclass(options):
        return dict(options) if isinstance(options, Mapping) else {}
    values = {f: getattr(options, f.name) for f in fields(options)}
    return {f.name: value for f, value in values.items() if not _same(value, default_of(f))}


def _same(value: Any, default: Any) -> bool:
    """Whether an option has its default; arrays of other shapes cannot be compared, nor what holds arrays."""
    try:
        return bool(np.all(value == default))
    except ValueError:
        return False


_STATED = "passes_vias", "joins_legs", "holds_constraints", "end_derivatives", "times_obstacles"
_METHODS = "replan", "near", "check"
"""What an object may have beside `plan`, with the meaning of `Planner`."""


class _Adapter(Planner[Any]):
    """Adapter of an object whose class is not derived from `Planner`; its own class takes the name of that class."""

    def __init__(self, planner: Any) -> None:
        super().__init__(getattr(planner, "options", None))
        self.planner = planner
        for name in _STATED:
            usual = getattr(self, name)
            stated, kind = getattr(planner, name, usual), type(usual)
            try:
                setattr(self, name, kind(stated))
            except (TypeError, ValueError):
                raise option_error(type(self).__name__, name, described(stated), in_words(kind.__name__)) from None
        for name in _METHODS:
            setattr(self, name, getattr(planner, name, getattr(self, name)))

    def plan(self, problem: Problem, budget: Budget, progress: Progress) -> PlanResult:
        """Return the result of the object."""
        answer: PlanResult = self.planner.plan(problem, budget, progress)
        return answer
