"""The run page as an instrument: one time for scene, curves, clearance, verdict and slider; failures; comparisons."""

import time

import numpy as np
import pytest

import optiplan as op
from optiplan.viewer.page import export_page
from optiplan.viewer.runs import ViewedRun
from tests.axe import serious
from tests.viewer.browsing import overlaps, pixels, poses, until

pytestmark = [pytest.mark.timeout(240)]
SIZES = [(1280, 800), (390, 844)]


def viewed(run: op.Run, label: str = "") -> ViewedRun:
    record = run.to_dict()
    return ViewedRun(label or run.planner, run.trajectory, record["report"], record["failure"], record)


@pytest.fixture(scope="module")
def shelf_problem() -> op.Problem:
    return op.load_problem("02_shelf")


@pytest.fixture(scope="module")
def proof(shelf_problem) -> op.Run:
    return op.plan(shelf_problem, "prm")


@pytest.fixture(scope="module")
def refused(shelf_problem) -> op.Run:
    return op.plan(shelf_problem, "quintic")


@pytest.fixture(scope="module")
def proof_page(proof, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("pages") / "proof.html"
    export_page(proof.problem, [viewed(proof)], path, back=("report.html#a", "the report"))
    return path.as_uri()


@pytest.fixture(scope="module")
def failure_page(refused, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("pages") / "failure.html"
    export_page(refused.problem, [viewed(refused)], path)
    return path.as_uri()


@pytest.fixture(scope="module")
def comparison_page(proof, refused, tmp_path_factory) -> str:
    """Six runs: the same path at other speeds, two of them refused; one planner without a motion."""
    path = tmp_path_factory.mktemp("pages") / "comparison.html"
    runs = [viewed(proof, "as planned"), viewed(refused)]
    for k, factor in enumerate((2.0, 1.5, 0.9)):
        motion = proof.trajectory.scaled(proof.trajectory.duration * factor)
        runs.append(
            ViewedRun(f"scaled, {k}", motion, op.verify(proof.problem, motion).to_dict(), None, proof.to_dict())
        )
    runs.append(ViewedRun("circle", None, None, {"kind": "input", "detail": "centre: nothing; expected centre"}))
    export_page(proof.problem, runs, path)
    return path.as_uri()


UNLIMITED = """() => {
  for (const { decoded } of optiplan.app.data.runs.filter((run) => run.decoded))
    for (const one of decoded.quantities.find(({ name }) => name === "jerk").series) one.low = one.high = null;
  optiplan.app.dock.choose("jerk");
}"""


def time_of(page) -> float:
    return page.evaluate("optiplan.clock.time")


def lines(page) -> list[float]:
    """The instants at which the cursors of all curves stand, s."""
    return page.evaluate("""() => optiplan.app.dock.plots.map((plot) => plot.plot.posToVal(
      plot.line.getBoundingClientRect().left - plot.plot.over.getBoundingClientRect().left, "x"))""")


def settled(page, selector: str) -> dict[str, float]:
    """Where something is once the page has found its layout: there, and the same twice, a few frames apart."""
    before = last = None
    while last is None or last != before:
        before, last = last, page.locator(selector).bounding_box()
        page.wait_for_timeout(150)
    return last


def drag(page, selector: str, share: float) -> None:
    box = settled(page, selector)
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"], steps=3)
    page.mouse.up()


def test_one_cursor_for_scene_curves_clearance_verdict_and_slider(visit, proof_page, proof):
    page = visit(proof_page + "#t=0.1&paused")
    page.set_viewport_size({"width": 1280, "height": 800})
    before, duration = poses(page), proof.trajectory.duration
    for _ in range(3):  # dragging in the curves seeks: scene, slider and both cursors move together
        drag(page, ".own .u-over", 0.5)
        if time_of(page) > 0.1:  # else the page was drawn anew under the mouse
            break
    assert time_of(page) == pytest.approx(0.5 * duration, rel=0.02)
    assert lines(page) == pytest.approx([time_of(page)] * 2, abs=0.01)
    assert float(page.locator("#scrub").input_value()) == pytest.approx(time_of(page) / duration, abs=1e-3)
    assert np.abs(poses(page) - before).max() > 0.05
    page.locator(".near .mark").click()  # the least clearance
    least = page.evaluate("optiplan.app.data.runs[0].clearance.least")
    assert time_of(page) == pytest.approx(least["t"])
    assert page.evaluate("optiplan.scene.rod.moment.distance") == pytest.approx(least["distance"], abs=1e-6)
    ends = page.evaluate("optiplan.scene.rod.ends.map((ball) => ball.position.toArray())")
    assert np.allclose(ends, least["points"], atol=1e-4)
    assert " – ".join(least["pair"]) in page.locator(".near .said").text_content()
    checks = {check.name: check for check in proof.report.checks}
    for name in ("velocity", "jerk", "collision"):  # rows jump, to the curve that shows them
        page.locator(f".check:has(.what:text-is('{name}'))").click()
        assert time_of(page) == pytest.approx(checks[name].time)
        chosen = page.locator(".tabs [aria-selected='true']").text_content()
        assert chosen == ("clearance" if name == "collision" else name)
    proved = checks["collision"].witness
    scene, itself = (f"{1e3 * proved[f'{kind}_clearance']:.3g}" for kind in ("scene", "self"))
    shown = f"scene {scene}, itself {itself} mm proved"
    assert shown in page.locator(".check", has_text="collision").locator(".figures").text_content()
    assert page.locator("#ticks .at").count() == sum(check.time is not None for check in proof.report.checks)
    page.locator(".tabs [data-name='torque']").click()
    page.locator(".own .key button").nth(2).hover()  # a joint, singled out, lights what it moves
    assert page.locator(".own .key [aria-pressed='true']").count() == 1
    lit = "optiplan.scene.runs[0].figure.bodies.map((b) => b.children.some((m) => (m.userData.look || {}).lit))"
    assert [k for k, on in enumerate(page.evaluate(lit)) if on] == [3]
    assert page.locator("#head a").get_attribute("href") == "report.html#a"


def test_habits_of_keys_address_theme_and_picture(visit, proof_page):
    page = visit(proof_page + "#t=0.2&paused&cam=-1,-2,1.5,0.3,0,0.4&tab=jerk&layers=obstacles,path,trail")
    assert page.evaluate("optiplan.scene.camera") == pytest.approx([-1, -2, 1.5, 0.3, 0, 0.4], abs=1e-6)
    assert page.locator(".tabs [aria-selected='true']").text_content() == "jerk"
    assert page.locator("#layers input:checked").count() == 3
    page.evaluate("location.hash = 't=0.7&paused&speed=0.5'")  # an address typed into an open page is obeyed
    until(page, "optiplan.clock.time === 0.7 && optiplan.clock.speed === 0.5")
    page.locator("#scrub").click()
    page.keyboard.press("Space")  # after scrubbing
    assert page.evaluate("optiplan.clock.playing")
    page.keyboard.press("Space")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.locator("#layer-floor").click()
    until(page, "location.hash.includes('layers=') && location.hash.includes('t=' + +optiplan.clock.time.toFixed(4))")
    light = pixels(page)
    page.locator("#theme").click()
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(230, 234, 237)"
    assert light.mean() - pixels(page).mean() > 60.0
    size = page.evaluate("optiplan.picture().then((blob) => createImageBitmap(blob)).then((p) => [p.width, p.height])")
    pane = page.locator("#pane").bounding_box()
    assert size == pytest.approx([2 * pane["width"], 2 * pane["height"]], abs=2.0)


def test_a_refused_motion_is_played_up_to_the_contact_and_seen(visit, failure_page, refused):
    page = visit(failure_page)
    witness = refused.failure.witness
    until(page, f"optiplan.clock.time > 0.9 * {witness['t']}")
    page.evaluate("optiplan.clock.loop = false")
    until(page, "!optiplan.clock.playing")
    assert time_of(page) == pytest.approx(witness["t"], abs=1e-3)  # not beyond
    assert page.locator("#ticks .band").count() >= 1
    until(page, "document.querySelectorAll('.label.bad:not([hidden])').length >= 3")
    labels = page.locator(".label.bad:visible").all_text_contents()
    assert f"panda_hand – board: overlap {-1e3 * witness['distance']:.2f} mm" in labels
    assert {"panda_hand", "board"} <= set(labels)
    red = "optiplan.scene.owned({!r}).every((m) => m.material.color.getHexString() === 'd3261f' || m.userData.look.red)"
    assert page.evaluate(red.format("board"))
    assert page.evaluate(red.format("panda_hand"))
    hidden = """() => { const { scene } = optiplan, failure = scene.failures[0];
      return OptiPlanCamera.hidden(scene.viewer.camera.position, failure.point, scene.solid.filter(
        (mesh) => !failure.bodies.includes(mesh) && !(mesh.userData.look || {}).through), 0.01).length; }"""
    assert page.evaluate(hidden) == 0  # no obstacle stands before the contact that is not see-through
    drawn = pixels(page)
    assert ((drawn[..., 0] > 150) & (drawn[..., 1] < 90) & (drawn[..., 2] < 90)).mean() > 0.01
    page.locator(".check.failed").click()
    assert time_of(page) == pytest.approx(witness["t"])
    for width, height in SIZES:
        assert overlaps(page, width, height) == []


def test_a_comparison_is_a_table_and_single_runs_can_be_pointed_at(visit, comparison_page):
    page = visit(comparison_page + "#t=0.3&paused")
    page.set_viewport_size({"width": 1280, "height": 800})
    names = page.locator("#runs > .run:not(.head) .name").all_text_contents()
    assert names == ["as planned", "scaled, 1", "scaled, 0", "scaled, 2"]  # verified by duration, then what was refused
    assert page.locator("#runs .more summary").text_content() == "2 without a motion"
    assert page.locator(".compare thead th").count() == 12
    assert page.locator(".compare tbody tr").count() == 4
    shown = "optiplan.scene.runs.map((run) => Boolean(run.path && run.path.visible))"
    assert page.evaluate(shown) == [True, False, True, True, False, False]
    page.locator("#runs > .run").nth(2).hover()
    assert page.evaluate(shown) == [False, False, False, True, False, False]
    page.mouse.move(700, 200)
    page.locator(".tabs [data-name='velocity']").click()
    assert page.locator(".own .key button").count() == 3
    colours = page.evaluate("optiplan.scene.runs.map((run) => run.colour)")
    assert len(set(colours)) == 6
    page.evaluate(UNLIMITED)
    assert page.locator(".own .head").text_content().startswith("jerk, largest of the joints")
    assert page.evaluate("optiplan.app.dock.plot.series.every((one) => Math.max(...one.y) > 1.0 && one.high === null)")
    page.locator("#runs .more summary").click()
    page.locator(".still-run", has_text="quintic").click()  # a refused motion is looked at alone
    assert page.evaluate(shown) == [False, True, False, False, False, False]
    assert page.locator("#key").text_content().startswith("quintic: collision")
    page.evaluate("location.hash = 'runs=scaled%2C%201,scaled%2C%202&run=scaled%2C%201&tab=table'")
    until(page, "optiplan.app.selected === 3")
    assert page.evaluate(shown) == [False, False, False, True, True, False]
    for width, height in SIZES:
        assert overlaps(page, width, height) == []


def test_nothing_overlaps_targets_are_large_enough_and_axe_finds_nothing_serious(visit, proof_page):
    page = visit(proof_page + "#t=0.3&paused&tab=velocity")
    for width, height in [(768, 700), *SIZES]:
        assert overlaps(page, width, height) == []
        if width == 768:  # that of the run beside the text of the studio
            assert page.evaluate("document.querySelector('.tabs').clientWidth") > 300
    small = """() => [...document.querySelectorAll("button, select, summary, #layers label")].filter((e) =>
      e.offsetParent && e.getBoundingClientRect().height < 39.5).map((e) => e.outerHTML.slice(0, 80))"""
    assert page.evaluate(small) == []
    badge = page.locator("#verdict .badge").bounding_box()
    for name in ("Curves", "Layers", "Verdict"):
        page.locator("#panels button", has_text=name).click()
        assert overlaps(page, 390, 844) == []
        assert page.locator("#verdict .badge").bounding_box() == badge  # always there
    page.set_viewport_size({"width": 1280, "height": 800})
    assert serious(page) == []
    page.locator("#theme").click()
    assert serious(page) == []


def test_facts_can_be_read_and_curves_used_without_webgl(browser, proof_page, proof):
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.add_init_script("""const own = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
        return kind.includes("webgl") ? null : own.call(this, kind, ...more); };""")
    page, thrown = context.new_page(), []
    page.on("pageerror", lambda error: thrown.append(str(error)))
    page.goto(proof_page + "#t=0.1&paused")
    page.wait_for_selector("html[data-ready='1']")
    assert "needs WebGL" in page.locator("#trouble").text_content()
    assert page.locator("#verdict .badge").text_content() == "verified"
    assert page.locator(".check").count() == len(proof.report.checks)
    drag(page, ".own .u-over", 0.5)
    assert time_of(page) == pytest.approx(0.5 * proof.trajectory.duration, rel=0.02)
    context.close()
    assert thrown == []


def test_curves_are_zoomed_and_a_range_is_played_again_and_again(visit, proof_page):
    page = visit(proof_page)
    page.set_viewport_size({"width": 1280, "height": 800})
    page.evaluate("optiplan.pause()")
    over = page.locator(".own .u-over")
    box = settled(page, ".own .u-over")
    middle = (box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.move(*middle)
    page.mouse.wheel(0, -300)  # of the screen's pixels, of which one is two of the page's
    until(page, "optiplan.clock.range !== null")
    low, high = page.evaluate("optiplan.clock.range")
    duration = page.evaluate("optiplan.duration")
    assert 0.3 * duration < high - low < 0.5 * duration
    assert low + high == pytest.approx(duration, rel=0.05)
    for plot in page.evaluate("optiplan.app.dock.plots.map((one) => [one.plot.scales.x.min, one.plot.scales.x.max])"):
        assert plot == pytest.approx([low, high])
    page.click(".dockbar .range")
    assert page.evaluate("optiplan.clock.range") is None
    page.keyboard.down("Shift")
    page.mouse.move(box["x"] + 0.2 * box["width"], middle[1])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], middle[1], steps=4)
    page.mouse.up()
    page.keyboard.up("Shift")
    assert page.evaluate("optiplan.clock.range") == pytest.approx([0.2 * duration, 0.6 * duration], rel=0.02)
    page.evaluate("optiplan.seek(0.59 * optiplan.duration); optiplan.play()")
    until(page, "optiplan.state.time < 0.3 * optiplan.duration")  # from its begin again
    page.evaluate("optiplan.pause()")
    over.dblclick()
    until(page, "optiplan.clock.range === null")


def test_a_table_tells_differences_to_the_selected_run(visit, comparison_page):
    page = visit(comparison_page)
    page.evaluate("optiplan.app.select(0)")
    told = page.locator(".compare tbody tr", has_text="scaled, 0").locator("td.number").nth(1).text_content()
    assert told.endswith("+100 %")
    page.evaluate("optiplan.app.select(2)")
    told = page.locator(".compare tbody tr", has_text="as planned").locator("td.number").nth(1).text_content()
    assert told.endswith("−50 %")


def test_distances_of_the_scene_alone_and_signals_made_of_curves(visit, proof_page):
    page = visit(proof_page + "#t=0.3&paused")
    page.set_viewport_size({"width": 1280, "height": 800})
    offered = page.locator("#distance-of option").all_text_contents()
    assert offered[:3] == ["of all", "robot – scene", "robot – itself"]
    nearest = "optiplan.scene.rod.moment"
    least = page.evaluate(nearest)["distance"]
    found = []
    for name in ("robot – scene", "robot – itself", offered[-1]):
        page.select_option("#distance-of", name)
        moment = page.evaluate(nearest)  # the rod goes along
        assert moment["pair"] == [name]
        assert page.locator(".near .head b").text_content() == f"clearance, {name}"
        found.append(moment["distance"])
        assert moment["distance"] == pytest.approx(np.linalg.norm(np.subtract(*moment["points"])), abs=1e-4)
    assert min(found[:2]) == pytest.approx(least, abs=1e-5)
    assert found[0] != pytest.approx(found[1], abs=1e-3)
    page.locator(".derive summary").click()
    page.get_by_label("curve", exact=True).select_option("velocity: joint2")
    page.get_by_role("button", name="Add", exact=True).click()
    assert page.locator(".tabs [aria-selected='true']").text_content() == "derived"
    rate, own = page.evaluate("""() => { const { quantities } = OptiPlanDock.decoded(optiplan.app.data.runs[0]);
      const at = (name, k) => quantities.find((one) => one.name === name).series[k], some = [0.13, 0.29, 0.41, 0.6];
      return [at("derived", 0), at("acceleration", 1)].map((one) =>
        some.map((x) => OptiPlanCurves.valueAt(one, x))); }""")
    assert rate == pytest.approx(own, rel=0.02, abs=0.1)
    address = page.evaluate("location.href")
    page.locator(".derive summary").click()
    page.get_by_role("button", name="× rate").click()
    assert page.locator(".tabs [data-name='derived']").count() == 0
    again = visit(address)
    assert again.locator(".tabs [aria-selected='true']").text_content() == "derived"
    assert again.input_value("#distance-of") == offered[-1]


def test_bodies_are_hidden_and_their_names_pinned(visit, proof_page):
    page = visit(proof_page + "#t=0.3&paused&cam=2.2,-1.6,1.4,0.4,0,0.4")
    page.set_viewport_size({"width": 1280, "height": 800})
    settled(page, "#pane")
    place = page.evaluate("""() => { for (let x = 200; x < 900; x += 10) for (let y = 100; y < 400; y += 10) {
      const name = optiplan.scene.bodyAt(x, y); if (name && name.startsWith("panda_link")) return [x, y, name]; } }""")
    box, (x, y, name) = page.locator("#pane").bounding_box(), place
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.get_by_role("button", name="Pin name").click()
    page.locator(".label.pin", has_text=name).wait_for()
    before = page.locator(".label.pin").bounding_box()
    page.evaluate("optiplan.seek(optiplan.duration)")
    end = time.monotonic() + 60.0
    while page.locator(".label.pin").bounding_box() == before:  # it goes along
        assert time.monotonic() < end
        page.wait_for_timeout(50)
    page.evaluate("optiplan.seek(0.3)")
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.get_by_role("button", name="Hide").click()
    assert name in page.locator("#hidden button").text_content()
    assert page.evaluate(f"optiplan.scene.bodyAt({x}, {y})") != name
    assert f"hide={name}" in page.evaluate("location.hash")
    again = visit(page.evaluate("location.href"))
    assert again.evaluate("[...optiplan.app.picked.hidden]") == [name]
    page.get_by_role("button", name=f"{name} ×").click()
    assert page.evaluate(f"optiplan.scene.bodyAt({x}, {y})") == name
    assert page.locator("#hidden").is_hidden()


def test_each_run_of_a_comparison_has_a_small_picture_with_the_same_axes(visit, comparison_page):
    page = visit(comparison_page + "#t=0.3&paused&tab=clearance")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.get_by_role("button", name="a picture a run").click()
    shown = "optiplan.app.dock.plots.map((one) => [one.spec.title, one.plot.scales.x.max, ...one.spec.axis])"
    (first, *_), *_ = plots = page.evaluate(shown)
    assert (first, len(plots)) == ("as planned", 3)
    assert len({tuple(one[1:]) for one in plots}) == 1
    page.locator(".tabs [data-name='velocity']").click()
    assert len({tuple(one[1:]) for one in page.evaluate(shown)}) == 1
    assert page.evaluate("optiplan.app.dock.plots.map((one) => one.series.length)") == [7, 7, 7]
    for width, height in SIZES:
        assert overlaps(page, width, height) == []
