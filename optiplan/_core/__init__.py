"""The native core: what planners compute most often, in C++, in a build for this processor.

Builds of the same sources differ in the instructions that they may use and in nothing else: all give the same bits.
An installation from source holds the one for its processor, a wheel holds three. `OPTIPLAN_CORE=none|base|avx2|avx512`
chooses one; without it, the widest that this processor runs is loaded. Where none was built, `variant` is "none",
`core` is None, and planners compute the same in Python.
"""

import os
import platform
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optiplan.errors import UnknownChoiceError

__path__.append(str(Path(__file__).parent / "in_place"))  # where `make core` puts the builds of a checkout

_NEEDS = {"avx512": {"avx2", "avx512f", "avx512dq", "avx512vl", "avx512bw"}, "avx2": {"avx2"}, "base": set[str]()}


def variants() -> tuple[str, ...]:
    """Builds of the core that are there and run on this processor, the widest first, and "none"."""
    built = [name for name in _NEEDS if find_spec(f"optiplan._core._core_{name}") is not None]
    flags = _processor_flags() if built and built != ["base"] else set()
    return (*(name for name in built if _NEEDS[name] <= flags), "none")


def _processor_flags() -> set[str]:
    """What the processor says it can, in Linux's words."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return set()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return set()
    return next((set(line.split(":", 1)[1].split()) for line in lines if line.startswith("flags")), set())


def _chosen() -> str:
    found, wanted = variants(), os.environ.get("OPTIPLAN_CORE")
    if wanted and wanted not in found:
        raise UnknownChoiceError("value of OPTIPLAN_CORE", wanted, found)
    return wanted or found[0]


variant: str = _chosen()
"""The build in use: "avx512", "avx2", "base" or "none"."""

if TYPE_CHECKING:
    from optiplan._core import _core_base as core
else:
    core: Any = None if variant == "none" else import_module(f"optiplan._core._core_{variant}")
