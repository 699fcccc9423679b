"""Point clouds and octrees: what their files hold, what is solid of them, and that a broken file is only refused."""

import io
import struct
import tracemalloc
import zipfile
from pathlib import Path

import coal
import numpy as np
import pytest

import optiplan as op
from optiplan.geometry.enclosure import Enclosure
from optiplan.geometry.file_shapes import Octree, PointCloud
from optiplan.geometry.meshes import reading
from optiplan.geometry.meshes.octomap import read_bt, read_ot
from optiplan.geometry.meshes.point_clouds import read_pcd, read_points_npz, read_points_ply
from optiplan.geometry.meshes.triangles import MeshError
from optiplan.geometry.shapes import build_geometry
from tests.planned import planned_until

POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (300, 3)).astype(np.float32).astype(np.float64)


@pytest.fixture(autouse=True)
def nothing_kept(own_cache, monkeypatch):
    monkeypatch.setattr(reading, "_kept", type(reading._kept)())


def ply(points):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    names = "".join(f"property float {axis}\n" for axis in "xyz")
    return (header + names + "property uchar red\nend_header\n").encode() + np.rec.fromarrays(
        [*points.astype("<f4").T, np.zeros(len(points), "u1")]
    ).tobytes()


def test_a_binary_ply_file_may_have_an_element_without_rows():
    """As MeshLab writes a cloud, with the list of a face's corners."""
    faces = b"element face 0\nproperty list uchar int vertex_indices\n"
    same_points(read_points_ply(ply(POINTS).replace(b"end_header\n", faces + b"end_header\n")), POINTS)
    more = faces + b"element camera 1\nproperty uchar x\nend_header\n"
    same_points(read_points_ply(ply(POINTS).replace(b"end_header\n", more) + b"\x07"), POINTS)


def literals(data):
    """LZF without a copy: only runs of up to 32 bytes."""
    return b"".join(bytes([len(run) - 1]) + run for run in (data[i : i + 32] for i in range(0, len(data), 32)))


def pcd(points, form):
    header = (
        "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\n"
        f"COUNT 1 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {form}\n"
    ).encode()
    if form == "ascii":
        return header + "".join(f"{x:.9g} {y:.9g} {z:.9g} 7\n" for x, y, z in points).encode()
    columns = [*points.astype("<f4").T, np.full(len(points), 7, "<u4")]
    if form == "binary":
        return header + np.rec.fromarrays(columns).tobytes()
    data = b"".join(column.tobytes() for column in columns)
    packed = literals(data)
    return header + struct.pack("<II", len(packed), len(data)) + packed


def npz(points, path, **named):
    np.savez_compressed(path, **(named or {"points": points}))
    return path.read_bytes()


def same_points(soup, points):
    np.testing.assert_allclose(soup.vertices, np.unique(points, axis=0), atol=1e-7)


@pytest.mark.parametrize("form", ["ascii", "binary", "binary_compressed"])
def test_pcd_files_are_read_and_their_gaps_left_out(form):
    gaps = POINTS.copy()
    gaps[5, 1] = np.nan
    same_points(read_pcd(pcd(gaps, form)), np.delete(POINTS, 5, axis=0))


def test_lzf_copies_what_came_before():
    """Sixteen points at one place: the second run repeats the first, byte by byte."""
    one, many = np.zeros((16, 3)), 4 * 16
    packed = b"\x00\x00" + bytes([7 << 5, 3 * many + many - 1 - 9 - 2 if 3 * many + many - 12 < 256 else 244, 0])
    header = pcd(one, "binary").split(b"DATA")[0] + b"DATA binary_compressed\n"
    size = 4 * many
    done = 1 + 7 + packed[3] + 2
    packed += literals(bytes(size - done))
    same_points(read_pcd(header + struct.pack("<II", len(packed), size) + packed), one[:1])


def test_ply_and_npz_files_are_read(tmp_path):
    same_points(read_points_ply(ply(POINTS)), POINTS)
    same_points(read_points_npz(npz(POINTS, tmp_path / "a.npz")), POINTS)
    same_points(read_points_npz(npz(POINTS, tmp_path / "b.npz", cloud=POINTS)), POINTS)


