"""The LeRobot data set: files, columns and figures of format v3.0, as `LeRobotDataset` looks for them."""

import json

import numpy as np
import pytest

from optiplan.runs.batches.episode import Episode
from optiplan.runs.batches.lerobot import write_lerobot
from optiplan.runs.batches.store import BatchStore

pq = pytest.importorskip("pyarrow.parquet")
RNG = np.random.default_rng(0)
LENGTHS = (5, 3, 8)


def episode(k, state="verified", joints=("j1", "j2"), robot="arm"):
    samples = RNG.normal(size=(LENGTHS[k % 3], len(joints))).astype(np.float32).ravel()
    said = {"name": f"p{k}", "hash": f"h{k}", "seed": k, "robot": robot, "task": f"set {k % 2}", "report": "{}"}
    return Episode(f"{k}.yaml", "d", -1, state, **said, joints=joints, rate=10.0, positions=samples, trajectory=b"{}")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    root = tmp_path_factory.mktemp("lerobot")
    with BatchStore(root / "batch", {}) as store:
        for k in range(3):
            store.add(episode(k))
        store.add(episode(3, "no-plan"))
        store.add(episode(4, joints=("j1", "j2", "j3")))
        store.flush()
        rows = list(store.rows())
        return write_lerobot(store, root / "sets"), rows


def test_one_data_set_a_robot_of_what_is_verified(made):
    folders, _ = made
    assert [folder.name for folder in folders] == ["arm", "arm_2"]
    info = json.loads((folders[0] / "meta" / "info.json").read_text())
    counts = [info[f"total_{what}"] for what in ("episodes", "frames", "tasks")]
    assert (info["codebase_version"], info["fps"], counts) == ("v3.0", 10, [3, 16, 2])
    assert info["splits"] == {"train": "0:3"}
    assert info["features"]["action"] == {"dtype": "float32", "shape": [2], "names": ["j1.pos", "j2.pos"]}


def test_frames_are_states_and_the_positions_to_go_to(made):
    (folder, _), rows = made
    info = json.loads((folder / "meta" / "info.json").read_text())
    path = folder / info["data_path"].format(chunk_index=0, file_index=0)
    table = pq.read_table(path)
    assert set(table.column_names) == set(info["features"])
    assert pq.ParquetFile(path).num_row_groups == 3
    columns = table.to_pydict()
    assert columns["index"] == list(range(16))
    assert columns["episode_index"] == [0] * 5 + [1] * 3 + [2] * 8
    assert columns["task_index"] == [0] * 5 + [1] * 3 + [0] * 8
    np.testing.assert_allclose(columns["timestamp"][5:8], [0.0, 0.1, 0.2], atol=1e-7)
    states = np.array(rows[0]["positions"]).reshape(-1, 2)
    np.testing.assert_array_equal(columns["observation.state"][:5], states)
    np.testing.assert_array_equal(columns["action"][:5], [*states[1:], states[-1]])


def test_episodes_say_where_their_frames_are(made):
    (folder, _), _ = made
    rows = pq.read_table(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [(row["dataset_from_index"], row["dataset_to_index"]) for row in rows] == [(0, 5), (5, 8), (8, 16)]
    assert [row["tasks"] for row in rows] == [["set 0"], ["set 1"], ["set 0"]]
    places = {key for key in rows[0] if key.endswith(("chunk_index", "file_index"))}
    assert places == {f"{what}/{kind}_index" for what in ("data", "meta/episodes") for kind in ("chunk", "file")}
    proofs = pq.read_table(folder / "meta" / "proofs" / "file-000.parquet").to_pylist()
    assert [(row["episode_index"], row["hash"], row["seed"]) for row in proofs] == [
        (0, "h0", 0),
        (1, "h1", 1),
        (2, "h2", 2),
    ]


def test_statistics_are_those_of_all_frames(made):
    (folder, _), rows = made
    found = json.loads((folder / "meta" / "stats.json").read_text())["observation.state"]
    everything = np.concatenate([np.array(row["positions"]).reshape(-1, 2) for row in rows[:3]])
    for key in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(found[key], getattr(everything, key)(axis=0), rtol=1e-6)
    assert found["count"] == [16]
    medians = [np.median(np.array(row["positions"]).reshape(-1, 2), axis=0) for row in rows[:3]]
    np.testing.assert_allclose(found["q50"], np.average(medians, axis=0, weights=LENGTHS), rtol=1e-6)


def test_a_robot_without_verified_episodes_has_no_data_set(tmp_path):
    with BatchStore(tmp_path / "batch", {}) as store:
        for states in (("verified", "verified"), ("verified", "no-plan")):
            for k, (state, robot) in enumerate(zip(states, ("left", "right"), strict=True)):
                store.add(episode(k, state, robot=robot))
            store.flush()
            made = write_lerobot(store, tmp_path / "sets")
    assert made == [*(tmp_path / "sets").iterdir()] == [tmp_path / "sets" / "left"]


def test_a_robot_called_like_a_folder_above_deletes_nothing(tmp_path):
    with BatchStore(tmp_path / "batch", {}) as store:
        store.add(episode(0, robot=".."))
        store.flush()
        assert write_lerobot(store, tmp_path / "batch" / "lerobot") == [tmp_path / "batch" / "lerobot" / "robot"]
        assert len(store.parts()) == 1


def test_tasks_are_a_table_by_text(made):
    pandas = pytest.importorskip("pandas")
    tasks = pandas.read_parquet(made[0][0] / "meta" / "tasks.parquet")
    assert tasks.loc["set 1"].task_index == 1
    assert tasks.iloc[0].name == "set 0"
