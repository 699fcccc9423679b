"""Expressions of the state, for one state and for many."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from optiplan.kinematics.symbolic.state import BatchedExpression
from optiplan.robot.robot import load_robot


def test_states_one_by_one_have_the_bits_that_they_have_together_in_any_thread():
    """One state is asked with arrays that are bound once: an answer stays as it was when the next one comes."""
    robot = load_robot("planar2r")
    expression = BatchedExpression(robot, "inequality", lambda k: k.pose("tool").p * k.sin(k.v[0]) + k.constant(0.5))
    states = np.random.default_rng(0).normal(size=(2, 200, robot.n))
    value, slopes = expression([*states, np.zeros((200, 2))])
    assert expression.orders == (0, 1)
    assert np.abs(slopes[1]).max() > 0.1

    def one_by_one(order):
        return [expression([states[0, k : k + 1], states[1, k : k + 1], np.zeros((1, 2))]) for k in order]

    forwards, backwards = range(200), range(199, -1, -1)
    with ThreadPoolExecutor(2) as pool:
        for order, found in zip((forwards, backwards), pool.map(one_by_one, (forwards, backwards)), strict=True):
            for k, (own, rates) in zip(order, found, strict=True):
                assert own.tobytes() == value[k].tobytes()
                assert [rate.tobytes() for rate in rates] == [slope[k].tobytes() for slope in slopes]
