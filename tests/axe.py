"""Accessibility of a page, by axe-core."""

import json
from importlib import resources
from typing import Any

import pytest


def serious(page: Any) -> list[str]:
    """What axe finds serious or critical: rule, how often, where first. Skips the test where axe is not installed."""
    pytest.importorskip("axe_playwright_python", reason="axe-playwright-python is not installed")
    page.evaluate((resources.files("axe_playwright_python") / "axe.min.js").read_text("utf-8"))
    found = page.evaluate(
        "async () => JSON.stringify((await axe.run(document, { resultTypes: ['violations'] })).violations)"
    )
    return [
        f"{one['id']} ({one['impact']}): {len(one['nodes'])}, first {one['nodes'][0]['html'][:160]}"
        for one in json.loads(found)
        if one["impact"] in ("serious", "critical")
    ]
