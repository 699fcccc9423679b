import sys
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Literal, Protocol

import numpy as np
import pytest

from optiplan.errors import InputError, UnknownChoiceError
from optiplan.planners.base import Planner
from optiplan.planners.option_schema import OptionError, PlannerOptions, kind_of, option
from optiplan.planners.registry import FAMILIES, PLANNERS, make_planner, planner_entry
from optiplan.planners.third_party import options_set
from tests.planners import cases


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_every_entry_loads_and_lists_its_options(name):
    planner = make_planner(name, cases.OPTIONS.get(name))
    options = PLANNERS[name].option_list()
    assert options
    assert all(option.kind for option in options)
    assert PLANNERS[name].family in FAMILIES
    assert type(planner) is PLANNERS[name].load()
    assert isinstance(planner, Planner)


def test_unknown_planner_lists_the_choices():
    with pytest.raises(UnknownChoiceError, match=f"unknown planner 'rrt'; choose from: {', '.join(sorted(PLANNERS))}"):
        make_planner("rrt")


def test_unknown_option_lists_options_with_types():
    with pytest.raises(UnknownChoiceError, match=r"goals \(int, default 8\), .*reach \(float, default 0.4\)"):
        make_planner("rrtconnect", {"raech": 1.0})


def test_all_wrong_types_are_reported_at_once():
    with pytest.raises(InputError) as caught:
        make_planner("rrtconnect", {"reach": "far", "goals": 2.5, "attempts": True})
    assert [(issue.field, issue.found, issue.expected) for issue in caught.value.issues] == [
        ("reach", "'far'", "a number"),
        ("goals", "2.5", "a whole number"),
        ("attempts", "true", "a whole number"),
    ]


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_every_option_says_what_it_is(name):
    assert [option.name for option in PLANNERS[name].option_list() if not option.meaning] == []


def test_meanings_come_from_the_fields_of_a_class_and_its_bases():
    options = {option.name: option.meaning for option in PLANNERS["rrtstar"].option_list()}
    assert options["reach"] == "longest tree edge, s at full joint speed."
    assert options["goals"].startswith("goal configurations")


def test_a_value_out_of_range_is_told_of_its_option():
    with pytest.raises(InputError) as caught:
        make_planner("rrtconnect", {"reach": -1.0})
    assert [issue.field for issue in caught.value.issues] == ["reach"]


@pytest.mark.parametrize(
    ("hint", "words"),
    [
        (float, "float"),
        (float | None, "float"),
        (tuple[float, ...] | None, "list of float"),
        (tuple[tuple[float, ...], ...], "list of list of float"),
        (Literal["literal", "qp"], "literal | qp"),
        (list[float], "list of float"),
        (dict[str, float] | None, "dict"),
    ],
)
def test_types_in_words(hint, words):
    assert kind_of(hint) == words


def test_an_int_stands_for_a_float():
    assert make_planner("rrtconnect", {"reach": 1}).options.reach == 1.0


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("rrtconnect", {"reach": 0.0}),
        ("rrtconnect", {"attempts": -1}),
        ("quintic", {"goals": 0}),
        ("trajopt", {"spans": 2}),
        ("trajopt", {"bunching": 1.0}),
        ("trajopt", {"good_enough": 0.5}),
        ("trajopt", {"solver": "abacus"}),
    ],
)
def test_values_out_of_range_are_input_errors(name, options):
    with pytest.raises(InputError, match=next(iter(options))):
        make_planner(name, options)


@dataclass(frozen=True)
class StillOptions:
    seconds: float = 1.0


class Still:
    """Plans nothing."""

    Options = StillOptions

    def __init__(self, options):
        self.options = options

    def plan(self, problem, budget, progress):
        raise NotImplementedError


def test_a_planner_from_outside_is_named_by_module_and_class(monkeypatch):
    monkeypatch.setitem(sys.modules, "somewhere", SimpleNamespace(Still=Still, Bare=object))
    assert planner_entry("somewhere:Still").summary == "Plans nothing."
    made = make_planner("somewhere:Still", {"seconds": 2})
    assert made.options == StillOptions(2.0)
    assert made.passes_vias is False, "what it does not state is a planner's default"
    assert made.check(None, None) is None
    with pytest.raises(UnknownChoiceError, match=r"seconds \(float, default 1.0\)"):
        make_planner("somewhere:Still", {"second": 2})
    for name, words in (("nowhere:Still", "No module named 'nowhere'"), ("somewhere:Bare", "no attribute 'Options'")):
        with pytest.raises(InputError, match=words):
            make_planner(name)


