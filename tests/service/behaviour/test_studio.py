"""The studio in a real browser: the text, the scene and the history of both."""

import json
from importlib import resources
from pathlib import Path

import pytest

from optiplan.robot.robot import load_robot
from tests.service.browsing import CHANGED, drag, open_studio, text_of, write
from tests.small_problems import NO_WAY, QUICK

pytestmark = pytest.mark.timeout(300)
wide = pytest.mark.parametrize("page", [(1280, 800)], indirect=True, ids=["wide"])

PAGES = resources.files("optiplan.service.pages")
EDITS = Path(__file__).parent / "edits.js"
SCRIPTS = (PAGES / "codemirror" / "codemirror.min.js", PAGES / "problem_text.js", EDITS)


@pytest.fixture
def bare(browser):
    """A page of the scripts that edit texts, without a server."""
    page = browser.new_page()
    for script in SCRIPTS:
        page.add_script_tag(content=script.read_text("utf-8"))
    yield page
    page.close()


def test_an_edit_changes_what_it_names_and_nothing_else(bare, problems):
    count = 0
    for path in sorted(problems.glob("*.yaml")):
        found = bare.evaluate("text => everyEdit(text)", path.read_text("utf-8"))
        assert found["wrong"] == [], path.name
        count += found["count"]
    assert count > 8000


@pytest.mark.parametrize(
    ("text", "path", "value", "after"),
    [
        ("a: 1\n", '["goal"]', "{pose: undefined, joints: [1]}", "a: 1\ngoal: {joints: [1]}\n"),
        ("goal:\na: 1\n", '["goal"]', "{pose: undefined, joints: [1]}", "goal: {joints: [1]}\na: 1\n"),
        ("goal:\n", '["goal", "joints"]', "[1]", "goal: {joints: [1]}\n"),
        ("task: [{line: 1}]\n", '["task", 4, "line"]', "2", "task: [{line: 1}]\n"),
        ("via: [null, 1]\n", '["via", 0]', "{a: 1}", "via: [{a: 1}, 1]\n"),
    ],
    ids=["no key", "nothing behind it", "nothing to go into", "beyond the list", "null in a list"],
)
def test_an_edit_of_what_is_not_there(bare, text, path, value, after):
    edits = f"ProblemText.set({json.dumps(text)}, {path}, {value})"
    assert bare.evaluate(f"ProblemText.applied({json.dumps(text)}, {edits})") == after


def test_an_entry_is_added_behind_a_key_without_a_list(bare):
    after = bare.evaluate("ProblemText.applied('via:\\n', ProblemText.add('via:\\n', ['via'], { a: 1 }))")
    assert after == "via: [{a: 1}]\n"


@wide
def test_typing_and_dragging_share_one_history(page, server):
    open_studio(page, server)
    first = text_of(page)
    before = page.evaluate("optiplanStudio.state.problem.goal.pose")
    page.click("#text .cm-content")
    page.keyboard.press("Control+A")
    page.keyboard.insert_text(first.replace("name: shelf", "name: pasted"))
    page.wait_for_function("optiplanStudio.state.problem.name === 'pasted'")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    drag(page, page.evaluate("optiplanStudio.scene.goalOnScreen()"), (-40, -20))
    page.wait_for_function(CHANGED, arg=before)
    after = text_of(page)
    assert "rpy: [0, 1.5708, 0]}    # m, and rad" in after  # its notation and its comment stay
    assert after.count("\n") == first.count("\n")
    page.locator("#text .cm-content").focus()
    page.keyboard.press("Control+Z")
    assert text_of(page) == first.replace("name: shelf", "name: pasted")
    page.keyboard.press("Control+Z")
    assert text_of(page) == first
    page.keyboard.press("Control+Y")
    page.keyboard.press("Control+Y")
    assert text_of(page) == after


