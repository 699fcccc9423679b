"""Control files: what they may say, what is refused and on which line, what a log folder holds."""

import json

import numpy as np
import pytest

import optiplan as op
from optiplan.errors import InputError
from optiplan.resources import control_dir
from optiplan.simulation.files.read import read_control
from optiplan.simulation.simulation import run_control
from tests.planned import planned_until

EXAMPLES = sorted(control_dir().glob("*.yaml"))
STEP = """version: 1
robot: planar2r
start: {joints: [0.1, 0.2]}
reference:
  step: {joint: shoulder, by: 0.1, lasting: 0.3}
controller:
  computed_torque: {frequency: 5}
"""


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "loop.yaml"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_can_be_read_and_says_what_it_shows(path):
    control = read_control(path)
    assert control.robot.n > 0
    assert path.read_text().startswith("# ")


def test_there_are_examples_of_every_controller_and_engine():
    read = [read_control(path).spec for path in EXAMPLES]
    assert {spec.controller.kind for spec in read} >= {"pid", "computed_torque", "task_space"}
    assert {spec.plant.engine for spec in read} == {"own", "mujoco", "ideal"}


def wrong(text, old, new):
    assert old in text
    return text.replace(old, new)


BAD = {
    "unknown key": ("version: 1", "version: 1\nspeed: 3", r"loop.yaml:2: speed: "),
    "no problem": ("robot: planar2r\n", "", r"found no problem|no problem; expected `problem`"),
    "unknown robot": ("planar2r", "planar3r", r"loop.yaml:2: robot: "),
    "start outside": ("[0.1, 0.2]", "[0.1, 99]", r"loop.yaml:3: start.joints\[1\]: .*outside its limits"),
    "wrong size": ("by: 0.1", "by: .nan", r"loop.yaml:5: reference.step"),
    "unknown joint": ("joint: shoulder", "joint: sholder", r"loop.yaml:5: .*did you mean 'shoulder'"),
    "two references": ("  step:", "  trajectory: x\n  step:", r"loop.yaml:4: reference.*exactly one of"),
    "no such controller": ("computed_torque: {frequency: 5}", "lqr: {}", r"controller.*lqr"),
    "frequency": ("frequency: 5", "frequency: -5", r"loop.yaml:7: controller.computed_torque.frequency"),
    "engine takes velocities": (
        "controller:",
        "plant: {engine: ideal}\ncontroller:",
        r"loop.yaml:8: controller.computed_torque: .*engine: ideal",
    ),
    "plant's step": ("controller:", "plant: {step: 0.0003}\ncontroller:", r"loop.yaml:6: plant.step: .*whole number"),
    "long delay": ("controller:", "plant: {delay: 1.0e9}\ncontroller:", r"loop.yaml:6: plant.delay: .*10"),
    "delay": ("controller:", "plant: {delay: 0.00031}\ncontroller:", r"loop.yaml:6: plant.delay: .*0.00025 or 0.0005"),
    "friction": (
        "controller:",
        "plant: {friction: {coulomb: [1, 2, 3]}}\ncontroller:",
        r"plant.friction.coulomb: 3 values; expected 2 values, one for each of",
    ),
    **{
        f"drive's {key}": (
            "computed_torque: {frequency: 5}",
            f"drive: {json.dumps({'takes': 'velocity', 'position': 10, 'velocity': 50, key: [1, 2, 3]})}",
            rf"loop.yaml:7: controller.drive.{key}: 3 values; expected 2 values, one for each of",
        )
        for key in ("position", "velocity", "integral", "integral_limit")
    },
    "tool reference of joints": (
        "step: {joint: shoulder, by: 0.1, lasting: 0.3}",
        "line: {by: [0.1, 0, 0], duration: 1}",
        r"controller.computed_torque: .*reference 'line', which is of the tool; expected controller: task_space",
    ),
    "no inertias": (
        "robot: planar2r\nstart: {joints: [0.1, 0.2]}",
        "robot: baxter_report\nstart: {configuration: stretched}",
        r"loop.yaml:2: robot: .*S0 \(link S0_link\)",
    ),
    "solver": (
        "computed_torque: {frequency: 5}",
        "task_space: {solver: proxqpp}",
        r"loop.yaml:7: controller.task_space.solver: 'proxqpp'; expected one of: .*native.*did you mean 'proxqp'",
    ),
    "dt": ("controller:", "rate: 0\ncontroller:", r"loop.yaml:6: rate"),
    **{
        f"{key} of the ideal plant": (
            "controller:\n  computed_torque: {frequency: 5}",
            f"controller: {{velocity: {{}}}}\nplant: {{engine: ideal, {key}: {value}}}",
            rf"loop.yaml:7: plant.{key}: a key without effect beside engine: ideal.*; expected no such key",
        )
        for key, value in {"friction": "{viscous: 1}", "rotor_inertia": 0.1, "payload": "{mass: 1}"}.items()
    },
    "a filter without an encoder": (
        "controller:",
        "plant: {velocity_filter: 20}\ncontroller:",
        r"loop.yaml:6: plant.velocity_filter: a key without effect beside encoder: 0",
    ),
    "what turns": (
        "controller:\n  computed_torque: {frequency: 5}",
        "scene: {obstacles: [{name: fan, shape: {box: [0.1, 0.1, 0.1]}, pose: {position: [2, 0, 0]},"
        " motion: {turn: {axis: [0, 0, 1], angle: [0, 1]}}}]}\ncontroller: {task_space: {}}",
        r"loop.yaml:\d: scene: 'fan', which turns, with controller: task_space.*obstacles that slide",
    ),
    "a push on the ideal plant": (
        "controller:\n  computed_torque: {frequency: 5}",
        "controller: {velocity: {}}\nplant: {engine: ideal}\ndisturbances: [{at: 0, lasting: 1}]",
        r"loop.yaml:8: disturbances: a key without effect beside engine: ideal",
    ),
    "law of the ideal plant": (
        "controller:\n  computed_torque: {frequency: 5}",
        "controller:\n  task_space: {damping: 0.7}\nplant: {engine: ideal}",
        r"loop.yaml:7: controller.task_space.damping: a key without effect beside engine: ideal",
    ),
    "law of measured states": (
        "computed_torque: {frequency: 5}",
        "task_space: {feedback: measured, frequency: 5}",
        r"loop.yaml:7: controller.task_space.frequency: a key without effect beside feedback: measured",
    ),
    "costs of the tool for joints": (
        "computed_torque: {frequency: 5}",
        "task_space: {orientation_cost: 0}",
        r"loop.yaml:7: controller.task_space.orientation_cost: a key without effect beside the reference 'step'",
    ),
    "two ways of a screw": (
        "step: {joint: shoulder, by: 0.1, lasting: 0.3}",
        "screw: {to: {position: [1, 0, 0]}, angle: 6.28, slide: 0.1, duration: 2}",
        r"loop.yaml:5: reference.screw: to and angle, slide; expected `to` alone",
    ),
    "both": (
        "robot: planar2r",
        "problem: 12_planar\nrobot: planar2r",
        r"loop.yaml:1: file: problem and robot; expected the problem, or its keys",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_names_line_and_field(file, case):
    old, new, message = BAD[case]
    with pytest.raises(InputError, match=message):
        read_control(file(wrong(STEP, old, new)))


def test_a_file_may_hold_keys_without_effect_at_their_defaults(file):
    text = wrong(STEP, "computed_torque: {frequency: 5}", "task_space: {frequency: 10, damping: 1, position_cost: 1}")
    plant = "{engine: ideal, payload: null, rotor_inertia: 0, friction: {viscous: 0}}"
    assert read_control(file(f"{text}plant: {plant}\ndisturbances: []\n")).spec.plant.engine == "ideal"


LATER = {
    "no such run": (
        "step: {joint: shoulder, by: 0.1, lasting: 0.3}",
        "trajectory: nowhere",
        r"trajectory: 'nowhere', but there is no",
    ),
    "step outside": ("by: 0.1", "by: 100", r"reference.step: shoulder = 100.1, outside its limits"),
    "plan of nothing": (
        "step: {joint: shoulder, by: 0.1, lasting: 0.3}",
        "plan: {}",
        r"reference.plan: plan without a problem",
    ),
}


@pytest.mark.parametrize("case", LATER)
def test_bad_references_are_told_before_anything_moves(file, case):
    old, new, message = LATER[case]
    with pytest.raises(InputError, match=message):
        run_control(file(wrong(STEP, old, new)))


def test_a_problem_that_is_not_there(file):
    with pytest.raises(InputError, match=r"loop.yaml:2: problem: '99_none'; expected .*01_reach"):
        read_control(file("version: 1\nproblem: 99_none\nreference: {plan: {}}\ncontroller: {velocity: {}}\n"))


def test_a_mapping_says_what_a_file_says(file):
    from_file = run_control(file(STEP)).log
    data = {"version": 1, "robot": "planar2r", "start": {"joints": np.array([0.1, 0.2])}}
    data |= {"reference": {"step": {"joint": "shoulder", "by": 0.1, "lasting": 0.3}}}
    data |= {"controller": {"computed_torque": {"frequency": 5}}}
    np.testing.assert_array_equal(op.simulate(data).log.q, from_file.q)


@pytest.mark.parametrize("frame", ["panda_hand_tcp", "panda_link8"])
def test_the_error_of_the_tool_is_that_of_the_frame_with_the_reference(frame):
    data = {"version": 1, "robot": "panda", "start": {"configuration": "ready"}, "plant": {"engine": "ideal"}}
    data["reference"] = {"line": {"by": [0.0, 0.01, -0.01], "duration": 0.4, "frame": frame}}
    log = op.simulate({**data, "controller": {"task_space": {"clearance": None}}}).log
    assert log.tracking.tool_peak < 1e-3
    assert log.tracking.turn_peak < 1e-3


def test_a_step_takes_values_by_joint(file):
    text = STEP.replace("[0.1, 0.2]", "{elbow: 0.2, shoulder: 0.1}")
    by_name, listed = (
        text.replace("joint: shoulder, by: 0.1", f"to: {to}") for to in ("{elbow: 0.3, shoulder: 0.2}", "[0.2, 0.3]")
    )
    np.testing.assert_array_equal(run_control(file(by_name)).log.q, run_control(file(listed)).log.q)
    with pytest.raises(InputError, match=r"loop.yaml:5: reference.step.to.elbo: unknown joint 'elbo'; expected one of"):
        read_control(file(by_name.replace("elbow: 0.3", "elbo: 0.3")))
    with pytest.raises(InputError, match=r"loop.yaml:3: start.joints: no value of elbow"):
        read_control(file(by_name.replace("elbow: 0.2, ", "")))


def test_the_log_folder(file, tmp_path):
    done = op.simulate(file(STEP))
    assert done.clean
    assert done.responses["shoulder"].overshoot < 0.01
    done.save(tmp_path / "log")
    record = json.loads((tmp_path / "log" / "run.json").read_text())
    assert record["clean"] is True
    assert record["execution"]["tracking"]["tool_rms"] == pytest.approx(done.log.tracking.tool_rms)
    assert set(record["step_response"]) == {"shoulder"}
    arrays = np.load(tmp_path / "log" / "log.npz")
    np.testing.assert_array_equal(arrays["q"], done.log.q)
    assert {"t", "q", "v", "wanted", "applied", "tool_error", "joint_names"} <= set(arrays)
    for name in ("error.svg", "limits.svg"):
        assert (tmp_path / "log" / name).read_text().startswith("<?xml")
    stored = op.simulate({**record["control"]})
    np.testing.assert_array_equal(stored.log.q, done.log.q)  # the record says all of it


@pytest.mark.parametrize("at", [0, 0.05])
@pytest.mark.parametrize("controller", ["computed_torque: {}", "task_space: {feedback: measured}", "task_space: {}"])
def test_the_error_right_after_a_step_is_that_step(file, at, controller):
    text = STEP.replace("by: 0.1", f"by: 0.1, at: {at}").replace("computed_torque: {frequency: 5}", controller)
    done = run_control(file(text))
    assert done.log.tracking.peak[0] == pytest.approx(0.1, abs=1e-3)
    assert set(done.responses) == {"shoulder"}


def test_a_step_without_samples_after_it_has_no_response(file, tmp_path):
    short = wrong(STEP, "lasting: 0.3", "at: 0.1, lasting: 1.0e-6") + "settle: 0\n"
    found = run_control(file(short))
    assert found.clean
    assert found.responses == {}
    found.save(tmp_path / "log")
    assert json.loads((tmp_path / "log" / "run.json").read_text())["step_response"] == {}


def test_noise_repeats_with_its_seed(file):
    noisy = STEP + "plant: {noise: {position: 1.0e-4}}\nseed: 3\n"
    one, two = (run_control(file(noisy)).log.q for _ in range(2))
    np.testing.assert_array_equal(one, two)
    other = run_control(file(noisy.replace("seed: 3", "seed: 4"))).log.q
    assert np.abs(one - other).max() > 0.0


def test_a_stored_run_is_followed(tmp_path, file):
    planned_until(op.load_problem("12_planar")).save(tmp_path / "run")
    text = "version: 1\nproblem: 12_planar\nreference: {trajectory: run}\ncontroller: {computed_torque: {}}\n"
    done = run_control(file(text))
    assert done.clean
    assert done.log.tracking.tool_rms < 1e-3
    moved = "version: 1\nrobot: planar2r\nstart: {joints: [0.5, 0.5]}\n" + text.partition("12_planar\n")[2]
    with pytest.raises(InputError, match=r"begins .* from the start"):
        run_control(file(moved))


def test_a_recorded_path_is_read_strictly(tmp_path, file):
    text = """version: 1
robot: ur5
start: {joints: [0, -1.2, 1.4, -0.4, 1.2, 0]}
reference: {recorded: {file: path.csv}}
controller: {task_space: {clearance: null}}
plant: {engine: ideal}
"""
    path = tmp_path / "path.csv"
    for content, message in (
        ("t,x\n0,1\n", r"path.csv:1: columns"),
        ("\n\nt,x\n0,1\n", r"path.csv:3: columns"),
        ("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,a,0,0,0,1\n", r"path.csv:3: row"),
        ("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,2\n", r"path.csv:3: .*unit quaternion"),
        ("t,x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,0,1\n\n1,0,0,0,0,0,0,1\n\n", r"path.csv:4: t: .*increase"),
        ("t,x,y,z,qx,qy,qz,qw\r0,0,0,0,0,0,0,1\r1,0,0,0,0,0,0,2\r", r"path.csv:3: .*unit quaternion"),
        ('t,"x\n' + "0,1\n" * 60_000, r"path.csv:\d+: row: field larger than field limit"),
    ):
        path.write_text(content)
        with pytest.raises(InputError, match=message):
            run_control(file(text))


def test_execute_and_its_arguments():
    run = planned_until(op.load_problem("12_planar"))
    assert not op.execute(run).touched
    late = op.execute(run, delay=0.002, payload=0.2, frequency=5.0)
    assert late.tracking.tool_rms > op.execute(run).tracking.tool_rms
    for argument, value in (("engine", "bullet"), ("delay", -1.0), ("payload", float("nan")), ("frequency", 0.0)):
        with pytest.raises(InputError, match=argument):
            op.execute(run, **{argument: value})
    with pytest.raises(InputError, match="run"):
        op.execute("nothing")


def test_a_task_is_refused_at_its_line(file):
    """Objects change hands in it; a loop would leave them where they are at first."""
    text = "version: 1\nproblem: 40_panda_sorts_cubes\nreference:\n  step: {joint: panda_joint1, by: 0.1}\n"
    with pytest.raises(InputError) as error:
        read_control(file(text + "controller: {task_space: {}}\nplant: {engine: ideal}\n"))
    (issue,) = error.value.issues
    assert issue.line == 2
    assert "40_panda_sorts_cubes" in issue.found
    assert "task" in issue.found
    assert "problem with a goal" in issue.expected
