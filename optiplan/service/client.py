"""`Client`: the functions of `import optiplan as op`, done by a server."""

import json
import re
import time
import uuid
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import httpx

from optiplan.api.loading import load_problem
from optiplan.api.planning import BUDGET, positive_seconds
from optiplan.arrays import number_argument
from optiplan.config.document import plain
from optiplan.errors import (
    InputError,
    Issue,
    OfOneProcess,
    OptiPlanError,
    described,
    options_argument,
    seed_argument,
    text_argument,
    wrong_argument,
)
from optiplan.files import read_bytes
from optiplan.problem.from_python import file_data
from optiplan.problem.hashing import shape_files_of
from optiplan.problem.problem import Problem
from optiplan.runs.run import Run
from optiplan.runs.run_folder import RUN, TRAJECTORY
from optiplan.runs.stored_runs import run_of_record
from optiplan.service.cell import EXECUTIONS, RESUME, RETRY, CellError, RemoteExecution, server_events
from optiplan.service.cell import PATIENCE as PROVING
from optiplan.trajectory.given_files import GivenFiles
from optiplan.trajectory.trajectory import Trajectory

PATIENCE = 30.0
"""s that a server has to answer what takes no planning, and beyond the budget what does."""
LONGEST = 1e6
"""s that an answer is waited for: no server takes a longer deadline or budget, and says so."""
AWAY = (0, 429, 502, 503, 504)
"""Statuses of a server, or of a proxy before it, that may answer soon; 0: none answers."""


class ServerError(CellError, OptiPlanError):
    """A server that cannot be reached, or refuses: `status` is that of HTTP, 0 where there is none."""


