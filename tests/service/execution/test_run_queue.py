"""The queue of one process beside others, which are here changes of the table of runs."""

import threading

from optiplan.service.execution.event_writer import EventWriter
from optiplan.service.execution.run_queue import RunQueue
from optiplan.service.settings import ServiceSettings
from optiplan.service.store.run_table import NewRun, RunEnd, RunTable
from optiplan.service.store.tables import open_database
from tests.waiting import wait_until

NEW = NewRun("0" * 32, "one", "0" * 64, "planar2r", "0" * 64, "quintic", 0, 1.0, None)


def test_a_run_that_was_cancelled_and_submitted_anew_elsewhere_ends_here(tmp_path):
    engine = open_database(f"sqlite:///{tmp_path / 'runs.sqlite'}")
    table, ended = RunTable(engine), threading.Event()
    begun = []

    def solve(record, cancel):
        begun.append(cancel)
        if len(begun) == 1:
            if cancel.wait(30.0):
                ended.set()
            return RunEnd("cancelled")
        return RunEnd("done", True)

    table.submit(NEW, "first")
    queue = RunQueue(ServiceSettings(data=tmp_path, solvers=1), engine, table, EventWriter(table), solve)
    queue.start()
    try:
        wait_until(lambda: begun)
        table.cancel(NEW.id, "first")  # by another process, and at once:
        assert table.submit(NEW, "second")[1]
        wait_until(lambda: table.get(NEW.id)["status"] == "done")
    finally:
        queue.close()
        engine.dispose()
    assert ended.is_set()
    assert len(begun) == 2
