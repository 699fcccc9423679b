"""The pages in a real browser: edit, drag, plan, watch, play, compare, cancel; without a word of complaint."""

import json
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from optiplan.config.document import parse_yaml
from optiplan.problem.load import problem_from_dict
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.page import render_page
from optiplan.viewer.run_data.closed_loop import read_log
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene
from tests.service.browsing import CHANGED, drag, open_studio, text_of, write
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import PATIENCE

OBSTACLE = """
scene:
  obstacles:
    - {name: ball, shape: {sphere: 0.09}, pose: {position: [0.3, -0.45, 0.35]}}
"""
pytestmark = pytest.mark.timeout(300)
wide = pytest.mark.parametrize("page", [(1280, 800)], indirect=True, ids=["wide"])
narrow = pytest.mark.parametrize("page", [(390, 844)], indirect=True, ids=["narrow"])
"""Each kind of page is used in both layouts, by one test or another."""


COVERED = """() => {
  const [hint, joints] = ["told", "joints"].map((id) => document.getElementById(id).getBoundingClientRect());
  return hint.right > joints.left && hint.bottom > joints.top && hint.top < joints.bottom;
}"""


def test_the_goal_is_dragged_with_all_branches_as_ghosts_and_the_hint_is_beside_the_joints(page, server):
    open_studio(page, server)
    began = page.evaluate("optiplanStudio.state.problem.goal.pose")
    ghosts = "optiplanStudio.scene.ghosts.children.length > 1"
    drag(page, page.evaluate("optiplanStudio.scene.goalOnScreen()"), (-40, -20), lambda: page.wait_for_function(ghosts))
    page.wait_for_function(CHANGED, arg=began)
    first = page.evaluate("optiplanStudio.state.problem.goal.pose")
    assert np.linalg.norm(np.subtract(first["position"], began["position"])) > 0.03
    assert "# From the lower right" in text_of(page)  # what else is in the file stays
    for handle, turned in (((0.17, 0, 0), False), ((0.07778, 0.07778, 0), True)):  # an arrow; a ring
        drag(page, page.evaluate("at => optiplanStudio.scene.goalOnScreen(...at)", list(handle)), (18, 14))
        page.wait_for_function(CHANGED, arg=first)
        pose = page.evaluate("optiplanStudio.state.problem.goal.pose")
        position, rotation = (np.linalg.norm(np.subtract(pose[key], first[key])) for key in ("position", "rpy"))
        assert (rotation > 0.02) == turned
        assert (position > 5e-3) != turned
        first = pose
    page.wait_for_selector("#joints summary")
    page.evaluate("document.getElementById('joints').open = true")
    assert not page.evaluate(COVERED)


STATED = """before => {
  const at = optiplanStudio.state.problem.scene.obstacles.find((one) => one.name === "ball").pose.position;
  return Math.hypot(...at.map((x, k) => x - before[k])) > 0.01;
}"""


@narrow
def test_an_obstacle_is_moved_and_the_file_saved(page, server, problems):
    open_studio(page, server)
    write(page, (problems / "01_reach.yaml").read_text() + OBSTACLE)
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    ball = "optiplanStudio.scene.obstacles.children.find((one) => one.name === 'ball')"
    for keys, still in (([], 2), (["Shift"], None)):
        before = page.evaluate(f"{ball}.position.toArray()")
        for key in keys:
            page.keyboard.down(key)
        drag(page, page.evaluate(f"optiplanStudio.scene.onScreen({ball})"), (-30, -25))
        for key in keys:
            page.keyboard.up(key)
        page.wait_for_function(STATED, arg=before)
        after = page.evaluate(f"{ball}.position.toArray()")
        if still is None:
            assert after[2] - before[2] > 0.01
        else:
            assert abs(after[still] - before[still]) < 2e-3
    page.evaluate("scrollTo(0, 0)")
    with page.expect_download() as saving:
        page.click("#save")
    text = Path(saving.value.path()).read_text()
    assert text == text_of(page)
    assert "- {name: ball" in text
    assert problem_from_dict(parse_yaml(text, Path("moved.yaml")).data).scene.obstacles[-1].name == "ball"


