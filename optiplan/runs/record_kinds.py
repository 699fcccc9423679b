"""The kinds of the values of a `run.json`: a file edited by hand is bad input where it is read."""

from collections.abc import Callable, Mapping
from typing import Any

from optiplan.arrays import is_finite
from optiplan.config.messages import describe
from optiplan.errors import InputError, Issue
from optiplan.verify.bounds.duration_bound import DurationBound


def check_record(record: Mapping[str, Any], file: str) -> None:
    """Check the kinds of the values that runs are made of, and of no others.

    Raises:
        InputError: naming every field that is of another kind.
    """
    issues = []
    for key, fits in _FITS.items():
        value = record.get(key)
        absent = key not in record or (value is None and key not in _NEVER_NULL)
        if not (absent or fits(value)):
            issues.append(Issue(file, None, key, describe(value), "what `optiplan plan --out` writes there"))
    checks = [] if issues else (record.get("report") or {}).get("checks", [])
    if not isinstance(checks, list) or not all(isinstance(check, dict) for check in checks):
        issues.append(Issue(file, None, "report.checks", describe(checks), "a list of JSON objects"))
    if issues:
        raise InputError(issues)
    if record.get("proved_bound") is not None:
        DurationBound.from_dict(record["proved_bound"], file)


def _mapping(value: Any) -> bool:
    return isinstance(value, Mapping)


def _numbers(value: Any) -> bool:
    return isinstance(value, Mapping) and all(map(is_finite, value.values()))


def _timings(value: Any) -> bool:
    if not isinstance(value, Mapping):
        return False
    own = {key: seconds for key, seconds in value.items() if key not in ("stages", "plan_cpu")}
    cpu, stages = value.get("plan_cpu"), value.get("stages")
    return _numbers(own) and (cpu is None or is_finite(cpu)) and (stages is None or _numbers(stages))


def _failure(value: Any) -> bool:
    told = isinstance(value, Mapping) and all(isinstance(value.get(key), str) for key in ("kind", "detail"))
    return told and isinstance(value.get("witness") or {}, Mapping)


def _info(value: Any) -> bool:
    names = value.get("expressions", []) if isinstance(value, Mapping) else None
    return isinstance(names, list) and all(isinstance(name, str) for name in names)


def _improvements(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(one, list) and len(one) == 2 and all(map(is_finite, one)) for one in value
    )


_FITS: Mapping[str, Callable[[Any], bool]] = {
    "planner": lambda value: isinstance(value, str),
    "problem": _mapping,
    "options": _mapping,
    "seed": lambda value: isinstance(value, int) and not isinstance(value, bool) and value >= 0,
    "failure": _failure,
    "report": _mapping,
    "metrics": _mapping,
    "lower_bound": is_finite,
    "timings": _timings,
    "info": _info,
    "improvements": _improvements,
}

_NEVER_NULL = frozenset({"planner", "problem", "seed"})
