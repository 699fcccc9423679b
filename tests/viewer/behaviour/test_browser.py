"""The page in a real browser: it must draw, play, scrub, and never complain."""

import dataclasses
import threading

import numpy as np
import pinocchio as pin
import pytest

from optiplan.geometry.scene import Box, Obstacle, Scene
from optiplan.problem.problem import JointGoal, derived
from optiplan.trajectory.segments import Segment
from optiplan.viewer.page import export_page, render_page
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene
from optiplan.viewer.server import PageServer
from tests.unchecked_problem import unchecked_problem
from tests.viewer.browsing import pixels, poses, until

pytestmark = [pytest.mark.timeout(240)]


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


def test_exported_file_draws_and_scrubs(visit, exported):
    page = visit(exported + "#t=0")
    first, start = pixels(page), poses(page)
    assert first.std() > 10.0  # not blank
    assert page.locator("#clock").text_content() == "0.00 / 2.00 s"
    page.locator("#scrub").evaluate("e => { e.value = 1; e.dispatchEvent(new Event('input')); }")
    last, end = pixels(page), poses(page)
    assert np.abs(last - first).max(axis=2).mean() > 0.3
    assert np.abs(end - start).max() > 0.1
    assert page.locator("#clock").text_content() == "2.00 / 2.00 s"
    assert page.evaluate("OptiPlanFacts.quality(1.003)") == "within 0.5 % of the least possible time for this end"


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
    page.set_viewport_size({"width": 1000, "height": 700})
    before = pixels(page)
    names = (
        "collision",
        "through",
        "obstacles",
        "path",
        "start",
        "goal",
        "ellipsoids",
        "rod",
        "trail",
        "frames",
        "floor",
    )
    for name in names:
        page.locator(f"#layer-{name}").click()
        seen = (pixels(page) for _ in range(10))  # a busy browser may show an older picture
        after = next((picture for picture in seen if np.abs(picture - before).max() > 5.0), None)
        assert after is not None, name
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
    page.locator(".run .tick input").first.uncheck()
    page.mouse.move(300, 150)  # a run that is pointed at is shown
    assert not page.evaluate("optiplan.scene.runs[0].ellipsoids.group.visible")


def test_the_page_tells_the_verdicts_and_escapes_names(visit, exported):
    page = visit(exported + "#t=0")
    assert page.locator("#head .badge").text_content() == "1 of 2 verified"
    assert page.locator("#selected .badge").text_content() == "verified"
    assert page.locator("h1").text_content() == 'a <b>shelf</b> & "more"'
    page.locator(".run .name", has_text="bad").click()
    assert page.locator("#selected .badge").text_content() == "not verified"
    assert page.locator(".problem").count() == 1


@pytest.fixture(scope="module")
def overlay(shelf, motion, tmp_path_factory) -> str:
    """Address of a comparison: two runs along one path, one along another, one that failed."""
    path = tmp_path_factory.mktemp("page") / "overlay.html"
    away = derived(shelf, goal=(JointGoal(shelf.start + 0.4),))
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
    moving = "#runs > .run:not(.head)"
    assert page.locator(f"{moving} .name").all_text_contents() == ["quick", "around", "slow"]
    assert page.locator(f"{moving} .time").all_text_contents() == ["1.000 s", "2.000 s", "1.500 s"]
    assert page.locator(f"{moving} .badge").all_text_contents() == ["not verified"]
    assert page.locator(".still-run b").all_text_contents() == ["stuck"]
    assert len(set(page.evaluate("optiplan.scene.runs.map((run) => run.colour)"))) == 4
    assert shown(page, "run.path && run.path.visible") == [False, True, False, True]  # one that is refused is not
    assert shown(page, "run.figure.bodies[1].visible") == [False, True, False, False]
    page.locator(moving).nth(1).locator(".tick input").nth(1).check()
    page.mouse.move(300, 150)
    assert shown(page, "run.figure.bodies[1].visible") == [False, True, False, True]
    page.locator(moving).nth(0).locator(".tick input").first.uncheck()
    page.mouse.move(300, 150)
    assert shown(page, "run.path && run.path.visible") == [False, False, False, True]
    assert shown(page, "run.figure.bodies[1].visible") == [False, False, False, True]


def test_coinciding_paths_share_the_tube_in_stripes(visit, overlay):
    page = visit(overlay + "#t=0.5&paused")
    counts = page.evaluate("optiplan.scene.runs.slice(1).map((run) => run.path.children[0].geometry.index.count)")
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
    problem = unchecked_problem(
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


def test_what_the_verdict_is_about_is_folded_below_it(visit, shelf, motion, tmp_path):
    path = tmp_path / "scope.html"
    scope = ["4 pairs of links not checked: 4 adjacent", "torque: at all times, without friction"]
    report = {"verified": True, "checks": [], "scope": scope, "link_geometry": {"panda_hand": "hull"}}
    export_page(shelf, [ViewedRun("quintic", motion(shelf), report)], path)
    page = visit(path.as_uri() + "#t=0&paused&ghosts=0")
    listed = page.locator("#checked > .more > ul li")
    assert listed.all_text_contents() == scope
    assert not listed.first.is_visible()
    page.get_by_text("what the verdict is about").click()
    assert listed.first.is_visible()
    page.get_by_text("geometry used, 1 links").click()
    assert page.get_by_text("panda_hand: hull").is_visible()
    page.get_by_text("pairs not checked, and why").click()
    assert page.get_by_text("proved never to meet").is_visible()


def test_stops_of_a_task_are_listed_with_their_reasons_between_its_steps(visit, shelf, motion, tmp_path):
    path = tmp_path / "task.html"
    segments = (
        Segment(1, "move", "there", 0.0, 0.5),
        Segment(1, "move", "there", 0.5, 1.0),
        Segment(2, "attach", "attach cup", 1.0, 1.0),
        Segment(3, "move", "back", 1.0, 2.0),
    )
    stops = [{"t": 0.5, "after": 1, "why": "a corner"}, {"t": 1.0, "after": 1, "why": "attach <cup>"}]
    report = {"verified": True, "checks": []}
    record = {"info": {"stops": stops}}
    task = dataclasses.replace(motion(shelf, 2.0), segments=segments)
    export_page(shelf, [ViewedRun("task", task, report, None, record)], path)
    page = visit(path.as_uri() + "#t=0&paused&ghosts=0")
    rows = page.locator("#steps .step-row").all_text_contents()
    assert page.locator("#steps summary").text_content() == "3 steps, 2 stops on the way"
    expected = ["1 · there0.00 s", "stops: a corner0.50 s", "stops: attach <cup>1.00 s", "2 · attach cup1.00 s"]
    assert rows == [*expected, "3 · back1.00 s"]
    page.get_by_text("stops: a corner").click()
    assert page.locator("#clock").text_content() == "0.50 / 2.00 s"


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
    export_page(derived(shelf, scene=Scene(boxes)), [], path)
    assert pixels(visit(path.as_uri())).std() > 10.0
