"""The array types of the project; shape and unit of an array stand in the docstring of what uses it."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Array of float64."""

Flags = npt.NDArray[np.bool_]
"""Array of truth values."""

Index = npt.NDArray[np.intp]
"""Array of indices."""
