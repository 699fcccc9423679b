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
START = 300.0
"""s within which a server has to answer, on a busy machine."""
HTTP = httpx.Client(trust_env=False, timeout=300.0)
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
            code = self._process.wait(60.0)
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


class Postgres:
    """A PostgreSQL of our own on a free port, with an empty database, which can be stopped and started.

    Attributes:
        url: address of the database.
    """

    def __init__(self, folder: Path) -> None:
        """Make and start it in an empty folder.

        Raises:
            RuntimeError: none is installed, or it does not start.
        """
        programs = postgres_folder()
        if programs is None:
            raise RuntimeError("PostgreSQL is not installed (Debian: apt-get install postgresql)")
        self._programs, self._folder, self._port = programs, folder, free_port()
        self._as_user: Sequence[str] = ()
        if os.getuid() == 0:  # it refuses to run as root
            shutil.chown(folder, "postgres")
            self._as_user = ("runuser", "-u", "postgres", "--")
        self.url = f"postgresql://optiplan@127.0.0.1:{self._port}/optiplan"
        made = self._call("initdb", "-U", "optiplan", "-A", "trust", "-E", "UTF8")
        if made.returncode or not self.start():
            raise RuntimeError(f"PostgreSQL does not start: {made.stderr[-500:]}")
        where = ["-h", "127.0.0.1", "-p", str(self._port), "-U", "optiplan"]
        subprocess.run([str(programs / "createdb"), *where, "optiplan"], check=True, capture_output=True, cwd=folder)

    def start(self) -> bool:
        """Start it; return whether it runs."""
        options = f"-p {self._port} -k {self._folder} -c listen_addresses=127.0.0.1"
        begun = self._call("pg_ctl", "-l", str(self._folder / "log"), "-o", options, "-w", "start")
        return begun.returncode == 0 or self.runs

    def stop(self) -> None:
        """Stop it at once, as a machine that goes away does."""
        self._call("pg_ctl", "-m", "immediate", "-w", "stop")

    @property
    def runs(self) -> bool:
        """Whether it runs."""
        return self._call("pg_ctl", "status").returncode == 0

    def _call(self, program: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
        command = [*self._as_user, str(self._programs / program), "-D", str(self._folder / "data"), *arguments]
        with tempfile.TemporaryFile("w+") as errors:  # no pipe, which the server would keep open
            done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=errors, text=True, cwd=self._folder)
            errors.seek(0)
            return subprocess.CompletedProcess(command, done.returncode, "", errors.read())


@contextmanager
def postgres_server() -> Iterator[Postgres]:
    """A PostgreSQL of our own, gone at the end.

    Raises:
        RuntimeError: none is installed, or it does not start.
    """
    folder = Path(tempfile.mkdtemp(prefix="optiplan-postgres-"))
    server = None
    try:
        server = Postgres(folder)
        yield server
    finally:
        if server is not None:
            server.stop()
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def postgres() -> Iterator[str]:
    """The address of an empty database in a PostgreSQL of our own.

    Raises:
        RuntimeError: none is installed, or it does not start.
    """
    with postgres_server() as server:
        yield server.url


def wait_until_ready(url: str, patience: float = START) -> float:
    """Wait until all processes of a server are warm; return the seconds that took."""
    began = time.monotonic()
    while time.monotonic() - began < patience:
        with suppress(httpx.HTTPError):
            if HTTP.get(f"{url}/readyz").status_code == 200:
                return time.monotonic() - began
        time.sleep(0.1)
    raise RuntimeError(f"{url} is not ready within {patience:g} s")
