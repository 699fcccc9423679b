"""The report in a real browser, from a file and served: it must look right, sort, open scenes, and never complain."""

import threading

import pytest

from optiplan.bench.report.analysis import analyse
from optiplan.bench.report.page import write_page
from optiplan.bench.report.server import ReportServer
from optiplan.bench.results.database import Store
from tests.axe import serious
from tests.viewer.browsing import UNDRAWN

TABLE = "#planners .view:first-child .scroll:first-of-type"
WITNESS = {"q": [0.1, 0.2], "points": [[0.1, 0.2, 0.3], [0.2, 0.2, 0.3]], "pair": ["arm", "ball"]}
OVERLAPS = """() => [...document.querySelectorAll(":is(.view:not([hidden]), #measures) figure svg")].map((svg) => {
  const boxes = Array.from(svg.querySelectorAll("text")).map((t) => t.getBoundingClientRect());
  let found = 0;
  boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => {
    const w = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const h = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (w > 2 && h > 3 && a.width > 0 && b.width > 0) found += 1;
  }));
  return found;
})"""
"""Of each figure that is shown, how many of its words lie over each other."""
pytestmark = [pytest.mark.timeout(240)]


@pytest.fixture
def visit(browser):
    """Open an address; at the end, any complaint of a page, or a request elsewhere, fails the test."""
    complaints = []
    size = {"width": 1400, "height": 900}
    context = browser.new_context(viewport=size, device_scale_factor=0.25)  # a sixteenth of the pixels
    context.add_init_script(UNDRAWN)
    context.set_default_timeout(100_000)

    def heard(message):
        if message.type in ("error", "warning") and "GPU stall due to ReadPixels" not in message.text:
            complaints.append(f"{message.type}: {message.text}")

    def asked(request):
        if not request.url.startswith(("file:", "data:", "http://127.0.0.1:")):
            complaints.append(request.url)

    context.on("console", heard)
    context.on("weberror", lambda error: complaints.append(str(error.error)))
    context.on("request", asked)

    def open_page(url):
        page = context.new_page()
        page.goto(url)
        return page

    yield open_page
    context.close()
    assert complaints == []


def some_runs(problems, planners):
    """The k-th planner fails on the first k // 2 problems. No two planners differ by the same on two problems.

    So each comparison has an exact test, which takes a hundredth of the time of one with ties.
    """
    runs = {}
    for p in range(problems):
        for k in range(planners):
            good, grows = p >= k // 2, 1.0 + 0.07 * p
            times = (0.5 + 0.05 * k * grows + 0.1 * p, 1.0 + 0.01 * ((7 * k) % 20) * grows)
            failed = ("collision", f"'arm' meets 'ball' at {p} s", WITNESS) if p % 2 else ("budget", "no path")
            runs[f"set{p % 3}/{p}", f"planner-{k:02d}", 0] = times if good else failed
    return runs


@pytest.fixture(scope="module")
def folder(write_results, tmp_path_factory):
    """Results of 20 planners on 12 problems, and their page."""
    folder = write_results(tmp_path_factory.mktemp("report") / "out", some_runs(12, 20))
    with Store(folder) as store:
        write_page(store, analyse(store), pages=1)
    return folder


@pytest.fixture
def page(folder, visit):
    return visit((folder / "report.html").as_uri())


def column(page, number):
    return page.locator(f"{TABLE} tbody td:nth-child({number})").all_text_contents()


