"""The symbolic twin against pinocchio, by the virtual machine and as machine code."""

import os
import shutil

import numpy as np
import pinocchio as pin
import pytest

from optiplan.errors import UnknownChoiceError
from optiplan.kinematics.symbolic import compiled
from optiplan.kinematics.symbolic.functions import SymbolicRobot
from optiplan.robot.robot import load_robot, robot_names

STATES = 1000
TOLERANCE = 1e-9
needs_compiler = pytest.mark.skipif(compiled.compiler() is None, reason="no C compiler")


def every_joint() -> pin.Model:
    """A tree with two branches and each type of joint, at random places, with random bodies and armature."""
    pin.seed(3)
    model = pin.Model()
    tilted = np.array([0.6, 0.0, 0.8])
    joints = [
        (0, pin.JointModelPlanar()),
        (1, pin.JointModelRUBZ()),
        (2, pin.JointModelPX()),
        (1, pin.JointModelRevoluteUnaligned(tilted)),
        (4, pin.JointModelPrismaticUnaligned(tilted)),
        (5, pin.JointModelRY()),
        (6, pin.JointModelRUBX()),
    ]
    for parent, joint in joints:
        number = model.addJoint(parent, joint, pin.SE3.Random(), f"joint{model.njoints}")
        model.appendBodyToJoint(number, pin.Inertia.Random(), pin.SE3.Random())
    model.addFrame(pin.Frame("tool", 7, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("hand", 3, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.armature = np.linspace(0.1, 0.9, model.nv)
    return model


def subject(name: str) -> tuple[pin.Model, str]:
    if name == "every joint":
        return every_joint(), "tool"
    robot = load_robot(name)
    return robot.model, robot.tool_frame


def states(model: pin.Model, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Configurations (nq, count), velocities and accelerations (nv, count)."""
    rng = np.random.default_rng(1)
    Q = [pin.integrate(model, pin.neutral(model), rng.uniform(-3, 3, model.nv)) for _ in range(count)]
    return np.array(Q).T, rng.uniform(-2, 2, (model.nv, count)), rng.uniform(-5, 5, (model.nv, count))


def over(function, *matrices):
    """Values (count, rows, columns) of a function mapped over the columns of its inputs."""
    count = matrices[0].shape[1]
    values = np.array(function.map(count)(*matrices))
    return values.reshape(values.shape[0], count, -1).transpose(1, 0, 2)


def of_pinocchio(model, frame, Q, V, A):
    """The same values, one state after another: dictionary of arrays (count, …)."""
    data, index = model.createData(), model.getFrameId(frame)
    rows = {name: [] for name in ("pose", "jacobian", "local", "com", "tau", "mass", "w")}
    for q, v, a in zip(Q.T, V.T, A.T, strict=True):
        pin.computeJointJacobians(model, data, q)
        rows["pose"].append(pin.updateFramePlacement(model, data, index).homogeneous.copy())
        J = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)
        rows["jacobian"].append(J)
        rows["local"].append(pin.getFrameJacobian(model, data, index, pin.LOCAL))
        # The product of the singular values is accurate where the determinant of J J^T is not.
        rows["w"].append([[np.prod(np.linalg.svd(J, compute_uv=False))]])
        rows["com"].append(pin.centerOfMass(model, data, q)[:, None].copy())
        rows["tau"].append(pin.rnea(model, data, q, v, a)[:, None].copy())
        rows["mass"].append(pin.crba(model, data, q).copy())
    return {name: np.array(values) for name, values in rows.items()}


@pytest.mark.parametrize("name", [*robot_names(), "every joint"])
def test_it_equals_pinocchio(name):
    model, frame = subject(name)
    Q, V, A = states(model, STATES)
    twin, expected = SymbolicRobot(model, machine_code=False), of_pinocchio(model, frame, Q, V, A)
    found = {
        "pose": over(twin.pose(frame), Q),
        "jacobian": over(twin.jacobian(frame), Q),
        "local": over(twin.jacobian(frame, "local"), Q),
        "com": over(twin.centre_of_mass(), Q),
        "tau": over(twin.rnea(), Q, V, A),
        "mass": over(twin.mass_matrix(), Q),
    }
    if not any(body.mass for body in model.inertias):  # the arm of a report that has none
        del found["com"]  # 0/0 in both
    for key, values in found.items():
        np.testing.assert_allclose(values, expected[key], rtol=TOLERANCE, atol=TOLERANCE, err_msg=key)
    if name != "planar2r":  # it has no full measure: see the test of its two rows
        np.testing.assert_allclose(over(twin.manipulability(frame), Q), expected["w"], rtol=TOLERANCE, atol=TOLERANCE)


def test_manipulability_of_two_links_by_rows():
    robot = load_robot("planar2r")
    twin = SymbolicRobot(robot.model, machine_code=False)
    Q, _, _ = states(robot.model, 50)
    J = over(twin.jacobian(robot.tool_frame), Q)
    assert np.abs(J[:, 1]).max() < 1e-12  # it moves in the plane of x and z
    w = over(twin.manipulability(robot.tool_frame, rows=(0, 2)), Q).ravel()
    np.testing.assert_allclose(w, np.abs(np.linalg.det(J[:, ::2][:, :2])), atol=1e-12)
    tall = over(twin.manipulability(robot.tool_frame), Q).ravel()  # sqrt(det(J^T J)), all six rows
    np.testing.assert_allclose(tall, np.sqrt(np.linalg.det(J.transpose(0, 2, 1) @ J)), atol=1e-12)
    gradient = over(twin.manipulability(robot.tool_frame, rows=(0, 2)).jacobian(), Q, np.zeros((1, 50)))
    assert np.abs(gradient[:, 0, 0]).max() < 1e-12  # turning the first joint turns all of the arm
    assert np.abs(gradient[:, 0, 1]).max() > 0.1
    at_right_angle = twin.manipulability(robot.tool_frame, rows=(0, 2)).jacobian()(np.array([0.3, np.pi / 2]), 0)
    assert np.abs(np.array(at_right_angle)).max() < 1e-12  # the optimum of a two-link arm


def test_manipulability_has_a_slope_where_it_is_zero():
    """An elbow stretched to the last bit: no root of zero in the derivative, which would be no number."""
    robot = load_robot("ur3")
    slope = SymbolicRobot(robot.model, machine_code=False).manipulability("tool0").jacobian()
    for elbow in (0.0, -np.pi, np.pi):
        q = np.array([0.3, -1.0, elbow, 0.2, 0.0, 0.5])
        assert np.isfinite(np.array(slope(q, 0))).all()


@pytest.mark.parametrize("name", ["panda", "ur5", "every joint"])
def test_derivatives_of_the_dynamics_are_those_of_pinocchio(name):
    model, _ = subject(name)
    twin = SymbolicRobot(model, machine_code=False)
    Q, V, A = states(model, 20)
    data, tau = model.createData(), np.zeros(model.nv)
    for q, v, a in zip(Q.T, V.T, A.T, strict=True):
        by_q, by_v, by_a = (np.array(value) for value in twin.rnea().jacobian()(q, v, a, tau))
        expected = pin.computeRNEADerivatives(model, data, q, v, a)
        np.testing.assert_allclose(by_q @ np.array(twin.tangent()(q)), expected[0], rtol=TOLERANCE, atol=TOLERANCE)
        np.testing.assert_allclose(by_v, expected[1], rtol=TOLERANCE, atol=TOLERANCE)
        upper = np.triu(expected[2])  # the triangle that pinocchio fills
        np.testing.assert_allclose(np.triu(by_a), upper, rtol=TOLERANCE, atol=TOLERANCE)


@pytest.mark.parametrize("name", ["panda", "every joint"])
def test_derivatives_against_differences(name):
    model, frame = subject(name)
    twin = SymbolicRobot(model, machine_code=False)
    functions = [twin.pose(frame), twin.jacobian(frame), twin.centre_of_mass(), twin.mass_matrix()]
    functions += [twin.jacobian(frame, "local"), twin.manipulability(frame)]
    Q, _, _ = states(model, 3)
    h = 1e-5
    for q in Q.T:
        G = np.array(twin.tangent()(q))
        for function in functions:
            size = function.numel_out(0)
            exact = np.array(function.jacobian()(q, np.zeros(function.size_out(0)))) @ G
            steps = h * np.eye(model.nv)
            values = [[function(pin.integrate(model, q, sign * step)) for sign in (1, -1)] for step in steps]
            differences = [(np.array(up) - np.array(down)).ravel(order="F") / (2 * h) for up, down in values]
            assert exact.shape == (size, model.nv)
            np.testing.assert_allclose(exact, np.array(differences).T, rtol=1e-6, atol=1e-6, err_msg=function.name())


def test_tangent_is_the_rate_of_the_configuration():
    model = every_joint()
    q, h = states(model, 1)[0][:, 0], 1e-6
    steps = h * np.eye(model.nv)
    rates = [(pin.integrate(model, q, step) - pin.integrate(model, q, -step)) / (2 * h) for step in steps]
    found = np.array(SymbolicRobot(model, machine_code=False).tangent()(q))
    np.testing.assert_allclose(found, np.array(rates).T, atol=1e-9)


@needs_compiler
def test_machine_code_equals_the_virtual_machine_and_is_made_once(tmp_path, monkeypatch):
    import casadi

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robot = load_robot("ur5")
    slow, fast = SymbolicRobot(robot.model, machine_code=False), SymbolicRobot(robot.model)
    function = fast.jacobian(robot.tool_frame)
    assert function.class_name() == "External"
    Q = casadi.MX.sym("Q", 6, 10)
    columns = np.random.default_rng(0).uniform(-3, 3, (6, 10))
    values = []
    for twin in (slow, fast):
        mapped = casadi.vec(twin.jacobian(robot.tool_frame).map(10)(Q))
        whole = casadi.Function("whole", [Q], [mapped, casadi.jacobian(mapped, casadi.vec(Q))])
        values.append([np.array(value) for value in whole(columns)])
    np.testing.assert_allclose(values[0][0], values[1][0], atol=1e-13)
    np.testing.assert_allclose(values[0][1], values[1][1], atol=1e-13)
    assert np.abs(values[1][1]).max() > 0.1

    libraries = list((tmp_path / "optiplan" / "twin").iterdir())
    assert len(libraries) == 1
    monkeypatch.setattr(compiled, "_compile", lambda *_: pytest.fail("compiled twice"))
    again = SymbolicRobot(load_robot("ur5").model).jacobian(robot.tool_frame)
    assert again.class_name() == "External"
    assert list((tmp_path / "optiplan" / "twin").iterdir()) == libraries


@needs_compiler
def test_another_robot_or_frame_is_another_library(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    model = load_robot("planar2r").model
    tool = load_robot("planar2r").tool_frame
    base = SymbolicRobot(model).centre_of_mass()
    heavier = model.copy()
    heavier.inertias[2] = pin.Inertia(3.0, np.array([0.2, 0.0, 0.0]), 0.1 * np.eye(3))
    q = np.array([0.3, 0.8])
    moved = SymbolicRobot(heavier).centre_of_mass()(q)
    assert np.abs(np.array(base(q)) - np.array(moved)).max() > 1e-3
    np.testing.assert_allclose(np.array(moved).ravel(), pin.centerOfMass(heavier, heavier.createData(), q), atol=1e-12)
    twin = SymbolicRobot(model)
    twin.pose(tool), twin.pose(model.frames[1].name)
    assert len(list((tmp_path / "optiplan" / "twin").iterdir())) == 4


@needs_compiler
def test_a_broken_library_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    model = load_robot("planar2r").model
    SymbolicRobot(model).tangent()
    library = next((tmp_path / "optiplan" / "twin").iterdir())
    broken = tmp_path / "broken"
    broken.write_bytes(b"not a library")
    os.replace(broken, library)  # as another file: the one that is loaded must not change under the process
    twin = SymbolicRobot(model).tangent()
    assert twin.class_name() == "External"
    assert np.array(twin([0.1, 0.2])) == pytest.approx(np.eye(2))


@pytest.mark.parametrize("missing", ["compiler", "cache", "working compiler"])
def test_the_virtual_machine_stands_in(tmp_path, monkeypatch, missing):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    if missing == "compiler":
        monkeypatch.setenv("CC", "no-such-compiler")
    elif missing == "working compiler":
        monkeypatch.setenv("CC", shutil.which("false"))
    else:
        (tmp_path / "optiplan").write_text("a file where the folder should be")
    robot = load_robot("planar2r")
    function = SymbolicRobot(robot.model).pose(robot.tool_frame)
    assert function.class_name() == "SXFunction"
    assert np.array(function([0.0, 0.0]))[3] == pytest.approx([0, 0, 0, 1])


def test_functions_are_made_once_and_names_are_checked():
    robot = load_robot("planar2r")
    twin = SymbolicRobot(robot.model, machine_code=False)
    assert twin.pose(robot.tool_frame) is twin.pose(robot.tool_frame)
    with pytest.raises(UnknownChoiceError, match="unknown frame 'no frame'"):
        twin.pose("no frame")
    with pytest.raises(UnknownChoiceError, match="unknown reference"):
        twin.jacobian(robot.tool_frame, "world")


def test_an_unknown_joint_is_refused():
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    with pytest.raises(ValueError, match=r"joint 'ball' is a JointModelSpherical; the symbolic twin knows continuous"):
        SymbolicRobot(model)
