from optiplan.planners.registry import PLANNERS


def test_list_tells_options_and_defaults(optiplan, optiplan_json):
    code, out, _ = optiplan("planners")
    assert code == 0
    for name, entry in PLANNERS.items():
        assert f"{name}: " in out
        assert all(option.name in out for option in entry.option_list())
    code, data = optiplan_json("planners")
    assert code == 0
    options = {option["name"]: option for option in data["planners"]["trajopt"]["options"]}
    assert options["margin"] == {"name": "margin", "kind": "float", "default": 0.005}
