"""The lecture's time laws: its examples 1, 2, 4, the PUMA's of 3, its homework and formulas, as planners make them."""

import numpy as np
import pytest

from optiplan.errors import InputError
from optiplan.planners.base import Budget
from optiplan.problem.load import problem_from_dict
from optiplan.runs.pipeline import run
from optiplan.trajectory.paths.hermite import hermite
from optiplan.trajectory.profiles.laws import Bounds, Trapezoid
from optiplan.trajectory.trajectory import Trajectory
from tests.reference.entries import entry

PUMA = "shoulder_origin_d1_0"


def planned(planner: str, start: list[float], goal: dict, robot: str = "planar2r", **options: object) -> Trajectory:
    data = {"version": 1, "robot": robot, "limits": {"jerk": "none"}, "start": {"joints": start}, "goal": goal}
    result = run(problem_from_dict(data), planner, options, Budget(20.0), lambda stage, fraction: None)
    assert result.verified
    return result.trajectory


def shoulder(planner: str, distance: float = 1.0, **options: object) -> Trajectory:
    """The first joint of a two-joint arm turns by `distance` from 0."""
    motion = planned(planner, [0.0, 1.0], {"joints": [distance, 1.0]}, **options)
    return Trajectory(("shoulder",), motion.breakpoints, motion.coefficients[:, :, :1])


def peak(motion: Trajectory, order: int) -> float:
    low, high = motion.extrema(order)
    return float(max(-low.min(), high.max()))


def test_lecture_cubic_coefficients():
    """The entry's formulas; the printed a3 has -(v0 + v1) and misses the end by 2 (v0 + v1) T."""
    tolerance, rng = entry("lecture.cubic.coefficients").tolerance, np.random.default_rng(0)
    for _ in range(100):
        q0, qf, v0, vf = rng.uniform(-2.0, 2.0, 4)
        T = rng.uniform(1.0, 3.0)
        a2 = (3.0 * (qf - q0) - (2.0 * v0 + vf) * T) / T**2
        a3, printed = ((2.0 * (q0 - qf) + sign * (v0 + vf) * T) / T**3 for sign in (1.0, -1.0))
        c = hermite(np.array([[q0], [v0]]), np.array([[qf], [vf]]), np.array([T]))[0, :, 0] / T ** np.arange(4)
        assert np.abs(c - [q0, v0, a2, a3]).max() <= tolerance
        assert np.polyval([printed, a2, v0, q0], T) - qf == pytest.approx(-2.0 * (v0 + vf) * T, abs=1e-9)


def test_lecture_example1():
    """Within limits of 2 rad/s and 8 rad/s²."""
    expected = entry("lecture.example1")
    motion = shoulder("cubic", duration=expected["T"])
    expected.check(motion.coefficients[0, :, 0], "coefficients_per_unit_displacement")
    expected.check(peak(motion, 1), "peak_velocity")
    expected.check(peak(motion, 2), "peak_acceleration")


def test_lecture_example2():
    expected = entry("lecture.example2")
    motion = shoulder("quintic", duration=expected["T"])
    expected.check(motion.coefficients[0, :, 0], "coefficients")
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        expected.check(peak(motion, order), f"peak_{name}")
    expected.check(motion.extrema_at(1).t_high[0], "peak_velocity_time")
    expected.check(motion.extrema_at(2).t_low[0], "peak_acceleration_time")
    expected.check(1.0 / expected["T"] / peak(motion, 1), "mean_over_peak_velocity")


def test_lecture_quintic_v0_5():
    expected = entry("lecture.quintic.v0_5")
    for k, T in enumerate(expected["T"]):
        c = hermite(np.array([[0.0], [5.0], [0.0]]), np.array([[1.0], [0.0], [0.0]]), np.array([float(T)]))
        highest = Trajectory(("q",), np.array([0.0, T]), c / float(T) ** np.arange(6)[:, None]).extrema_at(0)
        expected.check(highest.high[0], "q_max", k)
        expected.check(highest.t_high[0], "t_of_q_max", k)


