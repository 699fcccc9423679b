import pytest

from optiplan.cli.commands.planners import _yaml
from optiplan.planners.registry import FAMILIES, PLANNERS


def test_list_tells_options_and_defaults(optiplan, optiplan_json):
    code, out, _ = optiplan("planners")
    assert code == 0
    for name, entry in PLANNERS.items():
        assert f"{name}: " in out
        assert all(option.name in out for option in entry.option_list())
    code, data = optiplan_json("planners")
    assert code == 0
    options = {option["name"]: option for option in data["planners"]["trajopt"]["options"]}
    margin = options["margin"]
    assert margin.pop("meaning")
    assert margin == {"name": "margin", "kind": "float", "default": 0.005}


def test_planners_are_listed_by_family(optiplan):
    lines = optiplan("planners")[1].splitlines()
    places = [lines.index(family) for family in FAMILIES]
    assert places == sorted(places)
    for name, entry in PLANNERS.items():
        place = next(k for k, line in enumerate(lines) if line.startswith(f"{name}: "))
        above = [family for family, at in zip(FAMILIES, places, strict=True) if at < place]
        assert above[-1] == entry.family


@pytest.mark.parametrize(
    ("value", "text"), [(None, "not given"), (True, "true"), ((0.1, 2), "[0.1, 2]"), (0.5, "0.5"), ("qp", "qp")]
)
def test_defaults_are_written_as_in_a_file(value, text):
    assert _yaml(value) == text
