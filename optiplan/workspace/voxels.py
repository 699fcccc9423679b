"""The reach sphere cut into voxels: what was reached where, from how many directions, how dexterously."""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.records import dataclass
from optiplan.workspace.reach import Reach

DIRECTIONS = 32
"""Directions of the tool's z axis that are distinguished in a voxel."""


class Coverage(NamedTuple):
    """Fractions of the volume of the reach sphere, of its half above and its half below the shoulder, 0 to 1."""

    whole: float
    upper: float
    lower: float


@dataclass(frozen=True, eq=False)
class VoxelMap:
    """V voxels of edge `edge`, m: all whose centre lies in the reach sphere, reached or not.

    Attributes:
        centres: (V, 3) m, world.
        counts: (V,) samples in the voxel.
        directions: (V,) of `DIRECTIONS` directions of the tool's z axis, how many occurred.
        means, maxima: of every value mapped, (V,); NaN where nothing was reached.
    """

    edge: float
    centres: Array
    counts: Index
    directions: Index
    means: dict[str, Array]
    maxima: dict[str, Array]
    coverage: Coverage

    @property
    def orientation(self) -> float:
        """Mean over reached voxels of the share of directions that occurred, 0 to 1."""
        reached = self.counts > 0
        return float(self.directions[reached].mean() / DIRECTIONS) if reached.any() else 0.0


def sphere_directions(count: int = DIRECTIONS) -> Array:
    """Unit vectors (count, 3) spread evenly: z_k = 1 - (2k + 1)/count, longitude k pi (3 - sqrt 5), Fibonacci's."""
    k = np.arange(count)
    z = 1.0 - (2.0 * k + 1.0) / count
    longitude = k * np.pi * (3.0 - np.sqrt(5.0))
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(longitude), ring * np.sin(longitude), z], axis=1)


def voxelise(reach: Reach, per_radius: int, points: Array, axes: Array, values: dict[str, Array]) -> VoxelMap:
    """Sort N reached points (N, 3), m, with the tool's z axes (N, 3) and `values`, each (N,), into voxels.

    The cube around the sphere is cut into (2 per_radius)³ voxels.
    """
    side, edge = 2 * per_radius, reach.largest / per_radius
    line = (np.arange(side) - per_radius + 0.5) * edge
    centres = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = np.linalg.norm(centres, axis=1) <= reach.largest
    cell = np.clip(np.floor((points - reach.shoulder) / edge).astype(np.intp) + per_radius, 0, side - 1)
    flat = np.ravel_multi_index((cell[:, 0], cell[:, 1], cell[:, 2]), (side, side, side))
    counts = np.bincount(flat, minlength=side**3)
    seen = np.zeros((side**3, DIRECTIONS), dtype=bool)
    seen[flat, np.argmax(axes @ sphere_directions().T, axis=1)] = True
    means, maxima = {}, {}
    for name, value in values.items():
        total = np.bincount(flat, weights=value, minlength=side**3)
        means[name] = np.divide(total, counts, out=np.full(side**3, np.nan), where=counts > 0)[inside]
        highest = np.full(side**3, -np.inf)
        np.maximum.at(highest, flat, value)
        maxima[name] = np.where(counts > 0, highest, np.nan)[inside]
    hit, lower = counts[inside] > 0, centres[inside, 2] < 0.0
    coverage = Coverage(float(hit.mean()), float(hit[~lower].mean()), float(hit[lower].mean()))
    placed = centres[inside] + reach.shoulder
    return VoxelMap(edge, placed, counts[inside], seen[inside].sum(axis=1), means, maxima, coverage)


def ring_coverage(reach: Reach, points: Array, cell: float) -> Coverage:
    """Coverage counted in rings about the vertical through the shoulder: cells of edge `cell`, m, in (rho, z).

    A ring counts as reached when a point (N, 3) lies in it, weighted by its volume 2 pi rho cell². It needs far fewer
    samples than voxels, and says the same for an arm whose vertical first axis turns all the way round.
    """
    size = int(np.ceil(reach.largest / cell))
    away = points - reach.shoulder
    rho, z = np.linalg.norm(away[:, :2], axis=1), away[:, 2]
    reached = np.zeros((size, 2 * size), dtype=bool)
    row, column = np.floor(rho / cell).astype(np.intp), np.floor(z / cell).astype(np.intp) + size
    reached[np.clip(row, 0, size - 1), np.clip(column, 0, 2 * size - 1)] = True
    radius = (np.arange(size) + 0.5)[:, None] * cell
    height = (np.arange(2 * size) - size + 0.5)[None] * cell
    weight = np.where(np.hypot(radius, height) <= reach.largest, radius, 0.0)
    share = [float((weight * reached)[:, part].sum() / weight[:, part].sum()) for part in _halves(size)]
    return Coverage(*share)


def _halves(size: int) -> tuple[slice, slice, slice]:
    return slice(None), slice(size, None), slice(None, size)
