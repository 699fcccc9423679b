"""Configurations from users: arrays, values by joint, names of configurations."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from optiplan.arrays import Array, is_finite
from optiplan.config.messages import choices
from optiplan.errors import described, wrong_argument


def is_by_name(value: Any) -> bool:
    """Return whether a value is a mapping from names to numbers."""
    return isinstance(value, Mapping) and bool(value) and all(map(is_finite, value.values()))


def in_order(names: Sequence[str], value: Mapping[str, float], function: str, argument: str) -> list[float]:
    """Return the values (n,) of a mapping by joint, in the order of the joints.

    Raises:
        InputError: a name that is no planned joint, or a joint without a value.
    """
    for _, found, expected in wrong_names(names, value):
        raise wrong_argument(function, argument, found, expected)
    return [float(value[joint]) for joint in names]


def wrong_names(names: Sequence[str], value: Iterable[str]) -> list[tuple[str | None, str, str]]:
    """Return what is wrong with values by joint: each unknown joint, else the joints without a value.

    Args:
        names: of the joints, each of which needs a value.
        value: the joints that have one.

    Returns:
        The unknown joint or None, what was found, and what was expected.
    """
    given = tuple(value)
    unknown = [joint for joint in given if joint not in names]
    if unknown:
        return [(joint, f"unknown joint '{joint}'", choices(joint, names)) for joint in unknown]
    missing = [joint for joint in names if joint not in given]
    expected = f"a value of each joint: {', '.join(names)}"
    return [(None, f"no value of {', '.join(missing)}", expected)] if missing else []


def configurations(
    names: Sequence[str], named: Mapping[str, Array], value: Any, function: str, argument: str = "q"
) -> Array:
    """Return one configuration (n,) or several (k, n), rad or m, of a robot with these joints.

    Args:
        names: of the planned joints.
        named: configurations by name.
        value: numbers (n,) or (k, n), a value by joint (`{joint: value}`), or the name of a configuration.
        function: called by the user, without `op.`.
        argument: its name there.

    Raises:
        InputError: none of these; unknown names come with the choices.
    """
    if isinstance(value, str):
        if value not in named:
            raise wrong_argument(function, argument, f"'{value}'", choices(value, tuple(named)))
        return np.array(named[value])
    if is_by_name(value):
        return np.array(in_order(names, value, function, argument))
    n, found = len(names), described(value)
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.ndim not in (1, 2) or array.shape[-1] != n or not np.isfinite(array).all():
        expected = f"{n} finite numbers, for {', '.join(names)}; an array (k, {n}) of them, or {{joint: value}}"
        raise wrong_argument(function, argument, found, expected)
    return array


def configuration(
    names: Sequence[str], named: Mapping[str, Array], value: Any, function: str, argument: str = "q"
) -> Array:
    """Return one configuration (n,), as `configurations`.

    Raises:
        InputError: none, or several.
    """
    q = configurations(names, named, value, function, argument)
    if q.ndim != 1:
        raise wrong_argument(function, argument, described(q), f"one configuration ({len(names)},)")
    return q
