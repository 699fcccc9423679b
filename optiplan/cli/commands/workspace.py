"""`optiplan workspace`: where a robot's tool can be, how dexterous it is there, and how exact."""

import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from optiplan.cli.commands.studies import shown
from optiplan.cli.completion import robot_names
from optiplan.cli.options import AsJson, refuse
from optiplan.cli.output import plain_table, results, stdout_is_ours
from optiplan.cli.progress import ProgressLine


def _height(z: float | None) -> float | None:
    if z is not None and not math.isfinite(z):
        raise typer.BadParameter("expected a height in m")
    return z


Names = Annotated[
    list[str],
    typer.Argument(metavar="ROBOT…", help="bundled robots, or paths of robot.yaml", autocompletion=robot_names),
]
Count = Annotated[
    int | None, typer.Option(min=1, metavar="N", help="random configurations per robot (default: 200000)")
]
Grid = Annotated[
    int | None, typer.Option(min=2, metavar="K", help="instead of random ones: K values per joint, K^n configurations")
]
Group = Annotated[str | None, typer.Option(metavar="G", help="one of the robot's groups of joints")]
Frame = Annotated[str | None, typer.Option(metavar="F", help="frame (default: the robot's tool frame)")]
Apart = Annotated[bool, typer.Option("--collision/--no-collision", help="leave out configurations in self-collision")]
Floor = Annotated[
    float | None, typer.Option(callback=_height, metavar="Z", help="a floor at this height, m, not to be touched")
]
Accuracy = Annotated[bool, typer.Option("--accuracy", help="map what the joints' resolution means at the tool")]
Resolution = Annotated[
    str | None,
    typer.Option(
        metavar="R", help="of the joints: encoder bits per turn (17bit, the default), or a step in rad (1e-4)"
    ),
]
Voxels = Annotated[int, typer.Option(min=2, max=100, metavar="K", help="voxels in a radius of the reach")]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="write NPZ, PLY, a page and a picture there")]
Seed = Annotated[int | None, typer.Option(min=0, metavar="N", help="of the samples (default: 0)")]


def workspace(
    names: Names,
    samples: Count = None,
    grid: Grid = None,
    group: Group = None,
    frame: Frame = None,
    collision: Apart = True,
    floor: Floor = None,
    accuracy: Accuracy = False,
    resolution: Resolution = None,
    voxels: Voxels = 10,
    out: Out = None,
    seed: Seed = None,
    as_json: AsJson = False,
) -> int:
    """Sample where the tool can be, and compare robots.

    The reach sphere lies about the shoulder, where the first two axes meet; its radius is the largest reach without
    collisions. Covered is the share of its voxels in which a sample without collision lies: a lower bound. Rings say
    the same in cells of height and distance from the vertical, which few samples fill. Links are checked as their
    meshes, also where the robot's file says hull.

    [bold]Examples[/]

      optiplan workspace srra puma560 ur5 --out ws      and open ws/workspace.html

      optiplan workspace ur5 --accuracy --resolution 16bit

      optiplan workspace delbot --group arm --frame wrist_3 --grid 5 --no-collision

    Exit code: 0 done · 2 bad input.
    """
    from optiplan.api.workspaces import workspace as study
    from optiplan.runs.run_folder import check_folder
    from optiplan.viewer.workspaces.export import save_workspaces
    from optiplan.workspace.accuracy import DEFAULT_RESOLUTION
    from optiplan.workspace.sampling import WorkspaceOptions

    if not accuracy:
        refuse({"--resolution": resolution}, "goes with --accuracy")
    if not collision:
        refuse({"--floor": floor}, "does not go with --no-collision: no touch is looked for")
    if grid is not None:
        refuse({"--samples": samples, "--seed": seed}, "goes with random configurations, not with --grid")
    if out is not None:
        check_folder(out)
    wanted = (resolution or DEFAULT_RESOLUTION) if accuracy else None
    rows, found = [], []
    with stdout_is_ours(), ProgressLine() as progress:
        for name in names:
            began = time.perf_counter()
            progress(f"loading {name}", 0.0)
            one = study(
                name,
                samples=samples or WorkspaceOptions.samples,
                grid=grid,
                group=group,
                frame=frame,
                collision=collision,
                floor=floor,
                resolution=wanted,
                voxels=voxels,
                seed=seed or 0,
                progress=partial(progress, f"workspace of {name}"),
            )
            found.append(one)
            rows.append(_row(found[-1], time.perf_counter() - began))
    return shown({"robots": rows}, lambda: _show(rows, wanted), 0, as_json, out, partial(save_workspaces, found))


def _row(one: Any, seconds: float) -> dict[str, Any]:
    """Return the `--json` output of one robot; m, and shares from 0 to 1."""
    import numpy as np

    free = one.samples.free
    values = {name: value[free] for name, value in one.samples.values.items()}
    row: dict[str, Any] = {
        "robot": one.robot.name,
        "tool_frame": one.robot.tool_frame,
        "joint_names": list(one.robot.joint_names),
        "configurations": len(free),
        "free_fraction": one.free_fraction,
        "shoulder": one.reach.shoulder.tolist(),
        "reach": {"least": one.reach.least, "largest": one.reach.largest},
        "voxel_edge": one.voxels.edge,
        "voxels": len(one.voxels.counts),
        "coverage": one.voxels.coverage._asdict(),
        "coverage_rings": one.rings._asdict(),
        "orientation": one.voxels.orientation,
        "seconds": seconds,
    }
    for name, value in values.items():
        row[name] = {"mean": float(np.mean(value)), "largest": float(np.max(value))} if len(value) else None
    return row


def _show(rows: list[dict[str, Any]], resolution: str | None) -> None:
    table = plain_table(("",), [row["robot"] for row in rows])
    lines: list[tuple[str, Callable[[dict[str, Any]], str]]] = [
        ("configurations", lambda row: f"{row['configurations']:,}"),
        ("touching nothing", lambda row: f"{row['free_fraction']:.1%}"),
        ("reach from the shoulder, m", lambda row: f"{row['reach']['largest']:.4f}"),
        ("least distance, m", lambda row: f"{row['reach']['least']:.4f}"),
        ("covered, in voxels", lambda row: f"{row['coverage']['whole']:.1%}"),
        ("  upper half", lambda row: f"{row['coverage']['upper']:.1%}"),
        ("  lower half", lambda row: f"{row['coverage']['lower']:.1%}"),
        ("covered, in rings", lambda row: f"{row['coverage_rings']['whole']:.1%}"),
        ("  upper half", lambda row: f"{row['coverage_rings']['upper']:.1%}"),
        ("  lower half", lambda row: f"{row['coverage_rings']['lower']:.1%}"),
        ("directions in a reached voxel", lambda row: f"{row['orientation']:.1%}"),
        ("manipulability (reach = 1), mean", lambda row: _mean(row["yoshikawa"], 1.0)),
        ("inverse condition (reach = 1), mean", lambda row: _mean(row["asada"], 1.0)),
    ]
    if resolution is not None:
        lines.append((f"tool error bound at {resolution}, mean, mm", lambda row: _mean(row["error_worst"], 1e3)))
        lines.append((f"tool error at {resolution}, rms, mm", lambda row: _mean(row["error_rms"], 1e3)))
    lines.append(("seconds", lambda row: f"{row['seconds']:.1f}"))
    for heading, text in lines:
        table.add_row(heading, *(text(row) for row in rows))
    results().print(table, markup=False)


def _mean(value: dict[str, float] | None, factor: float) -> str:
    return "–" if value is None else f"{factor * value['mean']:.4g}"
