"""The textbook style and its figures: what is drawn holds for the motion, the law, the arm and the vias."""

import numpy as np
import pytest

from optiplan.errors import InputError, UnknownChoiceError
from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.kinematics.singularities import NAMES, singularity_model
from optiplan.planners.base import Budget
from optiplan.problem.examples import find_problem
from optiplan.problem.load import load_problem
from optiplan.robot.robot import load_robot
from optiplan.runs.pipeline import run as plan
from optiplan.viewer.plots.figures import LESSONS, PlotOptions, draw
from optiplan.viewer.plots.lessons.laws import LAWS, Displacement, acceleration_jumps
from optiplan.viewer.plots.lessons.singularities import SHOWN, singular_postures
from optiplan.viewer.plots.lessons.targets import shots
from optiplan.viewer.plots.runs import PlottedRun
from optiplan.workspace.accuracy import pose_accuracy, repeatability
from tests.reference.entries import entries

TEXTBOOK = PlotOptions(style="textbook")


def planned(name):
    problem = load_problem(find_problem(name))
    result = plan(problem, problem.planner, problem.options, Budget(20.0), lambda stage, fraction: None)
    return PlottedRun(problem.planner, problem, result.trajectory, result.verified)


@pytest.fixture(scope="module")
def trapezoid():
    return planned("19_lspb")


def drawn_limits(figure):
    return [line for panel in figure.axes for line in panel.lines if line.get_gid() == "limit"]


def test_axes_are_as_large_as_the_curve(trapezoid):
    """The lecture's example 4: 1/12 rad/s below a limit far above."""
    velocity = draw("joints", [trapezoid], TEXTBOOK).axes[1]
    low, high = velocity.get_ylim()
    assert 1 / 12 < high < 0.12
    assert -0.04 < low < 0.0
    assert draw("joints", [trapezoid], PlotOptions()).axes[1].get_ylim()[1] > 1.0


def test_the_title_tells_of_limits_that_are_drawn(trapezoid):
    paper, textbook = (draw("joints", [trapezoid], PlotOptions(style=style)) for style in ("paper", "textbook"))
    assert "dashed: limits" in paper.get_suptitle()
    assert len(drawn_limits(textbook)) < len(drawn_limits(paper))
    assert ("dashed: limits" in textbook.get_suptitle()) == bool(drawn_limits(textbook))
    for line in drawn_limits(textbook):
        low, high = line.axes.get_ylim()
        assert low <= line.get_ydata()[0] <= high
    few = draw("joints", [trapezoid], PlotOptions(joints=("shoulder",), style="textbook"))
    for panel in few.axes[1:4]:
        assert not [line for line in panel.lines if line.get_gid() == "limit"]


def test_laws_have_the_peaks_of_the_lecture():
    constants = entries("lecture")["lecture.profile_constants"]
    what = Displacement.of([])
    for ours, entry in (("cubic", "cubic"), ("quintic", "quintic"), ("LSPB", "lspb_third"), ("bang-bang", "bangbang")):
        motion = what.motion(ours)
        peaks = [float(np.abs([motion.extrema_at(k).low, motion.extrema_at(k).high]).max()) for k in (1, 2)]
        np.testing.assert_allclose(peaks, [constants[entry]["v"], constants[entry]["a"]], rtol=1e-9)
        assert (motion.start[0], motion.end[0], motion.duration) == pytest.approx((0.0, 1.0, 1.0))
    np.testing.assert_allclose(np.diff(what.motion("S-curve").breakpoints), 1 / 7)
    jumps = {name: int(np.count_nonzero(acceleration_jumps(what.motion(name)))) for name in LAWS}
    assert jumps == {"cubic": 2, "quintic": 0, "LSPB": 4, "bang-bang": 3, "S-curve": 0}


def test_laws_of_a_run_move_its_joint_in_its_time(trapezoid):
    figure = draw("laws", [trapezoid], TEXTBOOK)
    assert "shoulder moves by 1 rad in 18 s" in figure.get_suptitle()
    assert len(figure.axes) == 4 * 5
    speed = figure.axes[5 + 2].lines[0]
    assert max(speed.get_ydata()) == pytest.approx(1 / 12)
    assert max(speed.get_xdata()) == pytest.approx(18.0)


def test_targets_are_what_their_titles_say():
    figure = draw("accuracy", [], TEXTBOOK)
    titles = [panel.get_title().splitlines()[0] for panel in figure.axes]
    assert titles == [
        *("accurate and repeatable", "repeatable, not accurate"),
        *("accurate on average, not repeatable", "neither"),
    ]
    measured = []
    for panel in figure.axes:
        points = np.column_stack([next(line for line in panel.lines if line.get_gid() == "shots").get_xydata()])
        points = np.column_stack([points, np.zeros(len(points))])
        measured.append((pose_accuracy(points, np.zeros(3)), repeatability(points)))
        assert f"AP {measured[-1][0]:.2f} mm, RP {measured[-1][1]:.2f} mm" in panel.get_title()
    (a, b, c, d) = measured
    assert a[0] < 0.1 * b[0]
    assert c[0] < 0.1 * d[0]
    assert a[1] == pytest.approx(b[1])
    assert c[1] == pytest.approx(d[1])
    assert 3.0 * a[1] < c[1]
    assert np.abs(shots(0.0, 0.1).std(axis=0)[:2] - 0.1).max() < 0.015  # as spread as it says


