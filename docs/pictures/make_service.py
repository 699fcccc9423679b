"""Make the pictures of the service: `python docs/pictures/make_service.py`.

A server is started in an empty folder, planned with, and looked at in a headless Chromium, on a screen and on a phone:

* `service-home.png`: the list of runs. `service-benches.png`: three problems by four planners.
* `service-studio.png`, `service-studio-phone.png`: a goal that is being dragged, with all ways to reach it.
* `service-plan.png`: a run in the studio, with its improvements.
* `service-live.png`, `service-live-phone.png`: a controller that follows a target until the shelf holds it back.
* `service-execution.png`, `service-execution-phone.png`: an execution that waits for a ball in its way.

Needs chromium and the `test` extra (playwright, pillow). Takes some minutes.
"""

import io
import sys
import tempfile
import time
from pathlib import Path

import httpx
from PIL import Image
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
from service_process import serving, wait_until_ready  # noqa: E402

HERE = Path(__file__).parent
GPU = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZES = {"": (1280, 800), "-phone": (390, 844)}
"""px, by the end of a picture's name."""
TURN = """percent => {
  const slider = document.getElementById("speed");
  slider.value = percent;
  slider.dispatchEvent(new Event("input"));
}"""
"""Sets the speed of an execution."""
SHOWN = ("01_reach", "02_shelf", "07_any_of", "18_baxter_dual")
BENCHED = {"planners": ["trajopt", "rrtconnect", "quintic", "cubic"], "seeds": [0, 1], "budget": 3.0}


def fill(url: str) -> None:
    """Make runs and a bench, and wait for them."""
    texts = [(ROOT / "problems" / f"{name}.yaml").read_text() for name in SHOWN]
    with httpx.Client(base_url=url, timeout=120.0, trust_env=False) as http:
        http.post("/api/benches", json={"name": "three examples", "problems": texts[:3], **BENCHED}).raise_for_status()
        for text in texts:
            http.post("/api/problems", json={"problem": text}).raise_for_status()
            http.post("/api/runs", json={"problem": text, "budget": 6.0}).raise_for_status()
        while {"queued", "running"} & set(http.get("/api/runs").json()["counts"]):
            time.sleep(1.0)


def run_with_a_ball(url: str) -> str:
    """Plan the first example beside a ball; return the id of the run."""
    ball = "  - {name: ball, shape: {sphere: 0.09}, pose: {position: [0.3, -0.45, 0.35]}}"
    text = (ROOT / "problems" / "01_reach.yaml").read_text() + f"scene:\n  obstacles:\n  {ball}\n"
    with httpx.Client(base_url=url, timeout=120.0, trust_env=False) as http:
        answer = http.post("/api/plan", json={"problem": text, "budget": 3.0}).raise_for_status()
    return str(answer.json()["id"])


def drag(page: Page, scene: str, by: tuple[float, float]) -> None:
    """Take the frame and move it by so many px; it is still held then."""
    x, y = page.evaluate(f"{scene}.goalOnScreen()")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by[0], y + by[1], steps=5)


def studio(page: Page, name: str) -> None:
    """A goal that is dragged, and on the screen a run."""
    page.wait_for_function("optiplanStudio.state.problem")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    drag(page, "optiplanStudio.scene", (-40, -20))
    page.wait_for_function("optiplanStudio.scene.ghosts.children.length > 3")
    page.wait_for_timeout(1500)
    save(page, f"service-studio{name}")
    page.mouse.up()
    if name:
        return
    page.select_option("#example", "")
    page.reload()
    page.wait_for_selector("#issues .fine")
    page.fill("#budget", "8")
    page.click("#plan")
    page.wait_for_selector("#improvements li")
    page.wait_for_timeout(2000)
    save(page, "service-plan")


def live(page: Page, name: str) -> None:
    """A target that is dragged into the shelf's side."""
    page.wait_for_function("optiplanLive.scene.data")
    page.click("#begin")
    page.wait_for_function("optiplanLive.live.states > 30")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    drag(page, "optiplanLive.scene", (60, -8) if not name else (22, -4))
    page.mouse.up()
    page.wait_for_timeout(4000)
    page.evaluate("scrollTo(0, 0)")
    save(page, f"service-live{name}")
    page.click("#stop")
    page.wait_for_timeout(2000)


def execution(page: Page, name: str) -> None:
    """A ball that is dragged into the way of an arm."""
    page.wait_for_function("optiplanExecution.ready && optiplanExecution.scene.data")
    page.evaluate(TURN, 3)
    page.click("#begin")
    page.wait_for_function("optiplanExecution.live.states > 60")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
    ball = "optiplanExecution.scene.obstacles.children.find((one) => one.name === 'ball')"
    at = page.evaluate(f"optiplanExecution.scene.onScreen({ball})")
    there = page.evaluate("optiplanExecution.scene.onScreen(optiplanExecution.scene.root, 0.14, 0.65, 0.35)")
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(*there, steps=20)
    page.mouse.up()
    page.wait_for_selector("#state:text('waiting')")
    page.wait_for_timeout(1500)
    page.evaluate("scrollTo(0, 0)")
    save(page, f"service-execution{name}")
    page.click("#stop")
    page.wait_for_selector("#state:text('ended')")


def save(page: Page, name: str) -> None:
    """Save what is seen."""
    Image.open(io.BytesIO(page.screenshot())).convert("RGB").save(HERE / f"{name}.png", optimize=True)
    print(name, (HERE / f"{name}.png").stat().st_size // 1000, "kB")


def main() -> None:
    """Make them all."""
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder) / "data") as server, sync_playwright() as tool:
        wait_until_ready(server.url)
        fill(server.url)
        run = run_with_a_ball(server.url)
        browser = tool.chromium.launch(executable_path="/usr/bin/chromium", args=GPU)
        for name, (width, height) in SIZES.items():
            page = browser.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(120_000)
            for path, take in (("studio", studio), ("live", live), (f"execution#run={run}", execution)):
                page.goto(f"{server.url}/{path}")
                take(page, name)
            if not name:
                for path, wait in (("", ".run img"), ("benches", ".bench table")):
                    page.goto(f"{server.url}/{path}")
                    page.wait_for_selector(wait)
                    page.wait_for_load_state("networkidle")
                    save(page, f"service-{path or 'home'}")
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
