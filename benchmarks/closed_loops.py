"""Closed loops of the reports: SRRA's PID, Delbot's circle, Baxter's screw, as tables and pictures.

    python benchmarks/closed_loops.py --tables /tmp/loops --pictures docs/pictures       # about 3 minutes on one core
    python benchmarks/publish.py srra-pid /tmp/loops/srra-pid.md --readme docs/theory/reports.md

Every loop is a control file, most of them those of `control/` with other settings. The last line printed is one JSON
object.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import argparse
import copy
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from published import ROOT, commit, print_json, print_table, write_markdown

import optiplan as op
from optiplan.config.document import read_yaml
from optiplan.robot.frames import frame_poses
from optiplan.simulation.log import Log
from optiplan.simulation.simulation import Simulation, run_control
from optiplan.simulation.step_response import step_response

ROTORS = [3.0, 3.0, 2.0, 0.3, 0.3, 0.2]
"""kg·m², of SRRA's drives: chosen, as in control/srra_pid_step.yaml."""
REPORT = {"p": 100, "i": 1, "d": 10}
STIFF = {"p": [6000, 12000, 6000, 600, 300, 200], "d": [600, 1200, 600, 60, 30, 20]}
PIDS: dict[str, dict[str, Any]] = {
    "the report's: P 100, I 1, D 10": {"pid": REPORT},
    "the same, gravity compensated": {"pid": {**REPORT, "gravity_compensation": True}},
    "D 60 instead of 10": {"pid": {**REPORT, "d": 60, "gravity_compensation": True}},
    "I 100 instead of 1": {"pid": {**REPORT, "i": 100, "d": 60, "gravity_compensation": True}},
    "stiff: P 200-12000, D = P / 10": {"pid": {**STIFF, "gravity_compensation": True}},
    "stiff, I = 2 P, gravity left to it": {"pid": {**STIFF, "i": [2 * p for p in STIFF["p"]]}},
    "computed torque, 1.6 Hz": {"computed_torque": {"frequency": 1.6}},
}
DRIVE = {"position": 10, "velocity": STIFF["d"], "integral": [5 * d for d in STIFF["d"]]}
INTERFACES: dict[str, dict[str, Any]] = {
    "effort: PID, the report's, gravity compensated": {"pid": {**REPORT, "gravity_compensation": True}},
    "effort: PID, stiff, gravity compensated": {"pid": {**STIFF, "gravity_compensation": True}},
    "effort: computed torque, 1.6 Hz": {"computed_torque": {"frequency": 1.6}},
    "effort: computed torque, 10 Hz": {"computed_torque": {"frequency": 10}},
    "velocity: drives with P 10/s outside": {"drive": {"takes": "velocity", **DRIVE}},
    "position: drives with the same loops": {"drive": {"takes": "position", **DRIVE}},
}
"""Controllers by what the drives take: torques, velocities, positions."""
MOVED = [1.0, 0.6, -0.8, 0.5, 0.7, 0.5]
"""rad, from home: the goal of the motion that `srra_ptp` follows."""
STEPS = {"joint_1": 0.5, "joint_2": 0.5}
LOOPS = ("srra-pid", "srra-ptp", "delbot-circle", "baxter-screw")


