"""A lecture's example 4 as a person runs it: 1 rad in 18 s at several velocities."""

import pytest

EXAMPLE = """\
version: 1
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: [GOAL, 1.0]}
limits: {jerk: none}
planner: {name: lspb, duration: 18, SHAPE}
"""


def write(tmp_path, shape, goal="1.5"):
    path = tmp_path / "example.yaml"
    path.write_text(EXAMPLE.replace("GOAL", goal).replace("SHAPE", shape))
    return path


@pytest.mark.parametrize("goal", ["1.5", "-0.5"])
@pytest.mark.parametrize(
    "shape", ["velocity: 0.08333333333333333", "velocity: 0.06", "velocity: 0.11", "blend_time: 6"]
)
def test_within_the_bounds_is_planned(optiplan, tmp_path, shape, goal):
    code, out, _ = optiplan("plan", write(tmp_path, shape, goal))
    assert code == 0
    assert "duration 18.000 s" in out


@pytest.mark.parametrize("velocity", ["0.02", "0.12"])
def test_outside_is_an_input_error_with_the_bounds(optiplan, tmp_path, velocity):
    code, out, err = optiplan("plan", write(tmp_path, f"velocity: {velocity}"))
    assert (code, out) == (2, "")
    for part in (f"{velocity} rad/s", "'shoulder'", "0.0556", "0.111"):
        assert part in err
