"""What tests of the service's pages share: a page that fails by any complaint, the studio, a drag."""

from typing import Any

PATIENCE = 90_000
"""For a page on a busy machine with software rendering, ms."""

CHANGED = "before => JSON.stringify(optiplanStudio.state.problem.goal.pose) !== JSON.stringify(before)"


def text_of(page: Any) -> str:
    """The text of the studio's editor."""
    return page.evaluate("optiplanStudio.editor.text()")


def write(page: Any, text: str) -> None:
    """Put another text into the studio and wait until its scene is drawn."""
    page.evaluate("text => optiplanStudio.editor.replace(text)", text)
    name = next(line.split(":")[1].strip() for line in text.splitlines() if line.startswith("name:"))
    page.wait_for_function(f"optiplanStudio.state.problem && optiplanStudio.state.problem.name === '{name}'")
    page.wait_for_selector("#issues .fine")


def drag(page: Any, at: list[float], by: tuple[float, float], meanwhile: Any = lambda: None) -> None:
    """Drag what lies at a point of the page by so many pixels."""
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(at[0] + by[0], at[1] + by[1], steps=4)
    meanwhile()
    page.mouse.up()


def open_studio(page: Any, server: Any) -> None:
    """Open the studio and wait until it has drawn."""
    page.goto(f"{server.url}/studio")
    page.wait_for_selector("#issues .fine")
    page.wait_for_function("optiplanStudio.state.problem")
    page.evaluate("document.getElementById('pane').scrollIntoView()")
