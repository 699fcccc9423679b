"""What the studio writes into a text: nothing but what was meant, and nothing while its scene shows another text."""

import json

import pytest

from tests.service.browsing import drag, open_studio, text_of, write
from tests.service.conftest import QUICK

pytestmark = [
    pytest.mark.timeout(300),
    pytest.mark.parametrize("page", [(1280, 800)], indirect=True, ids=["wide"]),
]

EXACT = """\
version: 1
name: exact
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: [-0.5, 1.2]}
scene:
  obstacles:
    - name: can
      shape: {cylinder: {radius: 0.0124, length: 0.4}}
      pose: {position: [-1.30705, 0.2, 0.6], rpy_deg: [0, 0, 12.345]}
"""
CHOOSE = "name => optiplanStudio.scene.events.selected(name)"
UNTIL = "words => optiplanStudio.editor.text().includes(words)"


def enter(page, row: int, k: int, value: str) -> None:
    """Type a number into a field of the card of what is chosen."""
    field = page.locator("#fields .row").nth(row).locator("input").nth(k)
    field.fill(value)
    field.press("Enter")


def test_what_is_not_touched_stays_to_the_last_digit_and_what_is_typed_is_written(page, server):
    open_studio(page, server)
    write(page, EXACT)
    page.evaluate("document.getElementById('chosen').open = true")
    page.evaluate(CHOOSE, "can")
    expected = EXACT
    for row, k, value, before, after in (
        (1, 0, "0.5", "length: 0.4", "length: 0.5"),
        (0, 0, "0.01234", "radius: 0.0124", "radius: 0.01234"),
        (2, 2, "0.6123", "0.2, 0.6]", "0.2, 0.6123]"),
        (3, 2, "33.333", "[0, 0, 12.345]", "[0, 0, 33.333]"),
    ):
        enter(page, row, k, value)
        expected = expected.replace(before, after)
        page.wait_for_function("text => optiplanStudio.editor.text() === text", arg=expected)
        page.wait_for_function("text => optiplanStudio.state.valid === text", arg=expected)
    shape = json.dumps({"cylinder": {"radius": 0.01234, "length": 0.61239}})
    page.evaluate(f"optiplanStudio.scene.events.resized('can', {shape}, {AT}, true)")
    expected = expected.replace("length: 0.5", "length: 0.612")
    assert text_of(page) == expected
    page.wait_for_function("text => optiplanStudio.state.valid === text", arg=expected)
    page.locator("#fields button", has_text="Duplicate").click()
    page.wait_for_function(UNTIL, arg="name: can_2")
    assert "position: [-1.30705, 0.3, 0.6123]" in text_of(page)


AT = "[-1.30705, 0.2, 0.6123, 0, 0, Math.sin(33.333 * Math.PI / 360), Math.cos(33.333 * Math.PI / 360)]"
TOUCHED = """() => {
  const { events } = optiplanStudio.scene, pose = [0, 0, 0, 0, 0, 0, 1];
  events.branch(1);
  events.selected("top");
  events.goal(null, false, 1);
  events.goal(pose, true);
  events.obstacle("can", pose);
}"""
WRONG = EXACT.replace("name: exact", "name: other").replace("robot: planar2r", "robot: nobody")
CONTROLS = ("start", "goal", "record", "play", "add", "surface")


def test_a_text_that_is_not_drawn_is_not_written_into(page, server):
    open_studio(page, server)
    goal = page.evaluate("optiplanStudio.scene.goalOnScreen()")
    drag(page, goal, (-30, -10))
    page.wait_for_selector("#branches button:nth-child(2)")
    page.evaluate("text => { optiplanStudio.state.examples.wrong = text; }", WRONG)
    page.evaluate("() => document.getElementById('example').append(new Option('wrong', 'wrong'))")
    page.select_option("#example", "wrong")
    page.wait_for_selector("#issues button")
    assert page.locator("#branches button").count() == 0  # those were ways of another robot
    assert page.locator("#sliders input").count() == 0
    assert [page.is_disabled(f"#{one}") for one in CONTROLS] == [True] * len(CONTROLS)
    page.evaluate(TOUCHED)
    assert text_of(page) == WRONG
    assert "earlier text" in page.inner_text("#hint")
    page.evaluate("text => optiplanStudio.editor.replace(text)", EXACT)
    page.wait_for_function("optiplanStudio.state.problem && optiplanStudio.state.problem.name === 'exact'")
    assert [page.is_enabled(f"#{one}") for one in CONTROLS] == [True] * len(CONTROLS)


def test_ways_of_before_are_gone_when_the_robot_is_put_elsewhere(page, server):
    open_studio(page, server)
    drag(page, page.evaluate("optiplanStudio.scene.goalOnScreen()"), (-30, -10))
    page.wait_for_selector("#branches button:nth-child(2)")
    page.wait_for_selector("#issues .fine")
    page.locator("#branches button").nth(1).click()
    page.click("#start")
    page.wait_for_function("!optiplanStudio.state.branches.length")
    assert page.locator("#branches button").count() == 0
    assert page.is_hidden("#take")


def test_a_scene_that_the_server_refuses_is_said_to_be_old(page, server):
    open_studio(page, server)
    answers = [422, 200]

    def answer(route):
        if answers.pop(0) == 200:
            route.continue_()
        else:  # not 429: a console names it an error
            route.fulfill(status=203, json={"error": "not now"})

    page.route("**/api/scene", answer)
    page.evaluate("text => optiplanStudio.editor.replace(text)", QUICK)
    page.wait_for_selector("#hint:text('not drawn anew: not now')")
    page.evaluate("optiplanStudio.scene.events.goal([0, 0, 0, 0, 0, 0, 1], true)")
    assert text_of(page) == QUICK
    page.evaluate("text => optiplanStudio.editor.replace(text)", QUICK + "# more\n")
    page.wait_for_function("optiplanStudio.state.problem.name === 'free'")
    page.unroute_all()