@narrow
def test_a_running_controller_is_watched_and_its_target_dragged(page, server):
    page.goto(f"{server.url}/live")
    page.wait_for_function("optiplanLive.scene.data")
    page.select_option("#example", "01_reach")
    page.wait_for_function("optiplanLive.scene.data.name === 'reach' || !optiplanLive.live.id")
    page.click("#begin")
    page.wait_for_function("optiplanLive.live.states > 5")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    began = page.evaluate("optiplanLive.live.last")
    drag(page, page.evaluate("optiplanLive.scene.goalOnScreen()"), (-25, -30))
    page.wait_for_function(
        "began => Math.hypot(...optiplanLive.live.last.target.slice(0, 3).map((x, k) => x - began[k])) > 0.03",
        arg=began["target"],
    )
    page.wait_for_function("optiplanLive.live.last.error.position < 1e-3")
    after = page.evaluate("optiplanLive.live.last")
    assert np.linalg.norm(np.subtract(after["tool"][:3], began["tool"][:3])) > 0.03
    titles = page.locator("#strips .head b").all_text_contents()
    assert titles == ["errors of the tool", "smallest distance", "joint velocities"]
    strip = "optiplanLive.live.strips.strips[{}].plot"
    assert page.evaluate(strip.format(1) + ".series[0].low") == 5.0  # the distance that is kept, mm
    page.wait_for_function("Math.max(...optiplanLive.live.strips.strips[2].columns.flat().map(Math.abs)) > 0.01")
    assert page.evaluate(strip.format(2) + ".series.map((one) => [one.low, one.high])") == [[-1, 1]] * 7
    with page.expect_download() as saving:
        page.click("#save")
    record, log = recorded(saving.value)
    assert record["planner"] == "controller (own)"
    assert log["tool_error"].max() > 0.01  # when the target was moved
    assert len(log["t"]) > 5
    page.click("#home")
    page.wait_for_function(
        "began => Math.hypot(...optiplanLive.live.last.tool.slice(0, 3).map((x, k) => x - began[k])) < 1e-3",
        arg=began["tool"],
    )
    page.evaluate("optiplanLive.live.events.close()")  # a stream that breaks for good
    page.evaluate("optiplanLive.live.events.dispatchEvent(new Event('error'))")
    page.wait_for_function("optiplanLive.live.events.readyState === 1 && optiplanLive.live.states > 5")
    page.evaluate("window.fetch = () => Promise.reject(new Error('the server was killed')); null")
    page.evaluate("optiplanLive.live.events.dispatchEvent(new Event('error'))")  # the browser tries again
    page.wait_for_selector("#banner:text('The server does not answer')")
    page.reload()  # one that runs is watched again
    page.wait_for_function("optiplanLive.live.states > 5")
    page.click("#stop")
    assert page.inner_text("#state") == "ended"
    with page.expect_download() as saving:
        page.click("#save")  # what was seen stays
    assert recorded(saving.value)[0]["planner"] == "controller (own)"


LAST = "optiplanExecution.live.last"


@narrow
def test_an_execution_is_steered_and_an_obstacle_dragged_into_its_way(page, server, problems):
    text = (problems / "01_reach.yaml").read_text() + OBSTACLE
    run = server.ended(server.submit(problem=text, seed=60)["id"])
    page.goto(f"{server.url}/execution#run={run['id']}")
    page.wait_for_function("optiplanExecution.ready && optiplanExecution.scene.data")

    def turn(percent):
        page.evaluate(TURN, percent)

    turn(3)
    page.click("#begin")
    page.wait_for_function("optiplanExecution.live.states > 3")
    assert page.evaluate(LAST)["override"] == 0.03
    turn(2)
    page.wait_for_function(f"{LAST}.override === 0.02")
    page.click("#pause")
    page.wait_for_selector("#state:text('paused')")
    page.click("#reverse")
    page.wait_for_function(f"{LAST}.speed < 0")
    page.click("#resume")
    page.wait_for_function(f"{LAST}.speed > 0")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    ball = "optiplanExecution.scene.obstacles.children.find((one) => one.name === 'ball')"
    at = page.evaluate(f"optiplanExecution.scene.onScreen({ball})")
    end = "0.14, 0.65, 0.35"  # of the tool, as high as the ball, which is moved level
    there = page.evaluate(f"optiplanExecution.scene.onScreen(optiplanExecution.scene.root, {end})")
    sent = []
    page.on("request", lambda asked: asked.url.endswith("/obstacles") and sent.append(asked.post_data_json))
    page.mouse.move(*at)
    page.mouse.down()
    end = time.monotonic() + PATIENCE
    while not any(np.linalg.norm(one["velocities"]["ball"]) > 0.01 for one in sent):  # a starved page sees no speed
        assert time.monotonic() < end, sent
        for share in (0.25, 0.5, 0.75, 1.0):
            page.mouse.move(*(np.array(at) + share * np.subtract(there, at)))
            page.wait_for_timeout(40)
    page.wait_for_function(f"{LAST}.obstacles.ball")
    page.mouse.up()
    page.wait_for_selector("#state:text('waiting')")
    end = time.monotonic() + PATIENCE
    while not (sent and not any(sent[-1]["velocities"]["ball"])):  # one let go stands still
        assert time.monotonic() < end, sent
        page.wait_for_timeout(20)
    assert "ball" in page.inner_text("#reason")
    assert_strips_and_recording(page)
    page.evaluate("optiplanExecution.live.events.close()")  # a stream that breaks
    page.wait_for_selector("#state:text('stale')")
    page.evaluate("optiplanExecution.live.events.dispatchEvent(new Event('error'))")
    page.wait_for_selector("#state:text('waiting')")
    page.evaluate("scrollTo(0, 0)")
    page.click("#stop")
    page.wait_for_selector("#state:text('ended')")
    assert page.inner_text("#reason") == "asked to stop"
    assert page.is_enabled("#begin")


