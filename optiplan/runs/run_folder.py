"""The run folder: `run.json` and `trajectory.json`, written atomically."""

import json
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Protocol

from pydantic_core import to_json

from optiplan.errors import InputError, Issue, os_reason, path_argument
from optiplan.files import folder_of, parsed_json, read_bytes, write_together
from optiplan.records import dataclass
from optiplan.runs.record_kinds import check_record
from optiplan.trajectory.given_files import SAMPLES, GivenFiles
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import jsonable

RUN, TRAJECTORY = "run.json", "trajectory.json"
RATE = 200.0
"""Samples of `trajectory.json`, Hz; for other programs, since the pieces are the motion."""


class Saved(Protocol):
    """The parts of a run that are stored."""

    @property
    def trajectory(self) -> Trajectory | None:
        """Return the motion, if there is one."""

    def to_dict(self) -> dict[str, Any]:
        """Everything else."""

    def more_samples(self, rate: float) -> dict[str, Any]:
        """What stands beside the samples of the joints, at their times."""


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A run as read from disk.

    Attributes:
        place: the file or folder given.
        record: content of `run.json`; empty when only a trajectory file was given.
        trajectory: None when the run has none, because the planner failed.
        given: what stands in the files beside the motion.
        interpolation: the interpolation of the samples, in words, where the file has no pieces; else empty.
    """

    place: Path
    record: Mapping[str, Any]
    trajectory: Trajectory | None
    given: GivenFiles = field(default_factory=GivenFiles)
    interpolation: str = ""

    @property
    def record_file(self) -> Path:
        """The path of the `run.json`."""
        return folder_of(self.place) / RUN


def save_run(run: Saved, folder: Path, beside: Mapping[str, bytes] | None = None, older: Iterable[str] = ()) -> None:
    """Write a run; an older run in the folder is replaced. A run without trajectory leaves `run.json` alone.

    `run.json` is taken away first and renamed into place last: a folder that has one is complete. Where its content
    cannot be written, the older one is as it was.

    Args:
        run: the run.
        folder: made when it is not there.
        beside: further files of the run, by name; None: none.
        older: names of further files that an older run may have.

    Raises:
        InputError: the folder cannot be made or written.
    """
    try:
        write_together(folder, {**(beside or {}), **run_files(run)}, RUN, (TRAJECTORY, *older))
    except OSError as error:
        raise _unusable(folder, error, "a folder that can be written") from error


def run_files(run: Saved) -> dict[str, bytes]:
    """Return the files of a run folder by name; a run without trajectory has `run.json` alone."""
    record = json.dumps(jsonable(run.to_dict()), allow_nan=False, indent=1, default=repr)
    return {RUN: (record + "\n").encode(), **motion_file(run)}


def motion_file(run: Saved, rate: float | None = RATE) -> dict[str, bytes]:
    """Return `trajectory.json` with samples at a rate, Hz, at least; None: pieces alone. Empty without a trajectory."""
    if run.trajectory is None:
        return {}
    data = {**run.trajectory.to_dict(rate=rate), **({} if rate is None else run.more_samples(rate))}
    return {TRAJECTORY: to_json(data, inf_nan_mode="null") + b"\n"}


def folder_argument(function: str, out: object, check: Callable[[Path], object] | None = None) -> Path | None:
    """Return the folder in which a result is to be written, checked before it is made; None where none is given.

    Raises:
        InputError: it is no path, or cannot be written.
    """
    folder = None if out is None else path_argument(function, "out", out, "the path of a folder")
    if folder is not None:
        (check or check_folder)(folder)
    return folder


def check_folder(folder: Path) -> None:
    """Check by a trial write that a run can be saved in a folder; leaves nothing behind.

    Raises:
        InputError: it is a file, or it or its nearest parent cannot be written.
    """
    parent = folder.absolute()
    try:
        folder.exists()
    except OSError as error:  # such as a name that is too long
        raise _cannot_write(folder, os_reason(error)) from None
    while not (parent.exists() or parent.is_symlink()):
        parent = parent.parent
    found = None
    if not parent.is_dir():
        found = f"{parent} is {'a file' if parent.exists() else 'a link to nothing'}"
    else:
        try:
            with tempfile.TemporaryFile(dir=parent) as file:
                file.write(b"optiplan")
        except OSError as error:
            found = f"{parent} cannot be written ({os_reason(error)})"
    for name in (RUN, TRAJECTORY):
        if (folder / name).is_dir():
            found = f"{folder / name} is a folder"
    if found is not None:
        raise _cannot_write(folder, found)


def _cannot_write(folder: Path, found: str) -> InputError:
    return InputError([Issue(str(folder), None, "out", found, "a folder that can be written")])


def load_run(place: Path | str, joint_names: Sequence[str] | None = None) -> StoredRun:
    """Read a run folder, one of its two files, or a trajectory file from elsewhere: pieces, or samples (JSON or CSV).

    Args:
        place: the folder or file.
        joint_names: of the robot, for samples that name no joints or have them in another order.

    Raises:
        InputError: there is no run, or a file of it is broken.
    """
    place = Path(place)
    folder = folder_of(place)
    if folder is place or place.name == RUN:
        record = _read_record(folder / RUN)
        trajectory = folder / TRAJECTORY
        if record.get("failure") is None or trajectory.exists():
            return _with_motion(StoredRun(place, record, None), trajectory, joint_names)
        return StoredRun(place, record, None)
    beside = folder / RUN
    own = place.name == TRAJECTORY and beside.exists()
    return _with_motion(StoredRun(place, _read_record(beside) if own else {}, None), place, joint_names)


def _with_motion(run: StoredRun, file: Path, joint_names: Sequence[str] | None) -> StoredRun:
    """Return the run with the motion of a trajectory file: its pieces, else its interpolated samples."""
    from optiplan.trajectory.sample_file import read_samples, samples_from_dict

    if file.suffix.lower() == ".csv":
        samples = read_samples(file, joint_names)
    else:
        data = _read(file)
        if "pieces" in data or not SAMPLES & data.keys():
            motion = Trajectory.from_dict(data, str(file))
            return replace(run, trajectory=motion, given=GivenFiles.of(data, run.record, str(file)))
        samples = samples_from_dict(data, str(file), joint_names)
        run = replace(run, given=GivenFiles(None, data, run.record))
    return replace(run, trajectory=samples.trajectory(), interpolation=samples.interpolation)


def _read_record(path: Path) -> dict[str, Any]:
    """Read a `run.json` and check the kinds of its values."""
    record = _read(path)
    if not record:
        raise InputError([Issue(str(path), None, "file", "no entries", "what `optiplan plan --out` writes there")])
    check_record(record, str(path))
    return record


def _read(path: Path) -> dict[str, Any]:
    try:
        data = parsed_json(read_bytes(path).decode("utf-8-sig"))
    except OSError as error:
        raise _unusable(path, error, "a run folder or file") from error
    except json.JSONDecodeError as error:
        found = "YAML" if path.suffix in (".yaml", ".yml") else f"broken JSON ({error.msg})"
        expected = "JSON, such as a file of the folder that `optiplan plan FILE --out DIR` writes"
        raise InputError([Issue(str(path), error.lineno, "file", found, expected)]) from error
    except (ValueError, RecursionError) as error:  # no UTF-8, or a number of thousands of digits
        raise InputError([Issue(str(path), None, "file", "not readable as JSON text", "JSON")]) from error
    if not isinstance(data, dict):
        raise InputError([Issue(str(path), None, "file", f"a {type(data).__name__}", "a JSON object")])
    return data


def _unusable(path: Path, error: OSError, expected: str) -> InputError:
    return InputError([Issue(str(path), None, "file", os_reason(error), expected)])
