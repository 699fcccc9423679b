"""Identify the code of runs: OptiPlan's, by version, commit and content, and that of outside planners."""

import ast
import hashlib
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import optiplan

CODE = (".py", ".so", ".pyd")
"""Suffixes of files that hold code."""

DIGITS = 12
"""Of a digest, as shown."""


@cache
def own_digest() -> str:
    """SHA-256, in hex, of the files of the package `optiplan` that hold code, with their paths below it."""
    return _digest(_files_of(Path(optiplan.__file__).parent))


@cache
def own_code() -> str:
    """Version, commit and digest of OptiPlan in one line; a commit with files changed since ends in `+`.

    The commit is left out where the package is not part of a Git checkout.
    """
    return " ".join(filter(None, (optiplan.__version__, _commit(), own_digest()[:DIGITS])))


def planner_code(name: str, options: Mapping[str, Any]) -> str:
    """SHA-256, in hex, of a planner's own files; empty for a planner of ours that is given no files.

    Of a planner from outside these are all code files of its package; of one in a single module that module, and the
    modules and packages beside it that it imports, and so on. A file that an option names counts with its content.
    The planner is not imported.
    """
    files = [path for value in options.values() for path in _named(value)]
    module = name.partition(":")[0]
    if ":" in name and not module.startswith("optiplan."):
        files += _files_of_module(module.partition(".")[0])
    return _digest(files) if files else ""


def _named(value: Any) -> Iterator[Path]:
    values = value if isinstance(value, list | tuple) else [value]
    yield from (Path(each) for each in values if isinstance(each, str) and each and Path(each).is_file())


def _files_of_module(top: str) -> list[Path]:
    """The files of a top-level module or package; none where it cannot be found, which its runs will tell."""
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        return []
    if spec is None:
        return []
    if spec.submodule_search_locations is not None:
        return [path for folder in spec.submodule_search_locations for path in _files_of(Path(folder))]
    return _with_neighbours(Path(spec.origin)) if spec.origin else []


def _with_neighbours(module: Path) -> list[Path]:
    """A module and what lies beside it that it imports, directly or not."""
    found: dict[Path, None] = {}
    waiting = [module]
    while waiting:
        path = waiting.pop()
        if path in found:
            continue
        found[path] = None
        for name in _imported(path) if path.suffix == ".py" else ():
            beside = path.parent / name.partition(".")[0]
            waiting += [beside.with_suffix(".py")] if beside.with_suffix(".py").is_file() else []
            found |= dict.fromkeys(_files_of(beside) if beside.is_dir() else ())
    return list(found)


def _imported(path: Path) -> Iterator[str]:
    try:
        tree = ast.parse(path.read_bytes())
    except SyntaxError:
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


def _files_of(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix in CODE and path.is_file())


def _digest(files: Iterable[Path]) -> str:
    """Digest of contents and names; neither the order nor the folder in common counts."""
    parts = sorted((path.name, hashlib.sha256(path.read_bytes()).hexdigest()) for path in files)
    return hashlib.sha256("\n".join(f"{digest} {name}" for name, digest in parts).encode()).hexdigest()


def _commit() -> str:
    folder = Path(optiplan.__file__).parent
    if not (folder.parent / ".git").exists():
        return ""
    commit, changed = (_git(folder, *words) for words in (("rev-parse", "HEAD"), ("status", "--porcelain", "--", ".")))
    return commit[:DIGITS] + ("+" if commit and changed else "")


def _git(folder: Path, *words: str) -> str:
    try:
        return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