@wide
def test_a_page_that_is_loaded_again_goes_on_holding_its_execution(page, server):
    run = server.ended(server.submit(seed=62)["id"])["id"]

    def patient(route):  # what takes longer than a lease on a busy machine is not what is tested
        asked = route.request.post_data_json
        route.continue_(post_data=json.dumps(asked | {"lease": 60.0, "paused": True}))

    page.route(
        "**/api/executions", lambda route: patient(route) if route.request.method == "POST" else route.continue_()
    )
    page.goto(f"{server.url}/execution#run={run}")
    page.wait_for_function("optiplanExecution.ready")
    page.check("#lease")
    page.click("#begin")
    page.wait_for_function("optiplanExecution.live.states > 0")
    page.reload()
    page.wait_for_function("optiplanExecution.live.states > 0")
    assert page.is_checked("#lease")
    page.evaluate("sessionStorage.clear()")  # another tab watches only
    page.reload()
    page.wait_for_function("optiplanExecution.live.states > 0")
    assert not page.is_checked("#lease")
    page.click("#stop")
    page.wait_for_selector("#state:text('ended')")


def assert_strips_and_recording(page):
    """Of a robot that waits for the ball: what holds it back is red, and all that was seen can be saved."""
    assert "ball" in page.evaluate(f"{LAST}.blocked_by")
    red = "optiplanExecution.scene.obstacles.children.filter((one) => one.material.emissive.getHex())"
    assert page.evaluate(red + ".map((one) => one.name)") == ["ball"]  # what holds the robot back
    assert page.locator("#strips .head b").all_text_contents() == ["speed along the path", "joint velocities"]
    with page.expect_download() as saving:
        page.click("#save")
    record, log = recorded(saving.value)
    assert record["planner"] == "executed (paper)"
    assert record["problem"]["robot"] == "panda"
    assert np.abs(log["q"] - log["wanted"]).max() < 1e-3
    assert np.ptp(log["q"], axis=0).max() > 1e-4


def recorded(download):
    """The record and the log of a run folder that was saved, which the viewer shows."""
    folder = Path(download.path()).with_suffix(".recording")
    with zipfile.ZipFile(download.path()) as packed:
        packed.extractall(folder)
    record, log = json.loads((folder / "run.json").read_text()), read_log(folder)
    motion = Trajectory.from_dict(json.loads((folder / "trajectory.json").read_text()))
    assert motion.duration > 0.1
    problem = problem_from_dict(record["problem"])
    viewed = ViewedRun("seen", motion, record["report"], None, record, log)
    assert "tracking error" in render_page(build_scene(problem, [viewed]))
    return record, log


TURN = """percent => {
  const slider = document.getElementById("speed");
  slider.value = percent;
  slider.dispatchEvent(new Event("input"));
}"""


