"""What the studio writes into a text: nothing but what was meant, and nothing while its scene shows another text."""

import json

import pytest

from tests.service.behaviour.test_studio import TASK
from tests.service.browsing import drag, open_studio, text_of, write
from tests.waiting import wait_until

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


def test_a_quaternion_of_few_digits_is_a_rotation(page, server):
    open_studio(page, server)
    page.evaluate("document.getElementById('chosen').open = true")
    for few in ("0.7071", "0.70711"):  # of length below and above 1
        text = EXACT.replace("rpy_deg: [0, 0, 12.345]", f"quaternion: [0, {few}, 0, {few}]")
        write(page, text)
        page.wait_for_function(DRAWN, arg=text)
        page.evaluate(CHOOSE, "can")
        enter(page, 2, 1, "0.3")
        page.wait_for_function(UNTIL, arg="0.3")
        assert text_of(page) == text.replace("0.2, 0.6", "0.3, 0.6")
        page.evaluate(f"optiplanStudio.scene.events.obstacle('can', [-1.30705, 0.4, 0.6, 0, {few}, 0, {few}])")
        page.wait_for_function(UNTIL, arg="0.4, 0.6]")
        assert text_of(page) == text.replace("0.2, 0.6", "0.4, 0.6")


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


AT_ONCE = """poses => { for (const pose of poses) optiplanStudio.scene.events.goal(pose, true); }"""
TYPED_FIRST = """pose => {
  optiplanStudio.editor.view.dispatch({ changes: { from: 0, insert: "# mine\\n" }, userEvent: "input.type" });
  optiplanStudio.scene.events.goal(pose, true);
}"""
DRAWN = "text => optiplanStudio.state.valid === text && optiplanStudio.editor.text() === text"


def test_wishes_wait_for_the_scene_of_what_was_written_before(page, server):
    open_studio(page, server)
    write(page, EXACT)
    page.evaluate("document.getElementById('chosen').open = true")
    page.evaluate(CHOOSE, "can")
    held = []
    page.route("**/api/scene", lambda route: route.continue_() if held is None else held.append(route))
    for row, k, value in ((2, 0, "1.25"), (2, 1, "2.5"), (3, 2, "33.333"), (0, 0, "0.01"), (1, 0, "0.5")):
        enter(page, row, k, value)
    page.wait_for_function("optiplanStudio.state.wishes.length === 4")
    first, held = held, None
    for route in first:
        route.continue_()
    expected = EXACT.replace("-1.30705, 0.2", "1.25, 2.5").replace("12.345", "33.333")
    expected = expected.replace("radius: 0.0124, length: 0.4", "radius: 0.01, length: 0.5")
    page.wait_for_function(DRAWN, arg=expected)
    poses = [[0.5, 0.1 * k, 0.6, 0, 0, 0, 1] for k in range(4)]
    for both in (poses[:2], poses[2:]):  # the first makes a pose of joint values
        page.evaluate(AT_ONCE, both)
        pose = f"pose: {{position: [0.5, {both[1][1]:g}, 0.6]"
        page.wait_for_function(UNTIL, arg=pose)
        page.wait_for_function("optiplanStudio.state.valid === optiplanStudio.editor.text()")
        assert pose in text_of(page)
    page.locator("#fields button", has_text="Duplicate").evaluate("one => { one.click(); one.click(); }")
    page.wait_for_function(UNTIL, arg="name: can_3")
    assert text_of(page).count("name: can_2") == 1

    page.wait_for_function("optiplanStudio.state.valid === optiplanStudio.editor.text()")
    before = text_of(page)
    page.evaluate(TYPED_FIRST, poses[0])
    assert text_of(page) == "# mine\n" + before
    for path in ("scene", "problems/validate"):
        page.wait_for_function("optiplanStudio.state.valid === optiplanStudio.editor.text()")
        page.route(f"**/api/{path}", lambda route: route.fulfill(body="what is this"))
        page.evaluate(AT_ONCE, poses[:2])
        page.wait_for_selector("#issues .none")
        page.evaluate(AT_ONCE, poses[2:])
        after = text_of(page)
        assert "pose: {position: [0.5, 0, 0.6]" in after  # the first that was wished is written, and nothing else
        assert "earlier text" in page.inner_text("#hint")
        page.unroute(f"**/api/{path}")
        page.evaluate("text => optiplanStudio.editor.replace(text)", before)


