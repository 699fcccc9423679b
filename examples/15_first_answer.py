"""Get a proved motion as soon as there is one, and better ones while time remains.

Run it: python examples/15_first_answer.py
"""

import threading
import time

import optiplan as op

problem = op.load_problem("02_shelf")


class Listener:
    """Receive every better proved motion; end the planning after a given number.

    The last one may be up to 2 % longer than the one before, where it keeps the clearance that is wished for.
    """

    def __init__(self, motions):
        self.motions, self.enough = motions, threading.Event()

    def __call__(self, stage, fraction):
        """Ignore stages."""

    def proved(self, motion, seconds):
        """Print a verified motion; a robot may begin with it while the planner continues."""
        print(f"  after {seconds:.3f} s: a motion of {motion.duration:.3f} s")
        self.motions -= 1
        if self.motions == 0:
            self.enough.set()


op.plan(problem, budget=1.0)  # libraries are loaded, and the robot's tables made, once

print("the first motion:")
first = Listener(motions=1)
began = time.perf_counter()
run = op.plan(problem, budget=op.Budget(5.0, cancel=first.enough), progress=first)
print(f"{time.perf_counter() - began:.3f} s after it was asked for: {run}")

print("all of them:")
run = op.plan(problem, budget=5.0, progress=Listener(motions=1000))
print(f"in the end: {run}")
