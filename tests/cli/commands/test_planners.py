from itertools import cycle

import pytest

from optiplan.cli.commands.planners import _yaml
from optiplan.planners.registry import FAMILIES, PLANNERS


def test_options_and_defaults_of_the_planners_named(optiplan, optiplan_json, monkeypatch):
    for columns, (name, entry) in zip(cycle(["1000", "200"]), PLANNERS.items(), strict=False):
        monkeypatch.setenv("COLUMNS", columns)
        code, out, _ = optiplan("planners", name)
        assert code == 0
        assert out.startswith(f"{name}: ")
        assert all(f"  {option.name}: " in out for option in entry.option_list())
        assert not any(line.endswith(" ") for line in out.splitlines())
    code, data = optiplan_json("planners", "trajopt", "quintic")
    assert code == 0
    assert list(data["planners"]) == ["trajopt", "quintic"]
    options = {option["name"]: option for option in data["planners"]["trajopt"]["options"]}
    margin = options["margin"]
    assert margin.pop("meaning")
    assert margin == {"name": "margin", "kind": "float", "default": 0.005}


def test_without_names_json_has_the_options_of_all(optiplan_json):
    code, data = optiplan_json("planners")
    assert code == 0
    assert data["planners"].keys() == PLANNERS.keys()
    assert all(entry["options"] for entry in data["planners"].values())


def test_an_unknown_planner_is_bad_input(optiplan):
    code, _, err = optiplan("planners", "trajop")
    assert code == 2
    assert "trajopt" in err


def test_planners_are_listed_by_family(optiplan):
    lines = optiplan("planners")[1].splitlines()
    places = [lines.index(family) for family in FAMILIES]
    assert places == sorted(places)
    for name, entry in PLANNERS.items():
        place = next(k for k, line in enumerate(lines) if line.startswith(f"  {name} "))
        above = [family for family, at in zip(FAMILIES, places, strict=True) if at < place]
        assert above[-1] == entry.family


@pytest.mark.parametrize(
    ("value", "text"), [(None, "none"), (True, "true"), ((0.1, 2), "[0.1, 2]"), (0.5, "0.5"), ("qp", "qp")]
)
def test_defaults_are_written_as_in_a_file(value, text):
    assert _yaml(value) == text
