"""How figures look: sizes, colours that the colour-blind can tell apart, a sheet without a window."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c6d31")
"""Of Okabe and Ito, its yellow replaced, which cannot be seen on white."""
DASHES = ("-", "--", ":", "-.")
AXES = ("#d62728", "#2ca02c", "#1f5fd0")
"""Of x, y and z."""
LIMIT = "#b00020"

WIDTH = 7.2
"""in: two columns of a paper."""

_STYLE: dict[str, Any] = {
    "text.parse_math": False,  # names of joints may hold any character
    "font.family": "sans-serif",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#dfe3e6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "svg.fonttype": "none",
    "svg.hashsalt": "optiplan",
    "pdf.fonttype": 42,  # letters stay letters
}


def line_style(k: int) -> dict[str, Any]:
    """Colour and dashes of the k-th joint or run; all colours in one style before the next."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k // len(COLOURS) % len(DASHES)]}


@contextmanager
def styled() -> Iterator[None]:
    """Draw and save in our style."""
    import matplotlib

    style: Any = _STYLE
    with matplotlib.rc_context(style):
        yield


def sheet(height: float) -> Any:
    """An empty figure of a height, in, that no window shows."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
