"""Pictures and films of a page, drawn by a headless Chromium."""

import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optiplan.errors import OptiPlanError
from optiplan.files import replacing

if TYPE_CHECKING:
    from PIL.Image import Image

BROWSERS = (
    "chromium-headless-shell",
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
)
"""The first draws a page in half of the time: it has no window to draw around it."""
RATE = 20.0
"""Frames a second of a film."""
REST = 800
"""ms that a film stands still at its end."""
_PATIENCE = 180.0
"""s for a page to be drawn, which takes seconds on software rendering, and many beside other work."""
_SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


def browser_program() -> str | None:
    """Return the path of a browser that can draw a page, or None."""
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


@contextmanager
def opened(html: str, wish: str = "", size: tuple[int, int] = (1280, 800)) -> Iterator[Any]:
    """Open a page in a browser without a window; what is yielded is playwright's `Page`, with its first picture drawn.

    Args:
        html: text of the page.
        wish: its address after the `#`, such as `t=0.4&paused&tab=velocity`.
        size: width and height of the window, px.

    Raises:
        OptiPlanError: playwright or a browser is missing, or the page is not drawn in three minutes.
    """
    try:
        from playwright.sync_api import TimeoutError as NotDrawnError
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise OptiPlanError("pictures of a page need playwright: pip install 'optiplan[pictures]'") from None
    executable = browser_program()
    if executable is None:
        raise OptiPlanError(f"pictures of a page need a browser; looked for {', '.join(BROWSERS)}")
    with tempfile.TemporaryDirectory(prefix="optiplan-") as folder, sync_playwright() as tool:
        file = Path(folder) / "page.html"
        file.write_text(html, "utf-8")
        browser = tool.chromium.launch(executable_path=executable, args=_SOFTWARE)
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.set_default_timeout(1000.0 * _PATIENCE)
        try:
            page.goto(f"{file.as_uri()}#{wish}")
            page.wait_for_selector("html[data-ready='1']")
            settle(page)
        except NotDrawnError:
            raise OptiPlanError(f"the browser did not draw the page within {_PATIENCE:.0f} s") from None
        yield page
        browser.close()


def settle(page: Any) -> None:
    """Wait until what was asked for is drawn."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def frame(page: Any, time: float) -> "Image":
    """Return the picture of an open page at an instant, s."""
    from PIL import Image

    page.evaluate("(t) => optiplan.clock.jump(t)", time)
    settle(page)
    return Image.open(BytesIO(page.screenshot())).convert("RGB")


def save_picture(html: str, path: Path, wish: str = "", size: tuple[int, int] = (1280, 800)) -> None:
    """Write a PNG of a page at the instant and from the place that its address says; it appears whole or not at all.

    Raises:
        OptiPlanError: playwright or a browser is missing.
    """
    with opened(html, wish or "t=0&paused", size) as page:
        data = page.screenshot()
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def save_film(html: str, path: Path, wish: str = "", size: tuple[int, int] = (960, 600)) -> None:
    """Write the motion of a page's scene as GIF, or WebP or MP4 where the name ends so, at the speed its address says.

    Raises:
        OptiPlanError: there is no motion, or playwright, a browser, or for MP4 ffmpeg is missing.
    """
    ffmpeg = find_ffmpeg() if path.suffix.lower() == ".mp4" else None
    with opened(html, f"{wish}&scene", size) as page:
        page.evaluate("optiplan.clock.pause()")
        end, speed = page.evaluate("[optiplan.clock.end, optiplan.clock.speed]")
        if not end:
            raise OptiPlanError("there is no motion to film")
        count = max(1, round(end / speed * RATE))
        frames = [frame(page, end * k / count) for k in range(count + 1)]
    if ffmpeg is not None:
        save_mp4(frames, path, ffmpeg)
        return
    pauses = [round(1000.0 / RATE)] * count + [REST]
    kind = "WEBP" if path.suffix.lower() == ".webp" else "GIF"
    with replacing(path) as temporary:
        frames[0].save(temporary, kind, save_all=True, append_images=frames[1:], duration=pauses, loop=0)


def find_ffmpeg() -> str:
    """Return the program that writes MP4.

    Raises:
        OptiPlanError: it is not there.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise OptiPlanError(
            "an MP4 needs ffmpeg (apt install ffmpeg); GIF and WebP do not: optiplan view RUN --gif FILE"
        )
    return found


def save_mp4(frames: "Sequence[Image]", path: Path, ffmpeg: str) -> None:
    """Write frames as H.264, in the colours that every player knows, which takes even widths and heights.

    Raises:
        OptiPlanError: ffmpeg could not, with its last line.
    """
    width, height = frames[0].size
    still = round(REST * RATE / 1000.0)
    command = [ffmpeg, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{RATE:g}", "-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]
    command += ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]
    data = b"".join(image.tobytes() for image in [*frames, *[frames[-1]] * still])
    with replacing(path) as temporary:
        done = subprocess.run([*command, str(temporary)], input=data, capture_output=True, check=False)
        if done.returncode:
            words = done.stderr.decode(errors="replace").strip().splitlines()
            raise OptiPlanError(f"ffmpeg could not write {path}: {words[-1] if words else 'it does not say why'}")
