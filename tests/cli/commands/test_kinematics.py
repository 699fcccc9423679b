"""`optiplan kinematics`."""

import numpy as np
import pinocchio as pin
import pytest

from optiplan.kinematics.mecanum import Mecanum
from optiplan.robot.robot import load_robot

Q = [0.3, -1.2, 1.5, -0.3, 1.1, 0.4]


def words(q):
    return ",".join(f"{value!r}" for value in q)


def placed(robot, q, frame):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.asarray(q, dtype=float))
    return data.oMf[robot.model.getFrameId(frame)]


def test_pose_in_three_ways(optiplan_json):
    code, data = optiplan_json("kinematics", "ur5", "--at", words(Q))
    assert code == data["exit_code"] == 0
    X, pose = placed(load_robot("ur5"), Q, "tool0"), data["pose"]
    assert (data["frame"], data["configuration"], data["q"], data["outside_limits"]) == ("tool0", None, Q, [])
    assert np.array(pose["matrix"]) == pytest.approx(X.homogeneous, abs=1e-12)
    assert pose["position"] == pytest.approx(X.translation, abs=1e-12)
    assert pin.rpy.rpyToMatrix(*pose["rpy"]) == pytest.approx(X.rotation, abs=1e-12)
    x, y, z, w = pose["quaternion"]
    assert pin.Quaternion(w, x, y, z).toRotationMatrix() == pytest.approx(X.rotation, abs=1e-12)


def test_ik_takes_what_kinematics_gives(optiplan_json):
    pose = optiplan_json("kinematics", "ur5", "--at", words(Q))[1]["pose"]
    for option, numbers in (
        ("--matrix", np.ravel(pose["matrix"])),
        ("--quaternion", [*pose["position"], *pose["quaternion"]]),
        ("--pose", [*pose["position"], *pose["rpy"]]),
    ):
        solutions = optiplan_json("ik", "ur5", option, ",".join(f"{x:.17g}" for x in numbers), "--all")[1]["solutions"]
        assert min(np.abs(np.exp(1j * np.array(s["q"])) - np.exp(1j * np.array(Q))).max() for s in solutions) < 1e-9


def test_both_jacobians_are_those_of_differences(optiplan_json):
    data = optiplan_json("kinematics", "ur5", "--at", words(Q), "--frame", "wrist_2_link")[1]
    robot, h = load_robot("ur5"), 1e-6
    for j in range(6):
        ahead, behind = (placed(robot, Q + s * h * np.eye(6)[j], "wrist_2_link") for s in (1, -1))
        v = (ahead.translation - behind.translation) / (2 * h)
        w = pin.log3(ahead.rotation @ behind.rotation.T) / (2 * h)
        turned = pin.rpy.matrixToRpy(ahead.rotation) - pin.rpy.matrixToRpy(behind.rotation)
        rates = np.angle(np.exp(1j * turned)) / (2 * h)
        assert np.array(data["geometric_jacobian"])[:, j] == pytest.approx([*v, *w], abs=1e-8)
        assert np.array(data["analytic_jacobian"])[:, j] == pytest.approx([*v, *rates], abs=1e-8)


def test_measures_and_ellipsoids(optiplan_json):
    data = optiplan_json("kinematics", "ur5", "--at", words(Q))[1]
    J = np.array(data["geometric_jacobian"])
    for part, rows in (("full", J), ("translation", J[:3]), ("rotation", J[3:])):
        found, s = data["measures"][part], np.linalg.svd(rows, compute_uv=False)
        assert found["yoshikawa"] == pytest.approx(np.sqrt(np.linalg.det(rows @ rows.T)), rel=1e-9)
        assert (found["asada"], found["condition"]) == pytest.approx((s[-1] / s[0], s[0] / s[-1]), rel=1e-9)
    for part, rows in (("translation", J[:3]), ("rotation", J[3:])):
        found = data["ellipsoids"][part]
        for axis, speed, force in zip(found["axes"], found["velocity"], found["force"], strict=True):
            assert rows @ rows.T @ axis == pytest.approx(speed**2 * np.array(axis), abs=1e-12)
            assert np.linalg.norm(rows.T @ (force * np.array(axis))) == pytest.approx(1.0, rel=1e-12)


def test_the_lectures_best_elbow(optiplan_json):
    """lecture.example5: |det J| = a1 a2 |sin q2| = 0.7 at the best elbow, 0 stretched."""
    best, stretched = (optiplan_json("kinematics", "two_links", "--at", name)[1] for name in ("best", "stretched"))
    assert best["configuration"] == "best"
    assert best["measures"]["translation"]["yoshikawa"] == pytest.approx(0.7, abs=1e-12)
    assert (best["rank"], stretched["measures"]["translation"]["condition"]) == (2, None)


def test_singularities_have_names_and_say_how_near_they_are(optiplan, optiplan_json):
    near = [*Q[:4], 0.01, Q[5]]
    found = optiplan_json("kinematics", "ur5", "--at", words(near))[1]["singularities"]
    assert list(found) == ["shoulder", "elbow", "wrist"]
    assert abs(found["wrist"]["relative"]) == pytest.approx(np.sin(0.01), rel=1e-9)
    assert not any(one["singular"] for one in found.values())
    J = np.array(optiplan_json("kinematics", "ur5", "--at", words(near))[1]["geometric_jacobian"])
    assert abs(np.prod([one["factor"] for one in found.values()])) == pytest.approx(abs(np.linalg.det(J)), rel=1e-9)
    data = optiplan_json("kinematics", "ur5", "--at", words([*Q[:4], 0.0, Q[5]]))[1]
    assert (data["rank"], data["measures"]["full"]["condition"]) == (5, None)
    assert data["singularities"]["wrist"]["singular"] is True
    code, out, _ = optiplan("kinematics", "ur5", "--at", words([*Q[:4], 0.0, Q[5]]))
    assert code == 0
    assert "singular: wrist · rank 5 of 6\n" in out
    assert optiplan_json("kinematics", "panda")[1]["singularities"] is None


