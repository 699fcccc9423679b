"""What the reader of a design study refuses."""

import pytest

from optiplan.errors import InputError
from optiplan.studies.measures import MEASURES
from optiplan.studies.study import read_study
from tests.studies.test_measures import BAR


@pytest.mark.parametrize(
    "changes",
    [
        {"dh.rows.1": "=length", "dh.rows.1.a": "=load"},
        {"dh.rows.1.a": "=length", "dh.rows.1.a.b": "=load"},
        {"dh.rows.1.new": "=length", "dh.rows.1.new.b": "=load"},
    ],
)
def test_a_change_of_what_another_change_replaces_is_refused_with_its_place(changes):
    with pytest.raises(InputError, match="another change replaces") as caught:
        read_study({**BAR, "changes": changes}, MEASURES)
    assert caught.value.issues[0].path == ("changes", list(changes)[-1])


def test_a_change_may_be_a_number_and_a_parameter_may_have_one_use():
    study = read_study({**BAR, "changes": {**BAR["changes"], "dh.rows.0.a": 0.25}}, MEASURES)
    first, second = study.robot_data({"length": 1.5, "load": 3.0})["dh"]["rows"]
    assert (first["a"], second["a"], second["mass"]) == (0.25, 1.5, 3.0)
