"""`op.driver`: drivers by name."""

import pytest

import optiplan as op
from optiplan.api.driving import DRIVERS
from optiplan.errors import InputError, UnknownChoiceError


@pytest.fixture(scope="module")
def run():
    run = op.plan(op.load_problem("01_reach"), "quintic")
    assert run.verified
    return run


def test_an_unknown_name_lists_the_choices(run):
    with pytest.raises(UnknownChoiceError, match=f"choose from: {', '.join(sorted(DRIVERS))}"):
        op.driver("simm", run)


def test_an_unknown_option_lists_those_of_the_driver(run):
    with pytest.raises(InputError, match="engine: found the str 'own'; expected an option of 'file': path, rate"):
        op.driver("file", run, engine="own")


def test_it_takes_runs_with_a_motion():
    with pytest.raises(InputError, match=r"run: found None; expected a run of op\.plan"):
        op.driver("file", None)
