"""Scripts and styles of the pages, which lie in `web/`; nothing is built, everything is put into the page as it is."""

from collections.abc import Sequence
from importlib import resources

CURVES_STYLES = ("theme.css", "uplot/uPlot.min.css", "curves.css")
CURVES_SCRIPTS = ("uplot/uPlot.iife.min.js", "clock.js", "curves.js")
"""What a page with curves needs: `OptiPlanClock.Clock`, `OptiPlanCurves.Plot`; see `web/curves.js`."""


def asset(name: str) -> str:
    """Text of a file of `web/`, such as `curves.js`."""
    return resources.files("optiplan.viewer").joinpath("web", *name.split("/")).read_text("utf-8")


def styles(names: Sequence[str]) -> str:
    """The styles as one text for a `<style>` element."""
    return "\n".join(asset(name) for name in names)


def scripts(names: Sequence[str]) -> str:
    """A `<script>` element for each, in this order."""
    return "\n".join(f"<script>\n{inline(asset(name))}</script>" for name in names)


def inline(script: str) -> str:
    """Escape a script so that it cannot close its script tag."""
    return script.replace("</script", "<\\/script")


def licence(name: str) -> str:
    """A licence text for an HTML comment."""
    return asset(name).replace("--", "- -")
