"""What a process that serves does to itself."""

import gc

import pytest

from optiplan.service import server
from optiplan.service.settings import ServiceSettings


@pytest.fixture
def seldom():
    """The command line looks for garbage so seldom."""
    before = gc.get_threshold()
    gc.set_threshold(200_000)
    yield
    gc.unfreeze()
    gc.set_threshold(*before)


@pytest.mark.usefixtures("seldom")
def test_a_server_looks_for_garbage_often_while_it_serves(monkeypatch, tmp_path):
    """Else each request and each execution stayed in memory for days."""
    seen = []

    def run(serve):
        serve.close()
        seen.append((gc.get_threshold()[0], gc.get_freeze_count()))

    monkeypatch.setattr(server.asyncio, "run", run)
    monkeypatch.setattr(server, "log_to_stderr", lambda level: None)
    server.run_server(ServiceSettings(data=tmp_path, port=0))
    ((young, loaded),) = seen
    assert young == server.YOUNG_OBJECTS < 1000
    assert loaded > 10_000
