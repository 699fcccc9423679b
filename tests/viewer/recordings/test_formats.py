"""Recordings are read by the libraries of the programs that play them."""

import io
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optiplan.cli.main import run as optiplan
from optiplan.viewer.recordings.formats import mcap, rrd, save_recording
from optiplan.viewer.recordings.recording import recording_of
from tests.viewer.recordings.runs import planned


def test_foxgloves_library_reads_an_mcap():
    reader = pytest.importorskip("mcap.reader")
    problem, run = planned()
    recording = recording_of(problem, run)
    poses = np.tile(recording.bodies[-1].poses[:1], (len(recording.t), 1))
    poses[3:6] = np.nan
    taken_off = replace(recording.bodies[-1], name="taken off", poses=poses)
    recording = replace(recording, bodies=(*recording.bodies, taken_off))
    messages: dict[str, list] = {}
    schemas = {}
    for schema, channel, message in reader.make_reader(io.BytesIO(mcap(recording))).iter_messages():
        messages.setdefault(channel.topic, []).append(message)
        schemas[channel.topic] = None if schema is None else schema.name
    assert schemas["/tf"] == "foxglove.FrameTransforms"
    assert schemas["/scene"] == "foxglove.SceneUpdate"
    assert schemas["/verdict"] == "foxglove.Log"
    assert len(messages["/tf"]) == len(recording.t)
    assert messages["/tf"][-1].log_time == pytest.approx(1e9 * run.trajectory.duration, abs=1)
    last = json.loads(messages["/curves/position"][-1].data)
    assert list(last.values()) == pytest.approx(list(run.trajectory.end), abs=1e-6)
    assert b"obstacles/ball" in messages["/scene"][0].data
    assert [message.log_time for message in messages["/scene"]] == [int(1e9 * recording.t[k]) for k in (0, 3, 6)]
    assert all(b"taken off" in message.data for message in messages["/scene"])


def test_reruns_program_reads_an_rrd(tmp_path):
    pytest.importorskip("rerun")
    problem, run = planned()
    path = tmp_path / "run.rrd"
    path.write_bytes(rrd(recording_of(problem, run)))
    program = str(Path(sys.executable).parent / "rerun")
    subprocess.run([program, "rrd", "verify", str(path)], check=True, capture_output=True, timeout=60)
    told = subprocess.run([program, "rrd", "stats", str(path)], check=True, capture_output=True, text=True, timeout=60)
    for entity in ("/world/obstacles/ball", "/world/tool_path", "/curves/velocity", "/verdict"):
        assert entity in told.stdout


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    problem, run = planned()
    with pytest.raises(Exception, match=r"pip install 'optiplan\[recordings\]'"):
        save_recording(problem, run, tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_one_run_and_refuses_two(tmp_path, capsys):
    assert optiplan(["plan", "19_lspb", "--out", str(tmp_path / "run")]) == 0
    assert optiplan(["view", str(tmp_path / "run"), "--export", str(tmp_path / "run.mcap")]) == 0
    assert (tmp_path / "run.mcap").stat().st_size > 1000
    assert optiplan(["view", *[str(tmp_path / "run")] * 2, "--export", str(tmp_path / "two.mcap")]) == 2
    assert "one run" in capsys.readouterr().err
