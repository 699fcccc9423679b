"""Figures of runs: what is drawn is what the motion does, and files are what their names say."""

import csv
import re

import numpy as np
import pytest
import trimesh

import optiplan as op
from optiplan.errors import InputError, UnknownChoiceError
from optiplan.trajectory.trajectory import Trajectory
from optiplan.viewer.plots.curves import motion_curves
from optiplan.viewer.plots.figures import FIGURES, PlotOptions, draw, save_figures, write_all
from optiplan.viewer.plots.path_figure import outlines
from optiplan.viewer.plots.runs import PlottedRun, comparable

HEADS = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml", "csv": b"run,t,"}


@pytest.fixture(scope="module")
def run(shelf, motion):
    return PlottedRun("first", shelf, motion(shelf), True)


@pytest.fixture(scope="module")
def other(shelf, motion):
    return PlottedRun("second", shelf, motion(shelf, 2.0), False)


def gids(panel, name):
    return [line for line in panel.lines if line.get_gid() == name]


def test_curves_are_those_of_the_motion_and_jump_where_it_jumps(planar):
    """Two pieces whose accelerations differ: at the breakpoint both values are there."""
    c = np.zeros((2, 3, 2))
    c[0, 2], c[1, 0], c[1, 1], c[1, 2] = [1.0, 0.5], [1.0, 0.5], [2.0, 1.0], [-1.0, -0.5]
    from optiplan.problem.problem import JointGoal, Problem

    problem = Problem(planar, np.zeros(2), JointGoal(np.array([2.0, 1.0])))
    trajectory = Trajectory(planar.joint_names, np.array([0.0, 1.0, 2.0]), c)
    curves = motion_curves(problem, trajectory)
    assert (curves.t[0], curves.t[-1]) == (0.0, 2.0)
    assert (np.diff(curves.t) >= 0.0).all()
    at = np.flatnonzero(curves.t == 1.0)
    np.testing.assert_allclose(curves.joints[2][at], [[2.0, 1.0], [-2.0, -1.0]])
    inside = np.abs(curves.t - 1.0) > 1e-9
    for order in range(4):
        np.testing.assert_allclose(curves.joints[order][inside], trajectory(curves.t[inside], order), atol=1e-12)
    path = curves.X_WT[:, :3, 3]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    width = np.diff(curves.t)
    moving = width > 0.0
    mean = 0.5 * (curves.speed[1:] + curves.speed[:-1])[moving]
    np.testing.assert_allclose(steps[moving] / width[moving], mean, atol=2e-3)


def test_one_run_has_a_panel_a_quantity_with_limits_and_exact_extrema(run):
    panels = draw("joints", [run], PlotOptions()).axes
    assert [panel.get_ylabel().split(",")[0] for panel in panels] == [
        *("position", "velocity", "acceleration", "jerk", "torque")
    ]
    limits, n = run.problem.limits, run.problem.robot.n
    velocity = panels[1]
    heights = {round(float(line.get_ydata()[0]), 9) for line in gids(velocity, "limit")}
    assert heights == {round(sign * float(value), 9) for value in limits.velocity for sign in (-1, 1)}
    dots = [line for line in velocity.lines if line.get_marker() == "."]
    e = run.trajectory.extrema_at(1)
    assert len(dots) == n
    for joint, dot in enumerate(dots):
        np.testing.assert_array_equal(dot.get_ydata(), [e.low[joint], e.high[joint]])
        np.testing.assert_array_equal(dot.get_xdata(), [e.t_low[joint], e.t_high[joint]])


def test_shares_put_every_limit_at_a_hundred(run):
    panels = draw("joints", [run], PlotOptions(share=True)).axes
    for panel in panels:
        assert {abs(round(float(line.get_ydata()[0]), 6)) for line in gids(panel, "limit")} == {100.0}


def test_several_runs_have_a_panel_a_joint(run, other):
    some = run.problem.robot.joint_names[2:5]
    figure = draw("joints", [run, other], PlotOptions(joints=some))
    assert len(figure.axes) == 5 * 3
    assert [panel.get_title() for panel in figure.axes[:3]] == list(some)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["first, 1.600 s", "second, 2.000 s, not verified"]


