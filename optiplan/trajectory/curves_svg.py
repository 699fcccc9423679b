"""The joints of a motion as curves over time, in SVG that needs nothing else."""

from collections.abc import Sequence
from html import escape

from optiplan.arrays import Array

_WIDTH, _HEIGHT, _MARGIN, _KEY = 560, 200, 34, 150  # of the picture, px
_COLOURS = (
    "#1f77b4",
    "#ff7f0e",
    "#2ca02c",
    "#d62728",
    "#9467bd",
    "#8c564b",
    "#e377c2",
    "#7f7f7f",
    "#bcbd22",
    "#17becf",
)


def joint_curves(t: Array, Q: Array, joint_names: Sequence[str]) -> str:
    """Positions Q (k, n), rad or m, over times t (k,), s, with a key of the joints' names: an `<svg>` element."""
    low, high = float(Q.min()), float(Q.max())
    span = high - low or 1.0
    x = _MARGIN + t / t[-1] * (_WIDTH - _MARGIN - _KEY)
    Y = _HEIGHT - _MARGIN - (Q - low) / span * (_HEIGHT - 1.5 * _MARGIN)
    right, bottom, top = _WIDTH - _KEY, _HEIGHT - _MARGIN, 0.5 * _MARGIN
    parts = [f'<path d="M{_MARGIN} {top}V{bottom}H{right}" fill="none" stroke="#888"/>']
    parts += [_text(_MARGIN - 4, top + 4, f"{high:.3g}", "end"), _text(_MARGIN - 4, bottom, f"{low:.3g}", "end")]
    parts += [_text(right, bottom + 16, f"{t[-1]:.3g} s", "end"), _text(_MARGIN, bottom + 16, "0")]
    for j, name in enumerate(joint_names):
        colour = _COLOURS[j % len(_COLOURS)]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, Y[:, j], strict=True))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        parts.append(_text(right + 12, top + 4 + 14 * j, name, fill=colour))
    height = max(_HEIGHT, int(top + 14 * len(joint_names) + 8))
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{height}" role="img">'
    return f"{head}<title>joint positions over time</title>{''.join(parts)}</svg>"


def _text(x: float, y: float, words: str, anchor: str = "start", fill: str = "#666") -> str:
    style = f'font-size="11" font-family="sans-serif" text-anchor="{anchor}" fill="{fill}"'
    return f'<text x="{x:.0f}" y="{y:.0f}" {style}>{escape(words)}</text>'
