"""`optiplan serve` and `optiplan worker`: the planner as a service."""

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from optiplan.errors import InputError, Issue, OptiPlanError

DATABASE = "sqlite:///PATH or postgresql://USER@HOST/NAME (default: SQLite in the data folder)"
DATA = "folder for contents, uploads and the database, shared by all machines of a database"
FOLDER = "folder from which problems may read meshes and robots, besides uploads (repeatable)"
TOKEN = "file with the token that every request carries (or OPTIPLAN_TOKEN)"


def serve(
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="to listen on; other than loopback needs a token")] = "",
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="0: any")] = 7100,
    database: Annotated[str, typer.Option(metavar="URL", help=DATABASE)] = "",
    data: Annotated[Path | None, typer.Option(metavar="DIR", help=DATA)] = None,
    token_file: Annotated[Path | None, typer.Option(metavar="FILE", help=TOKEN)] = None,
    allow_host: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="host name that requests may use (repeatable)")
    ] = None,
    folder: Annotated[list[Path] | None, typer.Option(metavar="DIR", help=FOLDER)] = None,
    solvers: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="processes for the queue (default: one less than cores)")
    ] = None,
    interactive: Annotated[
        int, typer.Option(min=1, metavar="N", help="processes for POST /api/plan, past the queue")
    ] = 1,
    live: Annotated[int, typer.Option(min=0, metavar="N", help="live controllers at a time")] = 1,
    queue: Annotated[int, typer.Option(min=1, metavar="N", help="queued runs at most")] = 1000,
    memory: Annotated[float, typer.Option(min=300.0, metavar="MB", help="memory limit of a process")] = 2000.0,
    keep_days: Annotated[float, typer.Option(min=0.0, metavar="DAYS", help="how long runs are kept")] = 30.0,
    keep_gb: Annotated[
        float, typer.Option(min=0.0, metavar="GB", help="disk space for runs; the oldest are deleted")
    ] = 10.0,
    log_level: Annotated[str, typer.Option(metavar="LEVEL", help="debug, info, warning or error")] = "info",
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
        data=data,
        token=_token(token_file),
        hosts=tuple(allow_host or ()),
        folders=_folders(folder),
        solvers=_solvers(solvers),
        interactive=interactive,
        live=live,
        queue=queue,
        memory=memory,
        keep_days=keep_days,
        keep_bytes=int(1e9 * keep_gb),
    )
    return run_server(settings, _level(log_level))


def worker(
    database: Annotated[str, typer.Option(metavar="URL", help=DATABASE)],
    data: Annotated[Path | None, typer.Option(metavar="DIR", help=DATA)] = None,
    folder: Annotated[list[Path] | None, typer.Option(metavar="DIR", help=FOLDER)] = None,
    solvers: Annotated[int | None, typer.Option(min=1, metavar="N", help="processes (default: all cores)")] = None,
    memory: Annotated[float, typer.Option(min=300.0, metavar="MB", help="memory limit of a process")] = 2000.0,
    health_port: Annotated[
        int, typer.Option(min=0, max=65535, metavar="N", help="answer /healthz and /readyz on 127.0.0.1 (0: nowhere)")
    ] = 0,
    log_level: Annotated[str, typer.Option(metavar="LEVEL", help="debug, info, warning or error")] = "info",
) -> int:
    """Solve queued runs of a database, beside its server or on another machine.

    [bold]Example[/]

      optiplan worker --database postgresql://optiplan@db/optiplan --data /shared
    """
    from optiplan.service.server import run_worker

    settings = _settings(
        database=database,
        data=data,
        folders=_folders(folder),
        solvers=solvers or len(os.sched_getaffinity(0)),
        memory=memory,
    )
    return run_worker(settings, _level(log_level), health_port)


def _settings(data: Path | None, **given: Any) -> Any:
    from optiplan.service.settings import ServiceSettings

    return ServiceSettings(**given) if data is None else ServiceSettings(data=data.absolute(), **given)


def _solvers(given: int | None) -> int:
    return max(1, len(os.sched_getaffinity(0)) - 1) if given is None else given


def _folders(given: list[Path] | None) -> tuple[Path, ...]:
    missing = [path for path in given or () if not path.is_dir()]
    if missing:
        raise InputError([Issue(str(path), None, "folder", "no folder", "a folder that is there") for path in missing])
    return tuple(path.resolve() for path in given or ())


def _token(file: Path | None) -> str:
    """The token, of the file or else of the environment; empty without either."""
    if file is None:
        return os.environ.get("OPTIPLAN_TOKEN", "").strip()
    try:
        token = file.read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "no text"
        raise InputError([Issue(str(file), None, "token-file", str(reason).lower(), "a file with the token")]) from None
    if not token:
        raise InputError([Issue(str(file), None, "token-file", "an empty file", "a file with the token")])
    return token


def _level(name: str) -> str:
    if name.lower() not in ("debug", "info", "warning", "error"):
        raise OptiPlanError(f"--log-level: found '{name}'; choose from: debug, info, warning, error")
    return name
