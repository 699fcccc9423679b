"""Mesh files: what five formats hold, and that no file, however broken, does more than be refused."""

import contextlib
import json
import resource
import struct
import subprocess
import sys
import time
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import optiplan
from optiplan.geometry.meshes import reading, reading_process
from optiplan.geometry.meshes.reading import MeshFile, open_mesh, read_mesh, read_meshes
from optiplan.geometry.meshes.triangles import MeshError, unpack_soup
from optiplan.geometry.scene import Mesh
from optiplan.geometry.shapes import build_geometry


@pytest.fixture(autouse=True)
def nothing_kept(own_cache, monkeypatch):
    monkeypatch.setattr(reading, "_kept", type(reading._kept)())


def solid():
    """An L of 16 triangles turned about, so that no axis is like another."""
    base = trimesh.creation.box((0.4, 0.2, 0.1))
    base.apply_transform(trimesh.transformations.euler_matrix(0.3, 0.2, 0.1))
    base.apply_translation([0.1, 0.2, 0.3])
    return base


def areas(vertices, triangles):
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return sorted(np.linalg.norm(np.cross(b - a, c - a), axis=1).round(6))


def same_mesh(soup, mesh, atol=1e-6):
    def ordered(points):
        return np.array(sorted(np.unique(np.asarray(points).round(5), axis=0).tolist()))

    np.testing.assert_allclose(ordered(soup.vertices), ordered(mesh.vertices), atol=atol)
    assert areas(soup.vertices, soup.triangles) == pytest.approx(areas(mesh.vertices, mesh.faces), abs=1e-6)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("stl", {}),
        ("stl_ascii", {}),
        ("obj", {}),
        ("ply", {"encoding": "binary"}),
        ("ply", {"encoding": "ascii"}),
        ("glb", {}),
    ],
)
def test_every_format_gives_the_triangles_that_were_written(tmp_path, kind, options):
    path = tmp_path / f"m.{kind.partition('_')[0].upper()}"
    content = solid().export(file_type=kind, **options)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    soup = read_mesh(open_mesh(path))
    same_mesh(soup, solid())
    assert len(soup.vertices) == 8  # corners at the same place are one
    turned = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) if kind == "glb" else np.eye(3)
    np.testing.assert_array_equal(soup.turn, turned)
    bounds = build_geometry(Mesh(path)).aabb_local
    expected = np.asarray(solid().vertices) @ turned.T
    np.testing.assert_allclose(bounds.min_, expected.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(bounds.max_, expected.max(axis=0), atol=1e-6)


def test_polygons_are_cut_into_what_they_cover():
    """An L of six corners, whichever is the first and from whichever side: area 3, nothing in the notch."""
    corners = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
    for turn in range(6):
        for sense in (1, -1):
            ring = [(i + turn) % 6 + 1 for i in range(6)][::sense]
            for axes in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
                lines = [f"v {' '.join(str(corner[k]) for k in axes)}" for corner in corners]
                text = "\n".join([*lines, f"f {' '.join(map(str, ring))}", ""]).encode()
                soup = reading_process.READERS[".obj"](text)
                total = 0.5 * sum(areas(soup.vertices, soup.triangles))
                assert total == pytest.approx(3.0)


def test_obj_indices_count_from_the_end_and_lines_go_on():
    text = b"v 0 0 0\nv 1 0 0 1.0\nv 0 1 0 0.5 0.5 0.5\nvt 0 0\nf -3/1 \\\n -2/1 -1/1 # a face\nl 1 2\n"
    assert reading_process.READERS[".obj"](text).triangles.tolist() == [[0, 1, 2]]
    for wrong in (b"f 1 2 4", b"f 1 2 0_3", b"f 1 2 0", b"f 1 2 -4", b"f 1 2 x", b"curv 1 2", b"what 1"):
        with pytest.raises(MeshError):
            reading_process.READERS[".obj"](b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + wrong + b"\n")


@pytest.mark.parametrize("kind", ["int", "float"])
def test_ply_indices_are_whole_numbers(kind):
    header = "ply\nformat {} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    header += f"element face 1\nproperty list uchar {kind} vertex_indices\nend_header\n"
    files = [f"{header.format('ascii')}0 0 0\n1 0 0\n0 1 0\n3 0.9 1.9 2.9\n".encode()]
    if kind == "float":
        corners = np.array([0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes()
        begin = header.format("binary_little_endian").encode() + corners + b"\x03"
        files += [begin + np.array([0, 1, last], "<f4").tobytes() for last in (1.9, np.inf, np.nan)]
    for file in files:
        with pytest.raises(MeshError, match="no whole numbers"):
            reading_process.READERS[".ply"](file)


DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset><library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="12">
0 0 0 1 0 0 0 2 0 0 0 3</float_array><technique_common><accessor source="#pa" count="4" stride="3"/></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{polygons}</mesh></geometry>
</library_geometries><library_nodes><node id="kept">{inner}</node></library_nodes><library_visual_scenes>
<visual_scene id="s"><node>{node}</node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'
TETRAHEDRON = f'<triangles count="4">{INPUT}<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>'
PLACED = '<instance_geometry url="#g"/>'


def read_dae(asset="", polygons=TETRAHEDRON, node=PLACED, inner=""):
    text = DAE.format(asset=asset, polygons=polygons, node=node, inner=inner)
    return reading_process.READERS[".dae"](text.encode())


@pytest.mark.parametrize(
    ("asset", "peak"),
    [
        ("", (0, -3, 0)),  # y is up where nothing is said: the file's z is our -y
        ("<up_axis>Z_UP</up_axis>", (0, 0, 3)),
        ('<unit meter="0.001"/><up_axis>Z_UP</up_axis>', (0, 0, 0.003)),
        ('<unit name="inch" meter="0.0254"/><up_axis>Y_UP</up_axis>', (0, -0.0762, 0)),
        ("<up_axis>X_UP</up_axis>", (0, -3, 0)),
    ],
)
def test_collada_units_and_axes(asset, peak):
    soup = read_dae(asset)
    points = soup.vertices @ soup.turn.T
    if "X_UP" in asset:  # x is up: (1, 0, 0) is the top
        np.testing.assert_allclose(np.array([1.0, 0, 0]) @ soup.turn.T, [0, 0, 1])
        assert np.linalg.det(soup.turn) == pytest.approx(1.0)
    else:
        assert np.abs(points - peak).sum(axis=1).min() < 1e-12
        assert np.linalg.det(soup.turn) == pytest.approx(1.0)


def test_collada_nodes_are_placed_in_order_and_instanced():
    node = "<translate>1 0 0</translate><rotate>0 0 1 90</rotate><scale>2 2 2</scale>" + PLACED
    soup = read_dae("<up_axis>Z_UP</up_axis>", node=node + '<instance_node url="#kept"/>', inner=PLACED)
    tips = [(1.0, 0.0, 6.0), (-3.0, 0.0, 0.0), (1.0, 2.0, 0.0)]
    for tip in tips:
        assert np.abs(soup.vertices - tip).sum(axis=1).min() < 1e-12
    assert len(soup.triangles) == 8
    matrix = "<matrix>0 -1 0 1 1 0 0 0 0 0 1 0 0 0 0 1</matrix>"
    turned = read_dae("<up_axis>Z_UP</up_axis>", node=matrix + PLACED)
    assert np.abs(turned.vertices - (1.0, 1.0, 0.0)).sum(axis=1).min() < 1e-12


@pytest.mark.parametrize(
    ("polygons", "count"),
    [
        (f'<polylist count="2">{INPUT}<vcount>3 4</vcount><p>0 1 2 0 1 3 2</p></polylist>', 3),
        (TETRAHEDRON + f'<polylist count="0">{INPUT}<vcount/><p/></polylist>', 4),
        (f'<polygons count="1">{INPUT}<p>0 1 2</p></polygons>', 1),
        (f"<tristrips>{INPUT}<p>0 1 2 3</p></tristrips>", 2),
        (f"<trifans>{INPUT}<p>0 1 2 3</p></trifans>", 2),
        (f'<triangles count="1">{INPUT}<input semantic="NORMAL" offset="1"/><p>0 9 1 9 2 9</p></triangles>', 1),
    ],
)
def test_collada_polygons(polygons, count):
    assert len(read_dae(polygons=polygons).triangles) == count


@pytest.mark.parametrize(
    "change",
    [
        {"node": '<instance_node url="#kept"/>', "inner": '<instance_node url="#kept"/>'},
        {"node": '<instance_node url="#nowhere"/>'},
        {"node": "<skew>1 2 3 4 5 6 7</skew>" + PLACED},
        {"node": '<instance_controller url="#g"/>'},
        {"node": ""},
        {"asset": '<unit meter="0"/>'},
        {"asset": '<unit meter="nan"/>'},
        {"asset": "<up_axis>W_UP</up_axis>"},
        {"polygons": TETRAHEDRON.replace("1 2 3<", "1 2 4<")},
        {"polygons": TETRAHEDRON.replace('count="4"', 'count="3"')},
        {"polygons": TETRAHEDRON.replace("</p>", "</p><p>0 1 2</p>")},
        {"polygons": f'<polygons count="5">{INPUT}<p>0 1 2</p></polygons>'},
        {"polygons": f'<tristrips count="2">{INPUT}<p>0 1 2 3</p></tristrips>'},
        {"polygons": TETRAHEDRON.replace("0 2 1", "0 2 1e0")},
        {"polygons": TETRAHEDRON.replace("0 2 1", "0 2 1_0")},
        {"polygons": TETRAHEDRON.replace("0 2 1", f"0 2 {10**30}")},
    ],
    ids=lambda change: str(change)[:40],
)
def test_collada_that_is_not_understood_is_refused(change):
    with pytest.raises(MeshError):
        read_dae(**change)


def glb(document, data=b""):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], "<f4").tobytes()


def triangle_glb(**changes):
    document = {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [0, 0, 1], "scale": [2, 2, 2]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    }
    return reading_process.READERS[".glb"](glb(document | changes, CORNERS))


def test_glb_nodes_are_placed():
    assert triangle_glb().vertices.tolist() == [[0, 0, 1], [2, 0, 1], [0, 4, 1]]


@pytest.mark.parametrize(
    "changes",
    [
        {"nodes": [{"children": [0]}]},
        {"nodes": [{"mesh": 1}]},
        {"nodes": [{"mesh": 0, "skin": 0}]},
        {"extensionsRequired": ["KHR_draco_mesh_compression"]},
        {"accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}]},
        {"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "byteOffset": -4}]},
        {"buffers": [{"byteLength": 36, "uri": "/etc/passwd"}]},
        {"buffers": [{"byteLength": 36}] * 2, "bufferViews": [{"buffer": 1, "byteLength": 36}]},
        {"bufferViews": [{"buffer": 0, "byteLength": 12}]},
        {"bufferViews": [{"buffer": 0, "byteLength": 36, "byteOffset": 4}]},
        {"scenes": []},
    ],
    ids=lambda changes: str(changes)[:40],
)
def test_glb_that_is_not_understood_is_refused(changes):
    with pytest.raises(MeshError):
        triangle_glb(**changes)


def contents():
    """A valid content of each kind."""
    made = {f".{kind}": solid().export(file_type=kind) for kind in ("stl", "obj", "ply", "glb")}
    made[".dae"] = DAE.format(asset="", polygons=TETRAHEDRON, node=PLACED, inner="")
    return {kind: text.encode() if isinstance(text, str) else bytes(text) for kind, text in made.items()}


VALID = contents()
WORDS = [b"1e308", b"-1", b"inf", b"nan", b"99999999999", b"0", b"<", b"\xff\xfe", b"#", b"\0\0\0\0", b"{", b"[" * 999]


@st.composite
def broken(draw):
    """A valid file with some bytes taken out, put in, or exchanged."""
    kind = draw(st.sampled_from(sorted(VALID)))
    content = bytearray(VALID[kind])
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(content)))
        end = min(len(content), place + draw(st.sampled_from([0, 1, 4, 40, 4000])))
        content[place:end] = draw(st.one_of(st.binary(max_size=8), st.sampled_from(WORDS)))
    return kind, bytes(content)


@st.composite
def broken_glb(draw):
    """A GLB file in whose document entries are gone or other values."""
    content = VALID[".glb"]
    size = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + size])
    for _ in range(draw(st.integers(1, 2))):
        places = list(entries(document))
        holder, key = places[draw(st.integers(0, len(places) - 1))]
        values = [None, True, -1, 0, 1, 1.5, "x", [], {}, [None], [1, 2], {"a": 1}, 1e300, 2**70, float("nan")]
        if draw(st.booleans()):
            del holder[key]
        else:
            holder[key] = draw(st.sampled_from(values))
    return ".glb", glb(document, content[28 + size :])


