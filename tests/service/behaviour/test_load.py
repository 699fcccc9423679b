"""Many submissions at once, and damaged ones: the benchmarks of the service, made small."""

import os

from service_hostile import attack
from service_load import load


def test_all_of_many_runs_are_done_once(server):
    found = load(server.url, os.getpid(), 30)
    assert found.states == {"done": 30}
    assert found.ids == 30
    ends = [
        data for _, _, data in server.service.archive.runs.events_after(0, _newest(server, 30)) if data["type"] == "end"
    ]
    assert len(ends) == 30
    assert found.memory < 4000.0


def _newest(server, count):
    return [record["id"] for record in server.service.archive.runs.newest(count)]


def test_damaged_problems_break_nothing(server, tmp_path):
    found = attack(server.url, tmp_path, 150, seed=1)
    assert not found.faults, found.faults[0]
    assert found.statuses[200] > 100
