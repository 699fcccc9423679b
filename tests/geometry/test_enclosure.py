"""Which points a mesh encloses: known answers for solids, hollows, sheets and cracks, whatever the winding."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from optiplan.geometry.enclosure import Enclosure


def box(size=2.0, centre=(0.0, 0.0, 0.0)):
    made = trimesh.creation.box((size,) * 3)
    return np.asarray(made.vertices) + centre, np.asarray(made.faces, np.int64)


def joined(*parts):
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    return (
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([faces + k for (_, faces), k in zip(parts, offsets, strict=False)]),
    )


def inverted(part):
    return part[0], part[1][:, ::-1]


def doubled(part):
    return part[0], np.concatenate([part[1], part[1][:, ::-1]])


def cracked(part, width=1e-7):
    """Every triangle for itself, drawn together a little."""
    corners = part[0][part[1]]
    corners = corners + width * (corners.mean(axis=1, keepdims=True) - corners)
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def opened(part):
    """Without the two triangles of the side at z = +1."""
    top = (part[0][part[1]][:, :, 2] > 0.99).all(axis=1)
    assert top.sum() == 2
    return part[0], part[1][~top]


def holds(mesh, point):
    return Enclosure(*mesh).holds(np.array([point], float))


CHANGES = {"as it is": lambda part: part, "inverted": inverted, "doubled": doubled, "cracked": cracked}
IN, OUT = (0.3, 0.2, 0.1), (1.3, 0.2, 0.1)


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
@settings(max_examples=30)
@given(flips=st.lists(st.booleans(), min_size=12, max_size=12))
def test_a_box_is_solid_whatever_its_winding(change, flips):
    vertices, faces = box()
    mesh = change((vertices, np.where(np.array(flips)[:, None], faces[:, ::-1], faces)))
    assert holds(mesh, IN)
    assert not holds(mesh, OUT)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_answer_is_that_of_the_box_at_random_points(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = box()
    turned = faces[rng.permutation(12)]
    mesh = doubled((vertices, turned)) if rng.random() < 0.5 else (vertices, turned)
    for point in rng.uniform(-2.0, 2.0, (10, 3)):
        assert holds(mesh, point) == bool((np.abs(point) < 1.0).all())


def test_a_bin_is_open_and_a_bin_with_a_crack_for_an_opening_is_not():
    assert not holds(opened(box()), IN)
    assert not holds(doubled(opened(box())), IN)
    assert not holds(opened(box()), (0.999, 0.0, 0.0))  # so near to the wall that its cell is the wall's
    lid, faces = box()
    top = (lid[faces][:, :, 2] > 0.99).all(axis=1)
    shut = joined(opened(box()), (lid + np.array([0.0, 0.0, 1e-4]), faces[top]))
    assert holds(shut, IN)
    ajar = joined(opened(box()), (lid + np.array([0.0, 0.0, 0.5]), faces[top]))
    assert not holds(ajar, IN)


def test_solids_side_by_side_within_each_other_and_overlapping_are_solid():
    glued = joined(box(), box(centre=(2.0, 0.0, 0.0)))  # with a wall of both between them
    assert holds(glued, IN)
    assert holds(glued, (1.7, 0.0, 0.0))
    assert not holds(glued, (3.1, 0.0, 0.0))
    assert holds(joined(box(4.0), box()), IN)  # a bolt in a block
    crossing = joined(box(), inverted(box(centre=(1.0, 0.3, 0.2))))
    assert holds(crossing, (0.5, 0.3, 0.2))  # winding numbers cancel here, and yet both are solid


def test_a_hollow_is_free_if_its_walls_say_so():
    room = joined(box(4.0), inverted(box()))
    assert not holds(room, IN)
    assert holds(room, (1.5, 0.0, 0.0))
    mirrored = room[0] * [-1.0, 1.0, 1.0], room[1]
    assert not holds(mirrored, IN)
    assert holds(joined(box(4.0), doubled(box())), IN)  # a wall of both senses says nothing
    assert holds(joined(room, box(0.9, (0.3, 0.2, 0.1))), IN)  # a block in the room


@pytest.mark.parametrize("change", [lambda part: part, inverted])
def test_hollows_count_against_the_volume_whatever_the_winding(change):
    room = joined(box(4.0), inverted(box(2.0, (0.3, 0.0, 0.0))))
    parts = {
        "room": (room, 56.0),
        "block in it": (joined(room, box(1.0)), 57.0),
        "bolt": (joined(box(4.0), box()), 72.0),
    }
    for mesh, expected in parts.values():
        solids = Enclosure(*change(mesh)).solids()
        volumes = [sign * np.linalg.det(corners - corners[0, 0]).sum() / 6.0 for corners, sign in solids]
        assert sum(volumes) == pytest.approx(expected)


def test_edges_of_three_triangles_enclose_what_they_enclose():
    vertices, faces = box()
    flap = joined((vertices, faces), (np.array([[1.0, 1, 1], [1, 1, -1], [3, 3, 0]]), np.array([[0, 1, 2]])))
    assert holds(flap, IN)
    assert not holds(flap, (2.0, 0.0, 0.0))
    wall = np.array([[-1.0, -1, -1], [1, 1, -1], [-1, -1, 1], [1, 1, 1]]), np.array([[0, 1, 3], [0, 3, 2]])
    assert holds(joined((vertices, faces), wall), IN)


def test_faces_without_area_do_not_open_a_solid():
    vertices, faces = box()
    assert holds((vertices, np.concatenate([faces, [[0, 0, 1], [2, 2, 2]]])), IN)


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_fine_bottle_is_open_at_its_neck(turn):
    """A tube of radius 1, closed below: free inside; with a lid: not; turned against the grid as well."""
    tube = trimesh.creation.cylinder(radius=1.0, height=4.0, sections=64)
    tube.apply_transform(trimesh.transformations.rotation_matrix(turn, [1.0, 1.0, 0.0]))
    axis = trimesh.transformations.rotation_matrix(turn, [1.0, 1.0, 0.0])[:3, 2]
    vertices, faces = np.asarray(tube.vertices), np.asarray(tube.faces, np.int64)
    top = (vertices[faces] @ axis > 1.99).all(axis=1)
    assert holds((vertices, faces), (0.1, 0.1, 0.0))
    assert not holds((vertices, faces[~top]), (0.1, 0.1, 0.0))
