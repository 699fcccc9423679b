"""Verified episodes as data sets of LeRobot, format v3.0, without cameras: one data set a robot.

    meta/info.json, meta/stats.json, meta/tasks.parquet
    meta/episodes/chunk-000/file-000.parquet   a row an episode: length, place of its frames, statistics
    meta/proofs/file-000.parquet               ours: seed, hash, planner, verdict with all checks, motion in pieces
    data/chunk-000/file-000.parquet            a row a frame, a row group an episode

Frame k stands for the time k / fps. `observation.state` is q(k / fps), `action` is q((k + 1) / fps), the position to
go to next, and at the last frame the end itself; rad or m, float32. Quantiles over all episodes are means of those of
the episodes, weighted by their frames, as LeRobot aggregates them.

Source: `lerobot.datasets` of version 0.4.4, whose loader reads what this writes.
"""

import json
import shutil
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.files import write_text
from optiplan.runs.batches.episode import VERIFIED
from optiplan.runs.batches.store import BatchStore, array_of, pyarrow_modules

VERSION = "v3.0"
FILES_A_CHUNK = 1000
DATA_MB, VIDEO_MB = 100, 200
EPISODES_A_FILE = 10_000
"""Episodes in a file of `meta/episodes` and `meta/proofs`."""

DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
PROOFS = "meta/proofs"
"""Only data sets of ours have it."""
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
PROOF = ("file", "name", "seed", "hash", "planner", "duration", "lower_bound", "versions", "report", "trajectory")


def write_lerobot(store: BatchStore, folder: Path) -> list[Path]:
    """Write the verified episodes of a batch below `folder`, one data set a robot, in place of all older ones.

    Returns:
        The folders of the data sets.

    Raises:
        OSError: a folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    open_sets: dict[tuple[str, ...], _DataSet] = {}
    names: dict[tuple[str, ...], str] = {}
    for row in store.rows(["state", "robot", "joints", "rate", "task", "positions", *PROOF]):
        if row["state"] != VERIFIED:
            continue
        robot = (row["robot"], *row["joints"])
        if robot not in open_sets:
            names[robot] = _free_name(row["robot"], names.values())
            open_sets[robot] = _DataSet(folder / f".making-{names[robot]}", row)
        open_sets[robot].add(row)
    made = []
    for robot, data in open_sets.items():
        data.close()
        target = folder / names[robot]
        if target.exists():
            shutil.rmtree(target)
        data.folder.rename(target)
        made.append(target)
    for older in {path.parents[1] for path in folder.glob(f"*/{PROOFS}")} - {*made}:
        shutil.rmtree(older)
    return made


def _free_name(robot: str, taken: Collection[str]) -> str:
    """A folder for a robot: its name, with a number where another one has it; `.` and `..` are folders already."""
    plain = "".join(c if c.isalnum() or c in "-_." else "_" for c in robot).strip(".") or "robot"
    numbered = (plain if k == 0 else f"{plain}_{k + 1}" for k in range(len(taken) + 1))
    return next(name for name in numbered if name not in taken)


class _DataSet:
    """One data set that is being written."""

    def __init__(self, folder: Path, row: Mapping[str, Any]) -> None:
        self._pa, self._pq = pyarrow_modules()
        shutil.rmtree(folder, ignore_errors=True)
        self.folder = folder
        self.robot, self.joints = str(row["robot"]), list(row["joints"])
        self.rate = int(row["rate"])
        self.frames, self.episodes = 0, 0
        self.tasks: dict[str, int] = {}
        self.statistics = _Statistics()
        self._data: Any = None
        self._file = -1
        self._bytes = 0
        self._rows: list[dict[str, Any]] = []
        self._proofs: list[dict[str, Any]] = []

    def add(self, row: Mapping[str, Any]) -> None:
        """Append one episode."""
        pa = self._pa
        positions = array_of(row, "positions")
        k, task = len(positions), self.tasks.setdefault(str(row["task"]), len(self.tasks))
        columns = {
            "observation.state": positions,
            "action": np.concatenate([positions[1:], positions[-1:]]),
            "timestamp": (np.arange(k) / self.rate).astype(np.float32),
            "frame_index": np.arange(k),
            "episode_index": np.full(k, self.episodes),
            "index": np.arange(self.frames, self.frames + k),
            "task_index": np.full(k, task),
        }
        schema = self._frames_schema()
        arrays = [
            pa.FixedSizeListArray.from_arrays(pa.array(values.ravel(), pa.float32()), len(self.joints))
            if values.ndim == 2
            else pa.array(values, schema.field(name).type)
            for name, values in columns.items()
        ]
        table = pa.Table.from_arrays(arrays, schema=schema)
        self._write_frames(table)
        statistics = self.statistics.add(columns)
        self._rows.append(
            {
                "episode_index": self.episodes,
                "tasks": [str(row["task"])],
                "length": k,
                "data/chunk_index": self._file // FILES_A_CHUNK,
                "data/file_index": self._file % FILES_A_CHUNK,
                "dataset_from_index": self.frames,
                "dataset_to_index": self.frames + k,
                **{f"stats/{name}/{key}": value for name, of in statistics.items() for key, value in of.items()},
            }
        )
        self._proofs.append({"episode_index": self.episodes, **{key: row[key] for key in PROOF}})
        self.frames += k
        self.episodes += 1
        if len(self._rows) == EPISODES_A_FILE:
            self._write_episodes()

    def close(self) -> None:
        """Write what is still in memory, and the files about the whole."""
        self._write_episodes()
        self._data.close()
        features: dict[str, dict[str, Any]] = {
            name: {"dtype": "float32", "shape": [len(self.joints)], "names": [f"{joint}.pos" for joint in self.joints]}
            for name in ("observation.state", "action")
        }
        single = dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")
        for name, kind in {"timestamp": "float32", **single}.items():
            features[name] = {"dtype": kind, "shape": [1], "names": None}
        info = {
            "codebase_version": VERSION,
            "robot_type": self.robot,
            "total_episodes": self.episodes,
            "total_frames": self.frames,
            "total_tasks": len(self.tasks),
            "chunks_size": FILES_A_CHUNK,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": self.rate,
            "splits": {"train": f"0:{self.episodes}"},
            "data_path": DATA_PATH,
            "video_path": None,
            "features": features,
        }
        write_text(self.folder / "meta" / "info.json", json.dumps(info, indent=4) + "\n")
        write_text(self.folder / "meta" / "stats.json", json.dumps(self.statistics.total(), indent=4) + "\n")
        self._write_tasks()

    def _frames_schema(self) -> Any:
        pa = self._pa
        vector = pa.list_(pa.float32(), len(self.joints))
        named = [("observation.state", vector), ("action", vector), ("timestamp", pa.float32())]
        whole = ("frame_index", "episode_index", "index", "task_index")
        return pa.schema([*named, *((name, pa.int64()) for name in whole)])

    def _write_frames(self, table: Any) -> None:
        """Write the frames of one episode as a row group, into a new file where the last one is full."""
        if self._data is None or self._bytes + table.nbytes > DATA_MB * 2**20:
            if self._data is not None:
                self._data.close()
            self._file, self._bytes = self._file + 1, 0
            place = {"chunk_index": self._file // FILES_A_CHUNK, "file_index": self._file % FILES_A_CHUNK}
            path = self.folder / DATA_PATH.format(**place)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._data = self._pq.ParquetWriter(path, table.schema, compression="snappy")
        self._data.write_table(table)
        self._bytes += table.nbytes

    def _write_episodes(self) -> None:
        if not self._rows:
            return
        number = (self.episodes - 1) // EPISODES_A_FILE
        place = {"chunk_index": number // FILES_A_CHUNK, "file_index": number % FILES_A_CHUNK}
        rows = [{**row, **{f"meta/episodes/{key}": value for key, value in place.items()}} for row in self._rows]
        for path, content in (
            (self.folder / EPISODES_PATH.format(**place), rows),
            (self.folder / PROOFS / f"file-{number:03d}.parquet", self._proofs),
        ):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._pq.write_table(self._pa.Table.from_pylist(content), path, compression="snappy")
        self._rows, self._proofs = [], []

    def _write_tasks(self) -> None:
        """Write the tasks as a table whose index is the text of the task: pandas' own mark says so."""
        table = self._pa.table({"task_index": list(self.tasks.values()), "task": list(self.tasks)})
        kinds = (("task_index", "int64", "int64"), ("task", "unicode", "object"))
        columns = [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
            for name, kind, numpy in kinds
        ]
        mark = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
        table = table.replace_schema_metadata({"pandas": json.dumps(mark)})
        self._pq.write_table(table, self.folder / "meta" / "tasks.parquet")


