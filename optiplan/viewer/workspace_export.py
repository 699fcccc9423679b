"""Workspaces as files: points for other programs (NPZ, PLY), a page to turn them in, and a section as a picture."""

import html
import json
import re
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.files import replacing
from optiplan.viewer.surfaces import packed
from optiplan.workspace.sampling import Workspace
from optiplan.workspace.voxels import DIRECTIONS

LABELS = {
    "yoshikawa": "manipulability (reach = 1), mean",
    "yoshikawa_max": "manipulability (reach = 1), best",
    "asada": "inverse condition number (reach = 1), mean",
    "directions": f"tool directions reached, of {DIRECTIONS}",
    "error_worst": "tool error bound, mm, largest",
    "error_rms": "tool error, rms, mm, mean",
}


def save_workspaces(found: Sequence[Workspace], folder: Path) -> list[Path]:
    """Write `NAME.npz` and `NAME.ply` of each robot, and `workspace.html` and `workspace.png` of all together."""
    writers: list[tuple[str, Callable[[Path], object]]] = []
    for stem, one in zip(_stems(found), found, strict=True):
        writers += [(f"{stem}.npz", _npz(one)), (f"{stem}.ply", _ply(one))]
    page = render_workspaces(found)
    writers += [("workspace.html", lambda path: path.write_text(page, encoding="utf-8"))]
    writers += [("workspace.png", lambda path: draw_section(found, path))]
    for name, write in writers:
        with replacing(folder / name) as temporary:
            write(temporary)
    return [folder / name for name, _ in writers]


def _stems(found: Sequence[Workspace]) -> list[str]:
    """A file name for each robot, numbered where two have the same name."""
    names = [re.sub(r"[^\w.-]", "_", one.robot.name) for one in found]
    return [name if names.count(name) == 1 else f"{name}-{names[: k + 1].count(name)}" for k, name in enumerate(names)]


def mapped_values(one: Workspace) -> dict[str, Array]:
    """Values of every voxel by the keys of `LABELS`, (V,); -1 where nothing was reached. Errors in mm."""
    voxels = one.voxels
    values = {"yoshikawa": voxels.means["yoshikawa"], "yoshikawa_max": voxels.maxima["yoshikawa"]}
    values |= {"asada": voxels.means["asada"], "directions": voxels.directions.astype(np.float64)}
    if "error_worst" in voxels.means:
        values |= {"error_worst": 1e3 * voxels.maxima["error_worst"], "error_rms": 1e3 * voxels.means["error_rms"]}
    return {name: np.where(voxels.counts > 0, value, -1.0) for name, value in values.items()}


def render_workspaces(found: Sequence[Workspace]) -> str:
    """One page that shows all robots side by side, every reach sphere as large; nothing is loaded from elsewhere."""
    own = resources.files("optiplan.viewer")
    names = ", ".join(one.robot.name for one in found)
    data = {
        "labels": LABELS,
        "robots": [_panel(one) for one in found],
    }
    return Template((own / "workspace.html").read_text("utf-8")).substitute(
        title=html.escape(f"Workspace of {names}"),
        data=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
        script=(own / "workspace.js").read_text("utf-8"),
    )


def caption(one: Workspace) -> str:
    """Return the result in a line."""
    c = one.voxels.coverage
    return (
        f"{one.robot.name}: reach {one.reach.largest:.3f} m, sphere covered {c.whole:.1%}, "
        f"upper half {c.upper:.1%}, lower half {c.lower:.1%}"
    )


def _panel(one: Workspace) -> dict[str, Any]:
    return {
        "caption": caption(one),
        "radius": one.reach.largest,
        "edge": one.voxels.edge,
        "points": packed(one.voxels.centres - one.reach.shoulder),
        "values": {name: packed(value) for name, value in mapped_values(one).items()},
    }


