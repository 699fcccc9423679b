"""What all pages of the service have around them: links, errors, news of others, a server that goes and comes back."""

import json
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest

from tests.axe import serious
from tests.service.browsing import open_studio
from tests.small_problems import QUICK

pytestmark = pytest.mark.timeout(300)
wide = pytest.mark.parametrize("page", [(1280, 800)], indirect=True, ids=["wide"])


def test_a_server_that_goes_and_comes_back(tab, server):
    open_studio(tab, server)
    for pattern in ("**/api/**", "**/healthz"):
        tab.route(pattern, lambda route: route.abort("connectionrefused"))
    tab.evaluate(
        "optiplanStudio.editor.view.dispatch({ changes: { from: 0, insert: '# x' }, userEvent: 'input.type' })"
    )
    tab.wait_for_selector("#banner:not([hidden])")
    tab.wait_for_function("!document.querySelector('#issues .fine')")
    assert tab.is_disabled("#plan")
    assert "not checked" in tab.inner_text("#issues")
    tab.unroute_all()
    tab.wait_for_selector("#banner", state="hidden")
    tab.wait_for_selector("#issues .fine")
    assert tab.is_enabled("#plan")


@pytest.mark.parametrize(
    ("path", "api", "status", "words", "then"),
    [
        ("", "runs?limit=60", 503, "The server says: not now", "#runs .run, #runs .panel"),
        ("", "problems", 502, "The server does not answer", "#problems .run, #problems p"),
        ("benches", "benches", 429, "The server says: not now", "#benches .bench, #benches p:text('No benches yet')"),
        ("execution", "executions", 502, "The server does not answer", "#driver option"),
        ("studio", "examples", 401, "The server says: not now", "#issues .fine"),
    ],
)
def test_a_page_says_what_hinders_it_and_goes_on(tab, server, path, api, status, words, then):
    body = "<html>" if status == 502 else json.dumps({"error": "not now"})
    kind = "text/html" if status == 502 else "application/json"
    tab.route(f"**/api/{api}", lambda route: route.fulfill(status=status, body=body, content_type=kind))
    tab.goto(f"{server.url}/{path}")
    tab.wait_for_selector("#banner:not([hidden])")
    assert words in tab.inner_text("#banner")
    assert tab.locator(then).count() == 0
    tab.unroute_all()
    tab.wait_for_selector("#banner", state="hidden")
    tab.wait_for_selector(then, state="attached")


def test_benches_are_new_when_the_server_is_back(tab, server):
    tab.goto(f"{server.url}/benches")
    tab.wait_for_selector("#planners option")
    tab.wait_for_selector("#benches .bench, #benches p:text('No benches yet')")
    tab.evaluate("document.getElementById('benches').replaceChildren('of before')")
    tab.evaluate("dispatchEvent(new Event('optiplan:back'))")
    tab.wait_for_function("document.getElementById('benches').textContent !== 'of before'")


def listed(gone):
    """A list of 80 runs as the server gives it; run 5 has ended once one is gone."""
    about = {"failure": None, "timings": {"plan": 0.1}, "problem": "0" * 64, "robot": "planar2r", "planner": "quintic"}
    about |= {"seed": 0, "budget": 1.0, "deadline": None, "duration": 1.0, "ratio": 1.0}
    about |= {"started": 1.0, "finished": 2.0, "page": True}

    def answer(route):
        asked = {key: float(value[0]) for key, value in parse_qs(urlsplit(route.request.url).query).items()}
        runs = []
        for k in range(79, -1, -1):
            ended = k != 5 or gone
            state = {"status": "done" if ended else "queued", "verified": True if ended else None}
            if k not in gone and 1000.0 + k < asked.get("before", np.inf):
                runs.append({"id": f"{k:032x}", "name": f"run{k}", "submitted": 1000.0 + k, **about, **state})
        route.fulfill(json={"runs": runs[: int(asked["limit"])], "counts": {"done": 80 - len(gone)}})

    return answer


def test_older_runs_change_and_go_like_others(tab, server):
    gone = []

    def delete(route):
        if route.request.method == "DELETE":
            gone.append(int(route.request.url.rsplit("/", 1)[1], 16))
        route.fulfill(status=204)

    tab.route("**/api/runs/*", delete)
    tab.route("**/api/runs?*", listed(gone))
    tab.on("dialog", lambda dialog: dialog.accept())
    tab.goto(server.url)
    tab.click("#more")
    tab.wait_for_selector(".run:has-text('run0 ·')")
    for k in (3, 78):
        tab.locator(f".run:has-text('run{k} ·') input").check()
    assert tab.is_enabled("#compare")
    tab.locator(".run:has-text('run3 ·') button:text('Delete')").click()
    tab.wait_for_selector(".run:has-text('run3 ·')", state="detached")
    tab.wait_for_selector(".run:has-text('run5 ·') .badge.verified")
    assert tab.is_disabled("#compare")
    assert tab.locator("#runs .run").count() == 79