@wide
def test_edit_drag_plan_watch_and_play(page, server, problems):
    open_studio(page, server)
    text = (problems / "01_reach.yaml").read_text()
    page.evaluate("text => optiplanStudio.editor.replace(text)", text.replace("robot: panda", "robot: pandas"))
    page.wait_for_selector("#issues button")
    assert "did you mean 'panda'" in page.inner_text("#issues")
    assert page.is_disabled("#plan")
    write(page, text + "\nseed: 64\n")
    slider = page.locator("#sliders input").first
    slider.evaluate("one => { one.value = 0.4; one.dispatchEvent(new Event('input')); }")
    page.wait_for_function("optiplanStudio.state.q[0] === 0.4")
    page.fill("#budget", "5")
    page.click("#plan")
    page.wait_for_selector("#link:not([hidden])", state="attached")
    assert page.inner_text("#state") == "verified"
    assert page.get_attribute("#execute", "href").startswith("execution#run=")
    assert page.locator("#improvements li").count() >= 1
    page.frame_locator("#page").locator("canvas").first.wait_for()
    page.click("#back")
    assert page.is_hidden("#page")


@narrow
def test_cancel_from_the_studio(page, server):
    page.goto(f"{server.url}/studio")
    page.wait_for_selector("#issues .fine")
    write(page, NO_WAY + "seed: 65\n")
    page.fill("#budget", "60")
    page.click("#plan")
    page.wait_for_selector("#state.running")
    page.click("#cancel")
    page.wait_for_selector("#state.cancelled")


@narrow
def test_runs_are_listed_and_compared(page, server):
    runs = [server.ended(server.submit(problem=QUICK, planner=name, seed=61)["id"]) for name in ("quintic", "cubic")]
    page.goto(server.url)
    for run in runs:
        page.wait_for_selector(f"a[href='runs/{run['id']}']")
        assert page.locator(f"a[href='execution#run={run['id']}']").count() == int(run["verified"])
        page.locator(".run", has=page.locator(f"a[href='runs/{run['id']}']")).locator("input").check()
    page.wait_for_function("[...document.images].some((one) => one.complete && one.naturalWidth > 0)")
    page.click("#compare")
    page.wait_for_selector("canvas")
    assert "cubic" in page.content()  # on a narrow page the card is folded


@wide
def test_older_runs_are_counted_though_the_filter_shows_none_of_them(page, server):
    run = server.ended(server.submit(seed=63)["id"])
    newest = [{**run, "id": f"{k:032x}", "submitted": 1e6 - k} for k in range(60)]
    older = {**run, "id": "f" * 32, "submitted": 1.0, "status": "cancelled", "robot": "another"}
    page.route("**/thumbnail.svg*", lambda route: route.fulfill(body="<svg/>", content_type="image/svg+xml"))
    page.route("**/api/runs?limit=60", lambda route: route.fulfill(json={"runs": newest, "counts": {"done": 61}}))
    page.route("**/api/runs?limit=60&before=*", lambda route: route.fulfill(json={"runs": [older], "counts": {}}))
    page.goto(server.url)
    page.select_option("#verdict", "verified")
    page.click("#more")
    page.wait_for_selector("#found:text('60 of 61')")
    assert page.is_hidden("#more")
    assert page.locator("#robot option").all_text_contents() == ["any", "another", "planar2r"]


@wide
def test_of_stored_problems_of_one_name_each_can_be_chosen(page, server):
    text = QUICK.replace("name: free", "name: kept twice")
    kept = [text, text.replace("1.2]", "1.1]")]
    stored = [server.http.post("/api/problems", json={"problem": one}).json()["hash"] for one in kept]
    page.goto(f"{server.url}/benches")
    page.wait_for_selector("#planners option")
    for hash in stored:
        assert page.inner_text(f"#problems option[value='{hash}']").startswith("kept twice (stored ")
        page.select_option("#problems", [hash])
        page.select_option("#planners", ["quintic"])
        with page.expect_request(lambda asked: asked.method == "POST") as sent:
            page.click("#submit")
        assert sent.value.post_data_json["problems"] == [hash]
        page.wait_for_selector("#told:empty", state="attached")


@narrow
def test_a_bench_is_run_from_its_page(page, server):
    page.goto(f"{server.url}/benches")
    page.wait_for_selector("#planners option")
    page.select_option("#problems", ["19_lspb"])
    page.select_option("#planners", ["lspb", "quintic"])
    page.fill("#name", "from its page")
    page.fill("#seeds", "1")
    page.fill("#budget", "3")
    page.click("#submit")
    bench = page.locator(".bench", has_text="from its page")
    bench.locator("button:text('Delete')").wait_for()
    assert bench.locator(".badge.verified").count() == 2
    bench.locator("a:text('Full report')").click()
    page.wait_for_selector("svg polyline")
    assert "lspb" in page.content()
