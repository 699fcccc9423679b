"""Time laws of a given path: `time_path` times a path and never changes its shape."""

from collections.abc import Callable
from dataclasses import field, replace
from typing import Literal

import numpy as np

from optiplan.arrays import Array, Flags
from optiplan.records import dataclass
from optiplan.robot.robot import Limits, Robot
from optiplan.trajectory.samples import sample_times
from optiplan.trajectory.timing.compose import compose, time_of
from optiplan.trajectory.timing.jerk_limited import smooth_law
from optiplan.trajectory.timing.path_constraints import Rows, ToolLimits, rows_at, tool_scale, tool_shares
from optiplan.trajectory.timing.reachability import fastest_law, slowness
from optiplan.trajectory.timing.s_curve import s_curve
from optiplan.trajectory.timing.stops import stop_at_corners
from optiplan.trajectory.timing.time_scaling import scale_to_limits
from optiplan.trajectory.timing.torque_scaling import torque_scale
from optiplan.trajectory.trajectory import Trajectory

__all__ = ["TimingOptions", "ToolLimits", "compose", "time_path"]

Method = Literal["toppra", "jerk", "uniform"]

_PARTS = 160, 4  # of the grid along a path and of each of its pieces, at least, that a smooth law starts from
_PARTS_FASTEST = 800, 32  # of that of the fastest law, which is as good as its grid is fine
_MOST_PARTS = 2000  # above which pieces have no least number
_ROUNDS, _BEYOND = 6, 1e-3  # of halving parts; share of a limit by which a law may exceed it between points of the grid
_EASED, _BEYOND_LIMITS = 4, 1e-3  # laws, each slower where the one before passed limits by more than this share
_PLACES, _AROUND = 401, 2  # of a path, at which laws are made slower; and as many to either side
_SAME_PLACE = 1e-9  # share of the path: what is outside a part of it by no more is at its end
_ROUNDING = 1e-14  # share of the path: points of the grid that are no farther apart are one


@dataclass(frozen=True)
class TimingOptions:
    """Options of timing a path.

    Attributes:
        method: `toppra`: the fastest without regard to jerk, the acceleration jumps. `jerk`: jerk limits hold, the
            acceleration is continuous. `uniform`: one S-curve of the path's parameter, slowed down until everything
            holds. None: `jerk` where any joint has a jerk limit, else `toppra`.
        tool: limits of a frame's speed, besides those of the joints.
        tool_parts: the same of parts of the path, from one share of its parameter to another; speeds only.
        stop: polled between the stages and steps; when it returns True, the best law so far is returned.
    """

    method: Method | None = None
    tool: ToolLimits | None = None
    tool_parts: tuple[tuple[float, float, ToolLimits], ...] = ()
    stop: Callable[[], bool] = field(default=lambda: False)


def time_path(
    path: Trajectory, robot: Robot, limits: Limits, options: TimingOptions | None = None
) -> Trajectory | None:
    """Run exactly along a path from rest to rest, within all limits.

    q(t) = path(s(t)): `options.method` makes s(t), and the result is stretched or shortened as a whole until its
    tightest limit is just met. It never fails: where no faster law is found, `uniform` is the answer.

    Holds at: all times for velocity, acceleration and (but for `toppra`) jerk, on exact extrema; torque and tool limits
    at samples at most 1 ms apart.

    Args:
        path: q over a parameter s, twice continuously differentiable; degree at most 10 (5 for long ones is better).
        robot: gives the torques and the tool.
        limits: of the n joints; jerk may be infinite.
        options: see there.

    Returns:
        None where gravity alone takes more torque than allowed.

    Raises:
        UnknownChoiceError: the robot has no such tool frame.
    """
    found = time_path_by_law(path, robot, limits, options)
    return None if found is None else found[0]


