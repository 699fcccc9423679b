"""Checks of what stands in the files of a motion beside its pieces, upon which other programs act."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from optiplan.arrays import is_finite
from optiplan.kinematics.mecanum import WHEELS, wheel_matrix
from optiplan.problem.from_python import expression_names
from optiplan.problem.problem import Problem
from optiplan.problem.task.arms import in_task_order
from optiplan.robot.limits import ORDERS
from optiplan.trajectory.given_files import KNOWN, GivenFiles
from optiplan.trajectory.sample_file import Samples
from optiplan.trajectory.segments import segment_data
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.report import Check, VerifyPolicy

EVENT_TIME_TOLERANCE = 1e-6
"""s: how far the time of an event may be off that of its segment; files of other programs have fewer digits."""


def file_checks(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, given: GivenFiles) -> Iterator[Check]:
    """Yield a check of each part of the files that is there: expressions, samples, events, duration, wheels."""
    stated = (given.record.get("info") or {}).get("expressions", ())
    if lost := sorted({*stated} - {*expression_names(problem.path_constraints)}):
        yield Check("problem", "unchecked", False, detail=f"constraints that no file holds: {', '.join(lost)}")
    if given.samples is not None:
        yield samples(problem, trajectory, policy, given.samples)
    if trajectory.segments or any(key in file for file in _files(given).values() for key in ("segments", "events")):
        yield file_events(trajectory, given)
    if "duration" in given.record:
        yield duration(trajectory, given.record)
    sampled_run = bool(given.record) and "t" in given.motion  # its samples have those of the wheels beside them
    if {"wheels", "wheel_names"} & given.motion.keys() or (sampled_run and problem.robot.mecanum is not None):
        yield wheels(problem, trajectory, policy, given.motion)


def unread_keys(given: GivenFiles) -> tuple[str, ...]:
    """Return the statement of what stands in the motion's file and is neither read nor checked."""
    others = sorted(f"'{key:.40}'" for key in given.motion.keys() - KNOWN)
    return (f"in the file of the motion, neither read nor checked: {', '.join(others)}",) if others else ()


def sample_scope(given: GivenFiles) -> tuple[str, ...]:
    """Return the statement of when samples were held against the pieces, with their widest gap, s."""
    t = None if given.samples is None else given.samples.t
    if t is None or t.ndim != 1 or len(t) < 2:
        return ()
    widest = float(np.diff(t).max())
    return (f"{len(t)} samples, up to {widest:.3g} s apart: held against the motion at their own times, not between",)


def names(problem: Problem, trajectory: Trajectory) -> Check:
    """Check that segments have the names of their steps; without a task there are none."""
    found = [one.name for one in in_task_order(problem.task, trajectory.segments)]
    expected = [step.name for step in problem.task]
    if found == expected:
        return Check("segments", "exact", True, detail=f"{len(found)} segments with the names of their steps")
    if not expected:
        return Check("segments", "exact", False, detail=f"found {len(found)} segments; the problem has no task")
    k = next((k for k, (a, b) in enumerate(zip(found, expected, strict=False)) if a != b), 0)
    detail = f"found segment {k + 1} called '{found[k] if found else ''}'; expected '{expected[k]}'"
    return Check("segments", "exact", False, detail=detail)


def file_events(trajectory: Trajectory, given: GivenFiles) -> Check:
    """Check that `segments` and `file_events` of the files are those of the motion: each, in order, at its time.

    In the folder of a run both files have them.
    """
    own = segment_data(trajectory.segments)
    for file, data in _files(given).items():
        for key, expected in own.items():
            found = data.get(key, [] if given.record or key in data else expected)
            words = _unlike(found, expected)
            if words:
                return Check("events", "exact", False, place=f"{file}: {key}", detail=words)
    detail = f"{len(own['segments'])} segments and {len(own['events'])} events are those of the motion"
    return Check("events", "exact", True, detail=detail)


def duration(trajectory: Trajectory, record: Mapping[str, Any]) -> Check:
    """Check that the duration of `run.json` is that of the motion."""
    found = record["duration"]
    passed = _same(found, trajectory.duration)
    detail = "" if passed else f"run.json says {found!r:.40} s"
    return Check("duration", "exact", passed, trajectory.duration, unit="s", detail=detail)