@wide
def test_a_thousand_random_edits_are_undone_byte_for_byte(page, server):
    open_studio(page, server)
    page.evaluate(EDITS.read_text("utf-8") + "window.randomEdits = randomEdits; null")
    found = page.evaluate("seed => randomEdits(seed)", page.viewport_size["width"])
    assert found["undone"] == found["first"]
    assert found["steps"] > 100
    assert found["written"] > 100


PLAN_TWICE = """text => {
  optiplanStudio.editor.replace(text);
  for (const click of [1, 2]) document.getElementById("plan").click();
}"""


@wide
def test_what_is_planned_before_its_text_was_checked_stays(page, server):
    open_studio(page, server)
    write(page, QUICK)
    page.fill("#budget", "60")
    page.evaluate(PLAN_TWICE, NO_WAY + "seed: 4711\n")
    page.wait_for_function("optiplanStudio.state.problem.name === 'shut-in'")  # by now it was
    page.wait_for_selector("#state.running")
    page.click("#cancel")  # both of them
    page.wait_for_selector("#state.cancelled")
    page.evaluate("optiplanStudio.editor.replace(optiplanStudio.editor.text() + 'unknown: 1\\n')")
    page.wait_for_selector("#issues button")
    assert page.is_hidden("#watch")  # what was planned is not about this text


def test_the_end_of_a_run_is_shown_though_its_stream_is_gone(tab, server):
    open_studio(tab, server)
    write(tab, QUICK + "seed: 4712\n")
    tab.route("**/api/runs/*/events", lambda route: route.fulfill(status=502, body="Bad Gateway"))  # as of a proxy
    tab.click("#plan")
    tab.wait_for_selector("#state.verified")


@wide
def test_a_drag_in_a_task_moves_the_pose_of_its_step(page, server, problems):
    open_studio(page, server)
    text = (problems / "40_panda_sorts_cubes.yaml").read_text()
    write(page, text)
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    handles = page.evaluate("optiplanStudio.state.handles.map((one) => one.label)")
    chosen = handles.index("red_2 to the red ones")
    page.select_option("#steps", str(chosen))
    drag(page, page.evaluate("optiplanStudio.scene.goalOnScreen()"), (14, -10))
    page.wait_for_function("before => optiplanStudio.editor.text() !== before", arg=text)
    after = text_of(page)
    changed = [
        (old, new) for old, new in zip(text.split("\n"), after.split("\n"), strict=True) if old != new
    ]  # as many lines as before, one of them another
    assert len(changed) == 1
    assert "red_2 to the red ones" in changed[0][0]
    assert "rpy: [3.14159265, 0, 0]" in changed[0][1]
    page.wait_for_selector("#issues .fine")
    assert page.is_enabled("#plan")


GOALS = """\
version: 1
name: goals
robot: panda
start: {configuration: ready}
goal: {pose: {frame: panda_link7, position: [0.4, 0.1, 0.6], rpy: [3, 0, 0]}}
"""
TASK = """\
version: 1
name: steps
robot: panda
start: {configuration: ready}
scene:
  obstacles:
    - {name: cube, shape: {box: [0.04, 0.04, 0.04]}, pose: {position: [0.5, 0, 0.021]}}
task:
  - {name: over, move: {pose: {position: [0.4, 0.1, 0.5], rpy: [3, 0, 0]}}}
  - pick: {object: cube, mass: 0.1}
  - {name: aside, line: {pose: {position: [0.5, 0.2, 0.4], rpy: [3, 0, 0]}}}
"""