class Spoken(Protocol):
    """What pydantic cannot check."""


@dataclass(frozen=True)
class NeedyOptions(PlannerOptions):
    speed: float
    places: list[float] = field(default_factory=lambda: [1.0])
    weights: np.ndarray | None = None
    scale: np.ndarray = field(default_factory=lambda: np.ones(2))
    still: StillOptions = field(default_factory=StillOptions)
    spoken: Spoken | None = None


def test_options_without_a_plain_default_or_type(monkeypatch):
    class Needy(Still):
        Options = NeedyOptions

    monkeypatch.setitem(sys.modules, "somewhere", SimpleNamespace(Needy=Needy))
    listed = [(one.name, one.default) for one in planner_entry("somewhere:Needy").option_list()]
    assert listed[:3] == [("speed", "required"), ("places", [1.0]), ("weights", None)]
    given = {"speed": 2.0, "weights": np.ones(2), "places": [2.0], "still": StillOptions(2.0), "spoken": "yes"}
    made = make_planner("somewhere:Needy", given)
    assert vars(made.options) == given | {"scale": made.options.scale}
    assert options_set(made) == given
    for options, words in (
        ({}, "'speed'"),
        ({"speed": 1.0, "weights": [1, 2]}, "weights: a list of 2 values; expected ndarray"),
        ({"speed": 1.0, "places": "here"}, "places: 'here'; expected a list of numbers"),
        ({"speed": 1.0, "places": [float("nan")]}, "places: .*; expected a finite number"),
    ):
        with pytest.raises(InputError, match=words):
            make_planner("somewhere:Needy", options)


@dataclass(frozen=True)
class PatientOptions(PlannerOptions):
    patience: float = option(1.0, "s of waiting.", above=0, most=60)
    word: Literal["yes", "no"] = option("no", "what is said.")
    place: tuple[float, ...] | None = option(None, "(3,) m.", size=3)


def test_ranges_and_meanings_are_stated_once_by_the_field(monkeypatch):
    class Patient(Still):
        Options = PatientOptions
        passes_vias = True

    monkeypatch.setitem(sys.modules, "somewhere", SimpleNamespace(Patient=Patient))
    listed = planner_entry("somewhere:Patient").option_list()
    assert [(one.name, one.kind, one.meaning) for one in listed] == [
        ("patience", "float", "s of waiting."),
        ("word", "yes | no", "what is said."),
        ("place", "list of float", "(3,) m."),
    ]
    assert make_planner("somewhere:Patient").passes_vias
    for name, value, expected in (
        ("patience", 61, "a number > 0 and ≤ 60"),
        ("patience", float("nan"), "a number > 0 and ≤ 60"),
        ("place", [1.0, 2.0], "3 numbers"),
        ("word", "perhaps", "one of: yes, no"),
    ):
        with pytest.raises(InputError) as caught:
            make_planner("somewhere:Patient", {name: value})
        (issue,) = caught.value.issues
        assert (issue.planner, issue.field, issue.expected) == ("somewhere:Patient", name, expected)
    with pytest.raises(OptionError, match="patience = 0; expected a number > 0"):
        PatientOptions(patience=0)


def test_a_planner_from_outside_that_is_none(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "quits.py").write_text("raise SystemExit(0)")
    (tmp_path / "plain.py").write_text("class Planner:\n    Options = dict\n")
    (tmp_path / "idle.py").write_text(
        "from optiplan.planners.option_schema import PlannerOptions\n\nclass Planner:\n    Options = PlannerOptions\n"
    )
    for name, words in (
        ("quits:Planner", "SystemExit: 0"),
        ("plain:Planner", "dataclass"),
        ("idle:Planner", "no method plan"),
    ):
        with pytest.raises(InputError, match=words):
            make_planner(name)