def wheels(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, motion: Mapping[str, Any]) -> Check:
    """Check that `wheels` (k, 4), rad/s, at the times `t` (k,), are those that move the base as the motion does.

    |w_k - M(q) v| <= |M(q)| (rest_tolerance v_max), as of sampled velocities.
    """
    robot = problem.robot
    if robot.mecanum is None:
        return Check("wheels", "exact", False, detail=f"found rates of wheels; {robot.name} has none here")
    if motion.get("wheel_names") != list(WHEELS):
        found = f"found wheels {motion.get('wheel_names')!r:.80}; expected {', '.join(WHEELS)}"
        return Check("wheels", "exact", False, detail=found)
    try:
        t, given = (np.asarray(motion.get(key), dtype=float) for key in ("t", "wheels"))
    except (TypeError, ValueError, OverflowError):
        return Check("wheels", "exact", False, detail="found wheels that are no table of numbers")
    if t.ndim != 1 or not t.size or given.shape != (len(t), len(WHEELS)) or not np.isfinite(given).all():
        expected = f"finite rates of shape ({t.size}, {len(WHEELS)}), at the times t"
        return Check("wheels", "exact", False, detail=f"found wheels of shape {given.shape}; expected {expected}")
    inside = np.clip(t, 0.0, trajectory.duration)
    Q = trajectory(inside)
    matrices = np.array([wheel_matrix(robot, q) for q in Q])  # (k, 4, n)
    error = np.abs(given - np.einsum("kwj,kj->kw", matrices, trajectory(inside, 1)))
    allowed = np.abs(matrices) @ (policy.rest_tolerance * problem.limits.velocity)
    k, wheel = divmod(int(np.argmax(error / allowed)), len(WHEELS))
    worst, limit = float(error[k, wheel]), float(allowed[k, wheel])
    detail = f"{len(t)} samples; farthest from the motion"
    return Check("wheels", "exact", worst <= limit, worst, limit, "rad/s", float(t[k]), WHEELS[wheel], detail)


def _files(given: GivenFiles) -> dict[str, Mapping[str, Any]]:
    return {"trajectory.json": given.motion} | ({"run.json": given.record} if given.record else {})


def _unlike(found: Any, expected: Sequence[Mapping[str, Any]]) -> str:
    """Return how a list of entries is not the one expected, or an empty text."""
    if not isinstance(found, list) or len(found) != len(expected):
        count = f"{len(found)}" if isinstance(found, list) else f"{found!r:.40}"
        return f"found {count}; expected {len(expected)}, as the motion has"
    for k, (one, own) in enumerate(zip(found, expected, strict=True)):
        if not isinstance(one, Mapping) or one.keys() != own.keys():
            return f"entry {k + 1}: found {one!r:.80}; expected the keys {', '.join(own)}"
        for key, value in own.items():
            alike = type(one[key]) is type(value) and one[key] == value
            if not (_same(one[key], value) if isinstance(value, float) else alike):
                return f"entry {k + 1} ({own['name']}): found {key} = {one[key]!r:.40}; expected {value!r:.40}"
    return ""


def _same(found: Any, seconds: float) -> bool:
    return is_finite(found) and abs(found - seconds) <= EVENT_TIME_TOLERANCE


def samples(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, given: Samples) -> Check:
    """Times run from 0 to the end, and |q_k - q(t_k)|, |v_k - q'(t_k)|, |a_k - q''(t_k)| are within tolerances.

    Those are `position_tolerance`, and `rest_tolerance` times the limits of velocity and acceleration. Where the
    acceleration jumps, either side will do.
    """
    misfit = _misfit(trajectory, given)
    if misfit:
        return Check("samples", "exact", False, detail=misfit)
    t, last = given.t, trajectory.duration
    limits, rest = problem.limits, policy.rest_tolerance
    allowed = (np.full(trajectory.n, policy.position_tolerance), rest * limits.velocity, rest * limits.acceleration)
    inside = np.clip(t, 0.0, last)
    sides = (np.clip(np.nextafter(inside, -1.0) - 1e-9, 0.0, last), inside)
    worst = None
    for order, values in enumerate((given.q, given.v, given.a)):
        if values is None:
            continue
        found = trajectory(inside, order)
        if order == 2:
            found = np.stack([trajectory(side, 2) for side in sides])
            error = np.abs(values - found).min(axis=0)
        else:
            error = np.abs(values - found)
        share = error / allowed[order]
        k, j = divmod(int(np.argmax(share)), share.shape[1])
        if worst is None or share[k, j] > worst[0]:
            worst = (share[k, j], float(error[k, j]), float(allowed[order][j]), float(t[k]), j, order)
    assert worst is not None  # positions are always there
    share, error_most, limit, time, j, order = worst
    name, unit = problem.robot.joint_names[j], problem.robot.unit(ORDERS[order], j)
    kind = ("positions", "velocities", "accelerations")[order]
    detail = f"{len(t)} samples; farthest from the pieces are the {kind}"
    return Check("samples", "exact", bool(share <= 1.0), error_most, limit, unit, time, name, detail)


def _misfit(trajectory: Trajectory, given: Samples) -> str:
    """Return why these cannot be samples of the trajectory, or an empty text."""
    if given.t.ndim != 1 or len(given.t) < 2:
        return f"found t of shape {given.t.shape}; expected two times or more"
    k, n = len(given.t), trajectory.n
    for name, values in (("q", given.q), ("v", given.v), ("a", given.a)):
        if values is not None and values.shape != (k, n):
            return f"found {name} of shape {values.shape}; expected ({k}, {n})"
        if values is not None and not np.isfinite(values).all():
            return f"found {name} that are not finite"
    if not (np.isfinite(given.t).all() and (np.diff(given.t) > 0.0).all()):
        return "found times that are not finite or do not increase"
    off = max(abs(given.t[0]), abs(given.t[-1] - trajectory.duration))
    if off > 1e-9 * max(1.0, trajectory.duration):
        return (
            f"found times from {given.t[0]:.9g} s to {given.t[-1]:.9g} s; expected 0 to {trajectory.duration:.9g} s, "
            "as the pieces"
        )
    return ""