@wide
def test_what_the_scene_writes_goes_where_it_belongs(page, server, problems):
    """One page for several texts: each takes a second to open."""
    open_studio(page, server)
    edits = "([path, before, after]) => PoseText.edits(optiplanStudio.editor.text(), path, before, after)"

    write(page, TASK)  # a pick is four steps of the problem
    handles = page.evaluate("optiplanStudio.state.handles")
    assert [one["path"] for one in handles] == [["task", 0, "move", "pose"], ["task", 2, "line", "pose"]]
    assert page.evaluate("optiplanStudio.scene.obstacles.children.map((one) => one.name)") == ["cube"]
    moved = [0.5, 0.25, *handles[1]["pose"][2:]]
    (edit,) = page.evaluate(edits, [handles[1]["path"], handles[1]["pose"], moved])
    assert TASK[: edit["from"]].endswith("{name: aside, line: {pose: {position: [0.5, ")
    assert page.is_hidden("#goal")
    page.evaluate("optiplanStudio.scene.events.goal(null, false, 1)")
    page.wait_for_function("optiplanStudio.state.branches.length")
    page.locator("#branches button").first.click()
    assert page.is_hidden("#take")  # a line leads to a pose only
    page.evaluate("optiplanStudio.scene.events.goal(null, false, 0)")
    page.wait_for_function("optiplanStudio.state.branches.length")
    page.locator("#branches button").first.click()
    page.click("#take")
    page.wait_for_function("optiplanStudio.editor.text().includes('{name: over, move: {joints: [')")
    page.wait_for_selector("#issues .fine")

    text = (problems / "56_conveyor_pick.yaml").read_text()
    write(page, text)  # its one pose is that of a place
    assert page.evaluate("optiplanStudio.state.handles") == []
    assert page.evaluate(edits, [["task", 4, "approach", "pose"], moved, handles[0]["pose"]]) == []

    write(page, GOALS)  # its ways are those of its frame
    (handle,) = page.evaluate("optiplanStudio.state.handles")
    page.evaluate("pose => optiplanStudio.scene.events.goal(pose, false)", handle["pose"])
    page.wait_for_function("optiplanStudio.state.branches.length")
    q = page.evaluate("optiplanStudio.state.branches[0].q")
    assert load_robot("panda").fk(q, "panda_link7").position == pytest.approx(handle["pose"][:3], abs=1e-6)

    for end in (
        "configuration: ready",
        "joints_deg: [0, -45, 0, -135, 0, 90, 45]",
        "region: {position: [0.4, 0, 0.5], along: {x: [-0.1, 0.1]}}",
    ):
        write(page, GOALS[: GOALS.index("goal:")] + f"goal: {{{end}}}\n")
        page.wait_for_function("key => key in optiplanStudio.state.problem.goal", arg=end.split(":")[0])
        assert len(page.evaluate("optiplanStudio.state.handles")) == (not end.startswith("region"))
        page.evaluate("pose => optiplanStudio.scene.events.goal(pose, true)", handle["pose"])
        page.wait_for_function("Object.keys(optiplanStudio.state.problem.goal).join() === 'pose'")
        page.click("#undo")
        page.wait_for_function("optiplanStudio.state.valid === optiplanStudio.editor.text()")
        page.click("#goal")
        page.wait_for_function("Object.keys(optiplanStudio.state.problem.goal).join() === 'joints'")


DRAWN_AGAIN = """() => {
  const { scene, state } = optiplanStudio, { memory } = scene.viewer.renderer.info;
  return [1, 2, 3].map(() => {
    scene.show(state.drawn.scene, null);
    scene.handles([[0, 0, 0, 0, 0, 0, 1]], 1);
    scene.viewer.render();
    return memory.geometries;
  });
}"""


@wide
def test_a_scene_that_is_drawn_again_takes_no_more_memory(page, server):
    open_studio(page, server)
    first, *later = page.evaluate(DRAWN_AGAIN)
    assert later == [first, first]


TYPED = """words => optiplanStudio.editor.view.dispatch(
  { changes: { from: 0, insert: words + "\\n" }, userEvent: "input.type" })"""


