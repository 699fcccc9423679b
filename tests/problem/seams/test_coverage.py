"""Coverage of a patch: every place of it is near the path, the axes point into it, and what cannot be covered."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from optiplan.problem.seams.coverage import CoverSpec, cover

SPACING = 0.02


@pytest.fixture(scope="module")
def cap(tmp_path_factory):
    """A part of a sphere of 0.4 m about the origin, seen from above, and a flat ring."""
    folder = tmp_path_factory.mktemp("meshes")
    ball = trimesh.creation.icosphere(4, radius=0.4)
    trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 2] > 0.36]).export(folder / "cap.stl")
    trimesh.creation.annulus(0.05, 0.1, 0.01).export(folder / "ring.stl")
    return folder


@pytest.mark.parametrize("pattern", ["raster", "spiral"])
def test_a_patch_is_covered(cap, pattern):
    points, inward = cover(CoverSpec(mesh="cap.stl", spacing=SPACING, pattern=pattern), cap)
    radius = np.linalg.norm(points, axis=1)
    assert np.abs(radius - 0.4).max() < 2e-3
    assert np.abs(inward + points / radius[:, None]).max() < 0.08  # facets at the edge have no neighbours outside
    reach = np.linalg.norm(points[:, :2], axis=1).max()
    rng = np.random.default_rng(0)
    places = rng.uniform(-reach, reach, (2000, 2))
    edge = (0.5 if pattern == "spiral" else 1.0) * SPACING  # lines end before the edge, each on its own
    inside = places[np.linalg.norm(places, axis=1) < reach - edge]
    dense = np.concatenate([np.linspace(a, b, 5) for a, b in pairwise(points)])[:, :2]
    far = np.array([np.linalg.norm(dense - one, axis=1).min() for one in inside])
    assert far.max() < 0.75 * SPACING
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 2.0 * SPACING


def test_lines_lead_along_a_direction_and_keep_a_margin(cap):
    spec = CoverSpec(mesh="cap.stl", spacing=2 * SPACING, along=(0.0, 1.0, 0.0), margin=0.03)
    points, _ = cover(spec, cap)
    steps = np.diff(points, axis=0)
    assert (np.abs(steps[:, 1]) > np.abs(steps[:, 0])).mean() > 0.7
    assert np.linalg.norm(points[:, :2], axis=1).max() < 0.4 * np.sin(np.arccos(0.9)) - 0.03 + SPACING


def test_a_pose_and_a_scale_move_the_patch(cap):
    plain, _ = cover(CoverSpec(mesh="cap.stl", spacing=SPACING), cap)
    spec = CoverSpec(mesh="cap.stl", spacing=2 * SPACING, scale=2.0, pose={"position": (0.1, 0, 0)})
    assert np.allclose(cover(spec, cap)[0], 2.0 * plain + [0.1, 0, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"mesh": "ring.stl"}, "enters it again"),
        ({"mesh": "ring.stl", "pattern": "spiral"}, "middle of the patch"),
        ({"mesh": "cap.stl", "toward": (0.0, 0.0, 1.0)}, "faces the viewer"),
        ({"mesh": "cap.stl", "spacing": 1e-5}, "lines of 1e-05 m"),
        ({"mesh": "cap.stl", "margin": 0.5}, "margin"),
        ({"mesh": "cap.stl", "along": (0.0, 0.0, 1.0)}, "direction of view"),
    ],
)
def test_what_cannot_be_covered_is_refused(cap, keys, words):
    with pytest.raises(ValueError, match=words):
        cover(CoverSpec(**({"spacing": SPACING} | keys)), cap)
