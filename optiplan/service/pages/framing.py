"""The frame of every page that the service shows to people: heading, links to the others, what went wrong."""

import html
from collections.abc import Mapping
from http import HTTPStatus
from importlib import resources
from string import Template

from optiplan.service.refusals import Refusal

LINKS = {"": "Runs", "studio": "Studio", "live": "Live", "execution": "Execution", "benches": "Benches"}
"""Pages by their address, as links of the others name them."""

TOKEN_FORM = """<form method="get"><label>Token <input name="token" type="password" autocomplete="current-password"
autofocus required></label> <button class="first" type="submit">Enter</button></form>
<p class="none">It is the one that the server was started with, by <code>--token-file</code> or
<code>OPTIPLAN_TOKEN</code>. This browser then keeps it as a cookie.</p>"""


def framed(
    heading: str, name: str | None, content: str, scripts: tuple[str, ...] = (), kind: str = "", root: str = ""
) -> str:
    """Return a page as text.

    Args:
        heading: of the page.
        name: its address, of `LINKS`; None for none of them.
        content: HTML below the heading.
        scripts: names of scripts of the pages, in their order.
        kind: class of the body.
        root: what leads from the address of the page to that of the first one.
    """
    links = {root + address or ".": words for address, words in LINKS.items() if address != name}
    if name == "":
        links["openapi.json"] = "OpenAPI"
    title = f"{LINKS[name]} · OptiPlan" if name else heading
    frame = (resources.files("optiplan.service.pages") / "frame.html").read_text("utf-8")
    return Template(frame).substitute(
        title=html.escape(title),
        heading=html.escape(heading),
        kind=kind,
        root=root,
        links=" ".join(f'<a href="{address}">{words}</a>' for address, words in links.items()),
        scripts="\n".join(f'<script src="{root}pages/{script}.js" defer></script>' for script in scripts),
        content=content,
    )


def error_page(why: Refusal, path: str) -> str:
    """Return what a browser shows in place of a page that is refused; a missing token can be given there."""
    root = "../" * max(0, path.strip("/").count("/"))
    words = f"<h2>{why.status} · {html.escape(HTTPStatus(why.status).phrase)}</h2><p>{html.escape(str(why))}</p>"
    told = "".join(f"<li>{html.escape(_issue(one))}</li>" for one in why.issues)
    more = TOKEN_FORM if why.status == HTTPStatus.UNAUTHORIZED else ""
    return framed("OptiPlan", None, words + (f"<ul>{told}</ul>" if told else "") + more, root=root)


def _issue(issue: Mapping[str, object]) -> str:
    place = "" if issue.get("line") is None else f"line {issue['line']}: "
    return f"{place}{issue.get('field')}: {issue.get('found')}; expected {issue.get('expected')}"


def wants_page(method: str, path: str, accept: str) -> bool:
    """Whether a request is a browser's for a page, so that a person reads the answer."""
    return method == "GET" and "text/html" in accept and not path.startswith(("/api/", "/pages/"))
