"""Drive a simulated robot in real time: change its speed, pause it, watch it, and see what happens when it dies.

Run it: python examples/19_drive.py
"""

import os
import signal
import time

import optiplan as op

PATIENCE = 0.1  # s; 10 ms, the default, on a machine that does nothing else


def main():
    """Run a motion on a robot in a process of its own, then kill that process on the way."""
    run = op.plan(op.load_problem("01_reach"))
    driver = op.driver("sim", run, engine="own")  # without an engine: MuJoCo, where it is installed
    print(driver.capabilities())

    execution = op.Execution(op.Executor(run, deviation=0.2), driver, patience=PATIENCE)
    execution.subscribe(lambda message: print(message["kind"]) if message["kind"] == "end" else None)
    execution.start()
    execution.override(0.5)
    time.sleep(0.2)
    execution.pause()
    while execution.snapshot()["phase"] not in ("paused", "stopped"):
        time.sleep(0.01)
    print(f"paused at {execution.snapshot()['place']:.2f} s of {run.duration:.2f} s")
    execution.resume()
    found = execution.wait()
    print(f"{found['phase']} {found['reason']}: {found['missed']} ticks left out")
    print(f"the robot was {driver.report['error_max']:.1e} rad off at most")

    # The process of the robot dies: the execution sees it within a tick or two, and says so.
    driver = op.driver("sim", run, engine="ideal")
    execution = op.Execution(op.Executor(run, override=0.5), driver, patience=PATIENCE)
    execution.start()
    time.sleep(0.3)
    os.kill(driver.pid, signal.SIGKILL)
    print(execution.wait()["reason"])


if __name__ == "__main__":
    main()
