"""Settings of the service: where it listens, what it keeps, and how much it takes on."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import field
from pathlib import Path
from typing import Any

from sqlalchemy import make_url
from sqlalchemy.exc import ArgumentError

from optiplan.errors import InputError, Issue
from optiplan.files import user_folder
from optiplan.records import dataclass

PORT = 7100
"""TCP port, when none is given."""


def default_data() -> Path:
    """`$XDG_DATA_HOME/optiplan`, by default `~/.local/share/optiplan`.

    Raises:
        InputError: this user has no home.
    """
    try:
        return user_folder("XDG_DATA_HOME", ".local/share") / "optiplan"
    except FileNotFoundError as error:
        issue = Issue("this system", None, "data", str(error.strerror), "--data DIR, or a folder in XDG_DATA_HOME")
        raise InputError([issue]) from None


@dataclass(frozen=True)
class DriverSetup:
    """A robot that a server may move.

    Attributes:
        name: by which requests name it.
        driver: as `op.driver` names it.
        options: of that driver.
        patience: seconds that a set-point may be late before the robot stops, None: 0.01.
    """

    name: str
    driver: str
    options: Mapping[str, Any] = field(default_factory=dict)
    patience: float | None = None


@dataclass(frozen=True)
class ServiceSettings:
    """How a server or a worker runs; every limit is a hard one.

    Attributes:
        data: folder of contents and uploads, and of the database where that is SQLite. All machines that share a
            database share it.
        database: `sqlite:///…` or `postgresql://…`; empty: `service.sqlite` in `data`.
        database_password: of PostgreSQL, in place of the one in `database`; empty: that one, or what libpq finds.
        host: address to listen on.
        port: 0: any that is free.
        token: every request carries it; empty: none needed, which only a loopback address allows.
        hosts: names besides the address and localhost that requests may call this server by.
        folders: where problems may read meshes and robots from, besides the uploads.
        solvers: processes for queued runs; 0: this server only takes them, workers solve.
        interactive: processes for callers that wait.
        live: controllers that may run at a time, for live views.
        drivers: robots that may be moved, one execution each at a time.
        queue: most runs that wait; more are refused with 429.
        memory: of one process, MB resident.
        most_budget: longest budget of a run, s.
        reading: longest time to read one problem, s.
        body: largest request, bytes.
        bodies: most obstacles and held objects of one problem, together.
        head_time: s in which the head of a request has to come.
        body_time: s in which its body has to come.
        connections: most connections of one client at a time, which come through no proxy of ours.
        proxies: addresses or networks of proxies, whose word on the client and on HTTPS is taken.
        root_path: where a proxy has put this server, such as `/optiplan`; empty: at the top.
        rate: requests a second that one client may send in the long run; `burst` at once.
        burst: see `rate`.
        keep_days: runs older than that are deleted, and uploads that nobody has used for so long.
        keep_bytes: most bytes of contents; the oldest runs go first.
        uploads: most bytes of uploaded files; the longest unused go first.
        upload_files: most uploaded files.
        meshcat_port: where scripts on this machine draw into the pages of runs by meshcat's protocol, 0: any; None:
            nowhere.
        spare: bytes that stay free on the disk; below it nothing new is taken on (507).
    """

    data: Path = field(default_factory=default_data)
    database: str = ""
    database_password: str = field(default="", repr=False)
    host: str = "127.0.0.1"
    port: int = PORT
    token: str = ""
    hosts: tuple[str, ...] = ()
    folders: tuple[Path, ...] = ()
    solvers: int = 1
    interactive: int = 1
    live: int = 1
    drivers: tuple[DriverSetup, ...] = (DriverSetup("sim", "sim"),)
    queue: int = 1000
    memory: float = 2000.0
    most_budget: float = 300.0
    reading: float = 10.0
    body: int = 5_000_000
    bodies: int = 2000
    head_time: float = 10.0
    body_time: float = 60.0
    connections: int = 256
    proxies: tuple[str, ...] = ()
    root_path: str = ""
    rate: float = 200.0
    burst: int = 1000
    keep_days: float = 30.0
    keep_bytes: int = 10 * 10**9
    uploads: int = 10**9
    upload_files: int = 10_000
    meshcat_port: int | None = None
    spare: int = 50 * 10**6

    @property
    def database_url(self) -> str:
        """The database as SQLAlchemy takes it, with the driver that the service uses."""
        url = self.database or f"sqlite:///{(self.data / 'service.sqlite').absolute()}"
        for scheme in ("postgresql://", "postgres://"):
            if url.startswith(scheme):
                url = "postgresql+psycopg://" + url.removeprefix(scheme)
        if self.database_password:
            with suppress(ValueError, ArgumentError):  # who opens it tells what is wrong with it
                named = make_url(url).set(password=self.database_password)
                url = named.render_as_string(hide_password=False)
        return url

    @property
    def upload_folder(self) -> Path:
        """Where uploaded files lie, which relative names in problems are relative to."""
        return self.data / "uploads"

    @property
    def readable(self) -> tuple[Path, ...]:
        """The folders that problems may read from."""
        return (self.upload_folder, *self.folders)
