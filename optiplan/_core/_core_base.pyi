"""What each build of the core offers; see the C++ sources for formulas."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from optiplan.control.limits import row_limit, stop_limits

_Array = npt.NDArray[np.float64]
_Indices = npt.NDArray[np.int64]
_LaidRows = tuple[_Indices, _Array, _Array, _Array]
_SoftRows = tuple[_Indices, _Array, _Array, _Array, float, float]

class Spline:
    def __init__(
        self,
        derivatives: _Array,
        order: _Indices,
        rates: _Array,
        gram: _Array,
        limits: _Array,
        fixed: int,
        time: float,
        jerk: float,
        open_end: bool = False,
    ) -> None: ...
    def shortest_duration(self, control: _Array) -> float: ...

class StepSolver:
    def __init__(self, spline: Spline) -> None: ...
    def solve(
        self,
        control: _Array,
        duration: float,
        soft: Sequence[_SoftRows],
        radius: float,
        span: float,
        gap: float,
        costs: tuple[_Array, float, _Array, float] | None = None,
    ) -> tuple[_Array, float, float, int] | None: ...

class Shape:
    """A solid in its own frame, lengths in m."""

    @staticmethod
    def sphere(radius: float) -> Shape: ...
    @staticmethod
    def capsule(radius: float, half_length: float) -> Shape: ...
    @staticmethod
    def cylinder(radius: float, half_length: float) -> Shape: ...
    @staticmethod
    def box(half: _Array) -> Shape: ...
    @staticmethod
    def convex_hull(points: _Array) -> Shape: ...
    @staticmethod
    def triangles(vertices: _Array, triangles: _Indices) -> Shape: ...
    @staticmethod
    def half_space(normal: _Array, offset: float) -> Shape: ...

def distances(a: Shape, X_WA: _Array, b: Shape, X_WB: _Array, cutoff: float = ...) -> tuple[_Array, _Array, _Array]: ...
def overlaps_within(a: Shape, X_WA: _Array, b: Shape, X_WB: _Array, margin: float = ...) -> npt.NDArray[np.uint8]: ...

class Tree:
    @staticmethod
    def of(
        parents: _Indices,
        placements: _Array,
        screws: _Array,
        leaders: _Indices,
        couplings: _Array,
        inertias: _Array,
        planned: int,
        gravity: _Array,
    ) -> Tree: ...
    def poses(self, Q: _Array) -> _Array: ...
    def gravity(self, Q: _Array) -> _Array: ...

class Body:
    @staticmethod
    def of(joint: int, placement: _Array, shapes: Sequence[Shape], box: _Array, radius: float) -> Body: ...

_Near = tuple[_Indices, _Indices, _Array, _Array, _Array]
"""Rows, pairs, distances (K,); points on a and b, and normal (K, 3, 3); gradients (K, n)."""

class World:
    @staticmethod
    def of(
        tree: Tree,
        bodies: Sequence[Body],
        pairs: _Indices,
        clusters: Sequence[tuple[Body, Sequence[int]]] = (),
        never: Sequence[int] = (),
        error: Sequence[float] = (),
        tubes: Sequence[float] = (),
        floors: Sequence[float] = (),
        ends: Sequence[tuple[int, float, float, Sequence[float]]] = (),
    ) -> World: ...
    def near(self, Q: _Array, cutoff: float) -> _Near: ...
    def nearest(self, Q: _Array) -> _Near | None: ...
    def gradients(self, Q: _Array, rows: _Indices, pairs: _Indices, points: _Array, normals: _Array) -> _Array: ...
    def collides(self, q: _Array) -> bool: ...
    def touching(self, Q: _Array) -> npt.NDArray[np.uint8]: ...
    def lower_bounds(self, Q: _Array) -> _Array: ...
    def travel(self, Q: _Array, D: _Array) -> _Array: ...
    def move_body(self, body: int, placement: _Array) -> None: ...

class Sweep:
    def __init__(self, world: World, breakpoints: _Array, coefficients: _Array, rules: _Array) -> None: ...
    @property
    def intervals(self) -> int: ...
    def look(self, begin: int, end: int) -> list[float]: ...
    def prove(self, begin: int, end: int) -> list[tuple[float, int]]: ...

class PoseDescent:
    def __init__(self, tree: Tree, joint: int, placement: _Array, rows: int, rules: _Array) -> None: ...
    def descend(
        self, target: _Array, low: _Array, high: _Array, seed: _Array, iterations: int, gain: float
    ) -> _Array: ...

class EdgeChecker:
    def __init__(self, world: World, arms: _Array, torque: _Array, rules: _Array) -> None: ...
    def blocked(self, q: _Array) -> bool: ...
    def free(self, a: _Array, b: _Array) -> bool: ...
    def polyline_free(self, waypoints: _Array) -> bool: ...

class RrtConnect:
    def __init__(
        self,
        check: EdgeChecker,
        still: _Array,
        joints: _Indices,
        rows: _Array,
        least: float,
        carriers: int,
        start: _Array,
        goals: _Array,
        reach: float,
        seed: int,
    ) -> None: ...
    def grow(self, iterations: int, seconds: float) -> bool: ...
    @property
    def full(self) -> bool: ...
    @property
    def iterations(self) -> int: ...
    @property
    def met(self) -> bool: ...
    def size(self, tree: int) -> int: ...
    def path(self, joints: int) -> _Array: ...
    def sample(self, tree: int, most: int, joints: int) -> _Array: ...

def shorten(check: EdgeChecker, waypoints: _Array, velocity: _Array, draws: _Array, seconds: float) -> _Array: ...
def unit_extrema(coefficients: _Array) -> tuple[_Array, npt.NDArray[np.int64]]: ...

class InverseDynamics:
    def __init__(self, tree: Tree) -> None: ...
    def torques(self, Q: _Array, V: _Array, A: _Array) -> _Array: ...
    def demand(self, breakpoints: _Array, coefficients: _Array, allowed: _Array, times: _Array) -> _Array: ...

class CurvePoint:
    @property
    def control(self) -> _Array: ...
    @property
    def duration(self) -> float: ...
    @property
    def merit(self) -> float: ...
    @property
    def missing(self) -> float: ...
    @property
    def nearest(self) -> float: ...
    @property
    def feasible(self) -> bool: ...

class Step:
    @property
    def promise(self) -> float: ...

class Sqp:
    @staticmethod
    def among_bodies(
        spline: Spline,
        world: World,
        torque: _Array,
        still: _Array,
        cutoff: float,
        margins: tuple[float, _Array, _Array],
        settings: dict[str, float],
    ) -> Sqp: ...
    @staticmethod
    def among_others(
        spline: Spline,
        tree: Tree,
        torque: _Array,
        still: _Array,
        near: Callable[[_Array], tuple[_Indices, _Array, _Array]],
        settings: dict[str, float],
    ) -> Sqp: ...
    def set_samples(self, u: _Array, position: _Array, velocity: _Array, acceleration: _Array) -> None: ...
    def evaluate(self, control: _Array, duration: float) -> tuple[float, float, _LaidRows, _LaidRows]: ...
    def begin(self, control: _Array) -> CurvePoint: ...
    def step(self, point: CurvePoint, radius: float) -> Step | None: ...
    def follow(self, point: CurvePoint, step: Step) -> CurvePoint: ...
    def watch(self, point: CurvePoint, trial: CurvePoint) -> None: ...

class StopPath:
    @staticmethod
    def of(q: _Array, v: _Array, a: _Array, limit: _Array, jerk: _Array, dt: float) -> StopPath: ...
    @property
    def steps(self) -> int: ...
    @property
    def end(self) -> _Array: ...
    @property
    def way(self) -> _Array: ...
    def strongest(self, first: int, last: int) -> _Array: ...
    def carrying(self, coefficients: _Array, until: _Array, horizon: float) -> StopPath: ...
    def at(self, step: int) -> _Array: ...
    def motion(self, steps: _Indices) -> tuple[_Array, _Array]: ...

class View(stop_limits.DistanceView):  # of the same attributes, not derived from it
    ...
class LimitRows(row_limit.LimitRows):  # the same
    ...

class ClearanceWatch:
    def __init__(
        self, world: World, arms: _Array, reaches: _Array, effects: _Array, influence: _Array, kept: float
    ) -> None: ...
    def look(self, q: _Array, before: stop_limits.DistanceView | None) -> View: ...
    def stop_is_clear(self, path: StopPath, start: stop_limits.DistanceView, least: _Array) -> bool: ...

def is_finite(*arrays: _Array) -> bool: ...
def task_program(
    parts: Sequence[tuple[Any, ...]],
    main: _Indices,
    measured: tuple[int, int],
    motion: tuple[_Array, _Array],
    weight: float,
    rules: _Array,
    out: tuple[_Array, _Array, _Array, _Array],
) -> tuple[float, float]: ...
def undone(A: _Array, wanted: _Array, main: _Indices, x: _Array) -> tuple[float, float]: ...
def pose_rows(X_WF: _Array, X_WT: _Array, J: _Array) -> tuple[_Array, _Array, _Array]: ...
def capped(error: _Array, gain: float, limits: _Array) -> _Array: ...
def curbed(error: _Array, gain: float, brake: _Array, speed: _Array) -> _Array: ...
def torque_rows(M: _Array, h: _Array, v: _Array, torque: _Array, dt: float, labels: tuple[str, ...]) -> LimitRows: ...
def speed_rows(
    J: _Array,
    rate: _Array,
    v: _Array,
    dt: float,
    delay: _Array,
    bounds: _Array,
    parts: Sequence[int],
    labels: tuple[str, ...],
) -> LimitRows: ...
def stop_rows(
    view: stop_limits.DistanceView,
    v: _Array,
    delay: _Array,
    brake: _Array,
    least: _Array,
    margin: _Array,
    drift: _Array,
    lost: _Array,
    dt: float,
    rate: float,
    labels: tuple[str, ...],
) -> LimitRows: ...
def stack_rows(parts: Sequence[row_limit.LimitRows], n: int) -> tuple[_Array, _Array, _Array]: ...
def raise_least(least: _Array, asked: _Array, view: stop_limits.DistanceView, slip: float) -> None: ...
def rows_hold(C: _Array, low: _Array, high: _Array, x: _Array, slack: float) -> bool: ...
def solve_from(
    H: _Array,
    g: _Array,
    C: _Array,
    low: _Array,
    high: _Array,
    lower: _Array,
    upper: _Array,
    A: _Array,
    b: _Array,
    bounds: Sequence[int],
    rows: Sequence[int],
    rules: _Array,
) -> tuple[_Array, list[int], list[int]] | None: ...
def joint_box(
    q: _Array, v: _Array, a: _Array, table: _Array, order: Sequence[int], rules: _Array, out: _Array
) -> list[int]: ...

class TimeLaw:
    @staticmethod
    def steady(s: float, ds: float, begin: float) -> TimeLaw: ...
    @property
    def settled(self) -> float: ...
    @property
    def target(self) -> float: ...
    def at(self, t: float) -> tuple[float, float, float]: ...
    def then(self, next: TimeLaw) -> TimeLaw: ...
    def pieces(self) -> _Array: ...

class PathLaws:
    @staticmethod
    def of(
        breakpoints: _Array,
        coefficients: _Array,
        limits: _Array,
        ends: _Array,
        trees: Sequence[Tree],
        width: float,
        rules: _Array,
    ) -> PathLaws: ...
    def mirrored(self) -> PathLaws: ...
    def until(self, end: float) -> PathLaws: ...
    def sizes(self) -> _Array: ...
    @property
    def overloaded(self) -> float: ...
    def set_curvature(self, factors: _Array) -> None: ...
    def change(
        self, s: float, ds: float, dds: float, begin: float, target: float, reserve: float
    ) -> TimeLaw | None: ...
    def change_along(self, old: TimeLaw, now: float, target: float, reserve: float) -> TimeLaw | None: ...
    def rest_to_rest(self, s: float, begin: float) -> TimeLaw | None: ...
    @property
    def keeps_torque(self) -> bool: ...
    def set_point(self, law: TimeLaw, t: float) -> tuple[_Array, float, float, float]: ...

class PathWatch:
    @staticmethod
    def of(
        world: World,
        breakpoints: _Array,
        coefficients: _Array,
        width: float,
        begin: float,
        error: Sequence[float] = (),
    ) -> PathWatch: ...
    def add(self, body: Body) -> int: ...
    def blocked(
        self,
        law: TimeLaw,
        now: float,
        bodies: _Indices,
        poses: _Array,
        motions: _Array,
        margin: float,
        linger: float = 0.0,
    ) -> tuple[float, int, int] | None: ...
    def nearest(
        self, law: TimeLaw, now: float, bodies: _Indices, poses: _Array, motions: _Array, margin: float, most: float
    ) -> tuple[float, int, int, float] | None: ...

_Pieces = tuple[_Array, _Array]

def chunk_curve(state: _Array, Q: _Array, times: _Array, rests: bool, limits: _Array) -> _Pieces: ...
def chunk_times(state: _Array, Q: _Array, limits: _Array) -> _Array: ...
def with_stop(breakpoints: _Array, coefficients: _Array, limits: _Array) -> _Pieces: ...
def stop_curve(state: _Array, limits: _Array, share: float) -> _Pieces: ...

class MotionProof:
    @staticmethod
    def of(
        world: World,
        kinds: _Indices,
        kept: Sequence[tuple[int, list[int], list[bool], _Array]],
        limits: _Array,
        armature: _Array,
    ) -> MotionProof: ...
    def move(self, body: int, pose: _Array) -> None: ...
    def limits(
        self, breakpoints: _Array, coefficients: _Array, state: _Array
    ) -> tuple[int, int, float, float, float]: ...
    def torques(self, breakpoints: _Array, coefficients: _Array) -> tuple[int, float, float]: ...
    def apart(
        self, breakpoints: _Array, coefficients: _Array, clearance: float
    ) -> tuple[int, float, float, bool, float, float, int, int]: ...

class NearestChunk:
    @staticmethod
    def of(
        proof: MotionProof, state: _Array, Q: _Array, times: _Array, rests: bool, limits: _Array, radius: float
    ) -> NearestChunk: ...
    def step(self, distance: float, clearance: float, window: float, width: float) -> _Pieces | None: ...
    def set_points(self) -> _Array: ...

class SetPointHistory:
    def __init__(self, joints: int, kept: float, spacing: float) -> None: ...
    def note(self, time: float, q: _Array, place: float, epoch: int) -> None: ...
    def progress_at(self, time: float) -> float: ...
    def nearest(self, q: _Array, weights: _Array) -> tuple[_Array, float, float, int]: ...

class TorqueBounds:
    @staticmethod
    def of(tree: Tree, armature: _Array) -> TorqueBounds: ...
    def over(self, motion: _Array) -> tuple[_Array, _Array]: ...

_NearestGap = tuple[float, float, int]
_PlaneVerdict = tuple[
    bool,
    tuple[float, float],
    tuple[_NearestGap, _NearestGap],
    tuple[_NearestGap, _NearestGap],
    npt.NDArray[np.int32],
    npt.NDArray[np.int32],
    int,
    int,
]

class ProvedShape:
    @staticmethod
    def of(outline: Shape, round: _Array, points: _Array) -> ProvedShape: ...

class ProvedMotion: ...

class PlaneProof:
    @staticmethod
    def of(
        parents: _Indices,
        placements: _Array,
        axes: _Array,
        turns: _Array,
        coupling: _Array,
        offset: _Array,
        shapes: Sequence[ProvedShape],
        joints: _Indices,
        poses: _Array,
        volumes: _Array,
        pairs: _Indices,
        kinds: _Indices,
        exact: _Indices,
        first_part: _Indices,
        parts: _Indices,
    ) -> PlaneProof: ...
    def placed(self, poses: _Array) -> PlaneProof: ...
    def motion(
        self,
        breakpoints: _Array,
        coefficients: _Array,
        jump: _Array,
        piece: _Indices,
        middle: _Array,
        half: _Array,
        common: _Indices,
        first_more: _Indices,
        more: _Indices,
    ) -> ProvedMotion: ...
    def scan(self, motion: ProvedMotion, clearance: float) -> _PlaneVerdict: ...
    def prove(
        self, motion: ProvedMotion, rules: _Array, measured: _Array, most_intervals: int, most_queries: int
    ) -> _PlaneVerdict: ...

class BoxClosing:
    def __init__(
        self,
        tree: Tree,
        ends: _Array,
        radius: _Array,
        joint: _Indices,
        body: _Indices,
        pairs: _Indices,
        turns: _Array,
        boxes: _Array,
        turn_of: _Indices,
        arms: _Array,
    ) -> None: ...
    def close(
        self, lowest: _Array, highest: _Array, low: _Array, high: _Array, parts: int
    ) -> npt.NDArray[np.uint8]: ...
