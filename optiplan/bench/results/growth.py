"""Results that grow: what may be added to a folder, what must agree, and results of several folders in one.

A folder grows by planners, problems, seeds and repetitions. What its runs are measured by must be the same in all:
budget, hard limits and metrics, the content of a problem and the options and code of a planner, and OptiPlan's code.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import product
from pathlib import Path
from typing import Any

from optiplan.bench.results.database import Store
from optiplan.bench.results.records import Key
from optiplan.bench.suite.suite import code_differences, hash_of_parts, suite_differences
from optiplan.config.messages import some
from optiplan.errors import InputError, Issue
from optiplan.records import dataclass

SAME = ("budget", "limits", "metrics")
"""Parts of a suite that all runs of a folder have in common."""

WHICH = "started_at, worker, plan_time, duration, trajectory"
"""Columns that are alike in copies of one run, and hardly in two runs."""

Parts = Mapping[str, Any]
"""`Suite.parts` or `Suite.code`."""

SuiteRuns = list[list[Any]]
"""Problems, planners, seeds and repetitions of a suite, JSON-ready."""


def grown(old: Parts, new: Parts) -> tuple[dict[str, Any], list[str]]:
    """Parts of both suites together, and what prevents that, one sentence each."""
    conflicts = suite_differences(old, {part: new[part] for part in SAME})
    together: dict[str, Any] = {part: old.get(part) for part in SAME}
    for part in ("planners", "problems"):
        changed = [name for name, value in new[part].items() if old[part].get(name, value) != value]
        if changed:
            conflicts.append(f"{part}: the same name and another content: {some(changed)}")
        together[part] = {**old[part], **new[part]}
    together["seeds"] = list(dict.fromkeys([*old["seeds"], *new["seeds"]]))
    together["repetitions"] = max(old["repetitions"], new["repetitions"])
    return together, conflicts


def grown_code(old: Parts | None, new: Parts | None) -> tuple[dict[str, Any], list[str]]:
    """Code of both together, and what prevents that."""
    if old is None or new is None:
        return dict(new or old or {}), [] if old == new else ["code: not recorded in one of them"]
    together = {**old, "planners": {**old["planners"], **new["planners"]}}
    return together, code_differences(old, new)


def suite_runs(parts: Parts) -> SuiteRuns:
    """The runs of a suite: its problems, planners, seeds and repetitions, every one with every other."""
    return [*(list(parts[part]) for part in ("problems", "planners", "seeds")), list(range(parts["repetitions"]))]


def suites_of(store: Store) -> list[SuiteRuns]:
    """The runs of every suite that a folder holds results of."""
    return store.meta("suites", None) or [suite_runs(store.meta("parts"))]


def expected_runs(store: Store) -> int:
    """Number of runs of the suites of a folder, or of the folders that are shown together."""
    shown = store.meta("expected", None)
    return len({key for suite in suites_of(store) for key in product(*suite)}) if shown is None else int(shown)


def merge_results(folders: Sequence[Path], into: Path) -> Store:
    """Copy the results of several folders into one that holds none yet, and return it, open.

    A run that two folders share, because one is a copy of the other, comes once.

    Raises:
        InputError: what must agree does not, or two folders have different runs of one problem, planner, seed and
            repetition; holds everything found.
        StoreError: the folder cannot be written.
    """
    issues: list[Issue] = []
    with _opened(folders) as stores:
        parts, code = dict(stores[0].meta("parts")), stores[0].code
        for store in stores[1:]:
            parts, unlike = grown(parts, store.meta("parts"))
            code, other = grown_code(code, store.code)
            expected = f"what {folders[0]} has (`optiplan bench report {folders[0]} {store.folder} …` shows both)"
            issues += [Issue(str(store.folder), None, "merge", text, expected) for text in (*unlike, *other)]
        issues += _made_twice(stores)
        if issues:
            raise InputError(issues)
        names = dict.fromkeys(str(store.meta("name")) for store in stores)
        suites = [str(store.meta("suite")) for store in stores]
        meta: dict[str, Any] = {"name": " + ".join(names), "suite": "\n---\n".join(dict.fromkeys(suites))}
        meta |= {"suite_hash": hash_of_parts(parts), "parts": parts, **({"code": code} if code else {})}
        meta |= {"suites": [runs for store in stores for runs in suites_of(store)], "best_known": _best_known(stores)}
        with Store.filled(into, meta) as target:
            for store in stores:
                target.absorb(store, {})
    return Store(into)


@dataclass(frozen=True)
class Source:
    """A folder whose results are shown together with others.

    Attributes:
        folder: its path.
        sessions: the first of its sessions, and the first beyond them, as they are counted together.
        labels: what its planners are called together, to what they are called there.
    """

    folder: str
    sessions: tuple[int, int]
    labels: Mapping[str, str]


def together(folders: Sequence[Path], into: Path) -> Store:
    """Put results of several folders side by side into a folder, for one report, and return it, open.

    Only problems must be the same; everything else may differ, and meta `notes` says what does. A planner that is not
    the same everywhere, or that made the same runs in two folders, is called `label (folder)`.

    Raises:
        InputError: a problem of one name has different contents.
        StoreError: the folder cannot be written.
    """
    with _opened(folders) as stores:
        parts, issues, notes = dict(stores[0].meta("parts")), [], []
        for store in stores[1:]:
            whole, unlike = grown(parts, store.meta("parts"))
            expected = f"the problems of {folders[0]}, or others"
            wrong = [text for text in unlike if text.startswith("problems:")]
            issues += [Issue(str(store.folder), None, "report", text, expected) for text in wrong]
            words = [text for text in unlike if not text.startswith(("problems:", "planners:"))]
            words += [text for text in grown_code(stores[0].code, store.code)[1] if text.startswith("code: opt")]
            notes += [_of_both(text, folders[0], store.folder) for text in words]
            parts = whole
        if issues:
            raise InputError(issues)
        with ExitStack() as undone:
            target = undone.enter_context(Store.create(into, _meta(stores, parts, notes)))
            sources = [_absorbed(target, store, labels) for store, labels in zip(stores, _labels(stores), strict=True)]
            target.set_meta("sources", [vars(source) for source in sources])
            undone.pop_all()
        return target


def place_of(store: Store, key: Key) -> tuple[str, Key]:
    """The folder that a run is stored in, and its key there; another than the store's own for results put together."""
    sources = [Source(**source) for source in store.meta("sources", ())]
    if not sources:
        return str(store.folder), key
    columns = "problem = ? AND planner = ? AND seed = ? AND repetition = ?"
    session = store.query(f"SELECT session FROM runs WHERE {columns}", key)[0]["session"]
    source = next(one for one in sources if one.sessions[0] <= session < one.sessions[1])
    return source.folder, (key[0], source.labels[key[1]], key[2], key[3])