WAITING = """([shown, wishes, words]) => optiplanStudio.state.valid === shown
  && optiplanStudio.state.wishes.length === wishes && optiplanStudio.editor.text().includes(words)"""
SLIDE = "(one, value) => { one.value = value; one.dispatchEvent(new Event('input')); }"
BACK_AND_DRAGGED = """pose => {
  document.getElementById("undo").click();
  window.before = optiplanStudio.editor.text();
  optiplanStudio.scene.events.goal(pose, true);
}"""


def first(page, held):
    """The request that is held back longest, once there is one."""
    wait_until(lambda: page.wait_for_timeout(20) or held)
    return held.pop(0)


def test_what_waits_is_written_as_it_was_meant(page, server):
    open_studio(page, server)
    write(page, EXACT)
    page.wait_for_function(DRAWN, arg=EXACT)
    page.evaluate("() => { for (const id of ['chosen', 'joints']) document.getElementById(id).open = true; }")
    page.evaluate(CHOOSE, "can")
    held = []
    page.route("**/api/scene", lambda route: held.append(route))

    def draw(words):
        """Let the next scene come; what waited longest is then written."""
        written = text_of(page)
        first(page, held).continue_()
        page.wait_for_function(WAITING, arg=[written, 0, words])

    enter(page, 2, 0, "1.25")
    enter(page, 2, 1, "2.5")
    draw("[1.25, 2.5, 0.6]")
    enter(page, 2, 2, "0.7")  # on a card that does not say 2.5 yet
    draw("[1.25, 2.5, 0.7]")
    slider = page.locator("#sliders input").first
    slider.evaluate(SLIDE, 0.25)
    page.click("#start")
    slider.evaluate(SLIDE, 0.75)
    draw("start: {joints: [0.25, 1.0]}")
    draw("start: {joints: [0.25, 1.0]}")


def test_what_is_dragged_stays_in_the_hand_and_a_text_that_comes_back_is_drawn_first(page, server):
    open_studio(page, server)
    write(page, TASK)
    page.wait_for_function(DRAWN, arg=TASK)
    held = []
    page.route("**/api/scene", lambda route: held.append(route))
    page.evaluate("optiplanStudio.scene.events.obstacle('cube', [0.5, 0.4, 0.021, 0, 0, 0, 1])")
    page.wait_for_function(UNTIL, arg="[0.5, 0.4, 0.021]")

    def come():
        with page.expect_response("**/api/scene"):
            first(page, held).continue_()
        page.wait_for_timeout(300)
        assert page.evaluate("optiplanStudio.state.valid !== optiplanStudio.editor.text()")

    drag(page, page.evaluate("optiplanStudio.scene.goalOnScreen()"), (-30, -10), come)
    page.wait_for_function("words => !optiplanStudio.editor.text().includes(words)", arg="[0.4, 0.1, 0.5]")
    page.unroute("**/api/scene")
    while held:
        held.pop(0).continue_()
    page.wait_for_function("optiplanStudio.state.valid === optiplanStudio.editor.text()")
    moved = text_of(page)
    assert "[0.5, 0.4, 0.021]" in moved
    page.evaluate("text => optiplanStudio.editor.replace(text)", moved.replace("task:\n", "task:\n  - dwell: 1\n"))
    page.wait_for_function("optiplanStudio.state.valid === optiplanStudio.editor.text()")
    page.evaluate(BACK_AND_DRAGGED, [0.3, 0.3, 0.3, 0, 0, 0, 1])
    assert text_of(page) == moved == page.evaluate("before")
    assert "earlier text" in page.inner_text("#hint")
