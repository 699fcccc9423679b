"""A server in this process, for all tests that do not kill it, and problems that are planned in a blink."""

import threading
import time
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from optiplan.service.planner_service import PlannerService
from optiplan.service.server import serving
from optiplan.service.settings import DriverSetup, ServiceSettings
from tests.service import browsing
from tests.small_problems import QUICK
from tests.viewer.browsing import SELDOM, UNDRAWN
from tests.waiting import PATIENCE


@dataclass
class Running:
    """A server that runs: its address, what is behind it, and a client."""

    url: str
    service: PlannerService
    http: httpx.Client

    def ended(self, run: str, patience: float = PATIENCE) -> dict:
        """The run, once it has ended."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            found = self.http.get(f"/api/runs/{run}").json()
            if found["status"] not in ("queued", "running"):
                return found
            time.sleep(0.05)
        raise AssertionError(f"the run has not ended: {found}")

    def submit(self, **given) -> dict:
        """Submit the quick problem, or another, and return the answer."""
        answer = self.http.post("/api/runs", json={"problem": QUICK, "budget": 5.0, **given})
        assert answer.status_code == 202, answer.text
        return answer.json()


STARTED = ExitStack()
"""The server of this process, for as long as files of this folder follow each other."""
RUNNING: list[Running] = []


@pytest.fixture(scope="module")
def server(tmp_path_factory) -> Running:
    """One server for all: each takes seconds to start."""
    if not RUNNING:
        RUNNING.append(STARTED.enter_context(_started(tmp_path_factory.mktemp("service"))))
    return RUNNING[0]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Generator[None, object, object]:
    """End the server before a worker goes on to other folders, which have a use for its memory."""
    done = yield
    if nextitem is None or Path(__file__).parent not in nextitem.path.parents:
        RUNNING.clear()
        STARTED.close()
    return done


@contextmanager
def _started(folder: Path) -> Iterator[Running]:
    (folder / "meshes").mkdir()
    paper = DriverSetup("paper", "file", {"path": str(folder / "set_points.csv")}, patience=0.1)
    settings = ServiceSettings(
        data=folder / "data",
        port=0,
        folders=(folder / "meshes",),
        rate=1e6,
        burst=10**6,
        drivers=(paper,),
        meshcat_port=0,
    )
    with serving(settings) as (url, service):
        with httpx.Client(base_url=url, timeout=PATIENCE, trust_env=False) as http:
            yield Running(url, service, http)
        (thread,) = [one for one in threading.enumerate() if one.name == "server"]
    assert not thread.is_alive()


@pytest.fixture(autouse=True)
def nothing_is_left_moving(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test that fails while a robot moves leaves the driver free for the next ones."""
    yield
    if "server" in request.fixturenames:
        http = request.getfixturevalue("server").http
        for one in http.get("/api/executions").json()["executions"]:
            if one["ended"] is None:
                http.post(f"/api/executions/{one['id']}/stop", json={"reason": "the test is over"})


@pytest.fixture(params=[(1280, 800), (390, 844)], ids=["wide", "narrow"])
def page(browser, request, server):
    """A page that fails the test by any complaint, and by any request to somewhere else."""
    complaints = []
    size = dict(zip(("width", "height"), request.param, strict=True))
    page = browser.new_page(viewport=size, device_scale_factor=0.25)  # a sixteenth of the pixels
    page.add_init_script(SELDOM + UNDRAWN)
    page.set_default_timeout(browsing.PATIENCE)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on(
        "console",
        lambda said: (
            said.type in ("error", "warning") and "ReadPixels" not in said.text and complaints.append(said.text)
        ),
    )
    page.on(
        "requestfailed",  # so counts a stream of events that is closed, and what a page waits for that is left
        lambda failed: (
            failed.url.endswith("/events")
            or failed.failure == "net::ERR_ABORTED"
            or complaints.append(f"failed: {failed.url[:200]}")
        ),
    )
    ours = (server.url, "data:", "blob:", "about:")
    page.on("request", lambda asked: asked.url.startswith(ours) or complaints.append(f"elsewhere: {asked.url}"))
    yield page
    page.close()
    assert not complaints


@pytest.fixture
def tab(browser):
    """A page that may complain to its console, but throws nothing."""
    page, thrown = browser.new_page(viewport={"width": 1280, "height": 800}, device_scale_factor=0.25), []
    page.set_default_timeout(browsing.PATIENCE)
    page.add_init_script(SELDOM + UNDRAWN)
    page.on("pageerror", lambda error: thrown.append(str(error)))
    yield page
    page.close()
    assert thrown == []