def entries(data):
    """All places in JSON data: what holds an entry, and its key."""
    for key, value in list(data.items()) if isinstance(data, dict) else list(enumerate(data)):
        yield data, key
        if isinstance(value, dict | list):
            yield from entries(value)


@settings(max_examples=300)
@given(st.one_of(broken(), broken_glb()))
def test_a_broken_file_brings_out_no_other_error_than_that_it_is_one(case):
    kind, content = case
    with contextlib.suppress(MeshError):
        reading_process.READERS[kind](content)


CUT = {**VALID, "ASCII .stl": solid().export(file_type="stl_ascii").encode()}
CUT["ASCII .ply"] = solid().export(file_type="ply", encoding="ascii")


@pytest.mark.parametrize("kind", sorted(CUT))
def test_a_file_that_is_cut_off_is_refused_wherever_it_is_cut(kind):
    """OBJ has neither counts nor an end: a cut between two of its last polygons is not seen; all others are."""
    suffix, content = kind.split()[-1], CUT[kind]
    whole = reading_process._answer(suffix, content)
    assert whole[0] == "mesh"
    for length in range(len(content)):
        found = reading_process._answer(suffix, content[:length])
        if kind == ".obj" and found[0] == "mesh" and found != whole:
            assert content[:length].endswith(b"\n")
            assert len(unpack_soup(found[1]).vertices) == 8
        else:
            assert found[0] == "error" or found == whole


