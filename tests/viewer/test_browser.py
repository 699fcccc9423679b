"""The page in a real browser: it must draw, play, scrub, and never complain."""

import dataclasses
import io
import os
import shutil
import threading
import time
from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.problem.problem import JointGoal, Problem
from optiplan.viewer.page import export_page, render_page
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene
from optiplan.viewer.server import PageServer

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
QUIET = ["--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"]
pytestmark = [pytest.mark.timeout(240)]


@pytest.fixture(scope="module")
def browser() -> Iterator:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        if os.environ.get("CI"):
            pytest.fail("no chromium on this machine; CI must install it")
        pytest.skip("no chromium on this machine")
    with playwright.sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, *QUIET])
        yield browser
        browser.close()


@pytest.fixture
def visit(browser):
    """Open an address and wait for the first picture; at the end, any complaint of the page fails the test."""
    complaints: list[str] = []
    context = browser.new_context(viewport={"width": 640, "height": 480})

    def heard(message) -> None:
        # Chromium itself remarks on its software renderer reading pixels back for a screenshot.
        if message.type in ("error", "warning") and "GPU stall due to ReadPixels" not in message.text:
            complaints.append(f"{message.type}: {message.text}")

    def open_page(url: str):
        page = context.new_page()
        page.on("console", heard)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url[:200]}"))
        page.on(
            "request",
            lambda request: request.url.startswith((url.split("#")[0], "data:")) or complaints.append(request.url),
        )
        page.goto(url)
        page.wait_for_selector("html[data-ready='1']", timeout=60_000)
        return page

    yield open_page
    context.close()
    assert complaints == []


@pytest.fixture(scope="module")
def exported(shelf, motion, tmp_path_factory) -> str:
    """Address of a file with two runs, one of them refused with a witness."""
    path = tmp_path_factory.mktemp("page") / "page.html"
    witness = {"q": shelf.start.tolist(), "points": [[0.6, 0.0, 0.3], [0.6, 0.0, 0.4]], "pair": ["panda_hand", "board"]}
    refused = {
        "verified": False,
        "checks": [{"name": "collision", "passed": False, "worst": -1e-3, "witness": witness}],
    }
    report = {"verified": True, "checks": [{"name": "collision", "passed": True, "worst": 0.01}]}
    runs = [ViewedRun("good", motion(shelf), report), ViewedRun("bad", motion(shelf, 2.0), refused)]
    export_page(shelf, runs, path)
    return path.as_uri()


def pixels(page) -> np.ndarray:
    from PIL import Image

    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return np.asarray(
        Image.open(io.BytesIO(page.locator("canvas").screenshot(style="#card { visibility: hidden; }"))).convert("RGB"),
        dtype=float,
    )


def until(page, condition: str) -> None:
    """Wait for a condition by asking again and again: the page forbids the `eval` of playwright's own way."""
    end = time.monotonic() + 30.0
    while not page.evaluate(condition):
        assert time.monotonic() < end, f"never came true: {condition}"
        time.sleep(0.02)


def poses(page) -> np.ndarray:
    return np.array(page.evaluate("optiplan.poses()"), dtype=float)


def test_exported_file_draws_and_scrubs(visit, exported):
    page = visit(exported + "#t=0")
    first, start = pixels(page), poses(page)
    assert first.std() > 10.0  # not blank
    assert page.locator("#clock").text_content() == "0.00 / 2.00 s"
    page.locator("#scrub").evaluate("e => { e.value = 1; e.dispatchEvent(new Event('input')); }")
    last, end = pixels(page), poses(page)
    assert np.abs(last - first).max(axis=2).mean() > 1.0
    assert np.abs(end - start).max() > 0.1
    assert page.locator("#clock").text_content() == "2.00 / 2.00 s"


def test_shown_poses_are_those_of_the_trajectory(visit, exported, shelf, motion):
    page = visit(exported + "#t=0.637&paused")
    data = shelf.robot.model.createData()
    for shown, trajectory in zip(poses(page), (motion(shelf), motion(shelf, 2.0)), strict=True):
        pin.forwardKinematics(shelf.robot.model, data, trajectory(np.array([0.637]))[0])
        for j, found in enumerate(shown, 1):
            expected = data.oMi[j]
            assert np.allclose(found[:3], expected.translation, atol=1e-4)
            assert np.linalg.norm(pin.log3(pin.Quaternion(*found[[6, 3, 4, 5]]).matrix().T @ expected.rotation)) < 1e-3


def test_plays_pauses_and_obeys_keys(visit, exported):
    page = visit(exported)
    until(page, "optiplan.state.time > 0.2")
    page.keyboard.press("Space")
    assert not page.evaluate("optiplan.state.playing")
    before = page.evaluate("optiplan.state.time")
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("optiplan.state.time") == pytest.approx(max(0.0, before - 0.02))
    page.keyboard.press("Home")
    moved = poses(page)
    page.keyboard.press("ArrowDown")
    assert page.evaluate("optiplan.state.speed") == 0.5
    page.locator("#play").click()
    until(page, "optiplan.state.time > 0.1")
    assert np.abs(poses(page) - moved).max() > 1e-6


