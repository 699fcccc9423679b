"""`optiplan serve` and `optiplan worker`: the planner as a service."""

import math
import os
import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Any

import typer

from optiplan.cores import cores
from optiplan.errors import InputError, Issue, OptiPlanError

URL = "sqlite:///PATH or postgresql://USER@HOST/NAME"
Database = Annotated[str, typer.Option(metavar="URL", help=f"{URL} (default: SQLite in the data folder)")]
OneDatabase = Annotated[str, typer.Option("--database", metavar="URL", help=URL)]
PasswordFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="file with the database's password, which arguments show to all on the machine"),
]
Data = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="folder for contents, uploads and the database, shared by all machines of a database",
    ),
]
Folders = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="DIR",
        help="folder from which problems may read meshes and robots, besides uploads (repeatable)",
    ),
]
TokenFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="file with the token that every request carries (or OPTIPLAN_TOKEN)"),
]
HostNames = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="host name that requests may use (repeatable)"),
]
Proxies = Annotated[
    list[str] | None,
    typer.Option(metavar="ADDRESS", help="proxy (or network) whose word on clients and HTTPS is taken (repeatable)"),
]
Drivers = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME[=DRIVER[:KEY=VALUE,…]]",
        help="robot that may be moved, such as left=ur_rtde:host=10.0.0.2,patience=0.02 (repeatable; default: sim)",
    ),
]
RootPath = Annotated[
    str,
    typer.Option(metavar="PATH", help="where a proxy has put this server, such as /optiplan"),
]


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise typer.BadParameter(f"found {value}; expected a finite number")
    return value


Memory = Annotated[float, typer.Option(min=300.0, callback=_finite, metavar="MB", help="memory limit of a process")]
KeepDays = Annotated[float, typer.Option(min=0.0, metavar="DAYS", help="runs and unused uploads are kept (inf: ever)")]
KeepGb = Annotated[
    float, typer.Option(min=0.0, callback=_finite, metavar="GB", help="disk space for runs; the oldest are deleted")
]
UploadsGb = Annotated[
    float,
    typer.Option(
        min=0.0, callback=_finite, metavar="GB", help="disk space for uploads; the longest unused are deleted"
    ),
]
MeshcatPort = Annotated[
    int | None,
    typer.Option(min=0, max=65535, metavar="N", help="where meshcat's scripts draw into pages of runs (0: any)"),
]
LogLevel = Annotated[str, typer.Option(metavar="LEVEL", help="debug, info, warning or error")]


def serve(
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="to listen on; other than loopback needs a token")] = "",
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="0: any")] = 7100,
    database: Database = "",
    database_password_file: PasswordFile = None,
    data: Data = None,
    token_file: TokenFile = None,
    allow_host: HostNames = None,
    trusted_proxy: Proxies = None,
    root_path: RootPath = "",
    connections: Annotated[int, typer.Option(min=1, metavar="N", help="connections of one client at a time")] = 256,
    folder: Folders = None,
    solvers: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="processes for the queue (default: one less than cores)")
    ] = None,
    interactive: Annotated[
        int, typer.Option(min=1, metavar="N", help="processes for POST /api/plan, past the queue")
    ] = 1,
    live: Annotated[int, typer.Option(min=0, metavar="N", help="live controllers at a time")] = 1,
    driver: Drivers = None,
    queue: Annotated[int, typer.Option(min=1, metavar="N", help="queued runs at most")] = 1000,
    memory: Memory = 2000.0,
    keep_days: KeepDays = 30.0,
    keep_gb: KeepGb = 10.0,
    uploads_gb: UploadsGb = 1.0,
    upload_files: Annotated[int, typer.Option(min=0, metavar="N", help="uploaded files at most")] = 10_000,
    meshcat_port: MeshcatPort = None,
    log_level: LogLevel = "info",
) -> int:
    """Serve the planner to browsers and programs: REST, OpenAPI at /openapi.json, pages at /.

    Runs are kept in a database and queued in it: a server that is killed continues where it was.
    It listens on loopback only, unless it is given --host and a token.

    [bold]Examples[/]

      optiplan serve

      optiplan serve --host 0.0.0.0 --token-file token --database postgresql://optiplan@db/optiplan --data /shared
    """
    from optiplan.service.server import run_server

    settings = _settings(
        host=host or "127.0.0.1",
        port=port,
        database=database,
        database_password=_database_password(database, database_password_file),
        data=data,
        token=_secret(token_file, "token") or os.environ.get("OPTIPLAN_TOKEN", "").strip(),
        hosts=tuple(allow_host or ()),
        proxies=_proxies(trusted_proxy),
        root_path=_root_path(root_path),
        connections=connections,
        folders=_folders(folder),
        solvers=_solvers(solvers),
        interactive=interactive,
        live=live,
        drivers=_drivers(driver),
        queue=queue,
        memory=memory,
        keep_days=keep_days,
        keep_bytes=int(1e9 * keep_gb),
        uploads=int(1e9 * uploads_gb),
        upload_files=upload_files,
        meshcat_port=meshcat_port,
    )
    return run_server(settings, _level(log_level))


