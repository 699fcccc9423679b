"""The map of base poses: the best score at each place of the floor, as a picture and in a page."""

import base64
import html
import io
from collections.abc import Sequence
from string import Template
from typing import Any

import numpy as np

from optiplan.figure_style import sheet, styled
from optiplan.planners.tours.placing import PlaceScores

_PAGE = Template(
    """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}
.scrolled{overflow-x:auto}img{max-width:100%}
td,th{padding:.2rem .8rem;text-align:right}pre{background:#8882;padding:.8rem;overflow:auto}</style>
<h1>$title</h1>
<p>$summary</p>
<img alt="Map of base poses" src="data:image/png;base64,$picture">
<div class="scrolled" tabindex="0" role="region" aria-label="Planned base poses"><table>
<thead><tr><th>base moved by x, m<th>y, m<th>z, m<th>yaw, rad<th>score, s<th>planned, s<th>verified</tr></thead>
$rows</table></div>
<p>In the problem file:</p>
<pre>$yaml</pre>
</html>
"""
)


def draw_map(scores: PlaceScores, title: str) -> bytes:
    """Return the map as PNG: for each x and y the best score over z and yaw, s; crosses where places are missing."""
    with styled(axes__grid=False):
        figure = sheet(6.4, width=7.2)
        panel = figure.subplots()
        best: dict[tuple[float, float], float] = {}
        for (x, y, *_), seconds in zip(np.round(scores.moved, 6), scores.seconds, strict=True):
            best[x, y] = min(best.get((x, y), np.inf), float(seconds))
        places, seconds = np.array(list(best)), np.array(list(best.values()))
        good = np.isfinite(seconds)
        panel.plot(*places[~good].T, "x", color="0.6", markersize=4, label="places missing")
        drawn = panel.scatter(*places[good].T, c=seconds[good], cmap="viridis_r", s=70, marker="s")
        if good.any():
            figure.colorbar(drawn, ax=panel, label="score, s")
        panel.plot(0.0, 0.0, "o", mfc="none", mec="k", ms=11, label="given")
        first = scores.moved[scores.ranked()[0]]
        panel.plot(*first[:2], "*", color="tab:red", ms=13, label="best score")
        panel.set(xlabel="base moved by x, m", ylabel="base moved by y, m", aspect="equal", title=title)
        panel.legend(loc="upper left", fontsize=8)
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=110, format="png")
    return buffer.getvalue()


def place_page(title: str, summary: str, picture: bytes, rows: Sequence[Sequence[Any]], yaml: str) -> str:
    """Return a page that needs no other file: the map, the planned base poses, and the best one as YAML."""
    cells = ["".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) for row in rows]
    return _PAGE.substitute(
        title=html.escape(title),
        summary=html.escape(summary),
        picture=base64.b64encode(picture).decode(),
        rows="".join(f"<tr>{row}</tr>" for row in cells),
        yaml=html.escape(yaml),
    )
