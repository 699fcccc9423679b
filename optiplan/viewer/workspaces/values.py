"""What is shown of a workspace: numbers of every voxel with their labels, and the result in a line."""

import numpy as np

from optiplan.arrays import Array
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
"""Values of a voxel, by key, in words."""


def mapped_values(one: Workspace) -> dict[str, Array]:
    """Values of every voxel by the keys of `LABELS`, (V,); -1 where nothing was reached. Errors in mm."""
    voxels = one.voxels
    values = {"yoshikawa": voxels.means["yoshikawa"], "yoshikawa_max": voxels.maxima["yoshikawa"]}
    values |= {"asada": voxels.means["asada"], "directions": voxels.directions.astype(np.float64)}
    if "error_worst" in voxels.means:
        values |= {"error_worst": 1e3 * voxels.maxima["error_worst"], "error_rms": 1e3 * voxels.means["error_rms"]}
    return {name: np.where(voxels.counts > 0, value, -1.0) for name, value in values.items()}


def caption(one: Workspace) -> str:
    """Return the result in a line."""
    c = one.voxels.coverage
    return (
        f"{one.robot.name}: reach {one.reach.largest:.3f} m, sphere covered {c.whole:.1%}, "
        f"upper half {c.upper:.1%}, lower half {c.lower:.1%}"
    )