def test_motion_loops_only_when_asked(visit, exported):
    page = visit(exported + "#t=1.99")
    page.locator("#loop").uncheck()
    page.evaluate("optiplan.play()")
    until(page, "!optiplan.state.playing")
    assert page.evaluate("optiplan.state.time") == 2.0
    page.locator("#loop").check()
    page.evaluate("optiplan.seek(1.99); optiplan.state.playing = true")
    until(page, "optiplan.state.time < 1.9")


def test_layers_change_the_picture(visit, exported):
    page = visit(exported + "#t=0.8")
    before = pixels(page)
    for name in ("collision", "through", "obstacles", "path", "start", "goal", "ellipsoids", "witness", "floor"):
        page.locator(f"#layer-{name}").click()
        after = pixels(page)
        assert np.abs(after - before).max() > 5.0, name
        before = after


def test_ellipsoids_are_off_unless_asked_for_and_move_with_the_tool(visit, exported, shelf, motion):
    plain = visit(exported + "#t=0.8&paused")
    assert not plain.locator("#layer-ellipsoids").is_checked()
    page = visit(exported + "#t=0.8&paused&ellipsoids")
    assert page.locator("#layer-ellipsoids").is_checked()
    pair = "optiplan.scene.runs[0].ellipsoids.moving"
    model, data = shelf.robot.model, shelf.robot.model.createData()
    pin.framesForwardKinematics(model, data, motion(shelf)(np.array([0.8]))[0])
    tool = data.oMf[model.getFrameId(shelf.robot.tool_frame)].translation
    places = page.evaluate(f"{pair}.map((m) => m.position.toArray())")
    assert np.allclose(places, [tool, tool], atol=1e-5)
    velocity, force = np.array(page.evaluate(f"{pair}.map((m) => m.scale.toArray())"))
    assert np.allclose(velocity * force, velocity[0] * force[0], rtol=1e-4)  # reciprocal, apart from their two scales
    assert velocity[0] > velocity[2]
    page.locator(".run input").first.uncheck()
    assert not page.evaluate("optiplan.scene.runs[0].ellipsoids.group.visible")


def test_legend_tells_the_verdicts_and_escapes_names(visit, exported):
    page = visit(exported + "#t=0")
    assert page.locator(".badge").all_text_contents() == ["verified", "not verified"]
    assert page.locator("#card summary").text_content() == 'a <b>shelf</b> & "more"'
    assert page.locator(".problem").count() == 1


@pytest.fixture(scope="module")
def overlay(shelf, motion, tmp_path_factory) -> str:
    """Address of a comparison: two runs along one path, one along another, one that failed."""
    path = tmp_path_factory.mktemp("page") / "overlay.html"
    away = dataclasses.replace(shelf, goal=(JointGoal(shelf.start + 0.4),))
    failure = {"kind": "no-path", "detail": "there is none", "witness": {"q": shelf.goal[0].q.tolist(), "points": []}}
    runs = [
        ViewedRun("stuck", None, None, failure),
        ViewedRun("quick", motion(shelf, 1.0), {"verified": True}),
        ViewedRun("slow", motion(shelf, 1.5), {"verified": False, "checks": []}),
        ViewedRun("around", motion(away, 2.0), {"verified": True}),
    ]
    export_page(shelf, runs, path)
    return path.as_uri()


def shown(page, what: str) -> list[bool]:
    return page.evaluate(f"optiplan.scene.runs.map((run) => Boolean({what}))")


def test_overlay_names_planners_with_colours_and_durations(visit, overlay):
    page = visit(overlay + "#t=0.5&paused")
    assert page.locator(".run .name").all_text_contents() == ["stuck", "quick", "slow", "around"]
    assert page.locator(".run .time").all_text_contents() == ["1.00 s", "1.50 s", "2.00 s"]
    assert page.locator(".badge").all_text_contents() == ["no plan", "verified", "not verified", "verified"]
    colours = page.evaluate("optiplan.scene.runs.slice(1).map((run) => run.path.material.color.getHexString())")
    assert len(set(colours)) == 3
    assert shown(page, "run.path && run.path.visible") == [False, True, True, True]
    assert shown(page, "run.figure.bodies[1].visible") == [False, True, False, False]
    assert shown(page, "run.witness.visible") == [False, True, True, True]