class _Statistics:
    """Minimum, maximum, mean, standard deviation, count and quantiles of every column, over episodes and over all."""

    def __init__(self) -> None:
        self._sums: dict[str, dict[str, Array]] = {}

    def add(self, columns: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, dict[str, list[float]]]:
        """Add an episode, and return the statistics of it alone."""
        found = {}
        for name, values in columns.items():
            x = np.asarray(values, float).reshape(len(values), -1)
            own = {"min": x.min(0), "max": x.max(0), "mean": x.mean(0), "std": x.std(0)}
            own |= {key: np.quantile(x, q, axis=0) for key, q in QUANTILES.items()}
            found[name] = {**{key: value.tolist() for key, value in own.items()}, "count": [len(x)]}
            self._merge(name, own, x)
        return found

    def _merge(self, name: str, own: Mapping[str, Array], x: Array) -> None:
        """Add sums; the variance of all is E[x²] - E[x]², from sums about the first mean against cancellation."""
        sums = self._sums.setdefault(name, {"count": np.zeros(1), "about": own["mean"]})
        k, shifted = len(x), x - sums["about"]
        for key, value in {"sum": shifted.sum(0), "squares": (shifted**2).sum(0)}.items():
            sums[key] = sums.get(key, 0.0) + value
        for key in QUANTILES:
            sums[key] = sums.get(key, 0.0) + k * own[key]
        sums["min"] = np.minimum(sums.get("min", own["min"]), own["min"])
        sums["max"] = np.maximum(sums.get("max", own["max"]), own["max"])
        sums["count"] = sums["count"] + k

    def total(self) -> dict[str, dict[str, list[float]]]:
        """Return the statistics over all episodes."""
        found: dict[str, dict[str, list[float]]] = {}
        for name, sums in self._sums.items():
            count = sums["count"]
            mean = sums["sum"] / count
            spread = np.sqrt(np.maximum(sums["squares"] / count - mean**2, 0.0))
            found[name] = {
                "min": sums["min"].tolist(),
                "max": sums["max"].tolist(),
                "mean": (sums["about"] + mean).tolist(),
                "std": spread.tolist(),
                "count": [int(count[0])],
                **{key: (sums[key] / count).tolist() for key in QUANTILES},
            }
        return found
