"""Steps of different length: positions, velocities and accelerations that pass their limits, by form and long step.

    python benchmarks/demonstrations/controller_uneven_steps.py [--ticks 3000] [--robots panda,ur5] [--scenes]

Ticks last 10 ms, and 30 % of them longer: 20, 50, 100 ms, or any length up to that; the commanded state is fed back.
All joints are sent beyond their ends, to and fro. With `--scenes` the tool is sent to poses out of reach, the robot's
bodies keep apart as well, and their distances are measured by the verifier's model. One line a figure, in rad, m and s:
required (no more than rounding), measured. The exit code is 1 where a figure is missed. While a stop was one of steps
as long as the last, the Panda's joints passed their ends by 4, 13 and 19 mrad here in the form `velocity`.
"""

import argparse
import sys

import numpy as np
import pinocchio as pin

import optiplan as op
from optiplan.collision.model import CollisionModel
from optiplan.control.defaults import default_limits

START = {"panda": "ready", "ur5": "home", "baxter": "ready", "srra": "home", "delbot": "home"}
TICK = 0.01
"""s, of a tick that is in time."""
LONG = 0.3
"""Share of the ticks that are longer."""
ROUNDING = 1e-7
"""rad, m and s: what counts as a violation."""
CLEARANCE = 0.001
"""m, that bodies keep apart."""


def ticks(rng: np.random.Generator, longest: float, count: int, mixed: bool) -> np.ndarray:
    """Lengths (count,), s; `mixed`: long ones are of any length."""
    late = rng.uniform(1e-4, longest, count) if mixed else np.full(count, longest)
    return np.where(rng.random(count) < LONG, late, TICK)


def far_target(rng: np.random.Generator, robot: op.Robot) -> pin.SE3:
    """A pose of the tool at joints up to 0.5 rad or m beyond their limits."""
    limits, data = robot.limits, robot.model.createData()
    low, high = np.maximum(limits.lower, -np.pi) - 0.5, np.minimum(limits.upper, np.pi) + 0.5
    pin.framesForwardKinematics(robot.model, data, rng.uniform(low, high))
    return pin.SE3(data.oMf[robot.frame_id(robot.tool_frame)])


def passes(
    name: str, form: str, longest: float, count: int, mixed: bool, scene: bool, seed: int = 0
) -> dict[str, float]:
    """By how much limits were passed at most, and the share of steps that braked; negative values are room."""
    rng, robot = np.random.default_rng(seed), op.load_robot(name)
    limits, start = robot.limits, robot.configurations.get(START[name], next(iter(robot.configurations.values())))
    tool, joints = op.PoseTask(robot.tool_frame), op.PostureTask(start, cost=0.1)
    tasks = [tool, op.PostureTask(start)] if scene else [joints]
    own = default_limits()
    kept = [*own, op.ClearanceLimit(op.Scene(), at_least=CLEARANCE)] if scene else own
    controller, check = op.Controller(robot, tasks, limits=kept, form=form), CollisionModel(robot, op.Scene())
    state, worst = op.State(start), dict.fromkeys(("position", "velocity", "acceleration", "jerk"), -np.inf)
    low, high = np.maximum(limits.lower, -7.0), np.minimum(limits.upper, 7.0)
    braked, nearest = 0, np.inf
    for k, dt in enumerate(ticks(rng, longest, count, mixed)):
        if k % 60 == 0:
            if scene:
                tool.set_target(far_target(rng, robot))
            else:
                joints.target = np.where(rng.random(robot.n) < 0.5, low - 1.0, high + 1.0)
        step = controller.step(state, float(dt))
        mean = (step.v - state.v) / dt
        found = {
            "position": np.maximum(limits.lower - step.q, step.q - limits.upper),
            "velocity": np.abs(step.v) - limits.velocity,
            "acceleration": np.abs(mean) - limits.acceleration,
            "jerk": np.abs(mean - state.a) - dt * limits.jerk,
        }
        worst = {key: max(worst[key], float(values.max())) for key, values in found.items()}
        braked += step.solver == "braking"
        if scene:
            contact = check.clearance(step.q)
            nearest = nearest if contact is None else min(nearest, contact.distance)
        state = step.state
    if scene:
        worst["clearance"] = CLEARANCE - nearest
    return {**worst, "braked": braked / count}


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=3000, help="of each line")
    parser.add_argument("--robots", default="panda,ur5,baxter,srra,delbot")
    parser.add_argument("--scenes", action="store_true", help="bodies keep apart as well")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    missed = 0
    print(f"{'robot':7} {'form':13} {'ticks ms':>13}   passed at most (rad, m, s; below 0: never)   braked", flush=True)
    for name in options.robots.split(","):
        for form in ("velocity", "acceleration"):
            for longest, mixed in ((0.01, False), (0.02, False), (0.05, False), (0.1, False), (0.1, True)):
                print(f"{name}, {form}, {longest:g} s", file=sys.stderr)
                found = passes(name, form, longest, options.ticks, mixed, options.scenes, options.seed)
                braked = found.pop("braked")
                missed += any(value > ROUNDING for value in found.values())
                lengths = f"10 and {'up to ' if mixed else ''}{1e3 * longest:g}"
                seen = ", ".join(f"{key} {value:.1e}" for key, value in found.items())
                print(
                    f"{name:7} {form:13} {lengths:>13}   asked <= {ROUNDING:g}: {seen}   {100 * braked:.0f} %",
                    flush=True,
                )
    print(f"{missed} lines missed" if missed else "all as asked")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