def _npz(one: Workspace) -> Callable[[Path], object]:
    voxels, samples = one.voxels, one.samples
    arrays: dict[str, Any] = {f"voxel_{name}": value for name, value in mapped_values(one).items()}
    arrays |= {f"sample_{name}": value for name, value in samples.values.items()}

    def write(path: Path) -> None:
        np.savez_compressed(
            path,
            voxel_centres=voxels.centres,
            voxel_edge=np.array(voxels.edge),
            voxel_counts=voxels.counts,
            shoulder=one.reach.shoulder,
            reach=np.array([one.reach.least, one.reach.largest]),
            sample_q=samples.q,
            sample_position=samples.position,
            sample_axis=samples.axis,
            sample_free=samples.free,
            **arrays,
        )

    return write


def _ply(one: Workspace) -> Callable[[Path], object]:
    """Centres of the reached voxels, coloured by mean manipulability; binary, one record a point."""
    values = {name: value[one.voxels.counts > 0] for name, value in mapped_values(one).items()}
    fields: list[tuple[str, str]] = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
    fields += [("red", "u1"), ("green", "u1"), ("blue", "u1"), *((name, "<f4") for name in values)]
    records = np.zeros(len(values["yoshikawa"]), dtype=fields)
    for axis, column in zip("xyz", one.voxels.centres[one.voxels.counts > 0].T, strict=True):
        records[axis] = column
    share = values["yoshikawa"] / max(float(values["yoshikawa"].max(initial=0.0)), 1e-12)
    records["red"], records["green"], records["blue"] = 255 * share, 80 + 140 * share, 255 * (1.0 - share)
    for name, value in values.items():
        records[name] = value
    words = {"<f4": "float", "u1": "uchar"}
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(records)}"]
    lines += [f"property {words[kind]} {name}" for name, kind in fields]
    head = "\n".join([*lines, "end_header", ""])
    return lambda path: path.write_bytes(head.encode() + records.tobytes())


def draw_section(found: Sequence[Workspace], path: Path) -> None:
    """Draw the vertical section through the shoulder of each robot: manipulability, above, and directions, below."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = ("yoshikawa", "directions")
    figure = Figure(figsize=(4.3 * len(found), 8.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(rows), len(found), squeeze=False)
    for row, name in enumerate(rows):
        top = float(DIRECTIONS) if name == "directions" else max(float(mapped_values(one)[name].max()) for one in found)
        for column, one in enumerate(found):
            drawn = _section(panels[row, column], one, mapped_values(one)[name], top)
        figure.colorbar(drawn, ax=list(panels[row]), label=LABELS[name], shrink=0.85)
    figure.savefig(path, dpi=110, format="png")


def _section(panel: Any, one: Workspace, value: Array, top: float) -> Any:
    """Voxels of the slice y in [0, edge) from the shoulder; white inside the circle is what was not reached."""
    away = (one.voxels.centres - one.reach.shoulder) / one.voxels.edge
    slab = (away[:, 1] > 0.0) & (away[:, 1] < 1.0)
    side = 2 * one.options.voxels
    image = np.full((side, side), np.nan)
    row, column = (np.floor(away[slab, k]).astype(int) + side // 2 for k in (2, 0))
    image[row, column] = np.where(value[slab] < 0.0, np.nan, value[slab])
    R, s = one.reach.largest, one.reach.shoulder
    extent = (s[0] - R, s[0] + R, s[2] - R, s[2] + R)
    drawn = panel.imshow(image, origin="lower", extent=extent, vmin=0.0, vmax=top, cmap="viridis")
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    panel.plot(s[0] + R * np.cos(angle), s[2] + R * np.sin(angle), color="0.4", linewidth=1.0)
    panel.axhline(s[2], color="0.4", linewidth=0.8, linestyle="--")
    panel.set_title(caption(one).replace(", upper", ",\nupper"), fontsize=9)
    panel.set(xlabel="x, m", ylabel="z, m", aspect="equal")
    return drawn
