"""What is old by a clock that was set is not deleted for a day."""

import math

import pytest
import sqlalchemy as sa

from optiplan.service.store.even_clock import DAY, EvenClock
from optiplan.service.store.tables import open_database

NOW = 1.8e9


class Machine:
    """A machine: its clock, and the time that passes."""

    def __init__(self, path):
        self.now, self.passed = NOW, 1000.0
        self.engine = open_database(f"sqlite:///{path / 'kept.sqlite'}")
        sa.event.listen(self.engine, "checkout", self._set_up)

    def _set_up(self, connection, *_):
        connection.create_function("optiplan_clock", 0, lambda: self.now)

    def process(self):
        """A process that begins."""
        return EvenClock(self.engine, lambda: self.now, lambda: self.passed)

    def wait(self, seconds, clock=None):
        """Let time pass; with a clock that is looked at every hour."""
        for _ in range(math.ceil(seconds / 3600.0)):
            self.now, self.passed = self.now + 3600.0, self.passed + 3600.0
            if clock is not None:
                clock.even()


@pytest.fixture
def machine(tmp_path):
    found = Machine(tmp_path)
    yield found
    found.engine.dispose()


@pytest.mark.parametrize("step", [-400.0 * DAY, -2.0 * DAY, 2.0 * DAY, 400.0 * DAY])
def test_after_a_step_it_is_not_even_for_a_day(machine, step):
    clock = machine.process()
    assert clock.even()
    machine.wait(10.0 * DAY, clock)
    assert clock.even()
    machine.now += step
    assert not clock.even()
    machine.wait(0.9 * DAY, clock)
    assert not clock.even()
    assert not machine.process().even(), "another process takes that over"
    machine.wait(0.2 * DAY, clock)
    assert clock.even()


def test_a_clock_that_is_set_while_no_process_runs(machine):
    assert machine.process().even()
    machine.now += 400.0 * DAY
    later = machine.process()
    assert not later.even()
    machine.wait(1.1 * DAY, later)
    assert later.even()


def test_small_steps_and_short_pauses_are_nothing(machine):
    clock = machine.process()
    assert clock.even()
    machine.now += 60.0
    assert clock.even()
    machine.wait(0.5 * DAY)
    assert clock.even()
    machine.wait(0.5 * DAY)
    assert machine.process().even()


def test_several_processes_look(machine):
    clocks = [machine.process() for _ in range(3)]
    assert all(clock.even() for clock in clocks)
    machine.now += 40.0 * DAY
    assert not any(clock.even() for clock in clocks)