@contextmanager
def _opened(folders: Sequence[Path]) -> Iterator[list[Store]]:
    with ExitStack() as opened:
        yield [opened.enter_context(Store(folder)) for folder in folders]


def _meta(stores: Sequence[Store], parts: Parts, notes: list[str]) -> dict[str, Any]:
    names = dict.fromkeys(str(store.meta("name")) for store in stores)
    suites = [f"# {store.folder}\n{store.meta('suite')}" for store in stores]
    meta = {"name": " + ".join(names), "suite": "\n".join(suites), "suite_hash": "", "parts": parts}
    meta |= {"best_known": _best_known(stores)}
    return {**meta, "notes": list(dict.fromkeys(notes)), "expected": sum(map(expected_runs, stores))}


def _best_known(stores: Sequence[Store]) -> dict[str, float]:
    """The shortest duration of each problem that a store was held against, s."""
    every = [known for store in stores for known in store.meta("best_known", {}).items()]
    return dict(sorted(every, key=lambda known: -known[1]))  # of one problem the shortest comes last, and stays


def _absorbed(target: Store, store: Store, labels: Mapping[str, str]) -> Source:
    sessions = target.absorb(store, labels)
    return Source(str(store.folder), sessions, {new: old for old, new in labels.items()})


def _labels(stores: Sequence[Store]) -> list[dict[str, str]]:
    """Of every store what its planners are called together."""
    kinds: dict[str, set[str]] = {}
    keys: dict[str, list[set[Key]]] = {}
    for store in stores:
        code = store.code or {"digest": "", "planners": {}}
        done = store.done()
        for label, value in store.meta("parts")["planners"].items():
            kind = json.dumps([value, code["digest"], code["planners"].get(label)], sort_keys=True)
            kinds.setdefault(label, set()).add(kind)
            keys.setdefault(label, []).append({key for key in done if key[1] == label})
    twice = {label for label, each in keys.items() if sum(map(len, each)) > len(set().union(*each))}
    unlike = twice | {label for label, found in kinds.items() if len(found) > 1}
    names = [store.folder.name for store in stores]
    tails = names if len(set(names)) == len(names) else [str(store.folder) for store in stores]
    return [
        {label: f"{label} ({tail})" if label in unlike else label for label in store.meta("parts")["planners"]}
        for store, tail in zip(stores, tails, strict=True)
    ]


def _made_twice(stores: Sequence[Store]) -> list[Issue]:
    """Runs of one key that are not copies of one run."""
    seen: dict[Key, tuple[Any, Path]] = {}
    issues = []
    for store in stores:
        unlike: dict[Path, list[Key]] = {}
        for row in store.query(f"SELECT problem, planner, seed, repetition, {WHICH} FROM runs"):
            key, content = (row[0], row[1], row[2], row[3]), tuple(row)[4:]
            first, folder = seen.setdefault(key, (content, store.folder))
            if first != content:
                unlike.setdefault(folder, []).append(key)
        for folder, keys in unlike.items():
            words = some([f"{planner} on {problem}, seed {seed}" for problem, planner, seed, _ in keys])
            found = f"{len(keys)} runs that {folder} has, too, made another time: {words}"
            expected = "each run in one of the folders, or copies of it"
            issues.append(Issue(str(store.folder), None, "merge", found, expected))
    return issues


def _of_both(text: str, first: Path, second: Path) -> str:
    return text.replace(" there", f" in {first}").replace(" here", f" in {second}")