def test_the_path_has_its_frames_in_space_and_in_planes(run):
    figure = draw("path", [run], PlotOptions(frames=5))
    for panel in figure.axes:
        assert len(gids(panel, "frame")) == 3 * 5
    plane = figure.axes[1]
    np.testing.assert_array_equal(plane.lines[0].get_xydata(), run.curves.X_WT[:, :2, 3])
    # a triad's axes are as long in space as each other, and are those of the tool frame
    size = np.linalg.norm(np.diff(np.array(gids(figure.axes[0], "frame")[0].get_data_3d()).T, axis=0))
    x_axis = np.diff(gids(plane, "frame")[0].get_xydata(), axis=0)[0]
    np.testing.assert_allclose(x_axis, size * run.curves.X_WT[0, :2, 0], atol=1e-9)


def test_outlines_are_of_the_obstacles(shelf, tmp_path):
    found = list(outlines(shelf.scene, (0, 1)))
    assert len(found) == 4  # the half-space has none
    np.testing.assert_allclose([found[0].min(axis=0), found[0].max(axis=0)], [[0.55, -0.45], [0.95, 0.45]])
    ball = found[1] - [0.7, -0.2]
    assert np.linalg.norm(ball, axis=1).max() == pytest.approx(0.05)
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 1, 0], [1, 1, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]], process=False)
    sheet.export(tmp_path / "sheet.stl")
    slanted = op.Scene([op.Mesh("sheet", str(tmp_path / "sheet.stl"))])
    assert [len(list(outlines(slanted, plane))) for plane in ((0, 1), (0, 2), (1, 2))] == [0, 1, 1]


@pytest.mark.parametrize("kind", HEADS)
def test_files_are_what_their_names_say(run, other, tmp_path, kind):
    path = tmp_path / f"new/figure.{kind}"
    save_figures(["tool"], [run, other], PlotOptions(), path)
    first = path.read_bytes()
    assert first.startswith(HEADS[kind])
    save_figures(["tool"], [run, other], PlotOptions(), path)
    assert path.read_bytes() == first


def test_a_pdf_has_a_page_for_each_figure(run, tmp_path):
    save_figures(list(FIGURES), [run], PlotOptions(), tmp_path / "all.pdf")
    assert len(re.findall(rb"/Type /Page\s", (tmp_path / "all.pdf").read_bytes())) == len(FIGURES) == 3


def test_csv_has_the_samples_and_the_limits(run, tmp_path):
    written = write_all(["joints"], ["csv"], [run], PlotOptions(), tmp_path)
    assert [path.name for path in written] == ["curves.csv", "limits.csv"]
    rows = list(csv.DictReader(written[0].open()))
    joint = run.problem.robot.joint_names[3]
    t = np.array([float(row["t"]) for row in rows])
    np.testing.assert_allclose(
        [float(row[f"{joint}.velocity"]) for row in rows], run.trajectory(t, 1)[:, 3], rtol=0, atol=1e-12
    )
    last = [float(rows[-1][f"tool.{name}"]) for name in "xyz"]
    np.testing.assert_allclose(last, run.curves.X_WT[-1, :3, 3])
    table = {(row["joint"], row["quantity"]): row for row in csv.DictReader(written[1].open())}
    row = table[joint, "jerk"]
    assert float(row["upper"]) == run.problem.limits.jerk[3]
    assert float(row["largest"]) == run.trajectory.extrema_at(3).high[3]
    assert row["unit"] == "rad/s³"


def test_what_cannot_be_drawn_is_named(run, other, planar, bare, motion, tmp_path):
    with pytest.raises(InputError, match=r"found|\.png, \.svg, \.pdf, \.csv"):
        save_figures(["tool"], [run], PlotOptions(), tmp_path / "figure.jpg")
    with pytest.raises(InputError, match="3 figures"):
        save_figures(list(FIGURES), [run], PlotOptions(), tmp_path / "figure.png")
    with pytest.raises(UnknownChoiceError, match="elbow"):
        save_figures(["joints"], [run], PlotOptions(joints=("elbow",)), tmp_path / "figure.csv")
    with pytest.raises(InputError, match="'flat' moves"):
        comparable([run, PlottedRun("flat", bare, motion(bare), True)])
    with pytest.raises(InputError, match="no run with a motion"):
        comparable([])
    assert list(tmp_path.iterdir()) == []
