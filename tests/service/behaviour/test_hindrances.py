"""Pages that are hindered: no WebGL, answers that break off or come late, choices that cannot be compared."""

import json

import pytest

from tests.service.behaviour.test_shell import listed
from tests.service.browsing import open_studio, text_of, write
from tests.small_problems import QUICK

pytestmark = pytest.mark.timeout(300)

BLIND = """const own = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.includes("webgl") ? null : own.call(this, kind, ...more); };"""
BROKEN = """const ask = window.fetch;
const broken = new Set();
window.fetch = async (path, ...more) => {
  const answer = await ask(path, ...more);
  if (broken.has(path) || !/^api[/](runs|scene)/.test(path)) return answer;
  broken.add(path);
  const fail = () => Promise.reject(new TypeError("network error"));
  return new Proxy(answer, { get: (own, key) => (["text", "json"].includes(key) ? fail : Reflect.get(own, key, own)) });
};"""


def paused(route):
    """Begin an execution that stands until it is told to go."""
    if route.request.method == "POST":
        route.continue_(post_data=json.dumps(route.request.post_data_json | {"paused": True}))
    else:
        route.continue_()


def test_without_webgl_a_motion_is_stopped_and_a_text_is_planned(tab, server):
    tab.add_init_script(BLIND)
    run = server.ended(server.submit(seed=81)["id"])["id"]
    tab.route("**/api/executions", paused)
    tab.goto(f"{server.url}/execution#run={run}")
    tab.wait_for_function("window.optiplanExecution && optiplanExecution.ready")
    assert "needs WebGL" in tab.inner_text("#pane")
    assert tab.inner_text("#hint") == ""
    tab.click("#begin")
    tab.wait_for_function("optiplanExecution.live.states > 2")
    tab.click("#stop")
    tab.wait_for_selector("#state:text('ended')")

    open_studio(tab, server)
    write(tab, QUICK)
    assert "needs WebGL" in tab.inner_text("#pane")
    slider = tab.locator("#sliders input").first
    slider.evaluate("one => { one.value = 0.25; one.dispatchEvent(new Event('input')); }")
    tab.click("#start")
    tab.wait_for_function("optiplanStudio.state.problem.start.joints[0] === 0.25")
    tab.click("#plan")
    tab.wait_for_selector("#state.verified")
    tab.goto(f"{server.url}/live")
    tab.wait_for_function("window.optiplanLive && document.getElementById('example').options.length > 3")
    assert tab.is_enabled("#begin")


def test_an_execution_is_drawn_once_its_scene_comes_and_its_slider_stays_in_the_hand(tab, server):
    run, late = server.ended(server.submit(seed=82)["id"])["id"], [503, 503]

    def answer(route):
        if late:
            route.fulfill(status=late.pop(), json={"error": "not now"})
        else:
            route.continue_()

    tab.route("**/api/executions", paused)
    tab.goto(f"{server.url}/execution#run={run}")
    tab.wait_for_function("window.optiplanExecution && optiplanExecution.ready")
    tab.evaluate("optiplanExecution.scene.data.bodies = 99")  # as of another robot
    tab.route("**/api/executions/*/scene", answer)
    tab.click("#begin")
    tab.wait_for_function("optiplanExecution.live.states > 2 && optiplanExecution.scene.data.bodies !== 99")
    assert late == []
    box = tab.locator("#speed").bounding_box()
    tab.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    tab.mouse.down()
    value = tab.input_value("#speed")
    tab.evaluate("optiplanExecution.live.last.override = 0.9")
    sent = "[...Array(3).keys()].map((k) => optiplanExecution.live.events.dispatchEvent(new MessageEvent('state', "
    tab.evaluate(sent + "{ data: JSON.stringify(optiplanExecution.live.last) })))")
    assert (value, tab.input_value("#speed")) == ("50", "50")
    tab.mouse.up()
    tab.evaluate(ABSENT)
    assert tab.evaluate("optiplanExecution.scene.objects.meshes.map((one) => one.visible)") == [False]
    tab.evaluate("optiplanExecution.scene.show(optiplanExecution.scene.data, null)")
    assert tab.evaluate("optiplanExecution.scene.objects") is None

    held = []
    tab.route("**/override", lambda route: route.continue_() if held is None else held.append(route))
    for key, wanted in (("ArrowLeft", "49"), ("ArrowLeft", "48")):  # an answer of before comes between them
        tab.locator("#speed").press(key)
        tab.evaluate(sent + "{ data: JSON.stringify({ ...optiplanExecution.live.last, override: 0.9 }) })))")
        assert tab.input_value("#speed") == wanted
    first, held = held, None
    for route in first:
        route.continue_()
    tab.wait_for_function("!optiplanExecution.live.turned && optiplanExecution.live.last.override === 0.48")
    tab.click("#stop")
    tab.wait_for_selector("#state:text('ended')")

    tab.reload()  # its page is that of one that has ended
    tab.wait_for_function("window.optiplanExecution && optiplanExecution.ready")
    assert tab.evaluate("optiplanExecution.scene.data.runs.length") == 1
    assert "needs WebGL" not in tab.evaluate("OptiPlanShapes.undrawn(new Error('of ours'), 'all else is here')")
    tab.unroute("**/api/executions/*/scene")
    tab.route("**/api/runs/*/scene", lambda route: route.fulfill(status=502, body="a proxy's"))
    tab.select_option("#motion", run)
    tab.wait_for_selector("#hint:text('cannot be drawn: no answer came')")
    late += [503] * 9
    tab.route("**/api/runs/*/scene", answer)
    tab.locator("#motion").dispatch_event("change")
    tab.wait_for_selector("#hint:text('cannot be drawn: not now')")
    assert len(late) == 8


