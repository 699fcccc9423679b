"""Workspaces as files: points for other programs (NPZ, PLY), a page to turn them in, and a section as a picture."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.figure_style import sheet, styled
from optiplan.files import replacing
from optiplan.viewer.workspaces.page import render_workspaces
from optiplan.viewer.workspaces.values import LABELS, caption, mapped_values
from optiplan.workspace.sampling import Workspace
from optiplan.workspace.voxels import DIRECTIONS


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
    rows = ("yoshikawa", "directions")
    most = {"directions": float(DIRECTIONS)}
    most["yoshikawa"] = max(float(mapped_values(one)["yoshikawa"].max()) for one in found)
    with styled(axes__grid=False):
        figure = sheet(8.2, width=4.3 * len(found))
        panels = figure.subplots(len(rows), len(found), squeeze=False)
        for row, name in enumerate(rows):
            for column, one in enumerate(found):
                drawn = _section(panels[row, column], one, mapped_values(one)[name], most[name])
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
