"""Make the pictures of the README and the documentation, from real runs: `python docs/pictures/make.py [NAME…]`.

Every picture begins with a plan that the verifier judges. The viewer's page of it is drawn by a headless Chromium, one
instant after another, and the frames become an image. Nothing in them is drawn by hand.

* `shelf.webp`: the motion of `problems/02_shelf.yaml`, at a quarter of its speed, with its verdict.
* `failure.png`: the straight motion to the same goal, refused, with the place where it touches.
* `comparison.png`: three planners on the same problem.

Needs chromium and the `test` extra (playwright, pillow).
"""

import io
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

import optiplan as op

HERE = Path(__file__).parent
PROBLEM = "02_shelf"
SIZE = {"width": 800, "height": 500}  # px
BUDGET = 10.0  # s for each planner
SLOWER = 4.0  # the picture plays at 1 / SLOWER of the true speed
RATE = 20.0  # frames a second of the picture
REST = (700, 1300)  # ms of standing still at start and goal
GPU = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


EYE, TOWARD = (-0.92, -2.18, 1.55), (0.31, 0.04, 0.45)
"""Where the camera is and what it looks at, m, in the world of the problem."""

STYLE = """
#bar, #layers, .run .more, .run .robot { display: none !important; }
#card { width: 286px; top: 14px; left: 14px; }
#card > summary { list-style: none; }
#note { right: auto; left: 14px; bottom: 14px; margin: 0; font-variant-numeric: tabular-nums; }
"""


def plan(*planners: str) -> list[op.Run]:
    """The problem planned by each of these planners, and what came judged by the verifier."""
    runs = [op.plan(op.load_problem(PROBLEM), name, budget=BUDGET) for name in planners]
    for run in runs:
        print(run.planner, run.failure.detail if run.failure else f"{run.duration:.3f} s, verified: {run.verified}")
    return runs


@contextmanager
def opened(runs: list[op.Run], wish: str = "") -> Iterator[Page]:
    """Open the viewer on these runs in a browser of its own, without the player's bar and seen from the camera."""
    executable = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    with op.view(*runs, block=False, port=0) as shown, sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=executable, args=GPU)
        tab = browser.new_page(viewport=SIZE, device_scale_factor=2)
        tab.goto(f"{shown.url}#t=0&paused{wish}")
        tab.wait_for_selector("html[data-ready='1']")
        tab.add_style_tag(content=STYLE)
        settle(tab)
        # three.js counts y upwards: (x, y, z) of the problem is (x, z, -y) there
        tab.evaluate(
            """([eye, toward]) => {
              const { camera, controls } = optiplan.scene.viewer;
              camera.position.set(eye[0], eye[2], -eye[1]);
              controls.target.set(toward[0], toward[2], -toward[1]);
              controls.update();
            }""",
            [EYE, TOWARD],
        )
        yield tab
        browser.close()


def settle(tab: Page) -> None:
    """Wait until what was asked for is drawn."""
    tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def frame(tab: Page, t: float, note: str = "") -> Image.Image:
    """The picture at the instant t, s, with a note in its corner, which may be empty."""
    tab.evaluate(
        """([t, note]) => {
          optiplan.seek(t);
          document.getElementById("note").textContent = note;
          document.getElementById("note").hidden = !note;
        }""",
        [t, note],
    )
    settle(tab)
    drawn = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
    return drawn.resize((SIZE["width"], SIZE["height"]), Image.Resampling.LANCZOS)


def shelf() -> None:
    """Write the moving picture."""
    runs = plan("trajopt")
    duration = runs[0].duration or 0.0
    count = round(duration * SLOWER * RATE)
    with opened(runs, "&ghosts=0") as tab:
        instants = [duration * k / count for k in range(count + 1)]
        frames = [frame(tab, t, f"{t:.2f} s · shown at 1/{SLOWER:.0f} of the speed") for t in instants]
    pauses = [REST[0], *[round(1000 / RATE)] * (count - 1), REST[1]]  # ms
    options = {"duration": pauses, "loop": 0, "quality": 80, "method": 6}
    frames[0].save(HERE / "shelf.webp", save_all=True, append_images=frames[1:], **options)


def failure() -> None:
    """Write the picture of a motion that is refused: where, and which two bodies meet."""
    with opened(plan("quintic")) as tab:
        frame(tab, 0.0).save(HERE / "failure.png", optimize=True)


def comparison() -> None:
    """Write the picture of three planners' motions at the instant at which the quickest has arrived."""
    runs = plan("trajopt", "rrtconnect", "kpiece")
    quickest = min((run for run in runs if run.verified), key=lambda run: run.duration or 0.0)
    with opened(runs, "&ghosts=0") as tab:
        tab.add_style_tag(content=".run dl { display: none !important; }")
        note = f"after {quickest.duration:.2f} s {quickest.planner} has arrived"
        frame(tab, quickest.duration or 0.0, note).save(HERE / "comparison.png", optimize=True)


PICTURES = {"shelf": shelf, "failure": failure, "comparison": comparison}

if __name__ == "__main__":
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name]()