@pytest.mark.parametrize("lost", [b"endsolid", b"endfacet", b"endloop", b"facet normal", b"outer loop"])
def test_an_ascii_stl_without_one_of_its_lines_is_refused(lost):
    lines = CUT["ASCII .stl"].splitlines(keepends=True)
    place = max(k for k, line in enumerate(lines) if line.strip().startswith(lost))
    with pytest.raises(MeshError, match=r"is meant"):
        reading_process.READERS[".stl"](b"".join(lines[:place] + lines[place + 1 :]))


def test_vertices_that_nothing_uses_are_taken_where_nothing_can_be_missing():
    text = solid().export(file_type="obj").encode() + b"v 7 7 7\n"
    assert len(reading_process.READERS[".obj"](text).triangles) == 12
    with pytest.raises(MeshError, match="1 vertices that no polygon uses"):
        reading_process.READERS[".obj"](text.replace(b"f 8 6 7\n", b""))
    assert len(reading_process.READERS[".obj"](text.replace(b"v 7 7 7\n", b"").rstrip()).triangles) == 12


@settings(max_examples=300)
@given(broken())
def test_a_broken_file_is_arrays_or_a_reason(case):
    """In this process, as fast as it goes: the process apart adds limits and nothing else."""
    kind, content = case
    started = time.process_time()
    answer, data = reading_process._answer(kind, content)
    assert time.process_time() - started < reading.SECONDS
    if answer == "error":
        assert data.decode().strip()
        assert len(data) < 500
        return
    soup = unpack_soup(data)
    assert np.isfinite(soup.vertices).all()
    assert soup.triangles.min() >= 0
    assert soup.triangles.max() < len(soup.vertices)


