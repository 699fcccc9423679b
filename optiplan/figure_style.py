"""How every figure of matplotlib looks, and how it becomes SVG: colours that the colour-blind can tell apart."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#868686")
"""Of Okabe and Ito without yellow, which cannot be seen on white, and grey for black, which cannot be seen on black."""
DASHES = ("", "5 2", "1.2 1.6", "6 2 1.2 2")
"""Lengths of dashes and gaps, in widths of the line, as SVG takes them."""
AXES = ("#d62728", "#2ca02c", "#1f5fd0")
"""Of x, y and z."""
LIMIT = "#b00020"
INK, LINE = "#1d2429", "#d5dade"
"""Text and grid; the page of a report puts its own colours in their place."""

WIDTH = 7.2
"""in: two columns of a paper."""

_STYLE: dict[str, Any] = {
    "text.parse_math": False,  # names of joints may hold any character
    "font.family": "sans-serif",
    "font.size": 8.5,
    "text.color": INK,
    "axes.edgecolor": LINE,
    "axes.labelcolor": INK,
    "axes.titlesize": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "svg.fonttype": "none",
    "svg.hashsalt": "optiplan",
    "pdf.fonttype": 42,  # letters stay letters
}


def line_of(k: int) -> tuple[str, str]:
    """Colour and dashes of the k-th curve; all colours in one style before the next."""
    return COLOURS[k % len(COLOURS)], DASHES[k // len(COLOURS) % len(DASHES)]


def line_style(k: int) -> dict[str, Any]:
    """The same as matplotlib takes it."""
    colour, dashes = line_of(k)
    return {"color": colour, "linestyle": (0, tuple(map(float, dashes.split()))) if dashes else "-"}


@contextmanager
def styled(**changes: Any) -> Iterator[None]:
    """Draw and save in our style; `changes` are to it, with `__` for a dot."""
    import matplotlib

    style: Any = _STYLE | {name.replace("__", "."): value for name, value in changes.items()}
    with matplotlib.rc_context(style):
        yield


def sheet(height: float, layout: Literal["constrained"] | None = "constrained", width: float = WIDTH) -> Any:
    """An empty figure of a height and width, in, that no window shows."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def undated(kind: str) -> dict[str, Any]:
    """Metadata of a file of this kind without its date, so that the same figure gives the same bytes."""
    return {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})


def svg_of(figure: Any, **options: Any) -> str:
    """The figure as the text of an SVG file; `options` as of `savefig`."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata=undated("svg") | {"Creator": None}, **options)
    return buffer.getvalue()


def element_of(figure: Any, **options: Any) -> str:
    """The figure as an `<svg>` element for a page, without the head of a file."""
    text = svg_of(figure, **options)
    return text[text.index("<svg") :]
