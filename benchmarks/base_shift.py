"""How far Delbot's base shifts while its arm moves, and how near it comes to tipping over.

    python benchmarks/base_shift.py --markdown /tmp/base-shift.md       # about a minute
    python benchmarks/publish.py base-shift /tmp/base-shift.md --readme docs/theory/reports.md

Only the arm is to move, as fast as its limits allow. The base stands on braked wheels, on wheels whose rates are
controlled (MuJoCo, free rollers), or on wheels that turn freely. The support is the rectangle of the four wheels.
"""

import numpy as np
from published import print_table, table_parser, write_markdown

import optiplan as op
from optiplan.arrays import Array
from optiplan.geometry.support_polygon import SupportPolygon
from optiplan.robot.batched.base_reaction import base_reaction
from optiplan.simulation.closed_loop import Loop, simulate
from optiplan.simulation.controllers.base import Command, JointTarget
from optiplan.simulation.controllers.joints import ComputedTorque
from optiplan.simulation.log import Log
from optiplan.simulation.plants.dynamics import RigidBodyDynamics
from optiplan.simulation.plants.rigid_body import RigidBodyPlant
from optiplan.simulation.references.base import ToolTarget
from optiplan.simulation.references.joints import TrajectoryReference

MOTIONS = {
    "half a turn, stretched out": ([0.0, -0.2, 0.0, -1.6, 1.57, 0.0], [np.pi, -0.2, 0.0, -1.6, 1.57, 0.0]),
    "up and over": ([0.0, -0.3, -0.3, -1.6, 1.57, 0.0], [0.0, -2.8, 0.3, -1.6, 1.57, 0.0]),
}
"""Start and end of the arm, rad."""


class FreeBase(ComputedTorque):
    """Computed torque of the arm, while nothing holds the base.

    With the arm's accelerations a chosen, those of the base follow from its own rows: M_bb b + M_ba a + h_b = 0.
    """

    def command(self, q: Array, v: Array, target: JointTarget | ToolTarget) -> Command:
        """See the class."""
        assert isinstance(target, JointTarget)
        wanted = target.ahead_a + self._kd * (target.v - v) + self._kp * (target.q - q)
        M, h = self._dynamics.mass_matrix(q), self._dynamics.torque(q, v, np.zeros(len(q)))
        wanted[:3] = -np.linalg.solve(M[:3, :3], M[:3, 3:] @ wanted[3:] + h[:3])
        torque = M @ wanted + h
        torque[:3] = 0.0
        return Command(torque, target.q)


def main() -> None:
    """Move, measure, print."""
    options = table_parser(__doc__).parse_args()
    rows = []
    for name, ends in MOTIONS.items():
        start, goal = ([0.0, 0.0, 0.0, *arm] for arm in ends)
        run = op.plan(op.Problem("delbot", start, goal), budget=5.0)
        assert run.trajectory is not None
        assert run.verified
        robot, motion = run.problem.robot, run.trajectory
        wrench = base_reaction(robot, *motion.states(np.linspace(0.0, motion.duration, 500)))
        push = f"{np.hypot(*wrench[:, :2].T).max():.0f}"
        margin = f"{1e3 * support(robot).margins(wrench).min():.1f}"
        for wheels in ("braked", "controlled", "free"):
            shift = ["0", "0", "0"] if wheels == "braked" else moved(executed(run, wheels))
            rows.append([name, f"{motion.duration:.2f}", push, margin, wheels, *shift])
    headings = (
        *("motion of the arm", "duration s", "push N", "tip-over margin mm", "wheels"),
        *("shift, at most mm", "turn, at most mrad", "shift at the end mm"),
    )
    print_table(headings, rows)
    write_markdown(options.markdown, headings, rows)


def support(robot: op.Robot) -> SupportPolygon:
    """The rectangle of the wheels."""
    assert robot.mecanum is not None
    x, y = robot.mecanum.half_wheelbase, robot.mecanum.half_track
    return SupportPolygon.of([[-x, -y], [x, -y], [x, y], [-x, y]], 0.0)


def executed(run: op.Run, wheels: str) -> Log:
    """The motion on wheels of this kind."""
    if wheels == "controlled":
        return op.execute(run, "mujoco", wheels=True)
    assert run.trajectory is not None
    robot = run.problem.robot
    plant = RigidBodyPlant(robot, run.trajectory.start, 2.5e-4)
    controller = FreeBase(RigidBodyDynamics(robot), 10.0)
    return simulate(Loop(robot, robot.limits, TrajectoryReference(run.trajectory), controller, plant, dt=1e-3))


def moved(log: Log) -> list[str]:
    """How far the base was from where it should stand."""
    off = log.q[:, :3]
    along = np.hypot(off[:, 0], off[:, 1])
    return [f"{1e3 * along.max():.3g}", f"{1e3 * np.abs(off[:, 2]).max():.3g}", f"{1e3 * along[-1]:.3g}"]


if __name__ == "__main__":
    main()
