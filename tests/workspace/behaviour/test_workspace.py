"""Reach, coverage of the reach sphere, and samples that do not depend on the number of processes."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from optiplan.cores import cores
from optiplan.errors import OptiPlanError
from optiplan.kinematics.manipulability import ToolKinematics, manipulability_measures, scaled
from optiplan.robot.robot import load_robot
from optiplan.workspace.accuracy import joint_resolution, tool_error
from optiplan.workspace.parallel import ChunkedWork, run_chunks
from optiplan.workspace.reach import Reach, reach, sampling_range
from optiplan.workspace.sampling import CHUNK, WorkspaceOptions, robot_with_meshes, study_workspace
from optiplan.workspace.voxels import DIRECTIONS, ring_coverage, sphere_directions, voxelise
from tests.robot.robots import chain, joint, write_robot
from tests.waiting import wait_until

BALL = Reach(np.array([1.0, 2.0, 3.0]), 0.0, 0.5)


def filled(count, low=-1.0):
    """Points spread over the ball above `low` times its radius."""
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (count, 3))
    return points[(np.linalg.norm(points, axis=1) <= 0.5) & (points[:, 2] >= 0.5 * low)] + BALL.shoulder


def test_reach_of_the_srra_is_that_of_its_table():
    """srra.reach: largest a3 + a4 + d7, least |a3 - a4| - d7."""
    found = reach(load_robot("srra"))
    assert found.largest == pytest.approx(1.881038878405607, abs=1e-9)
    assert found.least == pytest.approx(0.06896112159439327, abs=1e-9)
    assert found.shoulder == pytest.approx([0, 0, 0], abs=1e-12)


@pytest.mark.parametrize(("name", "height"), [("ur5", 0.089159), ("puma560", 0.67183), ("panda", 0.333)])
def test_shoulder_is_where_the_first_axes_meet(name, height):
    assert reach(load_robot(name)).shoulder == pytest.approx([0, 0, height], abs=1e-9)


def test_reach_of_parallel_axes_starts_at_the_first(tmp_path):
    arm = load_robot(str(write_robot(tmp_path, chain(joint("j1", "a", "b", x=0.2), joint("j2", "b", "c")))))
    assert reach(arm).shoulder == pytest.approx([0.2, 0, 0])
    assert reach(arm, "c").largest == pytest.approx(0.5)
    with pytest.raises(OptiPlanError, match="the frame b at the shoulder"):
        reach(arm, "b")


def test_joints_are_sampled_over_one_turn_at_most():
    lower, upper = sampling_range(load_robot("srra"))
    assert upper - lower == pytest.approx(np.full(6, 2.0 * np.pi))
    puma = load_robot("puma560")
    assert np.array_equal(sampling_range(puma)[0][:2], puma.limits.lower[:2])


def test_directions_are_unit_and_apart():
    d = sphere_directions()
    assert d.shape == (DIRECTIONS, 3)
    assert np.linalg.norm(d, axis=1) == pytest.approx(1.0)
    assert (d @ d.T - 2.0 * np.eye(DIRECTIONS)).max() < np.cos(np.radians(25.0))


def test_a_ball_full_of_points_is_covered_and_its_upper_half_only_half():
    everything, above = filled(60_000), filled(60_000, low=0.0)
    for points, expected in ((everything, (1.0, 1.0, 1.0)), (above, (0.5, 1.0, 0.0))):
        z = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        assert voxelise(BALL, 5, points, z, {}).coverage == pytest.approx(expected)
        assert ring_coverage(BALL, points, 0.1) == pytest.approx(expected)


def test_voxels_hold_means_maxima_and_directions():
    points = BALL.shoulder + np.array([[0.01, 0.01, 0.01], [0.02, 0.02, 0.02], [0.3, 0.01, 0.01]])
    axes = np.array([[0.0, 0, 1], [0, 0, -1], [1, 0, 0]])
    found = voxelise(BALL, 5, points, axes, {"m": np.array([1.0, 3.0, 5.0])})
    k = int(np.argmin(np.linalg.norm(found.centres - points[0], axis=1)))
    assert (found.counts[k], found.directions[k], found.means["m"][k], found.maxima["m"][k]) == (2, 2, 2.0, 3.0)
    assert np.isnan(found.means["m"]).sum() == len(found.counts) - 2
    assert found.coverage.whole == pytest.approx(2 / len(found.counts))
    assert found.orientation == pytest.approx(1.5 / DIRECTIONS)


def test_study_is_the_same_on_one_process_and_on_three():
    robot, options = load_robot("ur5"), WorkspaceOptions(samples=3 * CHUNK + 7, seed=4)
    told = []
    alone, shared = study_workspace(robot, options, told.append, 1), study_workspace(robot, options, told.append, 3)
    assert np.array_equal(alone.samples.q, shared.samples.q)
    assert np.array_equal(alone.samples.free, shared.samples.free)
    assert alone.voxels.coverage == shared.voxels.coverage
    assert told == [0.25, 0.5, 0.75, 1.0] * 2
    other = study_workspace(robot, WorkspaceOptions(samples=CHUNK, seed=5), processes=1)
    assert not np.array_equal(other.samples.q, alone.samples.q[:CHUNK])


def test_values_are_those_of_the_samples():
    robot = load_robot("ur5")
    steps = joint_resolution(robot, "17bit")
    found = study_workspace(robot, WorkspaceOptions(samples=50, collision=False, resolution=steps), processes=1)
    J = ToolKinematics(robot).evaluate(found.samples.q)[1]
    expected = manipulability_measures(scaled(J, length=found.reach.largest)).yoshikawa
    assert found.samples.values["yoshikawa"] == pytest.approx(expected)
    assert found.samples.values["error_worst"] == pytest.approx(tool_error(J, steps).position_worst)
    assert found.free_fraction == 1.0


def test_collision_and_a_floor_take_configurations_away():
    robot = load_robot("ur5")
    free, held, floored = (
        study_workspace(robot, WorkspaceOptions(samples=1000, **options), processes=1).free_fraction
        for options in ({"collision": False}, {}, {"floor": 0.0})
    )
    assert free == 1.0
    assert 0.0 < floored < held < 1.0


def test_srra_covers_its_lower_half_and_puma_does_not():
    """What the arm is built for, in rings, from few samples."""
    found = {
        name: study_workspace(load_robot(name), WorkspaceOptions(samples=20_000), processes=1).rings.lower
        for name in ("srra", "puma560")
    }
    assert found["srra"] > 0.99
    assert found["puma560"] < 0.95


def test_the_ur5_has_no_hole_below_its_base_where_its_meshes_are_checked():
    """Hulls of its bent links touch in most configurations that fold under the base."""
    hulls, meshes = (
        study_workspace(robot, WorkspaceOptions(samples=6_000), processes=1)
        for robot in (load_robot("ur5"), robot_with_meshes("ur5"))
    )
    assert meshes.rings.lower > 0.985 > 0.91 > hulls.rings.lower
    assert meshes.free_fraction > 0.7
    assert hulls.free_fraction < 0.45


def test_too_many_configurations_are_refused():
    with pytest.raises(OptiPlanError, match="at most"):
        study_workspace(load_robot("ur5"), WorkspaceOptions(grid=50))


class Dying(ChunkedWork[int]):
    def prepare(self):
        return os._exit


def test_a_worker_that_dies_is_told():
    with pytest.raises(OptiPlanError, match="worker"):
        run_chunks(Dying(), 4, 2)


def test_a_script_without_a_guard_is_told_of_it(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("import optiplan as op\nop.workspace('planar2r', samples=4001)\n")
    with_two_cores = "import optiplan.workspace.sampling as s; s.cores = lambda: 2\n"
    script.write_text(with_two_cores + script.read_text())
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=100)
    assert done.returncode == 1
    assert 'without `if __name__ == "__main__":`' in done.stderr
    assert done.stderr.count("Traceback") == 1


class Interrupted(ChunkedWork[int]):
    def prepare(self):
        return lambda k: os.kill(os.getpid(), signal.SIGINT) or k


def test_ctrl_c_is_for_the_parent_of_the_workers():
    assert run_chunks(Interrupted(), 4, 2) == [0, 1, 2, 3]


@dataclass(frozen=True)
class Refusing(ChunkedWork[int]):
    """Its work raises the reason: where it is read, prepared or done."""

    where: str

    def __reduce__(self):
        return (_refuse, ()) if self.where == "read" else (Refusing, (self.where,))

    def prepare(self):
        return _refuse() if self.where == "prepared" else lambda _: _refuse()


def _refuse():
    raise OptiPlanError("the files of the robot have changed")


@pytest.mark.parametrize("where", ["read", "prepared", "done"])
def test_what_the_work_of_a_worker_refuses_is_told(where):
    with pytest.raises(OptiPlanError, match="the files of the robot"):
        run_chunks(Refusing(where), 2, 2)


class DyingBesideAnother(ChunkedWork[int]):
    def prepare(self):
        return lambda k: time.sleep(120) if k == 0 else os._exit(1)


def test_a_worker_that_dies_is_told_though_another_goes_on():
    with pytest.raises(OptiPlanError, match="worker"):
        run_chunks(DyingBesideAnother(), 2, 2)


class DyingWhenRead(ChunkedWork[int]):
    """Its process dies before it has read all of the work, which no pipe holds at once."""

    def __reduce__(self):
        return os._exit, (1,), None, iter([bytes(10_000_000)])


def test_a_worker_that_dies_while_it_starts_is_told():
    with pytest.raises(OptiPlanError, match="worker"):
        run_chunks(DyingWhenRead(), 2, 2)


@dataclass(frozen=True)
class Waiting(ChunkedWork[bool]):
    """Chunk 0 ends when all the others are done."""

    folder: Path

    def prepare(self):
        return self._do

    def _do(self, k: int) -> bool:
        if k == 0:
            wait_until(lambda: len(list(self.folder.iterdir())) == 4)
            return True
        (self.folder / str(k)).touch()
        return True


def test_chunks_are_dealt_one_at_a_time(tmp_path):
    """While one process is at chunk 0 the other does all the rest."""
    assert run_chunks(Waiting(tmp_path), 5, 2) == [True] * 5


def test_there_is_a_core():
    assert cores() >= 1