@pytest.mark.parametrize("distance", [1.0, -1.0])
def test_lecture_example4(distance):
    """Also downwards, where the lecture's V is negative; c is refused with both bounds."""
    expected = entry("lecture.example4")
    for k, case in enumerate(expected["cases"]):
        asked = {"duration": expected["T"], "velocity": distance * case["V"]}
        if not case["feasible"]:
            with pytest.raises(InputError, match=r"'shoulder'.*more than 0\.0556 and at most 0\.111 rad/s"):
                shoulder("lspb", distance, **asked)
            continue
        motion = shoulder("lspb", distance, **asked)
        expected.check(motion.breakpoints[1], "cases", k, "t_b")
        expected.check(peak(motion, 2), "cases", k, "acceleration")
        expected.check(peak(motion, 1), "cases", k, "V")
        expected.check(motion.duration, "T")
    expected.check([1.0 / expected["T"], 2.0 / expected["T"]], "V_bounds")


def test_lecture_example4_samples():
    expected, cases = entry("lecture.example4.samples"), entry("lecture.example4")["cases"]
    velocity = {case["case"]: case["V"] for case in cases}
    for case in "abd":
        motion = shoulder("lspb", duration=18, velocity=velocity[case])
        expected.check(motion(np.array(expected["t"], dtype=float))[:, 0], case)


def test_lecture_lspb_formula():
    """t_b, a and V from one another, and the bounds of V: one law, however it is asked for."""
    tolerance, T = entry("lecture.lspb.formula").tolerance, 7.0
    for V in np.linspace(1.1, 1.95, 30) / T:
        b = (V * T - 1.0) / V
        a = V / b
        for law in (Trapezoid(velocity=V), Trapezoid(blend_time=b), Trapezoid(acceleration=a)):
            made = law.pieces(T, Bounds())
            assert abs(made.breakpoints[1] - b) <= tolerance
            assert abs(made.coefficients[0, 2] * 2.0 - a) <= tolerance
            assert 0.0 < law.blend(T, Bounds()) <= 0.5 * T


def test_lecture_bangbang():
    expected = entry("lecture.bangbang")
    a = entry("lecture.example4")["cases"][0]["acceleration"]
    motion = shoulder("bangbang", acceleration=a)
    expected.check(motion.duration, "T_for_example4a_acceleration")
    assert motion.breakpoints[1] == pytest.approx(np.sqrt(1.0 / a), abs=expected.tolerance)
    assert peak(motion, 1) == pytest.approx(a * np.sqrt(1.0 / a), abs=expected.tolerance)


def test_lecture_profile_constants():
    expected = entry("lecture.profile_constants")
    for name in ("cubic", "quintic", "lspb_third", "bangbang"):
        motion = shoulder(name.removesuffix("_third"), duration=3.0)
        expected.check(peak(motion, 1) * 3.0, name, "v")
        expected.check(peak(motion, 2) * 9.0, name, "a")


def test_lecture_homework():
    """The trapezoid of the PUMA, all joints on one law; its peak velocity is that of the table too."""
    expected, branches = entry("lecture.homework"), entry("lecture.example3.ik")
    branch = next(b for b in branches.value if (b["base"], b["branch"]) == (PUMA, "run"))
    options = {"robot": "puma560", "duration": expected["T"]}
    trapezoid = planned("lspb", branch["q1"], {"joints": branch["q2"]}, blend_time=expected["t_b"], **options)
    alone = planned("lspb", branch["q1"], {"joints": branch["q2"]}, **options)  # a third of the time is the default
    assert np.abs(trapezoid.coefficients - alone.coefficients).max() < 1e-14
    expected.check(trapezoid.breakpoints[1], "t_b")
    dq = np.array(branch["q2"]) - branch["q1"]
    expected.check(np.abs(trapezoid.extrema(1)[1] - trapezoid.extrema(1)[0]).max() / np.abs(dq).max(), "V_over_dq")
    expected.check(peak(trapezoid, 2) / np.abs(dq).max(), "a_over_dq")
    assert peak(trapezoid, 1) == pytest.approx(branch["peak_velocity_trapezoidal"], abs=branches.tolerance)
    pose = {"position": [0.4, -0.2, 0.67183], "rpy": [np.pi / 2.0, 0.0, 0.0]}
    quintic = planned("quintic", branch["q1"], {"pose": pose}, **options)
    assert peak(quintic, 1) == pytest.approx(branch["peak_velocity_quintic"], abs=branches.tolerance)
    assert np.abs(quintic.end - branch["q2"]).max() <= branches.tolerance  # of eight branches, the table's