def main() -> None:
    """Run all loops, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=Path, help="folder for the tables")
    parser.add_argument("--pictures", type=Path, help="folder for the pictures")
    parser.add_argument("--only", choices=LOOPS, help="one of the tables (default: all)")
    options = parser.parse_args()
    told: dict[str, Any] = {"commit": commit()}
    makers = dict(zip(LOOPS, (srra, srra_ptp, delbot, baxter), strict=True))
    for name, make in makers.items() if options.only is None else [(options.only, makers[options.only])]:
        headings, rows, picture = make()
        print_table(headings, rows)
        told[name] = [dict(zip(headings, row, strict=True)) for row in rows]
        if options.tables is not None:
            options.tables.mkdir(parents=True, exist_ok=True)
            write_markdown(options.tables / f"{name}.md", headings, rows)
        if options.pictures is not None:
            options.pictures.mkdir(parents=True, exist_ok=True)
            picture.savefig(options.pictures / f"{name}.png", dpi=110)
    print_json(told)


def srra() -> tuple[tuple[str, ...], list[list[str]], Figure]:
    """Steps of one joint by 0.5 rad, by gains."""
    rows, shown = [], {}
    for joint, by in STEPS.items():
        for name, controller in PIDS.items():
            data = {
                "version": 1,
                "robot": "srra",
                "start": {"configuration": "home"},
                "reference": {"step": {"joint": joint, "by": by, "lasting": 5}},
                "controller": controller,
                "plant": {"rotor_inertia": ROTORS},
            }
            done = run_control(data)
            rows.append([f"{joint.replace('_', ' ')}", name, *response_cells(done, joint)])
            if joint == "joint_1" and done.log is not None:
                shown[name] = done.log
    headings = ("joint", "controller", "rise s", "overshoot", "settled s", "steady error mrad", "others, at most mrad")
    return headings, rows, response_picture(shown, 0, done.control.robot.unit("position", 0))


def srra_ptp() -> tuple[tuple[str, ...], list[list[str]], Figure]:
    """One quintic motion of all joints at half speed, by what the drives take; figures of joint 2, the loaded one."""
    rows, loops = [], {}
    problem = {"start": {"configuration": "home"}, "limits": {"velocity": 0.5, "acceleration": 0.5, "jerk": 0.5}}
    motion = op.plan(op.load_problem({"version": 1, "robot": "srra", **problem, "goal": {"joints": MOVED}}), "quintic")
    assert motion.verified
    with tempfile.TemporaryDirectory() as folder:
        motion.save(Path(folder))
        for name, controller in INTERFACES.items():
            data = {"version": 1, "robot": "srra", **problem, "reference": {"trajectory": folder}, "settle": 3.0}
            done = loops[name] = run_control({**data, "controller": controller, "plant": {"rotor_inertia": ROTORS}})
            log = needed(done)
            found = step_response(log.t, log.q[:, 1], 0.0, 0.0, MOVED[1])
            error = 1e3 * np.abs(log.q - log.wanted)
            moving = log.t <= float(motion.duration or 0.0)
            rows.append(
                [
                    name,
                    f"{found.rise:.3f}" if found.rise is not None else "never",
                    f"{100.0 * found.overshoot:.1f} %",
                    f"{error[moving].max():.3g}",
                    f"{error[-1].max():.3g}",
                ]
            )
    headings = ("controller", "rise s", "overshoot", "error on the way, at most mrad", "error 3 s later mrad")
    return headings, rows, errors_picture(loops)


def response_cells(done: Simulation, joint: str) -> list[str]:
    """Figures of the step, and how far other joints were moved by it."""
    assert done.log is not None
    found = done.responses[joint]
    j = done.log.joint_names.index(joint)
    others = np.delete(done.log.tracking.peak, j).max()
    return [
        "never" if found.rise is None else f"{found.rise:.3f}",
        f"{100.0 * found.overshoot:.1f} %",
        "not in 5 s" if found.settling is None else f"{found.settling:.2f}",
        f"{1e3 * found.steady_error:.2f}",
        f"{1e3 * others:.3g}",
    ]


def example(name: str, changes: Mapping[str, Any]) -> Simulation:
    """An example of `control/` with other values of some keys, run."""
    data = copy.deepcopy(read_yaml(ROOT / "control" / f"{name}.yaml").data)
    return run_control({**data, **changes})


def delbot() -> tuple[tuple[str, ...], list[list[str]], Figure]:
    """The circle of radius 62.5 mm: led by the task-space controller, and planned."""
    planned = {"version": 1, "problem": "27_circle", "reference": {"plan": {}}, "controller": {"computed_torque": {}}}
    friction = {"friction": {"viscous": 0.3, "coulomb": 0.3}, "delay": 0.002}
    loops = {
        "task space, velocities as commanded": example("delbot_circle", {}),
        "task space above computed torque": example("delbot_circle", {"plant": {}}),
        "the same in MuJoCo": example("delbot_circle", {"plant": {"engine": "mujoco"}}),
        "planned (`27_circle`), computed torque": run_control(planned),
        "planned, with friction 0.3 N·m and 2 ms delay": run_control({**planned, "plant": friction}),
    }
    rows = []
    for name, done in loops.items():
        log = needed(done)
        robot = done.control.robot
        p = frame_poses(robot, log.q, robot.tool_frame)[:, :3, 3]
        wanted = np.array([-0.257425, -0.11235, 0.38750709])
        off = p - wanted
        radius = np.hypot(off[:, 1], off[:, 2]) - 0.0625
        track = log.tracking
        rows.append(
            [
                name,
                *(micro(x) for x in (track.tool_rms, track.tool_peak, np.abs(radius).max(), np.abs(off[:, 0]).max())),
                micro(float(np.linalg.norm(p[-1] - p[0]))),
            ]
        )
    names = ("error RMS", "error, at most", "off the radius", "off the plane", "end from start")
    return ("loop", *(f"{name} µm" for name in names)), rows, errors_picture(loops)


def baxter() -> tuple[tuple[str, ...], list[list[str]], Figure]:
    """One screw of the left hand beside a table."""
    loops = {
        "task space, velocities as commanded": example("baxter_screw", {"plant": {"engine": "ideal"}}),
        "task space above computed torque": example("baxter_screw", {}),
        "the same in MuJoCo": example("baxter_screw", {"plant": {"engine": "mujoco"}}),
        "with friction 0.5 N·m and 2 ms delay": example(
            "baxter_screw", {"plant": {"friction": {"viscous": 0.5, "coulomb": 0.5}, "delay": 0.002}}
        ),
        "planned by `sclerp` (`29_sclerp`, 0.68 s), computed torque": run_control(
            {"version": 1, "problem": "29_sclerp", "reference": {"plan": {}}, "controller": {"computed_torque": {}}}
        ),
    }
    rows = []
    for name, done in loops.items():
        log = needed(done)
        track, contacts = log.tracking, log.contacts
        least = "–" if contacts is None or contacts.least is None else f"{1e3 * contacts.least:.2f}"
        errors = [micro(track.tool_rms), micro(track.tool_peak)]
        rows.append([name, *errors, f"{1e6 * track.turn_rms:.3g}", f"{1e6 * track.turn_peak:.3g}", least])
    names = ("error RMS µm", "error, at most µm", "turn RMS µrad", "turn, at most µrad", "clearance mm")
    return ("loop", *names), rows, errors_picture(loops)


def errors_picture(loops: Mapping[str, Simulation]) -> Figure:
    """Errors of the tool over time."""
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    ax = figure.subplots()
    for name, done in loops.items():
        log = needed(done)
        ax.semilogy(log.t[1:], 1e6 * np.maximum(log.tool_error[1:, 0], 1e-9), lw=0.9, label=name)
    ax.set_ylabel("tool error, µm")
    ax.set_xlabel("t, s")
    ax.grid(visible=True, lw=0.3)
    figure.legend(fontsize=7, ncols=2, loc="outside lower center")
    return figure


def response_picture(logs: Mapping[str, Log], joint: int, unit: str) -> Figure:
    """Answers of one joint, whose unit is `unit`, to the same step, by name of the controller."""
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    ax = figure.subplots()
    for name, log in logs.items():
        ax.plot(log.t, log.q[:, joint], lw=0.9, label=name)
    first = next(iter(logs.values()))
    ax.plot(first.t, first.wanted[:, joint], color="black", ls="--", lw=0.8, label="asked for")
    ax.set_xlabel("t, s")
    ax.set_ylabel(f"{first.joint_names[joint]}, {unit}")
    figure.legend(fontsize=7, ncols=4, loc="outside lower center")
    return figure


def needed(done: Simulation) -> Log:
    """The log, which there must be."""
    assert done.log is not None, done.failure
    return done.log


def micro(metres: float) -> str:
    """A length in micrometres."""
    return f"{1e6 * metres:.3g}"


if __name__ == "__main__":
    main()
