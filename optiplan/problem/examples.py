"""Find problem files by path, or by the name of an example shipped with OptiPlan."""

import difflib
import os
from collections.abc import Iterable
from pathlib import Path

from optiplan.errors import InputError, Issue
from optiplan.files import is_folder
from optiplan.resources import problems_dir

_ROBOT = "the description of a robot, of which `optiplan robots init` makes a robot file for problems (`robot: …`)"
_RUN = "what came of a run (`optiplan view` shows it)"
_NOT_PROBLEMS = {".urdf": _ROBOT, ".xacro": _ROBOT, ".srdf": _ROBOT}
_RUN_FILES = ("run.json", "trajectory.json")


def find_problem(name: str) -> Path:
    """Find the file of `name`: a path that exists, else `01_reach`, `01_reach.yaml` or `problems/01_reach.yaml`.

    Raises:
        InputError: no such file, with the most similar example; a file whose name is not that of a problem.
    """
    path = Path(name)  # `os.path` finds nothing where the name is longer than a file's can be, such as the text of one
    other = _NOT_PROBLEMS.get(path.suffix.lower()) or (_RUN if path.name in _RUN_FILES else None)
    if os.path.isfile(path) and other is None:
        return path
    examples = {example.stem: example for example in sorted(problems_dir().glob("*.yaml"))}
    if path.parent in (Path(), Path("problems")) and path.suffix in ("", ".yaml") and path.stem in examples:
        return examples[path.stem]
    if os.path.isfile(path) and other is not None:
        raise InputError([Issue(name, None, "file", other, "a problem file (YAML)")])
    is_path = bool(path.suffix) or path.parent != Path() or os.path.exists(path)  # such a name is of no example
    named = f"one of the examples: {', '.join(examples)}" if not is_path else "the name of an example, such as 01_reach"
    expected = f"a problem file, or {named}"
    if not os.path.exists(path):
        expected += _hint(path.stem, examples)
    raise InputError([Issue(name or "''", None, "file", _found(path) if name else "an empty name", expected)])


def _found(path: Path) -> str:
    if os.path.isfile(path / _RUN_FILES[0]):
        return f"the folder of a run: {_RUN}"
    if is_folder(path):
        return "is a folder"
    return "is no regular file" if os.path.exists(path) else "no such file"


def _hint(name: str, examples: Iterable[str]) -> str:
    """Return the example most similar to a name, or the only one that begins with it."""
    begun = [example for example in examples if name and example.startswith(name)]
    near = begun if len(begun) == 1 else difflib.get_close_matches(name, examples, n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""
