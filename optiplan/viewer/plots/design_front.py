"""The front of a design study: a figure for print, and a page with the figure and a table that show the same point."""

import html
import io
from itertools import combinations
from string import Template
from typing import Any

import numpy as np

from optiplan.figure_style import COLOURS, element_of, sheet, styled, undated
from optiplan.studies.result import DesignResult
from optiplan.studies.search import Design

_MOST = 10
"""Panels of a figure."""

_PAGE = Template(
    """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>$title</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem}
body{background:#fff;color:#1d2429}
svg{max-width:100%;height:auto}.wide{overflow-x:auto}table{border-collapse:collapse}
td,th{padding:.2rem .7rem;text-align:right;white-space:nowrap}td:last-child,th:last-child{text-align:left}
th button{all:unset;cursor:pointer;font-weight:600}th button:focus-visible{outline:2px solid}
tbody tr:hover,tbody tr.lit{background:#e69f0044}tr.role{font-weight:600}
g.lit use{transform-box:fill-box;transform-origin:center;transform:scale(2.6)}</style>
<h1>$title</h1>
<p>$summary</p>
$figure
<p>Grey: designs that meet what is required. Blue: the front. Square: the given design. Star: the compromise.
Point at a row to see its places in the figure; a heading sorts.</p>
<div class="wide"><table id="front"><thead><tr>$head</tr></thead><tbody>
$rows</tbody></table></div>
<h2>Designs that were planned with</h2>
<p>They have their bodies; every task is planned and verified.
Torque and tip-over margin are the worst along the motions.</p>
<div class="wide"><table>
<thead><tr><th>cycle time, s<th>torque, N·m<th>tip-over margin, m<th>verified<th>design</tr></thead>
<tbody>$proofs</tbody></table></div>
<script>
const table = document.getElementById("front"), body = table.tBodies[0];
for (const row of body.rows) {
  const marks = document.querySelectorAll(`[id^="$${row.dataset.design}-"]`);
  const light = (on) => marks.forEach((mark) => mark.classList.toggle("lit", on));
  row.onmouseenter = () => light(true); row.onmouseleave = () => light(false);
  marks.forEach((mark) => {
    mark.onmouseenter = () => { row.classList.add("lit"); light(true); };
    mark.onmouseleave = () => { row.classList.remove("lit"); light(false); };
  });
}
table.tHead.querySelectorAll("button").forEach((button, k) => {
  let sign = 1;
  button.onclick = () => {
    const value = (row) => row.cells[k].dataset.value ?? row.cells[k].textContent;
    const rows = [...body.rows].sort((a, b) => sign * (value(a) - value(b) || 0));
    body.append(...rows); sign = -sign;
  };
});
</script>
</html>
"""
)


def draw_front(result: DesignResult) -> Any:
    """Draw the front as matplotlib's `Figure`: a panel for each pair of objectives, or for each parameter."""
    units = dict(result.columns)
    names = [name for name, _ in result.wishes]
    pairs = list(combinations(names, 2)) or [(name, names[0]) for name in result.study.names]
    pairs = pairs[:_MOST]
    columns = min(len(pairs), 3 if len(pairs) != 4 else 2)
    lines = -(-len(pairs) // columns)
    figure = sheet((2.5 if len(pairs) > 1 else 3.6) * lines + 0.6)
    panels = np.atleast_1d(figure.subplots(lines, columns, squeeze=False)).ravel()
    for k, panel in enumerate(panels):
        if k >= len(pairs):
            panel.set_axis_off()
            continue
        _draw_pair(panel, result, pairs[k], k)
        x, y = pairs[k]
        panel.set(xlabel=_labelled(x, units.get(x, "")), ylabel=_labelled(y, units.get(y, "")))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _draw_pair(panel: Any, result: DesignResult, pair: tuple[str, str], k: int) -> None:
    """Draw two columns of all feasible designs, the front, the given design and the compromise."""
    feasible = [design for design in result.search.designs if design.violation == 0.0]
    panel.plot(*_points(result, feasible, pair).T, ".", color="0.75", ms=3, label="designs", zorder=1)
    for number, design in enumerate(result.front):
        (mark,) = panel.plot(*_points(result, [design], pair).T, "o", color=COLOURS[0], ms=4, zorder=2)
        mark.set_gid(f"d{number}-{k}")
        if number == 0:
            mark.set_label("front")
    (square,) = panel.plot(
        *_points(result, [result.given], pair).T, "s", mfc="none", mec="k", ms=7, label="given", zorder=3
    )
    square.set_gid(f"given-{k}")
    if result.compromise is not None:
        panel.plot(
            *_points(result, [result.compromise], pair).T, "*", color=COLOURS[1], ms=11, label="compromise", zorder=4
        )


def _points(result: DesignResult, designs: list[Design], pair: tuple[str, str]) -> Any:
    rows = [result.row(design) for design in designs]
    found = np.array([[row.get(name, np.nan) for name in pair] for row in rows]).reshape(-1, 2)
    return np.where(np.isfinite(found), found, np.nan)


def _labelled(name: str, unit: str) -> str:
    return name.replace("_", " ") + (f", {unit}" if unit not in ("", "1") else "")


def front_pdf(result: DesignResult) -> bytes:
    """Return the figure as PDF."""
    buffer = io.BytesIO()
    with styled():
        draw_front(result).savefig(buffer, format="pdf", metadata=undated("pdf"))
    return buffer.getvalue()


def design_page(result: DesignResult) -> str:
    """Return a page that needs no other file."""
    with styled():
        figure = element_of(draw_front(result))
    names = [name for name, _ in result.columns]
    roles = {id(proof.design): proof.role for proof in result.proofs}
    shown = [(f"d{k}", design) for k, design in enumerate(result.front)]
    if result.given not in result.front:
        shown.insert(0, ("given", result.given))
    rows = []
    for mark, design in shown:
        role, row = roles.get(id(design), ""), result.row(design)
        cells = "".join(
            f'<td data-value="{row[name]:.9g}">{row[name]:.4g}' if name in row else "<td>" for name in names
        )
        kind = ' class="role"' if role else ""
        rows.append(f'<tr data-design="{mark}"{kind}>{cells}<td>{html.escape(role)}</tr>')
    title = f"Design study {result.study.spec.name}"
    return _PAGE.substitute(
        title=html.escape(title),
        summary=html.escape(result.words),
        figure=figure,
        head="".join(f"<th><button>{html.escape(_labelled(*column))}</button>" for column in result.columns)
        + "<th>chosen as",
        rows="\n".join(rows),
        proofs=_proof_rows(result),
    )


def _proof_rows(result: DesignResult) -> str:
    rows = []
    for proof in result.proofs:
        seconds = "–" if proof.cycle_time is None else f"{proof.cycle_time:.3f}"
        worst = [f"{proof.along[name]:.4g}" if name in proof.along else "–" for name in ("torque", "tip_over")]
        verified = "yes" if proof.verified else "no"
        cells = "".join(f"<td>{cell}" for cell in (seconds, *worst, verified))
        words = proof.role + (f": {proof.trouble}" if proof.trouble else "")
        rows.append(f"<tr>{cells}<td>{html.escape(words)}</tr>")
    return "".join(rows)