def worker(
    database: OneDatabase,
    database_password_file: PasswordFile = None,
    data: Data = None,
    folder: Folders = None,
    solvers: Annotated[int | None, typer.Option(min=1, metavar="N", help="processes (default: cores given)")] = None,
    memory: Memory = 2000.0,
    health_port: Annotated[
        int, typer.Option(min=0, max=65535, metavar="N", help="answer /healthz and /readyz on 127.0.0.1 (0: nowhere)")
    ] = 0,
    log_level: LogLevel = "info",
) -> int:
    """Solve queued runs of a database, beside its server or on another machine.

    [bold]Example[/]

      optiplan worker --database postgresql://optiplan@db/optiplan --data /shared
    """
    from optiplan.service.server import run_worker

    settings = _settings(
        database=database,
        database_password=_database_password(database, database_password_file),
        data=data,
        folders=_folders(folder),
        solvers=solvers or cores(),
        memory=memory,
    )
    return run_worker(settings, _level(log_level), health_port)


def _settings(data: Path | None, **given: Any) -> Any:
    from optiplan.service.settings import ServiceSettings

    return ServiceSettings(**given) if data is None else ServiceSettings(data=data.absolute(), **given)


def _solvers(given: int | None) -> int:
    return max(1, cores() - 1) if given is None else given


def _folders(given: list[Path] | None) -> tuple[Path, ...]:
    missing = [path for path in given or () if not path.is_dir()]
    if missing:
        raise InputError([Issue(str(path), None, "folder", "no folder", "a folder that is there") for path in missing])
    return tuple(path.resolve() for path in given or ())


def _secret(file: Path | None, what: str) -> str:
    """The content of a file with a secret; empty without a file."""
    if file is None:
        return ""
    expected = f"a file with the {what}"
    try:
        found = file.read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "no text"
        raise InputError([Issue(str(file), None, f"{what}-file", str(reason).lower(), expected)]) from None
    if not found:
        raise InputError([Issue(str(file), None, f"{what}-file", "an empty file", expected)])
    return found


def _database_password(database: str, file: Path | None) -> str:
    if file is not None and not database.startswith(("postgresql://", "postgres://")):
        found, expected = "a password for SQLite", "--database postgresql://USER@HOST/NAME beside it"
        raise InputError([Issue(str(file), None, "database-password-file", found, expected)])
    return _secret(file, "database-password")


def _proxies(given: list[str] | None) -> tuple[str, ...]:
    for proxy in given or ():
        try:
            ip_network(proxy, strict=False)
        except ValueError:
            expected = "an address such as 127.0.0.1, or a network such as 10.0.0.0/8"
            raise InputError([Issue("command line", None, "trusted-proxy", f"'{proxy}'", expected)]) from None
    return tuple(given or ())


def _drivers(given: list[str] | None) -> tuple[Any, ...]:
    """The robots that may be moved: `NAME=DRIVER:KEY=VALUE,…`; a name alone is that of its driver."""
    from optiplan.api.driving import DRIVERS
    from optiplan.arrays import is_finite
    from optiplan.config.document import parse_yaml
    from optiplan.config.messages import choices
    from optiplan.execution.arguments import LONGEST_TICK
    from optiplan.service.settings import DriverSetup

    found: dict[str, DriverSetup] = {}
    for text in given or ["sim"]:
        name, _, rest = text.partition("=")
        driver, _, options = (rest or name).partition(":")
        pairs = [pair.partition("=") for pair in options.split(",") if pair]
        wrong = None if driver in DRIVERS else (f"'{driver}'", choices(driver, list(DRIVERS)))
        if not re.fullmatch("[A-Za-z0-9_.-]{1,40}", name) or name in found:
            wrong = f"'{name}'", "a name of letters and digits that no other driver has"
        if not all(key and sign for key, sign, _ in pairs):
            wrong = f"'{options}'", "KEY=VALUE, separated by commas"
        if wrong is not None:
            raise InputError([Issue("command line", None, "driver", *wrong)])
        values: dict[str, Any] = {key: parse_yaml(value, Path("driver")).data for key, _, value in pairs}
        patience = values.pop("patience", None)
        if patience is not None and not (is_finite(patience) and 0.0 < patience <= LONGEST_TICK):
            expected = f"seconds above 0, up to {LONGEST_TICK:g}"
            raise InputError([Issue("command line", None, "driver.patience", repr(patience), expected)])
        found[name] = DriverSetup(name, driver, values, patience)
    return tuple(found.values())


def _root_path(given: str) -> str:
    path = given.rstrip("/")
    if path and not re.fullmatch(r"(/[A-Za-z0-9._~-]+)+", path):
        raise InputError([Issue("command line", None, "root-path", f"'{given}'", "a path such as /optiplan")])
    return path


def _level(name: str) -> str:
    if name.lower() not in ("debug", "info", "warning", "error"):
        raise OptiPlanError(f"--log-level: found '{name}'; choose from: debug, info, warning, error")
    return name