def time_path_by_law(
    path: Trajectory, robot: Robot, limits: Limits, options: TimingOptions | None = None
) -> tuple[Trajectory, Trajectory] | None:
    """Return the motion of `time_path`, and its law: the share s(t) of the path's parameter, from 0 to 1."""
    options = options or TimingOptions()
    if not path.coefficients[:, 1:].any():
        rest = stop_at_corners(np.array([path.start, path.start]), limits, path.joint_names)
        steady = Trajectory(("s",), np.array([0.0, rest.duration]), np.array([[[0.0], [1.0 / rest.duration]]]))
        return (rest, steady) if np.isfinite(torque_scale(robot, limits.torque, rest)) else None
    method = options.method or ("jerk" if np.isfinite(limits.jerk).any() else "toppra")
    kept = replace(limits, jerk=np.full_like(limits.jerk, np.inf)) if method == "toppra" else limits
    path = path.scaled(uniform_law(path, kept).duration)  # ds/dt is about 1 then, whatever the path's own parameter is
    laws = [uniform_law(path, kept)]
    laws += [] if method == "uniform" or options.stop() else _laws(path, robot, kept, options)
    found = [(motion, law) for law in laws if (motion := _held(path, law, robot, kept, options)) is not None]
    if not found:
        return None
    motion, law = min(found, key=lambda one: one[0].duration)
    share = law.scaled(motion.duration)
    return motion, Trajectory(("s",), share.breakpoints, share.coefficients / path.duration)


def uniform_law(path: Trajectory, limits: Limits) -> Trajectory:
    """One S-curve s(t) from rest at 0 to rest at S, roughly as fast as the path's largest slopes |q'| allow."""
    slope = np.abs(path.extrema(1)).max(axis=0)
    moving = slope > 0.0
    rates = [(bound[moving] / slope[moving]).min() for bound in limits.rates]
    times, pieces = s_curve(path.duration, *rates)
    return Trajectory(("s",), np.concatenate([[0.0], np.cumsum(times)]), pieces[:, :, None])


def _laws(path: Trajectory, robot: Robot, limits: Limits, options: TimingOptions) -> list[Trajectory]:
    """Return laws; where the tool has limits, each is slower only where the one before exceeded limits.

    A law holds limits at points. Without this, a violation between them would slow the whole motion down, and the tool
    would run at its limit nowhere.
    """
    places = np.linspace(0.0, path.duration, _PLACES)
    slower, found = np.ones(_PLACES), list[Trajectory]()
    while len(found) < _EASED and not (found and options.stop()):
        law = _law(path, robot, limits, options, (places, slower))
        if law is None:
            break
        found.append(law)
        if options.tool is None and not options.tool_parts:
            break
        share = _shares_around(law, compose(path, law), robot, limits, options)
        if share.max() <= 1.0 + _BEYOND_LIMITS:
            break
        slower = slower * np.maximum(1.0, (1.0 + _BEYOND_LIMITS) * share)
    return found


def _shares_around(law: Trajectory, motion: Trajectory, robot: Robot, limits: Limits, options: TimingOptions) -> Array:
    """Return the largest share of limits that joints and tool take around `_PLACES` of the path, (K,).

    A motion that is slower there takes less by as much: it is the root of an acceleration's, the cubic root of a
    jerk's.
    """
    t, s = _samples(law, motion, options)
    rates = [np.abs(motion(t, order)) / bound for order, bound in enumerate(limits.rates, 1)]
    shares = np.max([rate.max(axis=1) ** (1.0 / order) for order, rate in enumerate(rates, 1)], axis=0)
    whole = [] if options.tool is None else [(0.0, 1.0, options.tool)]
    for begin, end, tool in (*whole, *options.tool_parts):
        inside = _inside(s, begin, end)
        shares[inside] = np.maximum(shares[inside], tool_shares(robot, tool, motion, t[inside]))
    found = np.zeros(_PLACES)
    np.maximum.at(found, np.rint(np.clip(s, 0.0, 1.0) * (_PLACES - 1)).astype(int), shares)
    around = np.pad(found, _AROUND, mode="edge")
    return np.asarray(np.lib.stride_tricks.sliding_window_view(around, 2 * _AROUND + 1).max(axis=1))


