"""The core's descent is that of the program: the same ends from the same starts."""

import numpy as np
import pytest

from optiplan._core import core
from optiplan.kinematics.ik.levenberg_marquardt import GAIN, Descent
from optiplan.kinematics.ik.numeric import random_seeds
from optiplan.robot.robot import load_robot


@pytest.mark.skipif(core is None, reason="compares the core with NumPy")
@pytest.mark.parametrize("name", ["panda", "ur5", "delbot", "baxter", "planar2r"])
@pytest.mark.parametrize("orientation", [True, False])
def test_the_core_descends_as_numpy_does(name: str, orientation: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot(name)
    native, plain = Descent(robot, robot.tool_frame, orientation), Descent(robot, robot.tool_frame, orientation)
    monkeypatch.setattr(plain, "_native", None)
    rng = np.random.default_rng(0)
    drawn = random_seeds(robot, np.zeros(robot.n), rng, 80)
    reached, apart = 0, []
    for k, (q, seed) in enumerate(zip(drawn[::2], drawn[1::2], strict=True)):
        for descent in (native, plain):
            descent.aim(plain.place(q).copy())
            narrow = np.minimum(q, seed) - 0.05, np.maximum(q, seed) + 0.05  # joints are held where they are pushed
            descent.hold_within(*(narrow if k % 4 == 3 else (robot.limits.lower, robot.limits.upper)))
        ends = [descent.descend(seed, 60, GAIN if k % 2 else 1e-4) for descent in (native, plain)]
        answers = [plain.reached(end) for end in ends]
        assert answers[0] == answers[1]
        reached += answers[0]
        apart.append(float(np.abs(ends[0] - ends[1]).max()))
    assert 10 <= reached
    assert float(np.quantile(apart, 0.9)) < 1e-9, "but for descents that rounding sends elsewhere"


def test_a_descent_keeps_what_it_is_given() -> None:
    robot = load_robot("panda")
    descent, q = Descent(robot, robot.tool_frame), robot.configurations["ready"]
    descent.aim(descent.place(q).copy())
    seed = (q + 0.05).astype(np.float32)[::-1][::-1]
    before = seed.copy()
    assert descent.reached(descent.descend(seed, 60))
    np.testing.assert_array_equal(seed, before)
