"""A mesh that its hull does not tell much of."""

import numpy as np


def horseshoe() -> tuple[np.ndarray, np.ndarray]:
    """A tube bent to half a circle, radius 0.3 m: its hull fills what is between its ends."""
    rings, corners = 24, 8
    a, b = np.meshgrid(np.linspace(0.0, np.pi, rings), np.arange(corners) * 2 * np.pi / corners, indexing="ij")
    radius = 0.3 + 0.03 * np.cos(b)
    points = np.stack([radius * np.cos(a), radius * np.sin(a), 0.03 * np.sin(b)], axis=2).reshape(-1, 3)
    index = np.arange(rings * corners).reshape(rings, corners)
    p, q = index[:-1], index[1:]
    p2, q2 = np.roll(p, -1, axis=1), np.roll(q, -1, axis=1)
    sides = np.concatenate([np.stack([p, q, q2], axis=2).reshape(-1, 3), np.stack([p, q2, p2], axis=2).reshape(-1, 3)])
    caps = [(ring[0], ring[k], ring[k + 1]) for ring in (index[0][::-1], index[-1]) for k in range(1, corners - 1)]
    return points, np.concatenate([sides, np.array(caps)])
