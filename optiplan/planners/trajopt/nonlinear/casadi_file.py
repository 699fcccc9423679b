"""A program with its start, bounds and parameters in one file, which CasADi alone can solve."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from optiplan.arrays import Array
from optiplan.files import write_bytes
from optiplan.planners.trajopt.nonlinear.solvers import SOLVERS

if TYPE_CHECKING:
    from optiplan.planners.trajopt.nonlinear.trajectory_nlp import TrajectoryNlp

INSTANTS = 201
"""At which `motion` gives the curve."""

_ABOUT = """The motion of a robot as a nonlinear program of CasADi: minimise f(x, p) with lbx <= x <= ubx and
lbg <= g(x, p) <= ubg. Solve it, without any other program:

    import json
    import casadi

    file = json.load(open("motion.casadi.json"))
    nlp, start, motion = (casadi.Function.deserialize(file[name]) for name in ("nlp", "start", "motion"))
    solver = casadi.nlpsol("solver", "ipopt", nlp, {"ipopt": file["ipopt"], "print_time": False})
    answer = solver(**start())
    print(solver.stats()["return_status"])
    t, q, v, a = motion(answer["x"], start()["p"])

`nlp`: (x, p) -> (f, g), f in s. `start`: () -> x0, p, lbx, ubx, lbg, ubg. `motion`: (x, p) -> t (1, N) in s, and
q, v, a (n, N) of the joints in rad or m. `ipopt`: the planner's settings of IPOPT. `x_names` and `g_names` name
variables and rows, `p_blocks` how many numbers of p have which name. Distances between bodies are linearised at x0, and
lbx and ubx keep x near it."""


def write_program(nlp: "TrajectoryNlp", arguments: dict[str, Array], path: Path) -> None:
    """Write a program with its start and bounds as JSON: how to solve it, functions that CasADi reads, and names.

    Raises:
        OSError: the file cannot be written.
    """
    program = nlp.to_casadi()
    functions = {
        "nlp": ca.Function("nlp", [nlp.x, nlp.p], [program["f"], nlp.g], ["x", "p"], ["f", "g"]),
        "start": ca.Function("start", [], [ca.DM(value) for value in arguments.values()], [], list(arguments)),
        "motion": ca.Function("motion", [nlp.x, nlp.p], list(nlp.motion(np.linspace(0.0, 1.0, INSTANTS)))),
    }
    content = {
        "about": _ABOUT.splitlines(),
        "casadi": ca.CasadiMeta.version(),
        "ipopt": SOLVERS["ipopt"].options["ipopt"],
        "joints": nlp.joint_names,
        "x_names": nlp.x_names,
        "g_names": nlp.g_names,
        "p_blocks": nlp.blocks,
        **{name: function.serialize() for name, function in functions.items()},
    }
    write_bytes(path, json.dumps(content, indent=1, allow_nan=False).encode() + b"\n")