@wide
def test_a_run_has_links_and_says_what_made_it(page, server):
    run = server.ended(server.submit(seed=7)["id"])["id"]
    page.goto(f"{server.url}/runs/{run}")
    page.wait_for_selector("html[data-ready='1']")
    assert page.inner_text("#origin") == "robot planar2r · planner quintic · seed 7"
    links = page.eval_on_selector_all(
        "#head a", "all => Object.fromEntries(all.map((one) => [one.textContent, one.href]))"
    )
    assert {"Runs", "Edit in the studio", "Problem", "Files", "CSV", "Execute"} == set(links)
    for words in ("Problem", "Files", "CSV"):
        assert server.http.get(links[words]).status_code == 200
    assert server.http.get(links["Problem"]).text == QUICK
    page.goto(links["Edit in the studio"])
    page.wait_for_function("window.optiplanStudio && optiplanStudio.editor.text().includes('name: free')")


@wide
def test_home_shows_what_others_submit_and_asks_before_it_deletes(page, server):
    page.goto(server.url)
    page.wait_for_selector(".run, .panel")
    run = server.ended(server.submit(seed=8)["id"])["id"]
    link = f"a[href='runs/{run}']"
    page.wait_for_selector(link)  # without a reload
    card = page.locator(".run", has=page.locator(link))
    asked = []
    page.once("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    card.locator("button:text('Delete')").click()
    assert "cannot be brought back" in asked[0]
    assert server.http.get(f"/api/runs/{run}").status_code == 200
    page.fill("#search", "no such run")
    page.wait_for_selector("#runs p:text('No run is like that')")
    page.fill("#search", "free quintic")
    page.wait_for_selector(link)
    page.once("dialog", lambda dialog: dialog.accept())
    card.locator("button:text('Delete')").click()
    page.wait_for_selector(link, state="detached")
    assert server.http.get(f"/api/runs/{run}").status_code == 404


@wide
def test_a_comparison_lasts_as_long_as_what_it_shows(page, server):
    names = ("quintic", "cubic", "septic")
    runs = [server.ended(server.submit(planner=name, seed=9)["id"]) for name in names]
    page.goto(f"{server.url}/compare?" + "&".join("run=" + run["id"] for run in runs))
    page.wait_for_selector("html[data-ready='1']")
    durations = [run["duration"] for run in runs]
    page.evaluate("optiplan.app.shown.fill(true); optiplan.app.update()")  # first shown are those that are verified
    assert page.evaluate("optiplan.duration") == pytest.approx(max(durations))
    longest = durations.index(max(durations))
    page.evaluate(
        "optiplan.app.select([0, 1, 2].find((k) => k !== arguments[0]))".replace("arguments[0]", str(longest))
    )
    page.evaluate(f"optiplan.app.shown[{longest}] = false; optiplan.app.update()")
    assert page.evaluate("optiplan.duration") == pytest.approx(sorted(durations)[-2])
    cells = "[...document.querySelectorAll('table.compare td.number')].map((one) => one.textContent)"
    page.evaluate("optiplan.app.dock.choose('table')")
    filled = [text for text in page.evaluate(cells) if text != "–"]
    assert len(filled) >= 8 * len(names)
    page.evaluate("optiplan.app.arrange('beside')")
    places = page.evaluate("optiplan.scene.runs.map((run) => run.figure.position.toArray())")
    shown = [places[k] for k in range(3) if k != longest]
    assert np.abs(np.subtract(*shown)).max() > 0.1
    assert page.evaluate("optiplan.scene.scenery.children.length") == 1  # the second has its obstacle, too


@wide
def test_any_page_is_drawn_leads_to_the_others_and_axe_finds_nothing_serious_light_or_dark(page, server):
    server.ended(server.submit(seed=10)["id"])
    page.add_init_script("undrawn = false")  # once on each page: a complaint of WebGL's is one of the page's
    pages = {"", "studio", "live", "execution", "benches"}
    for path in sorted(pages):
        page.goto(f"{server.url}/{path}")
        page.wait_for_selector("header nav a")
        found = page.eval_on_selector_all("header nav a", "links => links.map((link) => new URL(link.href).pathname)")
        assert {f"/{other}" for other in pages - {path}} <= set(found)
        if path == "studio":
            page.wait_for_selector("#issues .fine")
        page.wait_for_timeout(300)
        for theme in ("light", "dark"):
            page.evaluate("theme => { document.documentElement.dataset.theme = theme; }", theme)
            assert serious(page) == [], (path, theme)


@wide
def test_the_theme_is_kept(page, server):
    page.goto(f"{server.url}/benches")
    page.click("#theme")
    assert page.evaluate("getComputedStyle(document.documentElement).colorScheme") == "dark"
    page.goto(server.url)
    assert page.evaluate("getComputedStyle(document.documentElement).colorScheme") == "dark"