def hostile(kind, content):
    return MeshFile(reading.Path(f"hostile{kind}"), f"hostile{kind}{len(content)}", content)


ENDLESS = b"ply\nformat ascii 1.0\nelement vertex 999999999\nend_header\n"  # of no properties
LISTS = b"ply\nformat ascii 1.0\nelement vertex 9999999\n" + b"property list uchar int a\n" * 60 + b"end_header\n"


@pytest.mark.parametrize(
    ("content", "seconds", "why"),
    [(ENDLESS, 1, r"hostile\.ply: takes more than 1 s"), (LISTS + b"10 " * 6_000_000 + b"\n", 60, "too much memory")],
)
def test_what_takes_too_much_is_ended_and_the_others_are_read(monkeypatch, tmp_path, content, seconds, why):
    """One file takes for ever, or all memory, with time enough to take it; those before and after it are read."""
    monkeypatch.setattr(reading, "SECONDS", seconds)
    monkeypatch.setattr(reading, "MEMORY", 400 * 2**20)
    (tmp_path / "good.stl").write_bytes(VALID[".stl"])
    (tmp_path / "good.obj").write_bytes(VALID[".obj"])
    (tmp_path / "good.ply").write_bytes(VALID[".ply"])
    good = [open_mesh(tmp_path / f"good.{kind}") for kind in ("stl", "obj", "ply")]
    bad = hostile(".ply", content)
    with pytest.raises(MeshError, match=why):
        read_meshes([good[0], bad, *good[1:]])
    for mesh in good:
        same_mesh(read_mesh(mesh), solid())
    with pytest.raises(MeshError, match=why):
        read_mesh(bad)


