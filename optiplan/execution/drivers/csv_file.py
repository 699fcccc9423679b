"""Driver `file`: set-points as they go into a table, for programs that play one, and for looking at it."""

import csv
import os
from pathlib import Path

from optiplan.errors import InputError, Issue, os_reason, path_argument
from optiplan.execution.drivers.base import Capabilities
from optiplan.execution.measurement import Measurement
from optiplan.execution.status import Tick
from optiplan.runs.run import Run

PARTIAL = ".partial"
"""Stands behind the name of a file whose motion has not come to its end."""


class FileDriver:
    """Write a row a set-point: t, then q, v, a and torque of each joint.

    The file gets its name when the motion is done; until then, and after a stop, it is `NAME.partial`. An older file of
    the name is replaced.

    Args:
        run: whose robot's joints are written.
        path: of the file.
        rate: set-points per second, Hz.

    Raises:
        InputError: the file cannot be written.
    """

    def __init__(self, run: Run, *, path: Path | str = "set_points.csv", rate: float = 500.0) -> None:
        self._names, self._rate = tuple(run.problem.robot.joint_names), rate
        self._path = path_argument("driver", "path", path, "the path of a file")
        self._done = False
        try:
            if self._path.exists() and not self._path.is_file():
                raise OSError(0, "a folder" if self._path.is_dir() else "a device or a pipe")
            self._written = self._path.with_name(self._path.name + PARTIAL)
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._written.open("w", newline="", encoding="utf-8")
        except OSError as error:
            found = os_reason(error)
            raise InputError([Issue(str(path), None, "file", found, "a file that can be written")]) from error
        self._rows = csv.writer(self._file)
        columns = [f"{kind} {name}" for kind in ("q", "v", "a", "torque") for name in self._names]
        self._rows.writerow(["t", *columns])

    @property
    def report(self) -> dict[str, str]:
        """The `file` that holds the set-points."""
        return {"file": str(self._written)}

    def capabilities(self) -> Capabilities:
        """A file measures nothing, and waits."""
        return Capabilities("file", self._names, self._rate, ("position", "velocity", "torque"), waits=True)

    def state(self) -> Measurement | None:
        """None."""
        return None

    def send(self, tick: Tick) -> None:
        """Write a row; numbers are exact."""
        values = [tick.t, *tick.q, *tick.v, *tick.a, *tick.torque]
        self._rows.writerow([repr(float(value)) for value in values])
        self._done = tick.status.phase == "done"

    def stop(self, reason: str) -> None:
        """Have the file on the disk, with its name where the motion is done."""
        if self._file.closed:
            return
        try:
            self._file.flush()
            os.fsync(self._file.fileno())
        finally:
            self._file.close()
        if self._done:
            self._written = self._written.replace(self._path)
