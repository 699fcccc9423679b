"""What a solver process can be asked: check a problem, plan, draw, export, solve inverse kinematics."""

import base64
import json
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import optiplan
from optiplan.errors import InputError, Issue
from optiplan.files import reading
from optiplan.planners.base import Budget, silent, stages_of
from optiplan.planners.registry import load_libraries
from optiplan.problem.load import load_problem
from optiplan.problem.problem import Problem
from optiplan.resources import problems_dir, robots_dir
from optiplan.runs import pipeline
from optiplan.runs.export import FORMATS, export_trajectory
from optiplan.runs.run import Run
from optiplan.runs.run_folder import RATE, motion_file, run_files
from optiplan.service.execution.problem_reader import PlannerChoice, ProblemReader, files_changed
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import jsonable
from optiplan.verify.verify import verify

Answer = tuple[dict[str, Any], dict[str, bytes]]
"""A JSON-ready answer, and files by name."""

_WARM_UP = 1.0  # s


class Tasks:
    """Answers requests, with robots and problems kept in between.

    Attributes:
        hide_paths: takes the folders of this machine out of an error message.
    """

    def __init__(self, settings: Mapping[str, Any]) -> None:
        folders = [Path(folder) for folder in settings["folders"]]
        self._reader = ProblemReader(Path(settings["base"]), folders, settings["bodies"])
        self.hide_paths = _path_hider([Path(settings["base"]), *folders])

    def warm_up(self, what: str) -> None:
        """Load what `execute` needs; or `plan` the first example, so that code is compiled and caches are filled, too.

        For what is empty nothing is loaded.
        """
        if what == "execute":
            import optiplan.service.execution.executing  # noqa: F401
        if what != "plan":
            return
        with reading(None):
            problem = load_problem(problems_dir() / "01_reach.yaml")
        load_libraries("trajopt")  # of which the example needs none
        pipeline.run(problem, "trajopt", {}, Budget(_WARM_UP), silent)

    def check(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """Read a problem and the planner's options; the answer says what they are, and whether that `lasts`."""
        problem = self._reader.read(request)
        choice = self._reader.choose(request, problem)
        return _identity(problem, choice) | {"lasts": self._reader.keeps(request)}, {}

    def plan(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """Plan and prove; the files are those of a run folder. A request that is `early` has its motion sent first."""
        problem = self._reader.read(request)
        choice = self._reader.choose(request, problem)
        if files_changed(request, problem):
            detail = "the files that the problem names, or this program, were changed after it was submitted"
            return {"failure": {"kind": "input", "detail": detail, "witness": {}}, "timings": {}}, {}
        budget, given = Budget(request["budget"]), problem.with_seed(choice.seed)
        told = stages_of(progress) if request.get("early") else progress
        earlier = Trajectory.from_dict(request["earlier"]) if request.get("earlier") else None
        run = pipeline.plan_and_verify_once(
            given, choice.planner, choice.options, budget, told, earlier, by=pipeline.answer
        )
        about, rate = _about(run) | _identity(problem, choice), request.get("rate")
        if request.get("early"):
            progress.answered(about, motion_file(run, RATE if rate is None else rate or None))
        return about, run_files(run)

    def page(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """The page of runs, each of them from the texts of its two files, under its own of the `labels`, if any."""
        from optiplan.service.execution.viewed_runs import viewed_runs
        from optiplan.viewer.page import Drawn, Link, render_page
        from optiplan.viewer.scene import build_scene

        problem = self._reader.read(request)
        shown = viewed_runs(problem, request["runs"], request["ids"], request.get("labels") or ())
        if len(shown) > 1:
            links = [Link("./", "Runs")]
        else:
            run, api = request["ids"][0], f"../api/runs/{request['ids'][0]}"
            links = [Link("../", "Runs"), Link(f"../studio#run={run}", "Edit in the studio")]
            links += [Link(f"{api}/problem", "Problem"), Link(f"{api}/run.zip", "Files")]
            if shown[0].trajectory is not None:
                links += [Link(f"{api}/export.csv", "CSV"), Link(f"../execution#run={run}", "Execute")]
        drawn = Drawn(address=request["drawn"]) if request.get("drawn") else None
        return {}, {"page.html": render_page(build_scene(problem, shown), links[0], links[1:], drawn).encode()}

    def picture(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """A small picture of a problem, with the motion of a `trajectory.json` that was made for it, if any."""
        from optiplan.viewer.thumbnail import scene_picture

        problem, motion = self._reader.read(request), None
        if request.get("motion") and not files_changed(request, problem):  # else it may go through what is drawn
            motion = Trajectory.from_dict(json.loads(request["motion"]))
        return {}, {"picture.svg": scene_picture(problem, motion).encode()}

    def export(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """A motion for another program, proved again where it is slowed down to end on a cycle."""
        problem, format = self._reader.read(request), request["format"]
        motion = Trajectory.from_dict(json.loads(request["motion"]))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"motion{FORMATS[format].suffixes[0]}"
            export_trajectory(motion, path, format, request["rate"], proof=lambda slower: verify(problem, slower))
            return {}, {format: path.read_bytes()}

    def live(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """Run a controller until it is told to stop."""
        from optiplan.service.execution.live import LiveLoop, live_about

        loop = LiveLoop(self._reader.read(request), request.get("engine"))
        progress.answered(dict(live_about(loop)), {})
        loop.run(progress)
        return {"seconds": loop.t}, {}

    def execute(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """Execute a verified motion by a driver, until it has come to its end or its stop."""
        from optiplan.service.execution.executing import Executing

        return Executing(self._reader.read, request).run(progress), {}

    def recording(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """The run folder of what was seen of a robot that moved; see `SeenStates`."""
        from optiplan.simulation.recording import RecordedMotion

        problem = self._reader.read(request)
        rows = np.frombuffer(base64.b64decode(request["rows"])).reshape(-1, request["columns"])
        t, q, v, wanted, target = np.split(rows, np.cumsum([1, *(problem.robot.n,) * 3]), axis=1)
        recording = RecordedMotion(problem, request["by"], t[:, 0], q, v, wanted, target if target.size else None)
        return {}, recording.files()

    def bench_report(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """The report of a bench, of the texts of its runs."""
        from optiplan.service.execution.bench_report import bench_report

        with reading(self._reader.folders):
            page = bench_report(request["suite"], request["runs"], progress)
        return {}, {"report.html": page.encode()}

    def scene(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """What pages draw: the scene as data, what can be moved, and a motion where one is given.

        Raises:
            InputError: the motion is one through another scene.
        """
        from optiplan.service.execution.studio import studio_scene

        problem = self._reader.read(request)
        if files_changed(request, problem):
            found = "a run of another problem than is read now: its files, or this program, were replaced since the run"
            raise InputError([Issue("request", None, "run", found, "a run of the files and the program as they are")])
        motion = Trajectory.from_dict(json.loads(request["motion"])) if request.get("motion") else None
        return {}, {"scene.json": _json(studio_scene(problem, motion))}

    def pose(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """Poses of the joints at a configuration, what touches there, and where the tool is."""
        from optiplan.service.execution.studio import posed

        return posed(self._reader.read(request), np.asarray(request["q"], float)), {}

    def ik(self, request: Mapping[str, Any], progress: Any) -> Answer:
        """All branches of the inverse kinematics for a pose of a frame, each drawn as poses of the joints."""
        from optiplan.service.execution.studio import branches

        return branches(self._reader.read(request), request["pose"], request.get("near"), request.get("frame")), {}


def _identity(problem: Problem, choice: PlannerChoice) -> dict[str, Any]:
    """What decides the answer, the budget apart."""
    about = {"hash": problem.hash, "name": problem.name, "robot": problem.robot.name}
    return about | {"planner": choice.planner, "options": dict(choice.options), "seed": choice.seed}


def _about(run: Run) -> dict[str, Any]:
    failed = run.failure and {"kind": run.failure.kind, "detail": run.failure.detail, "witness": run.failure.witness}
    about = {
        "verified": run.verified,
        "duration": run.duration,
        "ratio": run.ratio,
        "failure": failed,
        "timings": dict(run.timings),
        "improvements": [list(one) for one in run.improvements],
    }
    return dict(jsonable(about))


def _json(data: Any) -> bytes:
    return json.dumps(jsonable(data), allow_nan=False, default=repr, separators=(",", ":")).encode() + b"\n"


def _path_hider(named: Iterable[Path]) -> Callable[[str], str]:
    """Return a function that takes the folders of this machine out of a text.

    Args:
        named: folders below which clients name files: `uploads/part.obj` is `part.obj`. Of others `…/` is left.
    """
    own = [robots_dir(), problems_dir(), Path(optiplan.__file__).parent, Path(sys.prefix), Path(sys.base_prefix)]
    own += [Path(tempfile.gettempdir()), Path.cwd()]
    try:
        own.append(Path.home())
    except RuntimeError:  # this user has none
        pass
    instead = {f"{root}/": "…/" for folder in own for root in (folder, folder.resolve())}
    instead |= {f"{root}/": "" for folder in named for root in (folder.absolute(), folder.resolve())}
    instead = {root: word for root, word in instead.items() if root.count("/") > 1}
    longest_first = sorted(instead, key=len, reverse=True)

    def hide(text: str) -> str:
        for root in longest_first:
            text = text.replace(root, instead[root])
        return text

    return hide
