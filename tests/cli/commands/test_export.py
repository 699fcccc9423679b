import json

import numpy as np
import pytest

from optiplan.errors import OptiPlanError
from optiplan.viewer import pictures


def test_a_motion_is_written_beside_its_run_and_verified_again(optiplan, run, free):
    code, out, _ = optiplan("export", run, "--to", "csv", "--rate", "1000")
    assert code == 0
    assert f"written: {run / 'motion.csv'}" in out
    assert "verified; " in out
    assert "quintic" in out
    rows = np.genfromtxt(run / "motion.csv", delimiter=",", names=True)
    assert np.diff(rows["t"]).max() <= 1e-3 + 1e-9
    assert optiplan("verify", free, run / "motion.csv")[0] == 0


def test_a_cycle_is_kept_exactly(optiplan, run):
    assert optiplan("export", run, "--to", "csv", "--rate", "250", "--cyclic")[0] == 0
    rows = np.genfromtxt(run / "motion.csv", delimiter=",", names=True)
    assert np.diff(rows["t"]) == pytest.approx(0.004, abs=1e-12)


def test_messages_of_ros_go_where_they_are_told(optiplan, run, tmp_path):
    code, out, _ = optiplan("export", run, "--to", "ros", "--out", tmp_path / "new" / "message.json")
    assert code == 0
    assert str(tmp_path / "new" / "message.json") in out
    assert json.loads((tmp_path / "new" / "message.json").read_text())["points"]


def test_the_program_of_a_motion_says_how_to_solve_it(optiplan, run):
    code, out, _ = optiplan("export", run, "--to", "casadi")
    assert code == 0
    file = json.loads((run / "motion.casadi.json").read_text())
    assert f"written: {run / 'motion.casadi.json'}" in out
    assert f"{len(file['x_names'])} variables, {len(file['g_names'])} rows" in out
    assert any("casadi.Function.deserialize" in line for line in file["about"])


def test_a_motion_that_is_not_verified_is_not_written(optiplan, run):
    motion = json.loads((run / "trajectory.json").read_text())
    pieces = motion["pieces"]
    pieces["breakpoints"] = (0.2 * np.array(pieces["breakpoints"])).tolist()
    c = np.array(pieces["coefficients"])
    pieces["coefficients"] = (c * 5.0 ** np.arange(c.shape[1])[:, None]).tolist()
    (run / "trajectory.json").write_text(json.dumps({"joint_names": motion["joint_names"], "pieces": pieces}))
    code, out, err = optiplan("export", run, "--to", "csv")
    assert (code, out) == (4, "")
    assert "not verified; nothing was written" in err
    assert not (run / "motion.csv").exists()
    code, out, _ = optiplan("export", run, "--to", "csv", "--unverified")
    assert code == 4
    assert "NOT verified" in out
    assert (run / "motion.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--to", "krl"], "expected one of: csv, json, npz, ros, urscript, casadi, png, mp4"),
        (["--to", "casadi", "--rate", "100"], "a program has no rate"),
        (["--to", "csv", "--rate", "0"], "optiplan export: rate: found the float 0.0; expected a number of samples"),
        (["--to", "urscript"], "of urscript: one of the six joints"),
        (["--to", "png", "--rate", "100"], "pictures have no samples"),
        (["--to", "png", "--out", "motion.jpg"], "a file that ends with .png"),
    ],
)
def test_bad_input_ends_with_2_and_writes_nothing(optiplan, run, arguments, words):
    before = sorted(run.iterdir())
    code, _, err = optiplan("export", run, *arguments)
    assert code == 2
    assert words in err
    assert sorted(run.iterdir()) == before


def test_a_run_without_a_motion_ends_with_3(optiplan, shut_in, tmp_path):
    optiplan("plan", shut_in, "--budget", "1", "--out", tmp_path / "none")
    code, _, err = optiplan("export", tmp_path / "none", "--to", "csv")
    assert code == 3
    assert "has no motion" in err


def test_a_film_without_ffmpeg_is_one_line_that_says_what_to_install(optiplan, run, monkeypatch):
    monkeypatch.setattr(pictures.shutil, "which", lambda name: None)
    before = sorted(run.iterdir())
    code, out, err = optiplan("export", run, "--to", "mp4")
    assert (code, out) == (2, "")
    assert "an MP4 needs ffmpeg (apt install ffmpeg)" in err
    assert err.count("\n") == 1
    assert sorted(run.iterdir()) == before


def test_pictures_are_of_the_run_half_way_and_films_of_all_of_it(optiplan, run, monkeypatch):
    drawn = {}
    monkeypatch.setattr(pictures, "find_ffmpeg", lambda: "ffmpeg")
    monkeypatch.setattr(pictures, "save_picture", lambda page, path, wish: drawn.update(png=(page, path, wish)))
    monkeypatch.setattr(pictures, "save_film", lambda page, path: drawn.update(mp4=(page, path)))
    for kind in ("png", "mp4"):
        code, out, _ = optiplan("export", run, "--to", kind)
        assert code == 0
        assert out.strip() == f"written: {run / 'motion'}.{kind}"
        assert drawn[kind][1] == run / f"motion.{kind}"
        assert "verified" in drawn[kind][0]
    middle = 0.5 * json.loads((run / "run.json").read_text())["duration"]
    assert drawn["png"][2] == f"t={middle:.3f}&paused"


def test_a_film_hands_its_frames_to_ffmpeg(tmp_path):
    """A program in its place that keeps what it is given: the frames, the last of them for a while, and their size."""
    from PIL import Image

    told, recorder = tmp_path / "told", tmp_path / "ffmpeg"
    recorder.write_text(f'#!/bin/sh\necho "$@" > {told}\nfor last; do :; done\ncat > "$last"\n')
    recorder.chmod(0o755)
    frames = [Image.new("RGB", (8, 6), (shade, 0, 0)) for shade in (1, 2, 3)]
    pictures.save_mp4(frames, tmp_path / "film.mp4", str(recorder))
    data = np.frombuffer((tmp_path / "film.mp4").read_bytes(), np.uint8).reshape(-1, 6, 8, 3)
    still = round(pictures.REST * pictures.RATE / 1000.0)
    assert data[:, 0, 0, 0].tolist() == [1, 2, 3] + [3] * still
    assert "-s 8x6 -r 20" in told.read_text()
    recorder.write_text("#!/bin/sh\ncat > /dev/null\necho 'Unknown encoder' >&2\nexit 1\n")
    with pytest.raises(OptiPlanError, match=r"ffmpeg could not write .*other\.mp4: Unknown encoder"):
        pictures.save_mp4(frames, tmp_path / "other.mp4", str(recorder))
    assert not (tmp_path / "other.mp4").exists()