@wide
def test_drafts_survive_a_reload_and_another_example(page, server):
    open_studio(page, server)
    page.evaluate(TYPED, "# mine")
    mine = text_of(page)
    page.reload()
    page.wait_for_function("window.optiplanStudio && optiplanStudio.editor.text().startsWith('# mine')")
    assert "draft" in page.inner_text("#notice")
    page.select_option("#example", "01_reach")
    page.wait_for_function("optiplanStudio.editor.text().includes('name: reach')")
    page.click("#notice button")
    assert text_of(page) == mine
    page.select_option("#example", "09_ur5")
    page.wait_for_function("optiplanStudio.state.problem && optiplanStudio.state.problem.name === 'ur5-column'")
    page.reload()  # an example as it is, is no draft
    page.wait_for_selector("#issues .fine")
    assert page.is_hidden("#notice")


@wide
def test_drafts_of_several_problems_are_kept(page, server):
    open_studio(page, server)
    page.evaluate(TYPED, "# first")
    stored = server.http.post("/api/problems", json={"problem": QUICK}).json()["hash"]
    page.goto(f"{server.url}/benches")
    page.goto(f"{server.url}/studio#{stored}")
    page.wait_for_selector("#issues .fine")
    assert text_of(page) == QUICK
    page.evaluate(TYPED, "# second")
    page.goto(f"{server.url}/benches")
    page.goto(f"{server.url}/studio")
    page.wait_for_function("window.optiplanStudio && optiplanStudio.editor.text().startsWith('# second')")
    page.locator("#notice button", has_text="Open that").click()
    assert text_of(page).startswith("# first")
    page.wait_for_selector("#issues .fine")


@wide
def test_each_tab_has_a_draft_of_its_own(page, server):
    """A tab that a page opens begins with a copy of its session, as one that the user doubles."""
    begins = "words => window.optiplanStudio && optiplanStudio.editor.text().startsWith(words)"
    open_studio(page, server)
    page.evaluate(TYPED, "# mine")
    with page.expect_popup() as opened:
        page.evaluate("() => { open(location.href); }")
    other = opened.value
    other.wait_for_function(begins, arg="# mine")
    for tab, words in ((page, "# one"), (other, "# two")):
        tab.evaluate(TYPED, words)
    for tab, words in ((other, "# two"), (page, "# one")):
        tab.reload()
        tab.wait_for_function(begins, arg=words)
    other.evaluate("sessionStorage.clear()")
    other.reload()
    other.wait_for_function(begins, arg="# one")  # the newest draft
    other.locator("#notice button", has_text="Begin anew").click()
    page.reload()
    page.wait_for_function(begins, arg="# one")


FULL = """() => {
  Storage.prototype.setItem = () => { throw new Error("full"); };
  optiplanStudio.editor.replace("name: 3");
  document.getElementById("theme").click();
}"""


@wide
def test_a_browser_that_keeps_nothing_still_checks(page, server):
    open_studio(page, server)
    theme = page.evaluate("document.documentElement.dataset.theme")
    page.evaluate(FULL)
    page.wait_for_selector("#issues button")
    assert page.is_disabled("#plan")
    assert page.evaluate("document.documentElement.dataset.theme") != theme


@wide
def test_obstacles_are_added_sized_doubled_and_taken_away(page, server):
    open_studio(page, server)
    first = text_of(page)
    page.select_option("#add", "cylinder")
    page.wait_for_function("optiplanStudio.state.problem.scene.obstacles.some((one) => one.name === 'cylinder_1')")
    page.evaluate("document.getElementById('chosen').open = true")
    radius = page.locator("#fields input").first
    radius.fill("0.08")
    radius.press("Enter")
    page.wait_for_function("optiplanStudio.editor.text().includes('radius: 0.08')")
    shape = "optiplanStudio.state.problem.scene.obstacles.at(-1).shape.cylinder"
    page.wait_for_function(f"{shape}.radius === 0.08")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    knob = page.evaluate("optiplanStudio.scene.onScreen(optiplanStudio.scene.knobs.children[0])")  # its upper end
    drag(page, knob, (0, -25))
    page.wait_for_function(f"{shape}.length > 0.41")
    turned = page.locator("#fields .row").nth(3).locator("input").nth(0)
    turned.fill("90")
    turned.press("Enter")
    page.wait_for_function("optiplanStudio.editor.text().includes('rpy: [1.5707963, 0, 0]')")
    page.locator("#fields button", has_text="Duplicate").click()
    page.wait_for_function("optiplanStudio.state.chosen === 'cylinder_1_2'")
    page.wait_for_function("optiplanStudio.state.problem.scene.obstacles.length === 9")
    page.locator("#fields button", has_text="Delete").click()
    page.wait_for_function("optiplanStudio.state.problem.scene.obstacles.length === 8")
    for _ in range(6):
        page.click("#undo")
    assert text_of(page) == first


