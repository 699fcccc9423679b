import pytest

from optiplan.errors import InputError
from optiplan.planners.option_schema import in_words
from optiplan.planners.registry import make_planner


@pytest.mark.parametrize(
    ("planner", "options", "field", "found", "expected"),
    [
        ("quintic", {"duration": "fast"}, "duration", "'fast'", "a number"),
        ("quintic", {"duration": -1}, "duration", "-1.0", "a number from 1e-06 to 1e+07"),
        ("quintic", {"motion": "all"}, "motion", "'all'", "one of: synchronised, independent, sequential"),
        ("quintic", {"start_velocity": 3}, "start_velocity", "3", "a list of numbers"),
        ("trajopt", {"samples": 3.5}, "samples", "3.5", "a whole number"),
        ("trajopt", {"samples": -3}, "samples", "-3", "a number from 2 to 10000"),
        ("trajopt", {"solver": "foo"}, "solver", "'foo'", "one of "),
        ("rrtconnect", {"reach": 0}, "reach", "0.0", "a number > 0"),
        ("rrtconnect", {"goals": True}, "goals", "true", "a whole number"),
        ("rrtconnect", {"attempts": -1}, "attempts", "-1", "a number ≥ 0"),
        ("circle", {"radius": -0.1, "plane": "xy"}, "radius", "-0.1", "a number > 0"),
        ("circle", {}, "centre", "nothing", "centre and normal, or radius and plane"),
        ("sclerp", {"goals": 0}, "goals", "0", "a number > 0"),
        ("sclerp", {"goals": 10**400}, "goals", "1" + 56 * "0" + "…", "a number > 0"),
    ],
)
def test_a_value_that_does_not_fit_is_told_with_what_would(planner, options, field, found, expected):
    with pytest.raises(InputError) as caught:
        make_planner(planner, options)
    (issue,) = caught.value.issues
    assert (issue.field, issue.found) == (field, found)
    assert expected in issue.expected


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("float", "a number"),
        ("list of int", "a list of whole numbers"),
        ("list of list of float", "a list, each a list of numbers"),
    ],
)
def test_kinds_in_words(kind, words):
    assert in_words(kind) == words