@pytest.mark.parametrize("name", ["puma560", "srra"])
def test_each_singularity_is_one_and_no_other(name):
    robot = load_robot(name)
    model = singularity_model(robot)
    postures = singular_postures(robot, model)
    assert [posture.name for posture in postures] == list(SHOWN)
    for posture in postures:
        s = np.linalg.svd(ToolKinematics(robot).evaluate(posture.q[None])[1][0], compute_uv=False)
        assert s[-1] < 1e-9 < 1e-3 < s[-2]
        assert model.factors(posture.q[None]).names(1e-6) == [(posture.name,)]
        assert (robot.limits.lower <= posture.q).all()
        assert (posture.q <= robot.limits.upper).all()
        assert posture.semi_axes[:, 2].min() < 0.01 < posture.semi_axes[:, 1].min()
    assert {posture.name for posture in postures} == set(NAMES)


def test_blocks_are_the_factors_of_the_determinant():
    robot = load_robot("puma560")
    Q = np.random.default_rng(5).uniform(-2.5, 2.5, (50, 6))
    model = singularity_model(robot)
    blocks = model.blocks(Q)
    product = np.linalg.det(blocks.arm) * np.linalg.det(blocks.wrist)
    np.testing.assert_allclose(np.abs(product), np.abs(np.linalg.det(ToolKinematics(robot).evaluate(Q)[1])), atol=1e-12)
    with pytest.raises(ValueError, match="wrist"):
        singularity_model(load_robot("ur5")).blocks(Q)


def test_no_joint_of_the_block_moves_in_the_direction_lost():
    robot = load_robot("puma560")
    model = singularity_model(robot)
    figure = draw("singularities", [], TEXTBOOK)
    spaces = [panel for panel in figure.axes if panel.name == "3d"]
    assert [panel.get_title().partition(":")[0] for panel in spaces] == list(SHOWN)
    for panel, posture in zip(spaces, singular_postures(robot, model), strict=True):
        lost = np.array(next(line for line in panel.lines if line.get_gid() == "lost").get_data_3d())
        direction = np.diff(lost, axis=1)[:, 0]
        blocks = model.blocks(posture.q[None])
        moved = (blocks.wrist if posture.name == "wrist" else blocks.arm)[0]
        assert np.abs(direction @ moved).max() < 1e-9 < 0.1 < np.linalg.norm(direction)
        np.testing.assert_allclose(lost.mean(axis=1), blocks.centre[0], atol=1e-12)


def test_vias_are_missed_and_then_hit():
    figure = draw("vias", [], TEXTBOOK)
    titles = [panel.get_title() for panel in figure.axes]
    assert titles[0].startswith("straight lines")
    assert "via 2 missed by 0.05" in titles[1]
    assert titles[-2].endswith("every via within its tolerance")
    pseudo = [[line for line in panel.lines if line.get_gid() == "pseudo"] for panel in figure.axes[1:-1]]
    assert [len(line[0].get_xdata()) for line in pseudo] == [0, 2]
    last, (via, height) = figure.axes[-2], figure.axes[0].lines[0].get_xydata()[2]
    curve = last.lines[1].get_xydata()
    assert np.interp(via, *curve.T) == pytest.approx(height, abs=1e-4)


def test_vias_of_a_run_end_at_its_motion():
    run = planned("23_via_blends")
    figure = draw("vias", [run], TEXTBOOK)
    curve = figure.axes[-2].lines[1].get_xydata()
    joint = run.problem.robot.joint_names.index(figure.axes[0].get_ylabel().split(",")[0])
    np.testing.assert_allclose(curve[:, 1], run.trajectory(curve[:, 0])[:, joint], atol=1e-9)


def test_what_has_no_such_figure_is_named(trapezoid):
    with pytest.raises(UnknownChoiceError, match="laws"):
        draw("laws", [trapezoid], PlotOptions())
    with pytest.raises(InputError, match="'planar2r', without a spherical wrist"):
        draw("singularities", [trapezoid], TEXTBOOK)
    with pytest.raises(InputError, match="a motion without vias"):
        draw("vias", [trapezoid], TEXTBOOK)
    with pytest.raises(InputError, match="2 runs for 'laws'"):
        draw("laws", [trapezoid, trapezoid], TEXTBOOK)
    with pytest.raises(InputError, match="none for 'joints'"):
        draw("joints", [], TEXTBOOK)
    assert list(LESSONS) == ["laws", "accuracy", "singularities", "vias"]
