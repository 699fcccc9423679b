"""Pictures drawn without a browser: what is nearer hides what is behind, and points lie where they are drawn."""

import io

import numpy as np
import pinocchio as pin
from PIL import Image

from optiplan.geometry.scene import Box, Capsule, Cylinder, Sphere
from optiplan.geometry.shapes import build_geometry
from optiplan.viewer.surfaces import body_triangles
from optiplan.viewer.thumbnail import HEIGHT, WIDTH, _drawn, thumbnail


def test_triangles_are_as_large_as_the_bodies():
    for shape, size in (
        (Box((0.1, 0.2, 0.3)), (0.1, 0.2, 0.3)),
        (Sphere(0.1), (0.2, 0.2, 0.2)),
        (Cylinder(0.1, 0.4), (0.2, 0.2, 0.4)),
        (Capsule(0.1, 0.4), (0.2, 0.2, 0.6)),
    ):
        surface = body_triangles(build_geometry(shape))
        np.testing.assert_allclose(np.ptp(surface.vertices, axis=0), size, rtol=0.02)
        a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
        outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c)
        assert (outward > 0.0).all()


def test_the_nearer_triangle_is_seen():
    back = np.array([[10.0, 10.0, 0.0], [90.0, 10.0, 0.0], [10.0, 90.0, 0.0]])
    front = back * [0.5, 0.5, 1.0] + [5.0, 5.0, 1.0]
    image = _drawn(np.stack([front, back]), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(image[20, 20], [1.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(image[15, 70], [0.0, 0.0, 1.0, 1.0])
    assert image[95, 95, 3] == 0.0


def test_a_picture_has_the_scene_and_its_points(shelf):
    picture = thumbnail(shelf)
    image = np.asarray(Image.open(io.BytesIO(picture.png)))
    assert image.shape == (HEIGHT, WIDTH, 4)
    assert 0.05 < (image[..., 3] > 0).mean() < 0.9
    assert len(picture.png) < 12_000
    ball = picture.project(np.array([[0.7, -0.2, 0.36]]))[0].astype(int)
    column, row = ball
    red, green, _, alpha = image[row, column].astype(int)
    assert alpha == 255
    assert green > red  # a small thing, in their colour
    up = picture.project(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert up[1, 1] < up[0, 1]
    assert up[1, 0] == up[0, 0]


def test_a_scene_without_bodies_has_a_picture(bare):
    picture = thumbnail(bare)
    assert np.asarray(Image.open(io.BytesIO(picture.png)))[..., 3].max() == 0
    assert np.isfinite(picture.project(pin.SE3.Random().translation[None])).all()