def test_rates_of_roll_and_yaw_that_do_not_exist(optiplan, optiplan_json):
    data = optiplan_json("kinematics", "srra", "--at", "0,0,0,0,0,0")[1]
    pitch = data["pose"]["rpy"][1]
    assert abs(abs(pitch) - np.pi / 2) < 1e-9
    assert data["analytic_jacobian"] is None
    assert "roll and yaw have no rates" in data["analytic_jacobian_reason"]
    level = words([0, 0, 0, 0, np.pi / 2, 0])
    assert optiplan_json("kinematics", "srra", "--at", level)[1]["analytic_jacobian"] is not None
    assert "roll and yaw have no rates" in optiplan("kinematics", "srra", "--at", "0,0,0,0,0,0")[1]


def test_wheels_turn_as_the_platform_moves(optiplan, optiplan_json):
    heading, v = 0.7, [0.1, -0.2, 0.3, 0, 0, 0, 0, 0, 0]
    at = words([1.0, 2.0, heading, 0, -1.2, -1.6, -1.9, 1.5708, 0])
    data = optiplan_json("kinematics", "delbot", "--at", at, "--velocity", words(v))[1]
    c, s = np.cos(heading), np.sin(heading)
    twist = [c * v[0] + s * v[1], -s * v[0] + c * v[1], v[2]]  # seen from the platform
    expected = Mecanum(0.03, 0.291909, 0.2726).wheel_rates(np.array(twist))
    assert data["velocity"]["wheel_rates"] == pytest.approx(expected, abs=1e-12)
    assert data["wheels"]["names"] == ["front_left", "front_right", "rear_left", "rear_right"]
    assert data["velocity"]["twist"] == pytest.approx(np.array(data["geometric_jacobian"]) @ v, abs=1e-12)
    assert "wheels" not in optiplan_json("kinematics", "delbot", "--group", "arm")[1]
    assert "front_left" in optiplan("kinematics", "delbot")[1]


@pytest.mark.parametrize(
    "arguments",
    [
        ("ur5",),
        ("delbot", "--velocity", "0.1,0,0.2,0,0,0,0,0,0"),
        ("baxter",),
        ("planar2r", "--at", "out"),
        ("two_links", "--symbolic"),
        ("puma560", "--symbolic"),
        ("srra", "--at", "home", "--symbolic"),
    ],
)
def test_a_person_reads_it_in_eighty_columns(optiplan, arguments, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = optiplan("kinematics", *arguments)
    assert code == 0
    assert max(map(len, out.splitlines())) <= 80
    assert "…" not in out.replace("q2, …", "")


def test_formulas(optiplan, optiplan_json):
    code, data = optiplan_json("kinematics", "two_links", "--symbolic")
    assert code == 0
    assert data["symbolic"]["pose"][0] == ["c12", "-s12", "0", "c1 + 0.7*c12"]
    assert data["symbolic"]["geometric_jacobian"][0] == ["-s1 - 0.7*s12", "-0.7*s12"]
    assert data["pose"]  # the numbers are there too
    _, out, _ = optiplan("kinematics", "two_links", "--symbolic")
    assert "  vx,q1 = -s1 - 0.7*s12\n" in out
    assert "Yoshikawa" not in out
    assert "Yoshikawa" in optiplan("kinematics", "two_links", "--at", "best", "--symbolic")[1]


def test_without_a_word_it_is_the_configuration_that_ik_prefers(optiplan, optiplan_json):
    assert optiplan_json("kinematics", "ur5")[1]["configuration"] == "ready"
    assert "delbot · frame grasp · at home [0, 0, 0," in optiplan("kinematics", "delbot")[1]


def test_outside_the_limits_is_said(optiplan, optiplan_json):
    assert optiplan_json("kinematics", "planar2r", "--at", "9,0")[1]["outside_limits"] == ["shoulder"]
    assert "outside the limits of: shoulder" in optiplan("kinematics", "planar2r", "--at", "9,0")[1]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("ur5", "--at", "1,2"), "--at: found 2 numbers; expected 6 numbers up to 1e+06 with commas between them"),
        (("ur5", "--at", "nose"), "found 'nose'; expected 6 numbers"),
        (("ur5", "--at", "redy"), "or one of: ready, up (did you mean 'ready'?)"),
        (("ur5", "--at", "1,2,3,4,5,nan"), "found '1,2,3,4,5,nan'"),
        (("ur5", "--at", " "), "found ' '"),
        (("ur5", "--at", ""), "an empty value after --at"),
        (
            ("delbot", "--group", "base", "--at", "1e308,1e308,0"),
            "found '1e308,1e308,0'; expected 3 numbers up to 1e+06",
        ),
        (("ur5", "--velocity", "1"), "--velocity: found 1 numbers"),
        (("ur5", "--frame", "nose"), "unknown frame 'nose'; choose from: "),
        (("ur6",), "unknown robot"),
        (("delbot", "--group", "leg"), "unknown group 'leg'"),
        (("panda", "--symbolic"), "found 7 joints; expected at most 6 joints"),
    ],
)
def test_bad_input_is_told(optiplan, arguments, text):
    code, out, err = optiplan("kinematics", *arguments)
    assert (code, out) == (2, "")
    assert text in err


def test_help_teaches(optiplan):
    code, out, _ = optiplan("kinematics", "--help")
    assert code == 0
    for text in ("fixed", "optiplan kinematics ur5", "--symbolic", "Exit code", "4×4"):
        assert text in out
