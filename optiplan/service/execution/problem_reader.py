"""Problems as they come over the network: read within the folders allowed, kept while they are asked for again."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from optiplan.bench.execution.robot_cache import RobotCache
from optiplan.cache import MostRecent
from optiplan.config.document import Document, parse_yaml, plain
from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue, UnknownChoiceError
from optiplan.files import reading
from optiplan.planners.registry import PLANNERS, make_planner
from optiplan.problem.from_data import read_problem
from optiplan.problem.problem import Problem
from optiplan.records import dataclass
from optiplan.resources import robots_dir
from optiplan.robot.robot import robot_names
from optiplan.runs.pipeline import chosen
from optiplan.service.store.uploads import mark_used

KEPT, KEPT_ROBOTS = 32, 16
"""Problems and robots that stay loaded."""


@dataclass(frozen=True)
class PlannerChoice:
    """The planner of a request, its options and the seed."""

    planner: str
    options: Mapping[str, Any]
    seed: int


class ProblemReader:
    """Reads requests; robots and the last problems stay loaded.

    Args:
        base: folder that files named in problems are relative to.
        folders: the only ones, besides the bundled robots, from which files are read.
        bodies: most obstacles and held objects of one problem.

    Attributes:
        folders: all that files are read from.
    """

    def __init__(self, base: Path, folders: list[Path], bodies: int) -> None:
        self._base, self.folders, self._bodies = base, [*folders, robots_dir()], bodies
        self._bundled = robots_dir().resolve()  # whose files do not change
        self._robots = RobotCache(KEPT_ROBOTS, set(robot_names()))
        self._problems: MostRecent[Problem] = MostRecent(KEPT)
        self._documents: MostRecent[Document] = MostRecent(KEPT)

    def read(self, request: Mapping[str, Any]) -> Problem:
        """The problem of a request: `problem` as text or data, `name` where it has none, `start` and `goal` instead.

        Problems of which a file was read that may change are not kept.

        Raises:
            InputError: everything that is wrong with it.
        """
        return self._problems.find(_key(request)) or self._load(request)

    def keeps(self, request: Mapping[str, Any]) -> bool:
        """Return whether a problem that was just read is kept: no file of it may change."""
        return self._problems.find(_key(request)) is not None

    def choose(self, request: Mapping[str, Any], problem: Problem) -> PlannerChoice:
        """The planner that is asked for, which is made on trial.

        Raises:
            InputError: there is no such planner or option, or it has a wrong value.
        """
        name, options = chosen(problem, request.get("planner"), request.get("options"))
        given = request.get("seed")
        try:
            if name not in PLANNERS:  # `module:Class` would run the sender's choice of code
                raise UnknownChoiceError("planner", name, PLANNERS)
            make_planner(name, options)
        except UnknownChoiceError as error:
            field = "planner" if error.kind == "planner" else f"planner.{error.found}"
            found, expected = f"unknown {error.kind} '{error.found}'", choices(error.found, error.choices)
            raise InputError([Issue("request", None, field, found, expected)]) from None
        return PlannerChoice(name, options, problem.seed if given is None else given)

    def _load(self, request: Mapping[str, Any]) -> Problem:
        path = Path(f"{request.get('name') or 'problem'}.yaml")
        given = request["problem"]
        if isinstance(given, str):  # requests often differ in start and goal alone
            document = self._documents.get(json.dumps([str(path), given]), lambda: parse_yaml(given, path))
        else:
            document = Document(path, plain(given), {})
        instead = {key: request[key] for key in ("start", "goal") if request.get(key) is not None}
        if isinstance(document.data, dict):
            document = replace(document, data=document.data | instead)
            self._count(document)
        with reading(self.folders) as files:
            problem = Problem.of(read_problem(document, self._base, self._robots))
        mark_used(self._base, files)
        if all(file.is_relative_to(self._bundled) for file in files):
            self._problems.keep(_key(request), problem)
        return problem

    def _count(self, document: Document) -> None:
        scene = document.data.get("scene")
        held = [scene.get(key) for key in ("obstacles", "attached")] if isinstance(scene, dict) else []
        count = sum(len(bodies) for bodies in held if isinstance(bodies, list))
        if count > self._bodies:
            raise InputError([document.issue(("scene",), f"{count} bodies", f"at most {self._bodies} on this server")])


def files_changed(request: Mapping[str, Any], problem: Problem) -> bool:
    """Return whether a request names the `hash` of another problem than the one that was read for it."""
    return request.get("hash") not in (None, problem.hash)


def _key(request: Mapping[str, Any]) -> str:
    """What the problem of a request is kept under."""
    asked = [request["problem"], request.get("name"), request.get("start"), request.get("goal")]
    return hashlib.sha256(json.dumps(asked).encode("utf-8", "surrogatepass")).hexdigest()
