"""`optiplan workspace`: table, JSON, files, and what is refused."""

import json
import re

import numpy as np
import trimesh

FEW = ("--samples", "300")


def test_table_compares_robots(optiplan):
    code, out, _ = optiplan("workspace", "srra", "ur5", *FEW, "--accuracy")
    assert code == 0
    for text in ("srra", "ur5", "lower half", "reach from the shoulder", "1.8810", "tool error bound at 17bit"):
        assert text in out


def test_json_of_a_grid_of_a_group(optiplan_json):
    code, data = optiplan_json("workspace", "delbot", "--group", "arm", "--grid", "3", "--no-collision")
    assert (code, data["exit_code"]) == (0, 0)
    row = data["robots"][0]
    assert (row["configurations"], row["free_fraction"]) == (729, 1.0)
    assert len(row["joint_names"]) == 6
    assert set(row["coverage"]) == {"whole", "upper", "lower"}
    assert "error_worst" not in row


def test_another_frame_has_another_reach(optiplan, optiplan_json):
    flags = ("delbot", "--group", "arm", "--grid", "3", "--no-collision")
    at_flange = optiplan_json("workspace", *flags, "--frame", "wrist_3")[1]["robots"][0]
    at_tool = optiplan_json("workspace", *flags)[1]["robots"][0]
    assert at_flange["tool_frame"] == "wrist_3"
    assert at_flange["reach"]["largest"] < at_tool["reach"]["largest"] - 0.05
    code, _, err = optiplan("workspace", "delbot", "--frame", "nose")
    assert code == 2
    assert "unknown frame 'nose'" in err


def test_resolution_sets_the_size_of_the_errors(optiplan_json):
    errors = [
        optiplan_json("workspace", "ur5", *FEW, "--accuracy", "--resolution", step)[1]["robots"][0]["error_rms"]["mean"]
        for step in ("1e-4", "2e-4")
    ]
    assert abs(errors[1] / errors[0] - 2.0) < 1e-9


def test_files_hold_what_was_found(optiplan_json, tmp_path):
    code, data = optiplan_json("workspace", "ur5", "ur5", *FEW, "--accuracy", "--out", tmp_path / "ws")
    assert code == 0
    names = sorted(path.name for path in (tmp_path / "ws").iterdir())
    assert names == ["ur5-1.npz", "ur5-1.ply", "ur5-2.npz", "ur5-2.ply", "workspace.html", "workspace.png"]
    assert len(data["files"]) == 6
    stored = np.load(tmp_path / "ws" / "ur5-1.npz")
    assert stored["sample_q"].shape == (300, 6)
    reached = stored["voxel_counts"] > 0
    assert np.all((stored["voxel_yoshikawa"] >= 0.0) == reached)
    cloud = trimesh.load(tmp_path / "ws" / "ur5-1.ply")
    assert np.abs(cloud.vertices - stored["voxel_centres"][reached]).max() < 1e-6
    assert (tmp_path / "ws" / "workspace.png").read_bytes().startswith(b"\x89PNG")


def test_page_stands_alone(optiplan, tmp_path):
    optiplan("workspace", "planar2r", *FEW, "--out", tmp_path)
    page = (tmp_path / "workspace.html").read_text()
    assert "default-src 'none'" in page  # the browser would refuse whatever a script asked for
    frame = re.sub(r"<!--.*?-->|<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"https?://|src=|@import", frame)
    data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', page).group(1))
    assert data["robots"][0]["caption"].startswith("planar2r: reach")


def test_bad_input_is_told_with_what_is_valid(optiplan, tmp_path):
    (tmp_path / "file").write_text("")
    for arguments, expected in (
        (("nobody",), "ur5"),
        (("ur5", "--group", "none"), "none"),
        (("ur5", "--accuracy", "--resolution", "fine", *FEW), "encoder bits"),
        (("ur5", "--resolution", "16bit", *FEW), "goes with --accuracy"),
        (("ur5", "--grid", "99"), "at most"),
        (("ur5", "--samples", "0"), "--samples"),
        (("ur5", "--no-collision", "--floor", "0.1"), "does not go with --no-collision"),
        (("ur5", "--grid", "3", "--samples", "9"), "goes with random configurations, not with --grid"),
        (("ur5", "--grid", "3", "--seed", "0"), "goes with random configurations, not with --grid"),
        (("ur5", "--out", tmp_path / "file"), "folder"),
    ):
        code, out, err = optiplan("workspace", *arguments)
        assert (code, out) == (2, "")
        assert expected in err
