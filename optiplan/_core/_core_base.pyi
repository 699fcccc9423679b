"""What each build of the core offers; see the C++ sources for formulas."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

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
    ) -> None: ...
    def shortest_duration(self, control: _Array) -> float: ...

class StepSolver:
    def __init__(self, spline: Spline) -> None: ...
    def solve(
        self, control: _Array, duration: float, soft: Sequence[_SoftRows], radius: float, span: float, gap: float
    ) -> tuple[_Array, float, float, int] | None: ...

class Sqp:
    @staticmethod
    def among_bodies(
        spline: Spline,
        world: World,
        torque: _Array,
        cutoff: float,
        margins: tuple[float, _Array, _Array],
        settings: dict[str, float],
    ) -> Sqp: ...
    @staticmethod
    def among_others(
        spline: Spline,
        tree: Tree,
        torque: _Array,
        near: Callable[[_Array], tuple[_Indices, _Array, _Array]],
        settings: dict[str, float],
    ) -> Sqp: ...
    def set_samples(self, u: _Array, position: _Array, velocity: _Array, acceleration: _Array) -> None: ...
    def evaluate(self, control: _Array, duration: float) -> tuple[float, float, _LaidRows, _LaidRows]: ...
    def optimise(
        self, control: _Array, iterations: int, stop: Callable[[], bool], best: float, longest: float
    ) -> tuple[_Array, float, float, float, float, int]: ...