def test_tables_are_sorted_by_a_click(page):
    labels = column(page, 1)
    assert labels == [f"planner-{k:02d}" for k in range(20)]
    page.locator(f"{TABLE} th button").nth(1).click()  # share of verified runs: the largest first
    shares = [float(text.split("%")[0]) for text in column(page, 2)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > shares[-1]
    page.locator(f"{TABLE} th button").nth(1).click()
    assert column(page, 1)[0] in ("planner-18", "planner-19")
    page.locator(f"{TABLE} th button").nth(0).click()
    assert column(page, 1) == labels


def test_nothing_overlaps_or_runs_out_of_the_page(page):
    assert page.evaluate("document.documentElement.scrollWidth") <= 1400
    overlaps = []
    for name in ("set0", "set1", "set2", ""):
        page.select_option("#set", name)
        page.locator(".view:visible figure svg").first.wait_for()
        overlaps += page.evaluate(OVERLAPS)
    assert not any(overlaps)
    assert len(overlaps) >= 20
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    small = page.evaluate(
        "() => [...document.querySelectorAll('nav a, .chosen')].filter((e) => e.offsetHeight < 40).length"
    )
    assert small == 0


def test_a_planner_is_singled_out(page):
    page.locator(f"{TABLE} .planner").nth(3).hover()
    lines = page.locator('.view:not([hidden]) figure svg [id$="-planner3"]')
    assert lines.count() > 3  # success within a time, two profiles, boxes
    assert page.evaluate("document.body.classList.contains('single')")
    other = page.locator('figure svg [id$="-planner4"]').first
    assert (
        float(
            other.evaluate(
                "async (e) => { await new Promise(r => setTimeout(r, 300)); return getComputedStyle(e).opacity }"
            )
        )
        < 0.5
    )
    assert lines.first.evaluate("e => getComputedStyle(e).opacity") == "1"


def test_sets_and_planners_are_filtered(page):
    """A set shows its own numbers and problems; a planner that is unticked is nowhere."""
    assert page.locator(".view:visible").count() == 1
    page.select_option("#set", "set1")
    assert page.locator(".view:visible h2").first.text_content() == "Planners of set set1"
    names = page.locator("#matrix tbody tr:visible").evaluate_all("rows => rows.map(row => row.dataset.problem)")
    assert names == [f"set1/{k}" for k in (1, 4, 7, 10)]
    assert page.locator("#problems details:visible").count() == 4
    before = page.locator(".view:visible .scroll").first.locator("tbody tr:visible").count()
    page.locator("[data-show='2']").uncheck()
    assert page.locator(".view:visible .scroll").first.locator("tbody tr:visible").count() == before - 1
    assert page.locator("#matrix [data-column='2']:visible").count() == 0
    assert page.locator("figure svg [id$='-planner2']:visible").count() == 0
    page.locator("[data-show='2']").check()
    page.select_option("#set", "")
    assert page.locator("#matrix tbody tr:visible").count() == 12


def test_packed_parts_are_unpacked_once_and_obey_the_filters(page):
    page.locator("[data-show='2']").uncheck()
    problem = page.locator("#problems details").nth(3)
    assert problem.locator("table").count() == 0
    for _ in range(3):
        problem.locator("summary").click()
    problem.locator("table").wait_for()
    assert problem.locator("table").count() == 1
    assert problem.locator("tbody tr:visible").count() == 19
    problem.locator("th button").first.click()
    problem.locator("th button").first.click()
    assert problem.locator("tbody td:first-child:visible").first.text_content() == "planner-19"
    assert problem.locator("a[download]").count() == 2


def test_ticked_runs_are_compared_and_tips_are_reached_by_keys(page):
    row = page.locator("#matrix tbody tr").first
    for k in (0, 2):
        row.locator(".pick").nth(k).check()
    opened = page.locator("#compare-open")
    assert opened.text_content() == "compare these 2 on set0/0"
    assert opened.get_attribute("href").endswith(".html#runs=planner-00,planner-02")
    command = page.locator("#compare code").text_content()
    assert command.endswith(" set0/0 planner-00,planner-02 0 0")
    page.locator("#matrix tbody tr").nth(1).locator(".pick").first.check()  # of one problem at a time
    assert page.locator(".pick:checked").count() == 1
    assert page.locator("#compare-open").is_hidden()  # no page beside the file: the command alone
    page.locator("#compare-clear").click()
    assert page.locator("#compare").is_hidden()
    page.mouse.move(0, 0)  # what lies under the mouse now that the bar is gone shows its tip too
    row.locator(".open").first.focus()
    assert page.locator("#tip").text_content().startswith("planner-00 on set0/0\nmotion 1.000 s")
    page.keyboard.press("Escape")
    assert page.locator("#tip").is_hidden()
    row.locator("th a").click()
    page.wait_for_url("**/report-scenes/*.html*", timeout=90_000)  # the page adds what it shows to its address
    page.get_by_role("link", name="report").click()  # and back
    page.wait_for_url("**/report.html#matrix", timeout=90_000)


def test_nothing_serious_for_axe(visit, write_results, tmp_path):
    """On a page with all of its parts and few rows, light and dark."""
    runs = {("s/a", "one", 0): (1.0, 2.0), ("t/b", "one", 0): (1.0, 3.0), ("s/a", "two", 0): (2.0, 1.5)}
    runs["t/b", "two", 0] = ("collision", "'arm' meets 'ball' at 1 s", WITNESS)
    with Store(write_results(tmp_path / "out", runs)) as store:
        page = visit(write_page(store, analyse(store), pages=0).as_uri())
    page.locator(".pick").first.check()
    for details in page.locator("details").all():
        details.evaluate("e => { e.open = true; }")
    assert serious(page) == []
    page.locator("#theme").click()
    assert serious(page) == []


def test_light_and_dark_are_readable(page):
    contrasts = []
    for _ in range(2):
        contrasts.append(
            page.evaluate(
                """() => {
                  const light = (css) => {
                    const [r, g, b] = css.match(/[0-9.]+/g).map((v) => v / 255).map(
                      (v) => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
                    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
                  };
                  const card = document.querySelector(".card"), text = document.querySelector(".card h3");
                  const [a, b] = [light(getComputedStyle(card).backgroundColor), light(getComputedStyle(text).color)];
                  return [a, (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05)];
                }"""
            )
        )
        page.locator("#theme").click()
    assert contrasts[0][0] > 0.9
    assert contrasts[1][0] < 0.1
    assert min(contrast for _, contrast in contrasts) > 4.5


def test_a_failure_opens_scene_and_witness_from_the_file(page):
    reason = page.locator(".reason", has_text="collision").first
    reason.locator("summary").click()
    assert "optiplan bench show" in reason.locator("code").first.text_content()
    reason.locator("a").first.click()
    page.wait_for_url("**/report-scenes/*.html*", timeout=90_000)  # the page adds what it shows to its address
    assert page.locator(".problem").first.text_content().startswith("collision: 'arm' meets 'ball'")
    assert page.evaluate("optiplan.scene.runs[0].witness.visible")


def test_served_every_listed_failure_is_a_link(write_results, tmp_path, visit):
    folder = write_results(tmp_path / "out", some_runs(6, 8))  # a page that is served is made for each request
    with ReportServer(folder, port=0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = visit(server.url)
        assert page.locator(".reason li").count() == page.locator(".reason li a").count() > 2
        page.goto(server.url + page.locator(".reason li a").last.get_attribute("href"))
        assert page.locator(".problem").count() == 1
        page.goto(f"{server.url}show?problem=%3Cb%3E&planner=x&seed=0&repetition=0")
        assert "unknown problem '<b>'" in page.locator("pre").text_content()
        assert server.answer("/show?problem=a") is None
        address = page.request.get(server.url).text().split('th scope=row><a href="')[1].split('"')[0]
        assert server.answer(f"/{address}").decode().count('"label":"planner-') == 8
        assert server.answer("/compare?problem=a") is None
        assert server.answer("/elsewhere") is None
        server.shutdown()
