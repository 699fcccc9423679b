"""Make the pictures of a benchmark's matrix and of a workspace: `python docs/pictures/make_bench.py`.

* `bench-matrix.png`: five planners on six of the examples, each for 8 s at most, as `optiplan bench` reports them.
* `workspace.png`: where the tool of the UR5 can be, cut open; the robot stands as in the voxel that is pointed at.

Needs chromium and the `test` extra (playwright, pillow). Takes a few minutes.
"""

import io
import json
import os
import shutil
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from optiplan.bench.execution.pool import LocalPool
from optiplan.bench.execution.runner import open_results, run_suite
from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.page import write_page
from optiplan.bench.suite.suite import load_suite
from optiplan.viewer.workspaces.page import render_workspaces
from optiplan.workspace.sampling import WorkspaceOptions, robot_with_meshes, study_workspace

HERE = Path(__file__).parent.resolve()
SIZE = {"width": 1280, "height": 800}  # px
GPU = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SUITE = {
    "version": 1,
    "name": "examples",
    "problems": [{"glob": f"{HERE.parent.parent}/problems/0[2-7]*.yaml", "set": "examples"}],
    "planners": ["trajopt", "rrtconnect", "rrtstar", "kpiece", "quintic"],
    "budget": 8,
}
POINTED_AT = (0.35, 0.28, 0.35)
"""Near to the voxel that is pointed at, m, in the robot's world."""


def bench_matrix(folder: Path) -> Path:
    """Run the suite and write its report."""
    (folder / "suite.yaml").write_text(json.dumps(SUITE))
    suite = load_suite(folder / "suite.yaml", folder / "files")
    os.chdir(folder)  # commands in the page name the folder as it is given
    with open_results(suite, Path("results", "examples")) as store:
        run_suite(suite, store, LocalPool(1), "1 local", lambda outcome: print(*outcome.row.key[:2]))
        return write_page(store, analyse(store), pages=1).resolve()


def workspace(folder: Path) -> Path:
    """Sample the workspace and write its page."""
    found = study_workspace(robot_with_meshes("ur5"), WorkspaceOptions(samples=200_000))
    (folder / "workspace.html").write_text(render_workspaces([found]), encoding="utf-8")
    return folder / "workspace.html"


def save(page: Page, path: Path) -> None:
    """Save what is seen, at half the number of pixels it was drawn with."""
    page.wait_for_timeout(800)
    drawn = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    drawn.resize((SIZE["width"], SIZE["height"]), Image.Resampling.LANCZOS).save(path, optimize=True)


def main() -> None:
    """Make both pictures."""
    executable = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=executable, args=GPU)
        page = browser.new_page(viewport=SIZE, device_scale_factor=2)
        page.set_default_timeout(180_000)
        page.goto(bench_matrix(Path(scratch)).as_uri())
        page.evaluate("document.querySelector('#matrix').scrollIntoView()")
        row = page.locator("#matrix tbody tr").first
        for k in (0, 1):
            row.locator(".pick").nth(k).check()
        row.locator(".open").nth(1).hover()
        save(page, HERE / "bench-matrix.png")
        page.goto(workspace(Path(scratch)).as_uri())
        page.wait_for_selector("html[data-ready='1']")
        page.evaluate(
            """(at) => {
              const robot = OptiPlanWorkspace.robots[0], { points, rows } = robot;
              const far = (k) => Math.hypot(...at.map((x, i) => x - points[3 * k + i]));
              const reached = [...rows.keys()].filter((k) => rows[k] >= 0);
              OptiPlanWorkspace.select([robot, reached.reduce((best, k) => (far(k) < far(best) ? k : best))]);
            }""",
            list(POINTED_AT),
        )
        page.locator("[data-layer=through] input").check()
        save(page, HERE / "workspace.png")
        browser.close()


if __name__ == "__main__":
    main()