@pytest.mark.parametrize(
    ("read", "content", "says"),
    [
        (read_pcd, b"VERSION .7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n0 0\n", "without x, y, z"),
        (read_pcd, pcd(POINTS, "binary")[:-1], "bytes of data"),
        (read_pcd, pcd(POINTS, "ascii") + b" 1\n", "numbers where its header says"),
        (read_pcd, pcd(POINTS, "binary_compressed")[:-4], "another size"),
        (read_pcd, b"nothing", "without its header"),
        (read_pcd, pcd(np.full((2, 3), np.nan), "ascii"), "no points"),
        (read_points_npz, b"PK\x03\x04 no archive", "no whole NPZ"),
        (read_pcd, pcd(POINTS, "ascii").replace(b"DATA", b"WIDTH 17\nHEIGHT 1\nDATA"), "17 times 1 points where"),
        (read_pcd, pcd(POINTS, "ascii").replace(b"DATA", b"COUNT 1 1 0 1\nDATA"), "COUNT"),
        (read_points_npz, b"hello", "no NPZ file, which is a ZIP archive"),
        (read_points_ply, ply(POINTS)[:-20], "bytes of data where its header says"),
        (
            read_points_ply,
            b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n",
            "fewer values than its header says",
        ),
        (read_points_ply, b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "without vertices"),
        (read_bt, b"# Octomap OcTree binary file\nid OcTree\nsize 3\nres 0.1\ndata\n\x03\x00", "ends in the middle"),
        (read_bt, b"# Octomap OcTree binary file\nid OcTree\nsize 1\nres -1\ndata\n\x02\x00", "resolution"),
        (read_bt, b"# Octomap OcTree binary file\nid OcTree\nsize 1\nres 0.1\ndata\n\x00\x00", "no occupied cell"),
        (
            read_bt,
            b"# Octomap OcTree binary file\nid OcTree\nsize 3\nres 0.1\ndata\n\x02\x00",
            "2 nodes where its header",
        ),
        (
            read_bt,
            b"# Octomap OcTree binary file\nid OcTree\nsize 2\nres 0.1\ndata\n\x02\x00\x00",
            "3 bytes of data where",
        ),
        (read_ot, b"# Octomap OcTree file\nid SemanticTree\nsize 1\nres 0.1\ndata\n", "SemanticTree"),
    ],
)
def test_a_broken_file_is_refused_with_its_reason(read, content, says):
    with pytest.raises(MeshError, match=says):
        read(content)


