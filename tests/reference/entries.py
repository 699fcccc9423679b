"""The source reports' numbers, as copied into the YAML files beside this one, and how a test compares with them."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.config.document import read_yaml

HERE = Path(__file__).parent
REPORTS = ("srra", "delbot", "lecture", "sclerp")


@dataclass(frozen=True)
class Entry:
    """One entry: recomputed `value` (numbers, and words that name things), its `tolerance`, and what is `printed`."""

    name: str
    tolerance: float
    value: Any
    printed: Any

    def __getitem__(self, key: Any) -> Any:
        return self.value[key]

    def check(self, found: Any, *path: Any, relative: bool = False) -> None:
        """Compare with the value at `path`; tolerance 0 means: equal in the 16 digits that the entry has."""
        expected = self.value
        for key in path:
            expected = expected[key]
        assert matches(found, expected, self.tolerance, relative), f"{self.name} {path}: {found} instead of {expected}"


def matches(found: Any, expected: Any, tolerance: float, relative: bool = False) -> bool:
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    assert found.shape == expected.shape, f"shape {found.shape} instead of {expected.shape}"
    if tolerance == 0.0:
        return [f"{x + 0.0:.16g}" for x in found.flat] == [f"{x + 0.0:.16g}" for x in expected.flat]
    bound = tolerance * (np.abs(expected) if relative else 1.0)
    return bool((np.abs(found - expected) <= bound).all())


@cache
def entries(report: str) -> dict[str, Entry]:
    items = read_yaml(HERE / f"{report}.yaml").data["entries"]
    return {
        item["id"]: Entry(item["id"], float(item["tolerance"]), item.get("value"), item.get("printed"))
        for item in items
    }


def entry(name: str) -> Entry:
    return entries(name.split(".")[0])[name]
