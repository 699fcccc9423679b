"""Files of samples that hold no motion."""

import json
import os

import pytest

from optiplan.errors import InputError
from optiplan.trajectory.sample_file import read_samples, samples_from_dict
from optiplan.trajectory.trajectory import Trajectory


@pytest.mark.parametrize("without", ["t", "q"])
@pytest.mark.parametrize("value", [None, "", "x"])
def test_samples_without_times_or_positions_are_refused(tmp_path, without, value):
    file = tmp_path / "motion.json"
    file.write_text(json.dumps({"joint_names": ["a"], "t": [0, 1], "q": [[0], [1]], without: value}))
    with pytest.raises(InputError, match=r"motion\.json: (t, )?q|t: "):
        read_samples(file)


@pytest.mark.parametrize("cell", ["0_0.5", "1_0", "\u0660.\u0665", "\uff11", "0.5x", "", "0x10"])
def test_a_cell_is_a_number_as_csv_files_have_it(tmp_path, cell):
    file = tmp_path / "motion.csv"
    file.write_text(f"t,a\n0,0\n1,{cell}\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"motion\.csv:3: row: "):
        read_samples(file)


@pytest.mark.parametrize("key", ["t", "q", "v"])
def test_true_is_no_number(tmp_path, key):
    file = tmp_path / "motion.json"
    data = {"joint_names": ["a"], "t": [0, 1.0, 2.0], "q": [[0], [1.0], [2]], "v": [[0], [1.0], [0.0]]}
    data[key] = [True, 1.5, 2.5] if key == "t" else [[0.5], [True], [1.5]]
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=f"{key}: other things than numbers|{key}: found other things"):
        read_samples(file)


def test_what_is_no_csv_and_no_file_is_named(tmp_path):
    """A device could be read for ever, and a quotation that does not end is more than a cell may hold."""
    file = tmp_path / "motion.csv"
    file.write_text('t,"a\n' + "0,1\n" * 60_000)
    with pytest.raises(InputError, match=r"motion\.csv:\d+: row: field larger than field limit"):
        read_samples(file)
    os.mkfifo(tmp_path / "pipe.csv")
    for name, words in (("pipe.csv", "not a regular file"), ("\0.csv", "embedded null"), ("none.csv", "no such file")):
        with pytest.raises(InputError, match=words):
            read_samples(tmp_path / name)


@pytest.mark.parametrize("name", ["a\u0007", "a\u00a0b"])
def test_a_name_with_a_control_character_or_unusual_blank_is_named(name):
    samples = samples_from_dict({"joint_names": [name], "t": [0, 1], "q": [[0], [1]]}, "motion")
    with pytest.raises(InputError, match=r"motion: joint_names: .* without control characters or unusual blanks"):
        samples.trajectory()


def test_a_joint_that_is_stated_twice_is_refused(tmp_path):
    file = tmp_path / "motion.csv"
    file.write_text("t,a,q_a,b\n0,9,0,0\n1,9,1,1\n")
    with pytest.raises(InputError, match=r"motion\.csv:1: header: two columns for a: a, q_a"):
        read_samples(file)
    for header in ("x,a", "t,v_a", "t,a,q_a", "t,a,v_b"):  # below empty lines
        file.write_text(f"\n\n{header}\n")
        with pytest.raises(InputError, match=r"motion\.csv:3: header"):
            read_samples(file)
    twice = {"joint_names": ["b", "b", "a"], "t": [0, 1], "q": [[0, 5, 0], [1, 6, 1]]}
    with pytest.raises(InputError, match=r"motion: joint_names: \('b', 'b', 'a'\)"):
        samples_from_dict(twice, "motion", ["a", "b"]).trajectory()


def test_pieces_and_segments_hold_no_truth_values():
    data = {"joint_names": ["a"], "pieces": {"breakpoints": [0.0, 1.0], "coefficients": [[[0.5], [True]]]}}
    with pytest.raises(InputError, match=r"pieces\.coefficients"):
        Trajectory.from_dict(data)
    data["pieces"]["coefficients"] = [[[0.5], [1.0]]]
    for wrong in ({"begin": False}, {"end": "1"}, {"step": True}, {"step": 1.9}, {"begin": float("nan")}):
        segment = {"step": 1, "kind": "move", "name": "move", "begin": 0.0, "end": 1.0} | wrong
        with pytest.raises(InputError, match="segments"):
            Trajectory.from_dict({**data, "segments": [segment]})


@pytest.mark.parametrize("first", [0.0, 5.0, -2.0])
def test_the_report_says_that_times_are_counted_from_the_first_one(tmp_path, first):
    file = tmp_path / "motion.csv"
    file.write_text(f"t,a\n{first},0\n{first + 1},0.5\n{first + 2},1\n")
    samples = read_samples(file)
    assert samples.trajectory().duration == 2.0
    assert (f"counted from the first one, {first:g} s" in samples.interpolation) == (first != 0.0)