def test_every_mesh_has_its_whole_time(monkeypatch):
    """Whatever the process took before: the limit is of whole seconds of all of it."""
    limits, used = [], 1.95
    fake = SimpleNamespace(
        getrusage=lambda who: (used, 0.0),
        setrlimit=lambda which, limit: limits.append((which, limit[0])),
        **{name: getattr(resource, name) for name in ("RLIMIT_AS", "RLIMIT_CORE", "RLIMIT_CPU")},
        RUSAGE_SELF=resource.RUSAGE_SELF,
        RLIM_INFINITY=resource.RLIM_INFINITY,
    )
    monkeypatch.setattr(reading_process, "resource", fake)
    job = f".stl {len(VALID['.stl'])}\n".encode() + VALID[".stl"]
    monkeypatch.setattr(reading_process.sys, "stdin", SimpleNamespace(buffer=BytesIO(job)))
    monkeypatch.setattr(reading_process.sys, "stdout", SimpleNamespace(buffer=BytesIO()))
    reading_process.main(5, 2**30)
    ((_, limit),) = [one for one in limits if one[0] == resource.RLIMIT_CPU]
    assert limit - used >= 5


def test_a_known_content_needs_no_process(tmp_path, own_cache, monkeypatch):
    (tmp_path / "a.stl").write_bytes(VALID[".stl"])
    first = read_mesh(open_mesh(tmp_path / "a.stl"))
    assert len(list((own_cache / "meshes").iterdir())) == 1
    monkeypatch.setattr(reading, "_kept", type(reading._kept)())
    monkeypatch.setattr(reading, "_run_worker", None)
    (tmp_path / "b.stl").write_bytes(VALID[".stl"])
    again = read_mesh(open_mesh(tmp_path / "b.stl"))
    np.testing.assert_array_equal(again.vertices, first.vertices)
    np.testing.assert_array_equal(again.triangles, first.triangles)


@pytest.mark.parametrize("why", ["ends", "late", "none"])
def test_a_process_that_ended_is_no_fault_of_the_file_for_ever(tmp_path, monkeypatch, why):
    (tmp_path / "a.stl").write_bytes(VALID[".stl"])
    file = open_mesh(tmp_path / "a.stl")

    def run(*_, **__):
        if why == "late":
            raise subprocess.TimeoutExpired("python", 1.0)
        if why == "none":
            raise OSError(12, "Cannot allocate memory")
        return SimpleNamespace(stdout=b"", returncode=-9)

    words = {"ends": "ends the process", "late": "takes more than 60 s", "none": r"started \(cannot allocate memory\)"}
    with monkeypatch.context() as patch:
        patch.setattr(reading.subprocess, "run", run)
        with pytest.raises(MeshError, match=words[why]):
            read_mesh(file)
    assert len(read_mesh(file).triangles)


def test_the_suffix_is_one_of_a_list(tmp_path):
    for name in ("a.csm", "a.smd", "a.gltf", "a", "a.stl.bak"):
        (tmp_path / name).write_bytes(VALID[".stl"])
        with pytest.raises(MeshError, match="none of STL, OBJ, DAE, PLY or GLB"):
            open_mesh(tmp_path / name)


def test_the_process_finds_the_package_where_no_path_leads_to_it(monkeypatch):
    """As in an editable install, which Python finds by a hook and not by `sys.path`."""
    root = Path(optiplan.__file__).parents[1]
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place and Path(place).resolve() != root])
    content = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    ((found,), why) = reading._run_worker([MeshFile(Path("a.obj"), "key", content)])
    assert (len(found.triangles), why) == (1, "")