class Client(OfOneProcess):
    """A planner on a server (`optiplan serve`).

    Args:
        url: of the server, such as `http://127.0.0.1:7100`.
        token: where it wants one.

    Example:
        >>> import optiplan as op
        >>> client = op.Client("http://127.0.0.1:7100")
        >>> run = client.plan("01_reach")  # doctest: +SKIP
    """

    def __init__(self, url: str, token: str = "") -> None:
        if not isinstance(url, str) or not url.startswith(("http://", "https://")):
            raise wrong_argument("Client", "url", described(url), "an address such as http://127.0.0.1:7100")
        if not isinstance(token, str) or not token.isascii() or not token.isprintable():
            raise wrong_argument("Client", "token", "what no header can carry", "printable ASCII characters")
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self.url = url.rstrip("/")
        self._name = uuid.uuid4().hex
        try:
            self._http = httpx.Client(base_url=self.url, headers=headers, timeout=PATIENCE)
        except (httpx.InvalidURL, UnicodeError) as error:
            found = f"{described(url)} ({error})"
            raise wrong_argument("Client", "url", found, "an address such as http://127.0.0.1:7100") from error

    def plan(
        self,
        problem: Problem | Path | str | Mapping[str, Any],
        planner: str | None = None,
        options: Mapping[str, Any] | None = None,
        budget: float = BUDGET,
        seed: int | None = None,
        deadline: float | None = None,
        warm_start: str | None = None,
    ) -> Run:
        """Plan on the server and wait for the answer; the motion is verified afresh here.

        Args:
            problem: as `op.load_problem` takes it, or a `Problem`; meshes of its scene are uploaded.
            planner: a name of `op.planners()`; None: the problem's own.
            options: of that planner.
            budget: s for planning and proof.
            seed: None: the problem's own.
            deadline: s from now after which no answer is wanted.
            warm_start: id of a run on the server, of a problem not far from this one, at whose motion planning begins.

        Raises:
            InputError: the problem or an argument is wrong, or the problem has an `op.Expression`, which stays here.
            ServerError: there is no server, it refuses, or the answer is of another problem.

        A motion whose record cannot be had, as where the server's disk is full, is returned without what stands there.
        """
        asked = _problem(problem)
        given = self._submission(asked, planner, options, budget, seed, deadline, warm_start)
        given |= {"rate": 0}
        seconds = min(given["deadline"] or given["budget"], LONGEST) + PATIENCE
        answer = self._sent("POST", "/api/plan", given, seconds)
        return self._run(asked, answer, waited=True)

    def submit(
        self,
        problem: Problem | Path | str | Mapping[str, Any],
        planner: str | None = None,
        options: Mapping[str, Any] | None = None,
        budget: float = BUDGET,
        seed: int | None = None,
        deadline: float | None = None,
        warm_start: str | None = None,
    ) -> str:
        """Queue a run and return its id; the same submission has the same id. Arguments as of `plan`.

        Raises:
            InputError, ServerError: as `plan`.
        """
        given = self._submission(_problem(problem), planner, options, budget, seed, deadline, warm_start)
        given |= {"submission": self._name}
        return str(self._sent("POST", "/api/runs", given)["id"])

    def status(self, run: str) -> dict[str, Any]:
        """How a run is: `status`, `verified`, `failure`, `timings`, ….

        Raises:
            ServerError: there is none of that id.
        """
        return self._sent("GET", f"/api/runs/{_id('status', run)}")

    def watch(self, run: str) -> Iterator[dict[str, Any]]:
        """What happens in a run, until it has ended; a connection that breaks on the way is made anew.

        Yields:
            `type` and more: `status`; `stage` with `fraction`; `best` with `seconds` and `duration`, of a verified
            motion; `end` with `status` and `verified`.

        Raises:
            ServerError: there is none of that id, or the server is gone for longer than `RESUME`, s.
        """
        connected, seen, lost = False, "", 0.0  # the last event, and since when nothing comes
        while True:
            try:
                for number, event in self._events(run, seen):
                    connected, seen, lost = True, number or seen, 0.0
                    if event["type"] == "stopping":
                        break
                    yield event
                    if event["type"] == "end":
                        return
                why = "the stream ended before the run"
            except (httpx.HTTPError, ServerError) as error:
                if not connected or getattr(error, "status", 0) not in AWAY:
                    raise _gone(self.url, error) from error
                why = str(error)
            lost = lost or time.monotonic()
            if time.monotonic() - lost > RESUME:
                raise ServerError(0, f"{self.url}: {why}")
            time.sleep(RETRY)

    def _events(self, run: str, seen: str) -> Iterator[tuple[str, dict[str, Any]]]:
        """The events of a stream, with their ids; those after the one that was seen."""
        try:
            yield from server_events(
                self._http, f"/api/runs/{_id('watch', run)}/events", {"Last-Event-ID": seen} if seen else None
            )
        except httpx.HTTPStatusError as error:
            _check(error.response)
            raise

    def execute(
        self,
        run: Run | str | Problem | Path | Mapping[str, Any],
        driver: str = "sim",
        budget: float = BUDGET,
        **options: Any,
    ) -> RemoteExecution:
        """Have the server execute a motion; it goes on without this client, unless there is a lease.

        Args:
            run: verified; or the id of one on the server; or a problem, as of `plan`, which the server plans first.
            driver: of the server; see `optiplan serve --driver`.
            budget: s for planning and proof, of a problem.
            options: `override`, speed at the start, 0 to 1; `clearance` to keep from what moves, m; `deviation` of a
                measured joint from its set-point at which the robot stops, rad or m; `rate`, set-points per second;
                `patience`, how late one may come, s; `lease`, s: where this program is silent for so long, the robot
                stops.

        Returns:
            What steers it: `override`, `pause`, `resume`, `reverse`, `stop`, `update_scene`, `state_in`, `splice`,
            `events`, `wait` and `close`.

        Raises:
            InputError: the run is not verified, or an argument is wrong.
            ServerError: there is no server, or it refuses, as where the driver is in use.

        Example:
            >>> import optiplan as op
            >>> robot = op.Client("http://127.0.0.1:7100").execute("01_reach", lease=1.0)  # doctest: +SKIP
            >>> robot.override(0.3)["phase"]  # doctest: +SKIP
            'changing'
        """
        seconds = positive_seconds("Client.execute", budget)
        asked = {**self._motion_of(run), "driver": driver, "budget": seconds, **_json("Client.execute", options)}
        about = self._sent("POST", EXECUTIONS, asked, seconds + PATIENCE)
        return RemoteExecution(self._http, partial(self._sent, seconds=PROVING), self._motion_of, about)

    def _motion_of(self, run: Run | str | Problem | Path | Mapping[str, Any]) -> dict[str, Any]:
        """A run, its id, or a problem, as the server takes it."""
        if isinstance(run, str) and re.fullmatch("[0-9a-f]{32}", run):
            return {"run": run}
        if not isinstance(run, Run):
            return {"problem": self._data(_problem(run))}
        if run.trajectory is None or not run.verified:
            raise wrong_argument("Client.execute", "run", "a run that is not verified", "a verified run of op.plan(…)")
        return {"problem": self._data(run.problem), "trajectory": run.trajectory.to_dict()}

    def _sent(
        self, method: str, path: str, body: Mapping[str, Any] | None = None, seconds: float = PATIENCE
    ) -> dict[str, Any]:
        """The data of an answer."""
        answer = self._send(method, path, json=body, timeout=seconds)
        try:
            return _OurData(self.url, answer.json())
        except (ValueError, TypeError):  # no JSON, or no mapping
            raise _not_ours(self.url) from None

    def run(self, run: str, problem: Problem | None = None) -> Run:
        """A run that has ended; its motion is verified afresh here.

        Args:
            run: its id.
            problem: of the run; None: as the run says, which needs its files here.

        Raises:
            ServerError: there is none, it has not ended, or it is of another problem.
        """
        answer = self.status(run)
        if answer["status"] in ("done", "failed"):
            answer["trajectory"] = (
                self._sent("GET", f"/api/runs/{run}/{TRAJECTORY}") if answer["status"] == "done" else None
            )
            return self._run(problem, answer)
        raise ServerError(409, f"the run {run} is {answer['status']}")

    def cancel(self, run: str) -> None:
        """Cancel a run that this client submitted; one that has ended, or that others submitted too, stays as it is.

        Raises:
            ServerError: there is none of that id.
        """
        self._send("POST", f"/api/runs/{_id('cancel', run)}/cancel", params={"submission": self._name})

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def __enter__(self) -> "Client":
        """Itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the connections."""
        self.close()

    def __repr__(self) -> str:
        """Where the server is."""
        return f"Client: {self.url}"

    def _submission(
        self,
        problem: Problem,
        planner: str | None,
        options: Mapping[str, Any] | None,
        budget: float,
        seed: int | None,
        deadline: float | None,
        warm_start: str | None,
    ) -> dict[str, Any]:
        options_argument("Client", options)
        text_argument("Client", "planner", planner, "the name of a planner, or None")
        text_argument("Client", "warm_start", warm_start, "the id of a run on the server, or None")
        given = {
            "problem": self._data(problem),
            "planner": planner,
            "options": None if options is None else _json("Client", options, "options."),
            "budget": positive_seconds("Client", budget),
            "seed": problem.seed if seed is None else seed_argument("Client", seed),
        }
        if deadline is not None:
            expected = "a number of seconds above 0, or None"
            deadline = number_argument("Client", "deadline", deadline, expected, above=0.0)
        return given | {"deadline": deadline, "warm_start": warm_start}

    def _data(self, problem: Problem) -> dict[str, Any]:
        """A problem as data; its meshes are uploaded."""
        data: dict[str, Any] = json.loads(json.dumps(file_data(problem, "Client")))
        for mesh in shape_files_of(data):
            mesh["file"] = self._upload(Path(mesh["file"]))
        return data

    def _upload(self, file: Path) -> str:
        from optiplan.cache import digest

        content = read_bytes(file)
        name = f"{digest([content])[:32]}/{file.stem[:40].encode('ascii', 'ignore').decode() or 'mesh'}{file.suffix}"
        name = "".join(c if c.isalnum() or c in "._-/" else "_" for c in name)
        self._send("PUT", f"/api/uploads/{name}", content=content)
        return name

    def _run(self, problem: Problem | None, answer: Mapping[str, Any], waited: bool = False) -> Run:
        if problem is not None and answer["problem"] != problem.hash:
            raise ServerError(409, "the server planned another problem: its robot or meshes differ from those here")
        record: Mapping[str, Any] = {}
        try:
            record = self._sent("GET", f"/api/runs/{answer['id']}/{RUN}")
        except ServerError as error:
            failure = answer["failure"]
            if not waited and (failure is None or error.status != 404):
                raise
            if not waited:  # what was waited for is at hand
                said = f"the run {answer['id']} failed: {failure['kind']}: {failure['detail']}"
                raise ServerError(500, said) from None
        data = answer["trajectory"]
        motion = None if data is None else Trajectory.from_dict(data)
        given = None if data is None else GivenFiles.of(data, record, TRAJECTORY)
        return run_of_record(record or answer, motion, problem, given, f"{self.url}/api/runs/{answer['id']}/{RUN}")

    def _send(self, method: str, path: str, **given: Any) -> httpx.Response:
        try:
            answer = self._http.request(method, path, **given)
        except (httpx.HTTPError, UnicodeError) as error:  # UnicodeError: of a host whose name cannot be one
            raise ServerError(0, f"no server answers at {self.url} ({error or type(error).__name__})") from error
        _check(answer)
        return answer


