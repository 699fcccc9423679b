"""What each build of the core offers; see the C++ sources for formulas."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[np.float64]
_Indices = npt.NDArray[np.int64]
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
        self, control: _Array, duration: float, soft: Sequence[_SoftRows], radius: float, span: float
    ) -> tuple[_Array, float, float, int] | None: ...