def _law(
    path: Trajectory, robot: Robot, limits: Limits, options: TimingOptions, slower: tuple[Array, Array]
) -> Trajectory | None:
    """Return the fastest law within limits, with speeds divided by factors (K,) at places (K,) of the path."""

    def rows(s: Array) -> Rows:
        found = rows_at(path, robot, limits, options.tool, s)
        for begin, end, tool in options.tool_parts:
            inside = _inside(s / path.duration, begin, end)
            found.speed[inside] = np.minimum(found.speed[inside], rows_at(path, robot, limits, tool, s[inside]).speed)
        found.speed[:] /= np.interp(s, *slower)
        return found

    if np.isfinite(limits.jerk).any():
        return smooth_law(path, limits, rows(_grid(path, _PARTS, options)), options.stop)
    return _refined(rows, _grid(path, _PARTS_FASTEST, options), options.stop)


def _refined(rows: Callable[[Array], Rows], grid: Array, stop: Callable[[], bool]) -> Trajectory | None:
    """The fastest law on a grid (k,) that is made finer where the law exceeds limits between its points."""
    law = fastest_law(rows(grid))
    for _ in range(_ROUNDS):
        if law is None or len(grid) > _MOST_PARTS or stop():
            break
        middles = 0.5 * (grid[1:] + grid[:-1])
        wide = slowness(law, rows(middles)) > 1.0 + _BEYOND
        if not wide.any():
            break
        grid = np.sort(np.concatenate([grid, middles[wide]]))
        law = fastest_law(rows(grid)) or law
    return law


def _grid(path: Trajectory, least: tuple[int, int], options: TimingOptions) -> Array:
    """Increasing parameters (k,) at which a law looks at the path; among them all breakpoints and ends of parts."""
    h = np.diff(path.breakpoints)
    of_piece = max(1, min(least[1], _MOST_PARTS // len(h)))
    parts = np.maximum(of_piece, np.ceil(h * (least[0] / path.duration))).astype(int)
    ends = zip(path.breakpoints[:-1], path.breakpoints[1:], parts, strict=True)
    inner = [np.linspace(a, b, k + 1)[1:] for a, b, k in ends]
    every = np.sort(np.concatenate([[0.0], *inner, path.duration * _part_ends(options)]))  # of tiny pieces too
    apart = np.append(True, np.diff(every) > _ROUNDING * path.duration)  # shares round to beside a breakpoint
    grid: Array = every[apart]
    grid[-1] = every[-1]
    return grid


def _part_ends(options: TimingOptions) -> Array:
    """Shares (2k,) of the path at which its k parts with limits of their own begin and end."""
    return np.array([share for begin, end, _ in options.tool_parts for share in (begin, end)], dtype=float)


def _inside(s: Array, begin: float, end: float) -> Flags:
    """Return which shares (K,) of the path are in a part of it."""
    return np.asarray((s >= begin - _SAME_PLACE) & (s <= end + _SAME_PLACE))


def _samples(law: Trajectory, motion: Trajectory, options: TimingOptions) -> tuple[Array, Array]:
    """Return times (K,), s, of a motion, those at the ends of parts among them, and the shares (K,) of the path."""
    ends = [time_of(law, share * law.end[0]) for share in _part_ends(options)]
    t = np.sort(np.append(sample_times(motion), ends))
    return t, law(t, clamp=True)[:, 0] / law.end[0]


def _held(path: Trajectory, law: Trajectory, robot: Robot, limits: Limits, options: TimingOptions) -> Trajectory | None:
    """Run a path by a law and scale that as a whole to the limits; None where gravity is too much."""
    trajectory = compose(path, law)
    slower = tool_scale(robot, options.tool, trajectory)
    if options.tool_parts:
        t, s = _samples(law, trajectory, options)
        for begin, end, tool in options.tool_parts:
            slower = max(slower, tool_scale(robot, tool, trajectory, t[_inside(s, begin, end)]))
    fitted = scale_to_limits(trajectory, limits, slower)
    slower = torque_scale(robot, limits.torque, fitted)
    return fitted.scaled(fitted.duration * slower) if np.isfinite(slower) else None
