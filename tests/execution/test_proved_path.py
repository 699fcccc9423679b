"""The ways along a proved path."""

import numpy as np

from optiplan.execution.path_laws import reversed_motion
from optiplan.trajectory.trajectory import Trajectory


def test_a_motion_whose_first_piece_is_shorter_than_rounding_is_reversed(run_of):
    """T - 1e-17 is T: of such a piece nothing is left."""
    motion = run_of("01_reach").trajectory
    cut = Trajectory(
        motion.joint_names,
        np.insert(motion.breakpoints, 1, 1e-17),
        np.insert(motion.coefficients, 0, motion.coefficients[0], axis=0),
    )
    back = reversed_motion(cut)
    t = np.linspace(0.0, motion.duration, 50)
    np.testing.assert_allclose(back(motion.duration - t), motion(t), atol=1e-9)
