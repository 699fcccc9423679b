"""The frame of the pages, and what a browser sees where a page is refused."""

import pytest

from optiplan.service.pages.framing import LINKS, error_page, framed, wants_page
from optiplan.service.refusals import Refusal
from optiplan.service.settings import ServiceSettings
from tests.service.guard.test_gate import TOKEN, ask

BROWSER = {"Accept": "text/html,application/xhtml+xml"}


def test_a_page_leads_to_all_others():
    page = framed("OptiPlan studio", "studio", "<p>here</p>")
    assert "<title>Studio · OptiPlan</title>" in page
    for address in LINKS:
        assert (f'href="{address or "."}"' in page) == (address != "studio")


def test_a_refused_page_says_why_and_escapes():
    why = Refusal(404, "there is no run '<b>'", [{"line": 3, "field": "robot", "found": "<i>", "expected": "panda"}])
    page = error_page(why, "/runs/x")
    assert "404 · Not Found" in page
    assert "&lt;b&gt;" in page
    assert "line 3: robot: &lt;i&gt;; expected panda" in page
    assert 'href="../studio"' in page
    assert "token" not in page


@pytest.mark.parametrize(
    ("method", "path", "accept", "page"),
    [
        ("GET", "/runs/1", "text/html", True),
        ("GET", "/api/runs/1", "text/html", False),
        ("GET", "/pages/home.js", "text/html", False),
        ("GET", "/runs/1", "application/json", False),
        ("POST", "/runs/1", "text/html", False),
    ],
)
def test_who_reads_the_answer(method, path, accept, page):
    assert wants_page(method, path, accept) is page


def test_a_token_can_be_given_in_the_browser():
    settings = ServiceSettings(token=TOKEN)
    asked = ask(settings, path="/studio", headers=BROWSER)
    assert asked.status_code == 401
    assert 'name="token"' in asked.text
    assert "json" in ask(settings, path="/studio").headers["content-type"]  # for programs
    assert ask(settings, path="/pages/service.css").status_code == 200  # the form has its style
    assert ask(settings, path=f"/studio?token={TOKEN}", headers=BROWSER).status_code == 303


def test_errors_of_pages_are_pages(server):
    for path, words in (
        ("/runs/" + "0" * 32, "there is no run"),
        ("/nowhere", "there is no page"),
        ("/compare", "run"),
    ):
        answer = server.http.get(path, headers=BROWSER)
        assert answer.headers["content-type"].startswith("text/html")
        assert answer.status_code in (404, 422)
        assert words in answer.text
        assert server.http.get(path).json()["error"]
