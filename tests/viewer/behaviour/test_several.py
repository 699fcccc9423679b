"""Several runs on one page: what plays, ticks, copies of obstacles, failures and names follow those that are shown."""

import numpy as np
import pytest

from optiplan.geometry.scene import Box, HalfSpace, Obstacle, Scene, Sphere
from optiplan.problem.problem import JointGoal
from optiplan.viewer.page import export_page
from optiplan.viewer.runs import ViewedRun
from tests.unchecked_problem import unchecked_problem
from tests.viewer.browsing import until
from tests.viewer.conftest import at

pytestmark = [pytest.mark.timeout(240)]


@pytest.fixture(scope="module")
def problem(panda):
    """A ball that moves beside a Panda, a board that stands, and a floor."""
    ball = Obstacle("ball", Sphere(0.08), at(0.4, -0.4, 0.9)).moving([[0.0, 0.2], [0.0], [0.0]], 1.2)
    return unchecked_problem(
        name="several",
        robot=panda,
        scene=Scene(
            (
                ball,
                Obstacle("board", Box((0.4, 0.9, 0.02)), at(0.75, 0.0, 0.3)),
                Obstacle("floor", HalfSpace((0.0, 0.0, 1.0), 0.0), at(0.0, 0.0, -0.1)),
            )
        ),
        start=panda.configurations["ready"],
        goal=(JointGoal(panda.configurations["ready"] + np.array([0.6, 0.2, 0.0, 0.3, 0.0, 0.0, 0.0])),),
        limits=panda.limits,
    )


@pytest.fixture(scope="module")
def three(problem, motion, tmp_path_factory) -> str:
    """A run of 2 s, one of 10 s, and one of 3 s in which the hand touches the board."""
    checks = [{"name": "velocity", "passed": True, "worst": 0.5, "time": 1.0}]
    witness = {"q": problem.start.tolist(), "points": [[0.6, 0.0, 0.3]] * 2, "pair": ["panda_hand", "board"]}
    bad = {"verified": False, "checks": [{"name": "collision", "passed": False, "worst": -1e-3, "witness": witness}]}
    runs = [
        ViewedRun("quick", motion(problem, 2.0), {"verified": True, "checks": checks}),
        ViewedRun("slow", motion(problem, 10.0), {"verified": True, "checks": checks}),
        ViewedRun("bad", motion(problem, 3.0), bad),
    ]
    path = tmp_path_factory.mktemp("several") / "page.html"
    export_page(problem, runs, path)
    return path.as_uri()


SHOW = "(shown) => { optiplan.app.shown = shown; optiplan.app.update(); }"
VISIBLE = "optiplan.scene.runs.map((run) => run.figure.bodies[1].visible)"
TICK = """() => {
  const [tick, all] = [".at", "#ticks"].map((one) => document.querySelector(one).getBoundingClientRect());
  return (0.5 * (tick.left + tick.right) - all.left - 8) / (all.width - 16);
}"""
COPIES = """() => {
  const { scene } = optiplan, named = (group) => group.children.find((mesh) => mesh.name === "ball").position.toArray();
  return [named(scene.layers.obstacle), ...scene.scenery.children.map(named)];
}"""
FAILED = """() => {
  const { scene } = optiplan, failure = scene.failures.find((one) => one.wanted), { position } = failure.run.figure;
  scene.draw(true);
  const wanted = scene.world([0.6 + position.x, position.y, 0.3 + position.z]).toArray();
  return [failure.point.toArray(), failure.labels[0].point.toArray(), wanted, position.length()];
}"""
BOARDS = """() => {
  const { scene } = optiplan, board = (group) => group.children.find((mesh) => mesh.name === "board");
  const all = [scene.layers.obstacle, ...scene.scenery.children].map(board);
  const look = (key) => all.map((one) => Boolean((one.userData.look || {})[key]));
  const failure = scene.failures.find((one) => one.wanted);
  const label = failure && failure.labels.find((one) => one.element.textContent === "board");
  const hidden = all.map((one) => one.layers.mask !== 1);
  return { red: look("red"), through: look("through"), hidden, label: label && all.indexOf(label.body) };
}"""
PINNED = """(k) => {
  optiplan.app.select(k);
  optiplan.scene.draw(true);
  return optiplan.app.picked.pins.get("panda_hand").point.toArray();
}"""


