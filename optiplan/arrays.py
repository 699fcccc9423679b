"""The array type of the project."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Array of float64; its shape and unit stand in the docstring of what uses it."""
