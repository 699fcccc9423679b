"""Slots of solver processes: they outlive what is wrong with a job, with who listens, and with their processes."""

import sqlite3
import time
from dataclasses import replace

import pytest
import sqlalchemy as sa
from service_process import HTTP

from optiplan.service.execution.solver_pool import SolverJob, SolverPool
from optiplan.service.health import HealthCheck, serve_health
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.tables import open_database
from optiplan.service.store.write_probe import WriteProbe
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import PATIENCE, wait_until

AWAY = sa.exc.OperationalError("INSERT", {}, sqlite3.OperationalError("disk I/O error"))
"""As a database raises it that goes away."""


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    """One slot."""
    found = SolverPool(ServiceSettings(data=tmp_path_factory.mktemp("pool")), {"queue": 1})
    found.start()
    yield found
    found.close()


def plan(**more):
    """A job that plans."""
    request = {"do": "plan", "problem": QUICK, "budget": 2.0, "hash": None}
    return SolverJob(request | more.pop("request", {}), PATIENCE, **more)


def raising(_):
    raise AWAY


def test_words_that_come_too_late_are_no_request(pool):
    """A task that does not listen leaves them in the pipe, and so does one that has just ended."""
    late, next_one = plan(), plan()
    late.said.put({"stop": True})
    late.said.put({"do": "alive", "number": 0})
    for job in (late, next_one):
        answer = pool.submit("queue", job).result(PATIENCE)
        assert answer.death is None
        assert answer.data["verified"]


def test_a_process_that_reads_no_words_is_ended_all_the_same(pool):
    job = plan(request={"problem": NO_WAY, "budget": 60.0})
    for _ in range(2000):  # more than the line to it holds
        job.said.put({"do": "x" * 1000})
    done = pool.submit("queue", job)
    wait_until(lambda: job.said.qsize() < 2000)
    job.cancel.set()
    assert done.result(PATIENCE / 2).death == "cancelled"


def test_a_slot_survives_who_listens(pool):
    first, second = plan(told=raising), plan(request={"early": True}, answered=raising)
    for job in (first, second):
        answer = pool.submit("queue", job).result(PATIENCE)
        assert answer.death is None
        assert answer.data["verified"]
    assert pool.ended == []


def test_a_slot_survives_a_request_that_cannot_be_sent_and_a_caller_that_went(pool):
    broken = pool.submit("queue", plan(request={"budget": float("nan")})).result(PATIENCE)
    assert broken.death == "crashed"
    assert "internal error" in broken.detail
    late = pool.submit("queue", plan(until=time.monotonic() - 1.0)).result(PATIENCE)
    assert late.death == "timeout"
    assert "before it began" in late.detail
    busy = pool.submit("queue", plan())
    gone = plan()
    assert gone.future.cancel()
    pool.submit("queue", gone)
    assert busy.result(PATIENCE).death is None
    assert pool.submit("queue", plan()).result(PATIENCE).death is None
    assert pool.ended == []


@pytest.mark.parametrize("idle", [False, True])
def test_a_process_that_cannot_be_set_up_is_no_process_that_is_ready(pool, monkeypatch, caplog, idle):
    pool.submit("queue", plan()).result(PATIENCE)
    slot = pool._slots[0]
    with monkeypatch.context() as patch:
        patch.setattr(slot, "_settings", replace(slot._settings, memory=float("nan")))
        slot._end()
        if idle:  # it is exchanged before a job comes
            wait_until(lambda: "no process that is ready" in caplog.text)
        failed = pool.submit("queue", plan()).result(PATIENCE)
        assert "internal error" in failed.detail
    assert pool.submit("queue", plan()).result(PATIENCE).death is None


def test_threads_that_have_ended_are_no_health(pool, tmp_path):
    class Queue:
        ended = ("lease",)

    engine = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    check = HealthCheck(pool, Queue(), WriteProbe(engine, ContentFolder(tmp_path / "contents", 0)))
    for status, body in (check.living(), check.ready()):
        assert status == 503
        assert "lease" in body["error"]
    pool.submit("queue", plan()).result(PATIENCE)
    Queue.ended = ()
    assert check.living()[0] == check.ready()[0] == 200
    full = HealthCheck(pool, Queue(), WriteProbe(engine, ContentFolder(tmp_path / "contents", 10**18)))
    assert full.living()[0] == 200
    assert "MB left" in full.ready()[1]["error"]
    server = serve_health(check, 0)
    url = f"http://127.0.0.1:{server.server_address[1]}"
    assert HTTP.get(f"{url}/readyz").json() == {"status": "ok"}
    Queue.ended = ("events",)
    assert HTTP.get(f"{url}/healthz").status_code == HTTP.get(f"{url}/readyz").status_code == 503
    assert HTTP.get(f"{url}/else").status_code == 404
    server.shutdown()
    server.server_close()
    engine.dispose()


def test_a_pool_whose_thread_ended_is_not_ready():
    pool = SolverPool(ServiceSettings(), {"queue": 2})
    assert pool.ended == ["solver-queue", "solver-queue"], "they were never started"
    assert not pool.ready