@wide
def test_a_branch_is_chosen_and_becomes_the_goal(page, server):
    open_studio(page, server)
    before = page.evaluate("optiplanStudio.state.problem.goal.pose")
    drag(page, page.evaluate("optiplanStudio.scene.goalOnScreen()"), (-30, -10))
    page.wait_for_function(CHANGED, arg=before)
    page.wait_for_function("optiplanStudio.scene.ghosts.children.length > 1")
    many = page.evaluate("optiplanStudio.state.branches.length")
    assert f"{many} ways" in page.inner_text("#hint")
    page.locator("#branches button").nth(1).click()
    q = page.evaluate("optiplanStudio.state.branches[1].q")
    page.click("#take")
    page.wait_for_function("(optiplanStudio.state.problem.goal || {}).joints")
    assert page.evaluate("optiplanStudio.state.problem.goal.joints") == pytest.approx(q, abs=1e-6)
    assert "  joints: [" in text_of(page)


@wide
def test_points_are_recorded_and_played_back(page, server, problems):
    open_studio(page, server)
    write(page, (problems / "01_reach.yaml").read_text())
    page.evaluate("document.getElementById('joints').open = true")
    for value in (0.2, 0.5):
        slider = page.locator("#sliders input").first
        slider.evaluate(f"one => {{ one.value = {value}; one.dispatchEvent(new Event('input')); }}")
        page.click("#record")
        page.wait_for_function(f"optiplanStudio.state.problem.via.some((one) => one.joints[0] === {value})")
    assert text_of(page).count("  - {joints: [") == 2
    page.click("#play")
    page.wait_for_function("optiplanStudio.state.q[0] > 0.45")


@wide
def test_a_surface_becomes_the_goal(page, server):
    open_studio(page, server)
    before = page.evaluate("optiplanStudio.state.problem.goal.pose")
    page.click("#surface")
    top = "optiplanStudio.scene.obstacles.children.find((one) => one.name === 'top')"
    page.mouse.click(*page.evaluate(f"optiplanStudio.scene.onScreen({top}, 0, 0, 0.01)"))
    page.wait_for_function(CHANGED, arg=before)
    pose = page.evaluate("optiplanStudio.state.problem.goal.pose")
    assert pose["position"][2] == pytest.approx(0.82, abs=2e-3)  # 1 cm above the shelf


@wide
def test_the_schema_completes_and_explains(page, server):
    open_studio(page, server)
    write(
        page,
        "version: 1\nname: words\nrobot: panda\nstart: {configuration: ready}\ngoal: {configuration: ready}\n",
    )
    page.click("#text .cm-content")
    page.keyboard.press("Control+End")
    page.keyboard.type("sce", delay=20)
    page.wait_for_selector(".cm-tooltip-autocomplete li:has-text('scene')")
    page.keyboard.press("Control+Space")
    words = json.dumps(page.evaluate("SchemaWords.parents('scene:\\n  obstacles:\\n    - {name: a, }', 41, 41, false)"))
    assert words == '["scene", "obstacles", 0]'