class _OurData(dict[str, Any]):
    """Data of a server of ours: a key that is missing tells that it is another one."""

    def __init__(self, url: str, data: Mapping[str, Any]) -> None:
        super().__init__(data)
        self._url = url

    def __missing__(self, key: str) -> Any:
        raise _not_ours(self._url)


def _not_ours(url: str) -> ServerError:
    return ServerError(0, f"what answers at {url} is no `optiplan serve`, or one of another version")


def _id(function: str, run: Any) -> str:
    """Return the id of a run that a path can hold."""
    if not isinstance(run, str) or not re.fullmatch(r"[\w-]+", run, re.ASCII):
        raise wrong_argument(f"Client.{function}", "run", described(run), "the id of a run on the server")
    return run


def _json(function: str, given: Mapping[str, Any], below: str = "") -> dict[str, Any]:
    """Values by key as they come out of JSON; an `InputError` names the argument, `below` a key, that is none."""
    found = {}
    for key, value in plain(given).items():
        try:
            found[key] = json.loads(json.dumps(value, allow_nan=False))
        except (TypeError, ValueError):
            expected = "finite numbers, texts, lists and mappings"
            raise wrong_argument(function, f"{below}{key}", described(value), expected) from None
    return found


def _problem(given: Any) -> Problem:
    return given if isinstance(given, Problem) else load_problem(given)


def _gone(url: str, error: Exception) -> ServerError:
    return error if isinstance(error, ServerError) else ServerError(0, f"{url}: {error or type(error).__name__}")


def _check(answer: httpx.Response) -> None:
    """Turn a refusal into an error."""
    if answer.status_code < 300:
        return
    if answer.is_redirect:
        there = answer.headers.get("location", "")
        raise ServerError(answer.status_code, f"{answer.request.url} sends on to '{there}'; give the address there")
    try:
        data = answer.json()
        issues = [Issue(**{**issue, "path": tuple(issue.get("path", ()))}) for issue in data["issues"]]
        text = str(data["error"])
    except (ValueError, KeyError, TypeError):
        issues, text = [], f"{answer.request.url}: HTTP {answer.status_code}"
    if issues and answer.status_code == 422:
        raise InputError(issues)
    raise ServerError(answer.status_code, text)
