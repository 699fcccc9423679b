"""The driver `sim` in real time: how late set-points are, what a tick costs, and how soon a death is seen.

    python benchmarks/drive_rates.py                    # ten runs at 500 Hz and 1 kHz, ten deaths
    python benchmarks/drive_rates.py --count 100 --markdown drive.md

For each robot and rate: set-points later than the grid of times, in ms at 50, 99 and 100 % (`late`); their intervals
as the robot's process sees them, standard deviation and longest (`interval`); ticks left out and all; processor time
of the loop a tick, µs (`tick`); how far joints are off at most, mrad (`off`); motions that came to their end (`done`).
Then the process of the robot is killed in motion: ms from the kill to the end of the execution, at 50 and 100 %.
Musts: every death is seen within 50 ms, and ends as `stopped` with its reason; no motion that came to its end touches,
or leaves a joint farther off than 5 mrad. The exit code is 1 where one is broken. A motion that a busy machine stops is
counted, not a fault: lateness of 10 ms is to end in a stop.
The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import signal
import sys
import time
from typing import Any

import numpy as np
from published import print_json, print_table, table_parser, write_markdown

import optiplan as op

PROBLEMS = ("01_reach", "09_ur5", "18_baxter_dual")
RATES = (500.0, 1000.0)
HEADINGS = (
    "run",
    "engine",
    "Hz",
    "done",
    "late 50 / 99 / 100 % ms",
    "interval σ / max ms",
    "left out",
    "tick µs",
    "off",
)
MOST_OFF, MOST_DEATH = 5e-3, 0.05  # rad or m; s


def main() -> None:
    """Run, kill, print."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=10, help="motions of each robot and rate, and deaths")
    parser.add_argument("--engine", default="mujoco", help="of the simulation: mujoco, own or ideal")
    parser.add_argument("--problems", nargs="+", default=list(PROBLEMS), help="names of shipped problems")
    options = parser.parse_args()
    rows, data, broken = [], {}, []
    for name in options.problems:
        run = op.plan(op.load_problem(name), budget=10.0)
        if not run.verified:
            raise SystemExit(f"{name}: {run!r}")
        for rate in RATES:
            found = driven(run, rate, options.engine, options.count)
            data[f"{name} {rate:g}"] = found
            rows.append(row_of(name, options.engine, rate, options.count, found))
            broken += [f"{name} at {rate:g} Hz: {fault}" for fault in found["faults"]]
            print(f"{name} at {rate:g} Hz: {found['done']} of {options.count} came to their end", flush=True)
    deaths, faults = killed(op.plan(op.load_problem(options.problems[0])), options.count)
    p50, most = 1e3 * np.percentile(deaths, [50, 100])
    print(f"death seen after {p50:.1f} ms (50 %), {most:.1f} ms (100 %) of {len(deaths)}", flush=True)
    print_table(HEADINGS, rows)
    if options.markdown:
        write_markdown(options.markdown, HEADINGS, rows)
    broken += faults
    print_json({**data, "deaths": {"p50_ms": p50, "max_ms": most}, "broken": broken})
    if broken:
        sys.exit("\n".join(broken))


def driven(run: op.Run, rate: float, engine: str, count: int) -> dict[str, Any]:
    """Run a motion so many times; return figures over all of them."""
    late, ticks, missed, done, cost, off, spread, longest, faults = [], 0, 0, 0, 0.0, 0.0, [], 0.0, []
    for _ in range(count):
        driver = op.driver("sim", run, engine=engine, rate=rate)
        execution = op.Execution(op.Executor(run), driver)
        began = time.process_time()
        execution.start()
        found = execution.wait(60.0 + run.duration)
        cost += time.process_time() - began
        report = driver.report
        late.append(execution.lateness())
        ticks, missed = ticks + round(found["t"] * rate), missed + found["missed"]
        spread.append(report.get("interval_std") or 0.0)
        longest = max(longest, report.get("interval_max") or 0.0)
        if found["phase"] != "done":
            continue
        done, off = done + 1, max(off, report["error_max"])
        if report["contacts"] or report["error_max"] > MOST_OFF:
            faults.append(f"contacts {report['contacts']}, {report['error_max']:.2g} off")
    return {
        "done": done,
        "late": [
            float(np.median([one["p50"] for one in late])),
            *(max(one[k] for one in late) for k in ("p99", "max")),
        ],
        "interval": [float(np.median(spread)), longest],
        "missed": missed,
        "ticks": ticks,
        "tick_us": 1e6 * cost / max(1, ticks),
        "off": off,
        "faults": faults,
    }


def row_of(name: str, engine: str, rate: float, count: int, found: dict[str, Any]) -> list[str]:
    """Return a row of the table."""
    return [
        name,
        engine,
        f"{rate:g}",
        f"{found['done']} of {count}",
        " / ".join(f"{1e3 * x:.2f}" for x in found["late"]),
        " / ".join(f"{1e3 * x:.2f}" for x in found["interval"]),
        f"{found['missed']} of {found['ticks']}",
        f"{found['tick_us']:.0f}",
        f"{1e3 * found['off']:.2f}",
    ]


def killed(run: op.Run, count: int) -> tuple[list[float], list[str]]:
    """Kill the robot's process in motion, so many times; return the seconds until the execution ended, and faults."""
    random, seconds, faults = np.random.default_rng(1), [], []
    for _ in range(count):
        driver = op.driver("sim", run, engine="ideal", rate=1000.0)
        execution = op.Execution(op.Executor(run, override=0.5), driver, patience=0.1)
        execution.start()
        time.sleep(random.uniform(0.1, run.duration))
        os.kill(driver.pid, signal.SIGKILL)
        began = time.monotonic()
        found = execution.wait(10.0)
        seconds.append(time.monotonic() - began)
        if found["phase"] != "stopped" or "signal 9" not in found["reason"] or seconds[-1] > MOST_DEATH:
            faults.append(f"a death after {1e3 * seconds[-1]:.0f} ms as {found['phase']}: {found['reason']}")
    return seconds, faults


if __name__ == "__main__":
    main()