ABSENT = """() => {
  const { scene } = optiplanExecution, stays = [{ begin: 0, body: 0, pose: [0, 0, 0, 0, 0, 0, 1], absent: true }];
  const one = { geometry: 0, colour: [1, 0, 0, 1], name: "tool", owner: "tool", stays };
  scene.motion({ ...scene.data.runs[0], objects: [one] });
  scene.at(0.1);
}"""


def test_an_answer_that_breaks_off_is_asked_for_again(tab, server):
    tab.add_init_script(BROKEN)
    tab.goto(server.url)
    tab.wait_for_selector("#runs .run, #runs .panel")
    open_studio(tab, server)


def test_what_cannot_be_compared_says_why(tab, server):
    def answer(route):
        def fulfill(json):
            for k, run in enumerate(json["runs"]):
                run["problem"] = str(k % 2) * 64
            route.fulfill(json=json)

        asked = type("Asked", (), {"request": route.request, "fulfill": staticmethod(fulfill)})
        listed([])(asked)

    tab.route("**/api/runs/*", lambda route: route.fulfill(status=204))
    tab.route("**/api/runs?*", answer)
    tab.goto(server.url)
    tab.wait_for_selector(".run:has-text('run79 ·')")
    tab.locator(".run:has-text('run79 ·') input").check()
    for k, words in ((78, "of different problems"), (77, "of different problems")):
        tab.locator(f".run:has-text('run{k} ·') input").check()
        assert words in tab.inner_text("#why")
        assert tab.is_disabled("#compare")
    tab.locator(".run:has-text('run78 ·') input").uncheck()
    for k in range(75, 61, -2):
        assert tab.is_enabled("#compare")
        tab.locator(f".run:has-text('run{k} ·') input").check()
    assert tab.inner_text("#why").startswith("9 are chosen; at most 8")
    assert tab.is_disabled("#compare")


ENDLESS = """\
version: 1
name: endless
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: {shoulder: -0.5, elbow: 1.2}}
via: [{joints: [0.1, 0.1]}, {joints_deg: [1, 2]}]
"""


def test_joints_reach_where_they_stand_and_what_is_not_played_is_said(tab, server):
    open_studio(tab, server)
    tab.evaluate("document.getElementById('joints').open = true")

    def endless(route):
        answer = route.fetch()
        data = answer.json()
        assert [one["unit"] for one in data["joints"]] == ["rad", "rad"]
        data["joints"][0] |= {"lower": None, "upper": None}
        data["start"][0] = 4.0
        route.fulfill(response=answer, json=data)

    tab.route("**/api/scene", endless)
    write(tab, ENDLESS)
    slider = tab.locator("#sliders label").first
    assert float(slider.locator("input").input_value()) == pytest.approx(4.0)
    assert slider.inner_text().endswith("4.000 rad")
    tab.click("#play")
    tab.wait_for_selector("#hint:text('2 of 3 points')")


SOON = "const own = setTimeout; window.setTimeout = (act, ms, ...more) => own(act, ms === 2000 ? 50 : ms, ...more);"


@pytest.mark.parametrize("answers", [[429, 503], [503] * 9, [502] * 9])
def test_a_scene_that_is_not_drawn_is_asked_for_a_few_times_and_written_into_never(tab, server, answers):
    tab.add_init_script(SOON)
    open_studio(tab, server)
    left = list(answers)

    def answer(route):
        if left:
            status = left.pop(0)
            route.fulfill(status=status, **({"body": "a proxy's"} if status == 502 else {"json": {"error": "not now"}}))
        else:
            route.continue_()

    tab.route("**/api/scene", answer)
    tab.evaluate(
        """text => { const { editor, scene } = optiplanStudio, hint = document.getElementById("hint"); window.told = [];
      new MutationObserver(() => {
        told.push(hint.textContent);
        if (hint.textContent.includes("not drawn anew: not now")) scene.events.goal([0, 0, 0, 0, 0, 0, 1], true);
      }).observe(hint, { childList: true });
      editor.replace(text); }""",
        QUICK,
    )
    if len(answers) < 3:
        tab.wait_for_function("optiplanStudio.state.problem.name === 'free'")
        assert left == []
    else:
        tab.wait_for_function("Math.max(optiplanStudio.state.tries, optiplanStudio.state.unheard) > 3")
        tab.wait_for_timeout(2500 if answers[0] == 502 else 500)  # a server's health is asked for once a second
        assert len(left) == 9 - 4
    if answers[0] == 502:
        assert "not answer" in tab.inner_text("#issues")
        tab.evaluate("optiplanStudio.scene.events.goal([0, 0, 0, 0, 0, 0, 1], true)")
    if len(answers) > 2:
        assert "earlier text" in tab.inner_text("#hint")
    assert answers[0] == 502 or any("not drawn anew: not now" in words for words in tab.evaluate("told"))
    assert any("earlier text" in words for words in tab.evaluate("told"))
    assert text_of(tab) == QUICK


HIDDEN = """async () => {
  const wait = (ms) => new Promise((done) => setTimeout(done, ms)), counts = [];
  const seen = (value) => Object.defineProperty(document, "visibilityState", { value, configurable: true });
  for (const runs of [false, true]) {
    let count = 0;
    seen("hidden");
    const look = Page.watching(async () => { count++; return runs && count < 3; }, 10, 20);
    await look();
    await wait(300);
    counts.push(count);
    seen("visible");
    dispatchEvent(new Event("visibilitychange"));
    await wait(300);
    counts.push(count > counts.at(-1));
  }
  return counts;
}"""


def test_a_page_that_nobody_sees_looks_only_while_something_runs(tab, server):
    tab.goto(f"{server.url}/benches")
    assert tab.evaluate(HIDDEN) == [1, True, 3, True]
