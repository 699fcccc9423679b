"""The pages in a real browser: edit, drag, plan, watch, play, compare, cancel; without a word of complaint."""

import shutil

import pytest

from tests.service.conftest import NO_WAY, QUICK

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
QUIET = ["--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"]
PATIENCE = 90_000  # ms
pytestmark = pytest.mark.timeout(300)


@pytest.fixture(params=[(1280, 800), (390, 844)], ids=["wide", "narrow"])
def page(browser, request, server):
    """A page that fails the test by any complaint, and by any request to somewhere else."""
    complaints = []
    page = browser.new_page(viewport=dict(zip(("width", "height"), request.param, strict=True)))
    page.set_default_timeout(PATIENCE)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on(
        "console",
        lambda said: (
            said.type in ("error", "warning") and "ReadPixels" not in said.text and complaints.append(said.text)
        ),
    )
    page.on(
        "requestfailed",  # a stream of events that is closed counts as one
        lambda failed: failed.url.endswith("/events") or complaints.append(f"failed: {failed.url[:200]}"),
    )
    ours = (server.url, "data:", "blob:", "about:")
    page.on("request", lambda asked: asked.url.startswith(ours) or complaints.append(f"elsewhere: {asked.url}"))
    yield page
    page.close()
    assert not complaints


def write(page, text):
    page.fill("#text", text)
    page.wait_for_function("document.querySelector('#issues .fine') && optiplanStudio.state.problem")
    name = next(line.split(":")[1].strip() for line in text.splitlines() if line.startswith("name:"))
    page.wait_for_function(f"optiplanStudio.state.problem.name === '{name}'")


def drag_the_goal(page):
    x, y = page.evaluate("optiplanStudio.scene.goalOnScreen()")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 40, y - 20, steps=4)
    page.wait_for_function("optiplanStudio.scene.ghosts.children.length > 1")
    page.mouse.up()
    page.wait_for_function("document.getElementById('text').value.includes('quaternion')")
    page.wait_for_selector("#issues .fine")
    assert "# From the lower right" in page.input_value("#text")  # what else is in the file stays


def test_edit_drag_plan_watch_and_play(page, server, problems):
    page.goto(f"{server.url}/studio")
    page.wait_for_selector("#issues .fine")
    page.wait_for_function("optiplanStudio.state.problem")
    if page.viewport_size["width"] > 1000:
        drag_the_goal(page)
    text = (problems / "01_reach.yaml").read_text()
    page.fill("#text", text.replace("robot: panda", "robot: pandas"))
    page.wait_for_selector("#issues button")
    assert "did you mean 'panda'" in page.inner_text("#issues")
    assert page.is_disabled("#plan")
    write(page, f"{text}\nseed: {page.viewport_size['width']}\n")
    slider = page.locator("#sliders input").first
    slider.evaluate("one => { one.value = 0.4; one.dispatchEvent(new Event('input')); }")
    page.wait_for_function("optiplanStudio.state.q[0] === 0.4")
    page.fill("#budget", "5")
    page.click("#plan")
    page.wait_for_selector("#link:not([hidden])", state="attached")
    assert page.inner_text("#state") == "verified"
    assert page.locator("#improvements li").count() >= 1
    page.frame_locator("#page").locator("canvas").first.wait_for()
    page.click("#back")
    assert page.is_hidden("#page")


def test_cancel_from_the_studio(page, server):
    page.goto(f"{server.url}/studio")
    page.wait_for_selector("#issues .fine")
    write(page, f"{NO_WAY}seed: {page.viewport_size['width']}\n")
    page.fill("#budget", "60")
    page.click("#plan")
    page.wait_for_selector("#state.running")
    page.click("#cancel")
    page.wait_for_selector("#state.cancelled")


def test_runs_are_listed_and_compared(page, server):
    runs = [server.ended(server.submit(problem=QUICK, planner=name, seed=61)["id"]) for name in ("quintic", "cubic")]
    page.goto(server.url)
    for run in runs:
        page.wait_for_selector(f"a[href='runs/{run['id']}']")
        page.locator(".run", has=page.locator(f"a[href='runs/{run['id']}']")).locator("input").check()
    page.wait_for_function("[...document.images].some((one) => one.complete && one.naturalWidth > 0)")
    page.click("#compare")
    page.wait_for_selector("canvas")
    assert "cubic" in page.content()  # on a narrow page the card is folded