def test_overlay_runs_are_chosen_one_by_one(visit, overlay):
    page = visit(overlay + "#t=0.5&paused")
    before = pixels(page)
    page.locator(".run").nth(3).locator(".robot input").check()
    assert shown(page, "run.figure.bodies[1].visible") == [False, True, False, True]
    both = pixels(page)
    assert np.abs(both - before).max() > 5.0
    page.locator(".run").nth(1).locator("input").first.uncheck()
    assert shown(page, "run.path && run.path.visible") == [False, False, True, True]
    assert shown(page, "run.figure.bodies[1].visible") == [False, False, False, True]
    assert np.abs(pixels(page) - both).max() > 5.0
    page.locator(".run").nth(0).locator("input").first.check()
    assert shown(page, "run.witness.visible") == [True, False, True, True]


def test_coinciding_paths_share_the_tube_in_stripes(visit, overlay):
    page = visit(overlay + "#t=0.5&paused")
    counts = page.evaluate("optiplan.scene.runs.slice(1).map((run) => run.path.geometry.index.count)")
    assert counts[0] + counts[1] == counts[2]
    assert counts[0] == pytest.approx(counts[1], rel=0.1)


def test_colours_of_many_runs_differ(visit, overlay):
    page = visit(overlay + "#t=0.5&paused")
    names = page.evaluate("Array.from({ length: 24 }, (_, k) => OptiPlanPaths.runColour(k))")
    rgb = np.array([[int(name[i : i + 2], 16) for i in (1, 3, 5)] for name in names], dtype=float)
    apart = np.linalg.norm(rgb[:, None] - rgb, axis=2) + 1e3 * np.eye(24)
    assert apart.min() > 24.0


def test_same_address_same_picture(visit, exported):
    first, second = (pixels(visit(exported + "#t=0.6&paused")) for _ in range(2))
    assert np.array_equal(first, second)


def test_served_page_of_a_planar_robot_without_runs(visit, planar):
    problem = Problem(
        name="flat",
        robot=planar,
        scene=Scene(),
        start=np.zeros(2),
        goal=(JointGoal(np.array([1.0, -1.0])),),
        limits=planar.limits,
    )
    with PageServer(render_page(build_scene(problem, [])), port=0) as served:
        threading.Thread(target=served.serve_forever, daemon=True).start()
        page = visit(served.url)
        assert pixels(page).std() > 3.0
        assert page.locator("#play").is_disabled()
        served.shutdown()


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_a_robot_without_bodies_is_drawn_and_told_in_words(visit, bare, motion, tmp_path, size):
    path = tmp_path / "bare.html"
    export_page(bare, [ViewedRun("quintic", motion(bare))], path)
    page = visit(path.as_uri() + "#t=0&paused&ghosts=0")
    page.set_viewport_size({"width": size[0], "height": size[1]})
    note = page.locator("#note")
    assert note.is_visible()
    assert "Robot 'bare' has no bodies" in note.text_content()
    place = note.bounding_box()
    assert place["x"] >= 0
    assert place["x"] + place["width"] <= size[0]
    assert page.locator("#layer-collision").count() == 0
    first = pixels(page)
    page.evaluate("optiplan.seek(1.2)")
    assert np.abs(pixels(page) - first).max() > 50.0


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_what_the_verdict_is_about_is_folded_below_it(visit, shelf, motion, tmp_path, size):
    path = tmp_path / "scope.html"
    scope = ["4 pairs of links not checked: 4 adjacent", "torque: at all times, without friction"]
    export_page(shelf, [ViewedRun("quintic", motion(shelf), {"verified": True, "checks": [], "scope": scope})], path)
    page = visit(path.as_uri() + "#t=0&paused&ghosts=0")
    page.set_viewport_size({"width": size[0], "height": size[1]})
    listed = page.locator("#runs .more li")
    assert listed.all_text_contents() == scope
    assert not listed.first.is_visible()
    page.get_by_text("what the verdict is about").click()
    assert listed.first.is_visible()
    card, line = page.locator("#card").bounding_box(), listed.first.bounding_box()
    assert card["x"] <= line["x"]
    assert line["x"] + line["width"] <= card["x"] + card["width"] <= size[0]


def test_the_note_stays_away_where_there_is_nothing_to_say(visit, exported):
    assert not visit(exported + "#t=0").locator("#note").is_visible()


def test_served_page_plays(visit, shelf, motion):
    with PageServer(render_page(build_scene(shelf, [("quintic", motion(shelf), None)])), port=0) as served:
        threading.Thread(target=served.serve_forever, daemon=True).start()
        page = visit(served.url)
        until(page, "optiplan.state.time > 0.1")
        served.shutdown()


def test_a_thousand_obstacles_are_drawn(visit, shelf, tmp_path):
    places = np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, 10)]), -1).reshape(-1, 3)
    boxes = tuple(Obstacle(f"box{k}", Box((0.05, 0.05, 0.05)), pin.SE3(np.eye(3), p)) for k, p in enumerate(places))
    path = tmp_path / "crowd.html"
    export_page(dataclasses.replace(shelf, scene=Scene(boxes)), [], path)
    assert pixels(visit(path.as_uri())).std() > 10.0