def test_what_plays_and_stands_along_the_time_is_what_is_shown(visit, three):
    page = visit(three + "#t=0&paused&run=quick")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.evaluate(SHOW, [True, True, True])
    assert page.evaluate(TICK) == pytest.approx(0.1, abs=0.02)
    page.evaluate(SHOW, [True, False, False])
    assert page.evaluate(TICK) == pytest.approx(0.5, abs=0.02)

    page.evaluate("optiplan.app.arrange('turn')")
    page.evaluate(SHOW, [True, False, True])
    for label in ("bad", "quick"):
        assert page.evaluate("optiplan.clock.following()")
        names = page.evaluate(f"optiplan.app.data.runs.map((run) => run.label).filter((_, k) => {VISIBLE}[k])")
        assert names == [label]
    page.evaluate("optiplan.app.select(1)")  # what is chosen is seen, ticked or not
    assert page.evaluate(VISIBLE) == [False, True, False]
    page.evaluate(SHOW, [False, False, False])
    assert page.evaluate("optiplan.clock.following()") is False
    assert page.evaluate("optiplan.app.selected") == 1


def test_runs_side_by_side_have_their_obstacles_failures_and_names(visit, three):
    page = visit(three + "#t=0&paused&arrange=beside&runs=quick,slow,bad&run=quick")
    for t in (0.0, 1.0):
        page.evaluate("t => optiplan.seek(t)", t)
        own, *copies = page.evaluate(COPIES)
        assert own == pytest.approx([0.4 + 0.2 * t, -0.4, 0.9])
        assert copies == [own, own]
    for on in (False, True):
        page.evaluate("on => optiplan.app.layers.set('obstacles', on)", on)
        assert page.evaluate("optiplan.scene.scenery.visible") is on
    page.evaluate("optiplan.app.picked.pin('panda_hand', true)")
    first, second = (page.evaluate(PINNED, k) for k in (0, 1))
    assert np.linalg.norm(np.subtract(first, second)) > 0.5
    page.evaluate("optiplan.app.select(2)")
    point, label, wanted, by = page.evaluate(FAILED)
    assert by > 0.5
    assert point == pytest.approx(wanted)
    assert label == pytest.approx(wanted)
    boards = page.evaluate(BOARDS)
    assert (boards["red"], boards["label"]) == ([False, False, True], 2)
    page.evaluate("optiplan.app.picked.hide('board', true)")
    assert page.evaluate(BOARDS)["hidden"] == [True] * 3
    page.evaluate("optiplan.app.layers.set('through', true)")
    assert page.evaluate(BOARDS)["through"] == [True] * 3
    for mode, red in (("together", [True]), ("beside", [False, False, True])):
        page.evaluate("mode => optiplan.app.arrange(mode)", mode)
        boards, all_of_them = page.evaluate(BOARDS), [True] * len(red)
        assert (boards["red"], boards["through"], boards["hidden"]) == (red, all_of_them, all_of_them)
    page.evaluate("optiplan.app.picked.hide('board', false)")
    assert not any(page.evaluate(BOARDS)["hidden"])
    assert page.evaluate(UNDER) == "ball"


TOUCHED = """() => {
  const { scene } = optiplan, floor = scene.layers.obstacle.children.find((mesh) => mesh.name === "floor");
  scene.draw(true);
  const named = ({ labels }) => labels.some(({ body }) => body === floor);
  return [Boolean((floor.userData.look || {}).red), scene.failures.map(named)];
}"""


def test_runs_that_touch_the_same_floor_show_it_side_by_side_and_in_one_place(visit, problem, motion, tmp_path):
    witness = {"q": problem.start.tolist(), "points": [[0.6, 0.0, -0.1]] * 2, "pair": ["panda_hand", "floor"]}
    bad = {"verified": False, "checks": [{"name": "collision", "passed": False, "worst": -1e-3, "witness": witness}]}
    export_page(problem, [ViewedRun(name, motion(problem, 2.0), bad) for name in "ab"], tmp_path / "page.html")
    page = visit((tmp_path / "page.html").as_uri() + "#t=0&paused&arrange=beside&runs=a,b&run=a")
    for mode in ("beside", "together", "beside"):
        page.evaluate("mode => optiplan.app.arrange(mode)", mode)
        assert page.evaluate(TOUCHED) == [True, [True, True]]
        for chosen in (1, 0):
            page.evaluate("k => optiplan.app.select(k)", chosen)
            assert page.evaluate(TOUCHED) == [True, [True, True]]