def bomb(shape, zeros: int, head: bytes | None = None, kind: str = "<f8") -> bytes:
    """An NPZ file whose array `points` says it has this shape and unpacks to so many zeros behind its header."""
    npy, file = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(npy, {"descr": kind, "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", (npy.getvalue() if head is None else head) + bytes(zeros))
    return file.getvalue()


ENDLESS = b"\x93NUMPY\x02\x00\xff\xff\xff\x7f"
"""A header that says that it is 2 GB long."""


@pytest.mark.parametrize(
    ("made_of", "says"),
    [
        (((10**8, 3), 10**7), "100000000 points; at most"),
        (((10**7,), 8 * 10**7), r"points of shape \(10000000,\)"),
        (((10**9, 3), 10), "1000000000 points"),
        (((4, 3), 0, None, "<c16"), "complex128"),
        (((4, 3), 90), "no whole NPZ"),
        (((), 10**7, ENDLESS), "no whole NPZ"),
        (((), 10**7, b"\x93NUMPY\x09\x00"), "no whole NPZ"),
        (((), 10**7, b"nothing"), "no whole NPZ"),
    ],
)
def test_an_npz_file_is_refused_for_its_header_before_it_is_unpacked(made_of, says):
    content = bomb(*made_of)
    tracemalloc.start()
    try:
        with pytest.raises(MeshError, match=says):
            read_points_npz(content)
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()


def test_a_tree_without_end_is_refused():
    endless = b"\xff\xff" * 40
    with pytest.raises(MeshError, match="16 levels"):
        read_bt(b"# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.1\ndata\n" + endless)


def test_an_array_of_objects_is_not_unpickled(tmp_path):
    np.savez(tmp_path / "a.npz", points=np.array([{"x": 1}], dtype=object))
    with pytest.raises((MeshError, ValueError), match=r"pickle|shape"):
        read_points_npz((tmp_path / "a.npz").read_bytes())


# Octrees: trees written here, in the two forms of OctoMap, from occupied and free cells of several sizes.


def divided(cells, cell, leaf, inner):
    """Write the tree below `cell`: what is asked of `leaf` and `inner` for each node, children first in their order."""
    x, y, z, edge = cell
    half = edge // 2
    children = [
        (x + half * (i & 1), y + half * (i >> 1 & 1), z + half * (i >> 2 & 1), half) if half else None for i in range(8)
    ]
    below = [
        None if child is None else [c for c in cells if all(child[k] <= c[k] < child[k] + half for k in range(3))]
        for child in children
    ]
    return inner(children, below, lambda child, some: divided(some, child, leaf, inner))


def bt(cells, resolution):
    """`cells`: {(x, y, z, edge): occupied}."""
    known = [1]

    def inner(children, below, further):
        known.append(sum(map(bool, below)))
        kinds, rest = 0, b""
        for i, (child, some) in enumerate(zip(children, below, strict=True)):
            if not some:
                continue
            if some == [child]:
                kinds |= (2 if cells[child] else 1) << 2 * i
            else:
                kinds |= 3 << 2 * i
                rest += further(child, some)
        return struct.pack("<H", kinds) + rest

    half = 1 << 15
    body = divided(list(cells), (-half, -half, -half, 2 * half), None, inner)
    header = f"# Octomap OcTree binary file\n# made by a test\nid OcTree\nsize {sum(known)}\nres {resolution}\ndata\n"
    return header.encode() + body


def ot(cells, resolution, colour=b"", kind="OcTree"):
    known = [1]

    def inner(children, below, further):
        known.append(sum(map(bool, below)))
        bits, rest = 0, b""
        for i, (child, some) in enumerate(zip(children, below, strict=True)):
            if not some:
                continue
            bits |= 1 << i
            if some == [child]:
                rest += struct.pack("<f", 0.85 if cells[child] else -0.4) + colour + b"\x00"
            else:
                rest += further(child, some)
        return struct.pack("<f", 0.0) + colour + bytes([bits]) + rest

    half = 1 << 15
    body = divided(list(cells), (-half, -half, -half, 2 * half), None, inner)
    return f"# Octomap OcTree file\nid {kind}\nsize {sum(known)}\nres {resolution}\ndata\n".encode() + body


CELLS = {
    (0, 0, 0, 2): True,
    (2, 0, 0, 1): True,
    (2, 1, 0, 1): True,
    (2, 0, 1, 1): False,
    (-1, -1, -1, 1): True,
    (8, 8, 8, 4): True,
    (12, 8, 8, 4): True,
}


@pytest.mark.parametrize("write", [bt, ot, lambda cells, res: ot(cells, res, b"\x01\x02\x03", "ColorOcTree")])
def test_an_octree_is_solid_where_it_is_occupied_and_nowhere_else(write):
    read = read_bt if write is bt else read_ot
    soup = read(write(CELLS, 0.5))
    solid, rng = Enclosure(soup.vertices, soup.triangles), np.random.default_rng(1)
    for point in np.concatenate([rng.uniform(-1.5, 2.0, (150, 3)), rng.uniform(3.5, 8.5, (50, 3))]):
        truth = any(
            occupied and all(0.5 * low < p < 0.5 * (low + edge) for low, p in zip(cell, point, strict=True))
            for (*cell, edge), occupied in CELLS.items()
        )
        assert solid.holds(point[None]) == truth, point


def test_two_cells_of_one_size_have_no_wall_between_them():
    soup = read_bt(bt({(8, 8, 8, 4): True, (12, 8, 8, 4): True}, 0.5))
    assert len(soup.triangles) == 20


# Distances


def balls_truth(points, radius, box):
    """Distance of an axis-parallel box (half edges) at the origin to the nearest ball."""
    return np.linalg.norm(np.maximum(np.abs(points) - box, 0.0), axis=1).min() - radius


def test_a_cloud_is_never_farther_than_its_points_and_hardly_nearer(tmp_path):
    (tmp_path / "cloud.ply").write_bytes(ply(POINTS))
    radius, half = 0.02, np.array([0.05, 0.08, 0.03])
    body = build_geometry(PointCloud(tmp_path / "cloud.ply", radius=radius))
    rng = np.random.default_rng(2)
    for _ in range(100):
        place = rng.uniform(-1.0, 1.0, 3)
        found = coal.distance(
            body,
            coal.Transform3s(),
            coal.Box(*(2.0 * half)),
            coal.Transform3s(np.eye(3), place),
            coal.DistanceRequest(),
            coal.DistanceResult(),
        )
        truth = balls_truth(POINTS - place, radius, half)
        if truth > 0.0:
            assert found <= truth + 1e-9
            assert found >= truth - (0.74 * radius + np.sqrt(3.0) * radius)
        else:
            assert found <= 1e-9


# In problems


SCENE = """
version: 1
robot: panda
start: {{configuration: ready}}
goal: {{joints: [1.3, -0.785, 0, -2.356, 0, 1.571, 0.785]}}
scene:
  obstacles:
    - {{name: cloud, shape: {shape}, pose: {{position: [0, 0, 0]}}}}
"""


def pole():
    """Points 1 cm apart on a vertical line between start and goal, 40 cm high."""
    z = np.arange(0.3, 0.7, 0.01)
    return np.column_stack([np.full(len(z), 0.307 * np.cos(0.65)), np.full(len(z), 0.307 * np.sin(0.65)), z])


def test_a_motion_past_a_cloud_is_planned_and_proved_and_one_through_it_refused(tmp_path):
    np.savez(tmp_path / "pole.npz", points=pole())
    (tmp_path / "p.yaml").write_text(SCENE.format(shape="{points: {file: pole.npz, radius: 0.01}}"))
    problem = op.load_problem(tmp_path / "p.yaml")
    run = planned_until(problem)
    assert run.verified
    free = op.plan(problem.with_scene(op.Scene()), planner="quintic")
    assert free.verified
    assert not op.verify(problem, free.trajectory).verified


def test_yaml_and_python_are_one_problem(tmp_path):
    np.savez(tmp_path / "pole.npz", points=pole())
    (tmp_path / "map.bt").write_bytes(bt({(8, 8, 8, 4): True}, 0.05))
    for shape, body in (
        ("{points: {file: pole.npz, radius: 0.01}}", op.PointCloud("cloud", tmp_path / "pole.npz", radius=0.01)),
        ("{octree: {file: map.bt}}", op.Octree("cloud", tmp_path / "map.bt")),
    ):
        (tmp_path / "p.yaml").write_text(SCENE.format(shape=shape))
        problem = op.load_problem(tmp_path / "p.yaml")
        again = problem.with_scene(op.Scene([body]))
        assert again.hash == problem.hash
        problem.save(tmp_path / "again.yaml")
        assert op.load_problem(tmp_path / "again.yaml").hash == problem.hash


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        ("{points: {file: none.ply, radius: 0.01}}", "there is no file"),
        ("{points: {file: p.yaml, radius: 0.01}}", r"'.yaml' is none of PLY, PCD or NPZ"),
        ("{octree: {file: p.yaml}}", "is none of BT or OT"),
        ("{points: {file: pole.npz, radius: 0.0}}", "radius"),
        ("{points: {file: far.npz, radius: 1.0e-6}}", "a larger radius makes fewer"),
    ],
)
def test_what_cannot_be_read_is_bad_input(shape, says, tmp_path):
    np.savez(tmp_path / "pole.npz", points=pole())
    np.savez(tmp_path / "far.npz", points=np.random.default_rng(0).uniform(-1.0, 1.0, (200_000, 3)))
    (tmp_path / "p.yaml").write_text(SCENE.format(shape=shape))
    with pytest.raises(op.InputError, match=says):
        op.load_problem(tmp_path / "p.yaml")


def test_shapes_say_what_they_are():
    assert Octree(Path("a.bt")).to_data() == {"file": "a.bt"}
    assert PointCloud(Path("a.ply"), 0.1).to_data() == {"file": "a.ply", "radius": 0.1}
