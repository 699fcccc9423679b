"""What somebody does who sees the pages for the first time, by mouse alone."""

from pathlib import Path

import pytest

from optiplan.config.document import parse_yaml
from optiplan.problem.load import problem_from_dict
from tests.service.browsing import CHANGED, drag, open_studio, text_of

pytestmark = pytest.mark.timeout(300)
SCENE = "optiplanStudio.scene"
CYLINDER = f"{SCENE}.obstacles.children.find((one) => one.name === 'cylinder_1')"
IN_THE_WAY = "0.5, 0.0"  # before the divider, between the bays
PLANNED = """before => ["verified", "refused", "failed"].includes(document.getElementById("state").textContent)
  && !document.getElementById("link").hidden && document.getElementById("link").href !== before"""


@pytest.mark.parametrize("page", [(1280, 800)], indirect=True, ids=["wide"])
def test_from_the_shelf_to_a_film_by_mouse_alone(page, server):
    open_studio(page, server)
    assert page.evaluate("optiplanStudio.state.problem.name") == "shelf"  # the example that the studio opens with
    goal_into_another_bay(page)
    page.wait_for_function(f"{SCENE}.ghosts.children.length > 1")
    page.locator("#branches button:not(.bad)").first.click()  # a way to reach it
    page.click("#take")
    page.wait_for_function("(optiplanStudio.state.problem.goal || {}).joints")
    cylinder_into_the_way(page)
    text = text_of(page)
    assert "cylinder_1" in text
    assert problem_from_dict(parse_yaml(text, Path("shelf.yaml")).data).scene.obstacles[-1].name == "cylinder_1"
    runs = [planned_by(page, name) for name in ("trajopt", "rrtconnect")]
    compared(page, server, runs)
    page.goto(f"{server.url}/runs/{runs[0]}")
    page.wait_for_selector("html[data-ready='1']")
    page.evaluate("undrawn = false")
    with page.expect_download(timeout=120_000) as film:
        page.click("#film")
    assert film.value.suggested_filename.endswith(".webm")
    recorded = Path(film.value.path()).read_bytes()
    assert recorded.startswith(b"\x1aE\xdf\xa3")  # as every WebM
    assert len(recorded) > 5000
    with page.expect_download() as table:
        page.click("#more a:text('CSV')")
    assert len(Path(table.value.path()).read_text().splitlines()) > 20


def goal_into_another_bay(page):
    """By the arrow that points down, from the upper left one into the lower left one."""
    before = page.evaluate("optiplanStudio.state.problem.goal.pose")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    tip, below = (page.evaluate(f"{SCENE}.goalOnScreen({x}, 0, 0)") for x in (0.17, 0.52))
    drag(page, tip, (below[0] - tip[0], below[1] - tip[1]))
    page.wait_for_function(CHANGED, arg=before)
    position = page.evaluate("optiplanStudio.state.problem.goal.pose.position")
    assert position == pytest.approx([0.62, 0.2, 0.27], abs=0.03)


def cylinder_into_the_way(page):
    page.select_option("#add", "cylinder")
    page.wait_for_function(CYLINDER)
    height = page.evaluate(f"{CYLINDER}.position.z")
    at = page.evaluate(f"{SCENE}.onScreen({CYLINDER})")
    there = page.evaluate(f"{SCENE}.onScreen({SCENE}.root, {IN_THE_WAY}, {height})")
    drag(page, at, (there[0] - at[0], there[1] - at[1]))
    page.wait_for_function(f"Math.hypot({CYLINDER}.position.x - 0.5, {CYLINDER}.position.y) < 0.03")
    page.wait_for_selector("#issues .fine")


def planned_by(page, planner):
    """Plan with it; return the id of the verified run."""
    before = page.evaluate("document.getElementById('link').href")
    page.select_option("#planner", planner)
    page.click("#plan")
    page.wait_for_function(PLANNED, arg=before)
    assert page.inner_text("#state") == "verified", page.inner_text("#watch")
    run = page.get_attribute("#link", "href").removeprefix("runs/")
    page.click("#back")
    return run


def compared(page, server, runs):
    page.click("nav a:text('Runs')")
    for run in runs:
        page.locator(".run", has=page.locator(f"a[href='runs/{run}']")).locator("input").check()
    page.click("#compare")
    page.wait_for_selector("html[data-ready='1']")
    assert page.locator("#runs > .run:not(.head) .name").all_text_contents()[0] == "trajopt"
    page.go_back()
