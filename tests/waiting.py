"""Waiting for events: with patience that only a broken test uses up, however busy the machine is."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

PATIENCE = 300.0
"""s for anything that takes a moment where nothing else runs."""


def wait_until(condition: Callable[[], object]) -> None:
    """Return once a condition holds.

    Raises:
        AssertionError: it does not within `PATIENCE`.
    """
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "never came"
        time.sleep(0.02)


def answer_of(work: Coroutine[Any, Any, Any]) -> Any:
    """What a coroutine returns or raises, run in a thread: this one may hold playwright's loop, which runs on."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, work).result()


def processor_seconds(process: int) -> float:
    """Time that a process has worked, s in steps of 0.01, whatever others do."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0