UNDER = """() => {
  const { scene } = optiplan, ball = scene.scenery.children[0].children.find((mesh) => mesh.name === "ball");
  scene.draw(true);
  const at = ball.getWorldPosition(ball.position.clone()).project(scene.viewer.camera);
  return scene.bodyAt(0.5 * (1 + at.x) * scene.width, 0.5 * (1 - at.y) * scene.height);
}"""
GIVEN = """() => { for (const run of optiplan.scene.runs) {
  const one = { geometry: 0, colour: [1, 0, 0, 1], name: "taken", owner: "taken" };
  const at = (body) => ({ ...one, stays: [{ begin: 0, body, pose: [0, 0, 0, 0, 0, 0, 1] }] });
  run.data.objects = [at(0), at(5)];
  run.objects.group.removeFromParent();
  run.objects = new OptiPlanObjects.Objects(optiplan.scene, run, () => optiplan.scene.surface(one.colour));
} }"""


def test_what_runs_take_is_hidden_with_their_robots(visit, three):
    page = visit(three + "#t=0&paused")
    page.evaluate(GIVEN)
    page.evaluate("() => { optiplan.app.robots = [true, false, false]; optiplan.app.update(); }")
    seen = "(one) => one === null || (one.visible && seen(one.parent))"
    taken = f"() => {{ const seen = {seen}; return optiplan.scene.runs.map((run) => run.objects.meshes.map(seen)); }}"
    nothing = [False, False]  # of what stands, and of what is held
    for on, first in ((True, [True, True]), (False, [False, True]), (True, [True, True])):
        page.evaluate("on => optiplan.app.layers.set('obstacles', on)", on)
        assert page.evaluate(taken) == [first, nothing, nothing]


SEEN = """() => [document.body.className, document.body.dataset.panel, optiplan.app.arrangement.mode,
  optiplan.app.layers.wish, optiplan.scene.camera.map((x) => x.toFixed(2))]"""


def test_the_address_holds_all_that_it_can_say(visit, three):
    asked = "#scene&through&view=collision&ghosts=0&arrange=beside&panel=dock&cam=3,0,1,0,0,0.5"
    page = visit(three + asked)
    until(page, "location.hash.includes('arrange=beside')")
    seen, hash = page.evaluate(SEEN), page.evaluate("location.hash")
    assert seen[:3] == ["bare", "dock", "beside"]
    assert {"through", "collision"} < set(seen[3])
    assert not {"start", "goal"} & set(seen[3])
    assert visit(three + hash).evaluate(SEEN) == seen
    page.evaluate("location.hash = 'arrange=nonsense'")
    until(page, "optiplan.app.written === location.hash")
    assert page.evaluate(SEEN)[2] == "beside"
    assert page.locator(".arrangement select").input_value() == "beside"


def test_a_run_without_a_quantity_has_no_picture_of_it(visit, three):
    page = visit(three + "#t=0&paused&tab=jerk")
    page.evaluate("""() => {
      const { app } = optiplan, { decoded } = app.data.runs[1];
      decoded.quantities = decoded.quantities.filter((one) => one.name !== "jerk");
      app.dock.multiples = true;
      app.dock.choose("jerk");
    }""")
    assert page.locator(".own .cell").count() == 2


def test_curves_of_another_run_bear_its_name(visit, problem, motion, tmp_path):
    failure = {"kind": "no-path", "detail": "there is none", "witness": {}}
    runs = [ViewedRun("first", motion(problem, 2.0), {"verified": True}), ViewedRun("stuck", None, None, failure)]
    export_page(problem, runs, tmp_path / "page.html")
    page = visit((tmp_path / "page.html").as_uri() + "#t=0&paused&tab=velocity")
    assert page.locator(".own .head").text_content().startswith("velocity")
    page.evaluate("optiplan.app.select(1)")
    assert page.locator(".own .head").text_content().startswith("first: velocity")


def test_runs_that_were_all_refused_do_not_follow_each_other(visit, problem, motion, tmp_path):
    witness = {"motion": motion(problem, 2.0).to_dict(), "q": problem.start.tolist()}
    failure = {"kind": "collision", "detail": "they touch", "witness": witness}
    export_page(problem, [ViewedRun(name, None, None, failure) for name in "ab"], tmp_path / "page.html")
    page = visit((tmp_path / "page.html").as_uri() + "#t=0&paused&arrange=turn")
    assert page.evaluate("optiplan.clock.following()") is False
    assert page.evaluate("optiplan.app.selected") == 0
