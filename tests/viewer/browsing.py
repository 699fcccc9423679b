"""A headless browser for the tests of pages."""

import io
import os
import time
from collections.abc import Iterator

import numpy as np
import pytest

from optiplan.viewer.pictures import browser_program

CHROMIUM = browser_program()
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
ROUGH = ["--webgl-antialiasing-mode=none", "--webgl-msaa-sample-count=0"]  # smooth edges are half of software's work
QUIET = [
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
WITHOUT = [
    "WebUIOmniboxPopup",
    "WebUIOmniboxAimPopup",
    "SpareRendererForSitePerProcess",  # with the two before, two processes more for each page, which show nothing
    "DestroyProfileOnBrowserClose",  # these are on playwright's own list, which ours takes the place of
    "HttpsUpgrades",
    "MediaRouter",
    "OptimizationHints",
    "PaintHolding",
    "Translate",
]
"""Features of Chromium that no page here needs."""

SELDOM = """{
  const draw = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (act) => setTimeout(() => draw(act), 130);
}"""
"""Makes a page draw some seven times a second: in software, sixty times would take all that the processor has."""

UNDRAWN = """{
  window.undrawn = true;
  for (const { prototype } of [WebGLRenderingContext, WebGL2RenderingContext])
    for (const name of Object.getOwnPropertyNames(prototype).filter((one) => /^draw(Arrays|Elements)/.test(one))) {
      const draw = prototype[name];
      prototype[name] = function (...given) { if (!window.undrawn) draw.apply(this, given); };
    }
}"""
"""Leaves out what software would need most of the time for, triangles, until `undrawn` is false: where pixels count."""


@pytest.fixture(scope="session")
def browser() -> Iterator:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        if os.environ.get("CI"):
            pytest.fail("no chromium on this machine; CI must install it")
        pytest.skip("no chromium on this machine")
    with playwright.sync_playwright() as tool:
        flags = [*FLAGS, *ROUGH, *QUIET, f"--disable-features={','.join(WITHOUT)}"]
        browser = tool.chromium.launch(executable_path=CHROMIUM, args=flags)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser):
    """Open an address and wait for the first picture; at the end, any complaint of the page fails the test."""
    complaints: list[str] = []
    size = {"width": 640, "height": 480}
    context = browser.new_context(viewport=size, device_scale_factor=0.5)  # a quarter of the pixels
    context.add_init_script(SELDOM + UNDRAWN)
    context.set_default_timeout(100_000)  # software rendering beside other work

    def heard(message) -> None:
        # Chromium itself remarks on its software renderer reading pixels back for a screenshot.
        if message.type in ("error", "warning") and "GPU stall due to ReadPixels" not in message.text:
            complaints.append(f"{message.type}: {message.text}")

    def open_page(url: str):
        page = context.new_page()
        page.on("console", heard)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url[:200]}"))
        page.on(
            "request",
            lambda request: request.url.startswith((url.split("#")[0], "data:")) or complaints.append(request.url),
        )
        page.goto(url)
        page.wait_for_selector("html[data-ready='1']", timeout=100_000)
        return page

    yield open_page
    context.close()
    assert complaints == []


def pixels(page) -> np.ndarray:
    from PIL import Image

    page.evaluate("""() => new Promise((done) => {
      undrawn = false;
      for (const ghost of optiplan.scene.outlines.ghosts) ghost.seen = "";  // kept pictures, of no triangles
      optiplan.scene.dirty();
      requestAnimationFrame(() => requestAnimationFrame(done));
    })""")
    picture = page.locator("#pane canvas").screenshot(style="#labels, #legend { visibility: hidden; }")
    page.evaluate("undrawn = true")
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)


def until(page, condition: str) -> None:
    """Wait for a condition by asking again and again: the page forbids the `eval` of playwright's own way."""
    end = time.monotonic() + 100.0
    while not page.evaluate(condition):
        assert time.monotonic() < end, f"never came true: {condition}"
        time.sleep(0.02)


def poses(page) -> np.ndarray:
    return np.array(page.evaluate("optiplan.poses()"), dtype=float)


OVERLAPS = """() => {
  const seen = (e) => e.offsetParent !== null && getComputedStyle(e).visibility !== "hidden";
  const name = (e) => `${e.tagName}#${e.id}.${e.className} ${e.textContent.slice(0, 30)}`;
  const found = [];
  const groups = ["#head", "#tools", "#bar", "#layers", "#panels", "#work", "body", ".run", ".check", ".facts"];
  groups.push(".dockbar", ".curves .head", ".curves .key", ".compare tr");
  for (const group of groups) for (const parent of document.querySelectorAll(group)) {
    if (!seen(parent)) continue;
    const shown = [...parent.children].filter((e) => seen(e) && !["SCRIPT", "STYLE"].includes(e.tagName));
    const children = shown.map((e) => [e, e.getBoundingClientRect()]).filter(([, r]) => r.width && r.height);
    children.forEach(([a, p], i) => {
      for (const [b, q] of children.slice(i + 1)) {
        const x = Math.min(p.right, q.right) - Math.max(p.left, q.left);
        const y = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
        if (x > 1 && y > 1) found.push(`${name(a)} overlaps ${name(b)}`);
      }
      const scrolled = a.closest(".tabs, .key, .scrolled"), card = a.closest("#card");
      if (p.right > innerWidth + 1 && !scrolled) found.push(`${name(a)} leaves the page`);
      if (card && p.right > card.getBoundingClientRect().right + 1) found.push(`${name(a)} leaves the card`);
    });
  }
  if (document.documentElement.scrollWidth > innerWidth) found.push("the page is wider than the window");
  return found;
}"""


def overlaps(page, width: int, height: int) -> list[str]:
    """What overlaps its neighbour or leaves its card in a window of this size, px, measured from the boxes."""
    page.set_viewport_size({"width": width, "height": height})
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.evaluate(OVERLAPS)
