"""A server, a worker and a PostgreSQL as processes of their own, for tests and benchmarks that kill them."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx

PROGRAM = "from optiplan.cli.main import main; main()"
START = 60.0
"""s within which a server has to answer."""
HTTP = httpx.Client(trust_env=False, timeout=60.0)
"""For all requests: making one takes longer than most answers."""


class Program:
    """`optiplan serve` or `optiplan worker`, with all that it starts in a group of processes of its own.

    Attributes:
        started: s from its start to its first line, when it answers.
    """

    def __init__(self, *arguments: str, log: Path | None = None) -> None:
        began = time.monotonic()
        with (log or Path(os.devnull)).open("ab") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM, *arguments],
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                start_new_session=True,
            )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        self.started = time.monotonic() - began
        if " at http" not in line and "working" not in line:
            self.kill()
            raise RuntimeError(f"{arguments[0]} did not start: {line!r} {log.read_text()[-2000:] if log else ''}")
        self.url = line.partition(" at ")[2].split()[0].rstrip("/") if " at " in line else ""

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def kill(self) -> None:
        """End it by SIGKILL; its solvers die with it."""
        with suppress(ProcessLookupError):
            os.kill(self._process.pid, signal.SIGKILL)
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def stop(self) -> int:
        """End it as ctrl-C does; return its exit code."""
        with suppress(ProcessLookupError):
            os.kill(self._process.pid, signal.SIGTERM)
        try:
            code = self._process.wait(30.0)
        except subprocess.TimeoutExpired:
            self.kill()
            raise
        assert self._process.stdout is not None
        self._process.stdout.close()
        return code


@contextmanager
def serving(data: Path, *arguments: str) -> Iterator[Program]:
    """A server on a free port, killed at the end."""
    program = Program("serve", "--port", "0", "--data", str(data), *arguments, log=data.parent / "server.log")
    try:
        yield program
    finally:
        program.kill()


def free_port() -> int:
    """A port that nobody listens on now."""
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
    return port


def postgres_folder() -> Path | None:
    """Where Debian's PostgreSQL has its programs; None if it is not installed."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    return found[-1].parent if found else None


@contextmanager
def postgres() -> Iterator[str]:
    """A PostgreSQL of our own on a free port, with an empty database; yields its address.

    Raises:
        RuntimeError: none is installed, or it does not start.
    """
    programs = postgres_folder()
    if programs is None:
        raise RuntimeError("PostgreSQL is not installed (Debian: apt-get install postgresql)")
    folder, port = Path(tempfile.mkdtemp(prefix="optiplan-postgres-")), free_port()
    as_user: Sequence[str] = ()
    if os.getuid() == 0:  # it refuses to run as root
        shutil.chown(folder, "postgres")
        as_user = ("runuser", "-u", "postgres", "--")
    data, log = folder / "data", folder / "log"
    try:
        make = [*as_user, str(programs / "initdb"), "-D", str(data), "-U", "optiplan", "-A", "trust", "-E", "UTF8"]
        made = subprocess.run(make, capture_output=True, text=True, cwd=folder)
        options = f"-p {port} -k {folder} -c listen_addresses=127.0.0.1"
        start = [*as_user, str(programs / "pg_ctl"), "-D", str(data), "-l", str(log), "-o", options, "-w", "start"]
        begun = subprocess.run(start, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder)
        if made.returncode or begun.returncode:
            raise RuntimeError(f"PostgreSQL does not start: {made.stderr[-500:]} {begun.stderr[-500:]}")
        create = [str(programs / "createdb"), "-h", "127.0.0.1", "-p", str(port), "-U", "optiplan", "optiplan"]
        subprocess.run(create, check=True, capture_output=True, cwd=folder)
        yield f"postgresql://optiplan@127.0.0.1:{port}/optiplan"
    finally:
        stop = [*as_user, str(programs / "pg_ctl"), "-D", str(data), "-m", "immediate", "stop"]
        subprocess.run(stop, capture_output=True, cwd=folder)
        shutil.rmtree(folder, ignore_errors=True)


def wait_until_ready(url: str, patience: float = START) -> float:
    """Wait until all processes of a server are warm; return the seconds that took."""
    began = time.monotonic()
    while time.monotonic() - began < patience:
        with suppress(httpx.HTTPError):
            if HTTP.get(f"{url}/readyz").status_code == 200:
                return time.monotonic() - began
        time.sleep(0.1)
    raise RuntimeError(f"{url} is not ready within {patience:g} s")
