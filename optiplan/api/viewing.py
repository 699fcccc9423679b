"""`view`: runs in the browser, from Python."""

import html
import sys
import threading
from pathlib import Path
from types import TracebackType

from optiplan.api.loading import load_run
from optiplan.errors import OfOneProcess, described, flag_argument, whole_argument, wrong_argument
from optiplan.runs.run import Run
from optiplan.viewer.drawing.page_server import DrawnPageServer
from optiplan.viewer.page import render_page
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene
from optiplan.viewer.server import FIRST_PORT, PageServer


class View(OfOneProcess):
    """A page that is served in the background, at `url`, until `close`; a context manager does that at its end.

    `meshcat.Visualizer(meshcat_url)` draws into it; None where none was asked for.
    """

    def __init__(self, server: PageServer) -> None:
        self._server = server
        self.url = server.url
        self.meshcat_url = server.meshcat.url if isinstance(server, DrawnPageServer) else None
        self._thread = threading.Thread(target=server.serve_forever, args=(0.1,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Serve no longer; a second time does nothing."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()

    def __enter__(self) -> "View":
        """The view itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Serve no longer."""
        self.close()

    def __repr__(self) -> str:
        """Where to look."""
        return f"View: {self.url}{'' if self._thread.is_alive() else ' (closed)'}"

    def _repr_html_(self) -> str:
        """The whole page inside a notebook, which then plays it without this server, too; and a link."""
        page = html.escape(self._server.kept())
        frame = f'<iframe srcdoc="{page}" title="OptiPlan" style="width: 100%; height: 640px; border: 0"></iframe>'
        return f'{frame}<br><a href="{self.url}" target="_blank">{self.url}</a>'


def view(*runs: Run | Path | str, block: bool = True, port: int = FIRST_PORT, meshcat_port: int | None = None) -> View:
    """Show runs of one robot in the browser: play, pause, scrub; several play together, in turn, or side by side.

    Args:
        runs: at least one run, or the folder of one.
        block: serve until ctrl-C and tell the address on standard output; else in the background.
        port: the first to try; the next free one is taken, 0 any.
        meshcat_port: where scripts draw into the page by meshcat's protocol, 0 any; None: nowhere. What cannot be
            drawn is reported on the page and on standard error.

    Returns:
        The view: its `url` and `meshcat_url`, and `close`, which a view that blocked has behind it.

    Raises:
        InputError: no run, or runs of several robots.
        OptiPlanError: no port can be had.

    Example:
        >>> import optiplan as op
        >>> with op.view(op.plan(op.load_problem("01_reach")), block=False) as shown:
        ...     shown.url.startswith("http://127.0.0.1:")
        True
    """
    if not runs:
        raise wrong_argument("view", "runs", "none", "at least one run, or the folder of one")
    for run in runs:
        if not isinstance(run, Run | Path | str):
            raise wrong_argument("view", "runs", described(run), "a run of op.plan(…), or the folder of one")
    whole_argument("view", "port", port, 0, most=65535)
    if meshcat_port is not None:
        whole_argument("view", "meshcat_port", meshcat_port, 0, most=65535)
    flag_argument("view", "block", block)
    shown = [run if isinstance(run, Run) else load_run(run) for run in runs]
    problem = shown[0].problem
    robot = problem.robot
    for run in shown[1:]:
        if (run.problem.robot.fingerprint, run.problem.robot.joint_names) != (robot.fingerprint, robot.joint_names):
            found = f"a run of the robot '{run.problem.robot.name}' with {run.problem.robot.n} joints"
            raise wrong_argument("view", "runs", found, f"runs of '{robot.name}' with the same {robot.n} joints")
    several = len({run.problem.hash for run in shown}) > 1
    scene = build_scene(problem, [_viewed(run, several) for run in shown])
    if meshcat_port is None:
        served = View(PageServer(render_page(scene), port=port))
    else:
        served = View(DrawnPageServer(scene, meshcat_port, lambda words: print(words, file=sys.stderr), port=port))
    if block:
        _wait(served)
    return served


def _wait(served: View) -> None:
    """Tell where to look, and wait for ctrl-C."""
    print(f"open {served.url} in a browser (ctrl-C ends)", flush=True)
    if served.meshcat_url is not None:
        print(f'meshcat.Visualizer("{served.meshcat_url}") draws into it', flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        pass
    finally:
        served.close()


def _viewed(run: Run, several: bool) -> ViewedRun:
    return ViewedRun.of(run, run.problem.name if several else run.planner)
