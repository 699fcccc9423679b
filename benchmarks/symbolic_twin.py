"""How fast is the symbolic twin? Poses, Jacobians and dynamics, and their derivatives, against pinocchio's.

    python benchmarks/symbolic_twin.py [ROBOT …]

Every figure is the time of one call from Python with existing arrays, the shortest of several rounds in
one run, and its ratio to pinocchio's (below 1: the twin is faster). `map` is the time a state of one call over 1,000.
The cache is a fresh folder, so that compile times are those of a first use. The last line printed is one JSON object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from published import script_parser
from rich.console import Console
from rich.table import Table

from optiplan.kinematics.symbolic.compiled import compiler
from optiplan.kinematics.symbolic.functions import SymbolicRobot
from optiplan.robot.robot import Robot, load_robot

ROBOTS = ("panda", "ur5", "srra", "delbot")
ROUNDS, CALLS, STATES = 7, 300, 1000


def seconds(call: Callable[[], object], calls: int = CALLS) -> float:
    """Shortest mean time of a call over several rounds."""
    rounds = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        for _ in range(calls):
            call()
        rounds.append((time.perf_counter() - began) / calls)
    return min(rounds)


def in_place(function: Any, arguments: list[np.ndarray]) -> Callable[[], object]:
    """A call of a CasADi function that reads and writes arrays where they are, and copies nothing."""
    buffer, run = function.buffer()
    kept = [argument.ravel(order="F") for argument in arguments]
    kept += [np.zeros(max(function.nnz_in(i), 1)) for i in range(len(kept), function.n_in())]
    results = [np.zeros(max(function.nnz_out(i), 1)) for i in range(function.n_out())]
    for i, array in enumerate(kept):
        buffer.set_arg(i, memoryview(array))
    for i, array in enumerate(results):
        buffer.set_res(i, memoryview(array))
    return lambda held=(buffer, kept, results): run()  # type: ignore[misc]


def of_pinocchio(robot: Robot, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> dict[str, Callable[[], object]]:
    """Pinocchio's calls for the same quantities, or the nearest it has.

    That is the Jacobian for the derivative of a pose, and the Hessians of all joints for that of one Jacobian.
    """
    model, data = robot.model, robot.model.createData()
    frame = model.getFrameId(robot.tool_frame)

    def forward() -> None:
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacement(model, data, frame)

    return {
        "pose": forward,
        "jacobian": lambda: pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED),
        "rnea": lambda: pin.rnea(model, data, q, v, a),
        "mass matrix": lambda: pin.crba(model, data, q),
        "derivative of pose": lambda: pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED),
        "derivative of jacobian": lambda: pin.computeJointKinematicHessians(model, data, q),
        "derivative of rnea": lambda: pin.computeRNEADerivatives(model, data, q, v, a),
    }


def makers(robot: Robot, twin: SymbolicRobot) -> dict[str, Callable[[], Any]]:
    """What to build, by the names of `of_pinocchio`."""
    tool = robot.tool_frame
    return {
        "pose": lambda: twin.pose(tool),
        "jacobian": lambda: twin.jacobian(tool),
        "rnea": twin.rnea,
        "mass matrix": twin.mass_matrix,
        "derivative of pose": lambda: twin.pose(tool).jacobian(),
        "derivative of jacobian": lambda: twin.jacobian(tool).jacobian(),
        "derivative of rnea": lambda: twin.rnea().jacobian(),
    }


def mapped(function: Any, given: int, rng: np.random.Generator) -> float:
    """Seconds a state of one call over `STATES` states; the first `given` inputs are drawn."""
    function = function.map(STATES)
    arguments = [rng.uniform(-1.0, 1.0, function.size_in(i)) for i in range(given)]
    return seconds(in_place(function, arguments), 1) / STATES


def measure(name: str) -> dict[str, dict[str, float]]:
    """Times, s, and ratios for one robot."""
    robot, rng = load_robot(name), np.random.default_rng(0)
    q, v, a = rng.uniform(-1.0, 1.0, (3, robot.n))
    twins = {"vm": SymbolicRobot(robot.model, machine_code=False), "c": SymbolicRobot(robot.model)}
    virtual, machine = (makers(robot, twin) for twin in twins.values())
    result = {}
    for quantity, reference in of_pinocchio(robot, q, v, a).items():
        built: dict[str, Any] = {}
        figures = {}
        for way, table in (("vm", virtual), ("c", machine)):
            began = time.perf_counter()
            built[way] = table[quantity]()
            figures[f"build_{way}"] = time.perf_counter() - began
        given = [q, v, a] if "rnea" in quantity else [q]
        figures["pinocchio"] = seconds(reference)
        for way, function in built.items():
            figures[way] = seconds(in_place(function, given))
            figures[f"{way}_ratio"] = figures[way] / figures["pinocchio"]
            figures[f"{way}_map"] = mapped(function, len(given), rng)
        began = time.perf_counter()
        makers(robot, SymbolicRobot(robot.model))[quantity]()
        figures["load_cached"] = time.perf_counter() - began
        result[quantity] = figures
    return result


def show(name: str, figures: dict[str, dict[str, float]]) -> None:
    """One table a robot."""
    table = Table("", "pinocchio µs", "VM µs", "C µs", "VM / pin.", "C / pin.", "C map µs", "compile s", "cached ms")
    for quantity, row in figures.items():
        micro = [f"{1e6 * row[key]:.2f}" for key in ("pinocchio", "vm", "c")]
        ratios = [f"{row['vm_ratio']:.2f}", f"{row['c_ratio']:.2f}", f"{1e6 * row['c_map']:.2f}"]
        table.add_row(quantity, *micro, *ratios, f"{row['build_c']:.2f}", f"{1e3 * row['load_cached']:.1f}")
    Console(width=120).print(f"{name}", table)


def main() -> None:
    """Measure in a fresh cache, print."""
    parser = script_parser(__doc__)
    parser.add_argument("robots", nargs="*", default=list(ROBOTS), help="names of robots")
    names = parser.parse_args().robots
    result = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            load_robot(name)  # what is generated for it goes to the usual cache
        os.environ["XDG_CACHE_HOME"] = folder
        for name in names:
            result[name] = measure(name)
            show(name, result[name])
    print(json.dumps({"compiler": compiler(), "robots": result}))


if __name__ == "__main__":
    main()
