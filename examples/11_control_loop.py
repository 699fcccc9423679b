"""A loop of your own at 500 Hz: read the state, step the controller, send the command; what to do when it is late.

Put your robot's driver in the place of `Driver`. A step that comes late is sent late: until then the robot follows the
command before. In place of the third late step in a row it gets the command to brake.

Run it: python examples/11_control_loop.py
"""

import gc
import time

import optiplan as op

DT = 0.002  # s
LATE = 2  # missed deadlines in a row after which the robot brakes
SECONDS = 1.0


class Driver:
    """Stands for the driver of a real robot, which takes positions or velocities every 2 ms."""

    def __init__(self, q):
        self.state = op.State(q)

    def read(self):
        """Return the state now: of a real robot, the commanded or the measured one."""
        return self.state

    def send(self, step):
        """Command positions `step.q`, velocities `step.v` or accelerations `step.a`, as your robot takes them."""
        self.state = step.state


robot = op.load_robot("panda")
scene = op.Scene([op.Box("post", size=(0.1, 0.1, 0.8), position=(0.45, 0.35, 0.4))])
tool = op.PoseTask(robot.tool_frame)
controller = op.Controller(robot, [tool, op.PostureTask("ready")], scene=scene)
driver = Driver(robot.configurations["ready"])

tool.set_target(op.Pose(position=(0.5, 0.1, 0.4), rpy=(3.14159, 0, 0)))
controller.step(driver.read(), DT)  # the first step allocates: take it before the robot moves
gc.collect()
gc.freeze()  # the garbage collector skips loaded objects: no pauses from it

late = 0
due = time.perf_counter()
for _ in range(round(SECONDS / DT)):
    step = controller.step(driver.read(), DT)
    missed = time.perf_counter() - due > DT
    late = late + 1 if missed else 0
    if late > LATE:
        step = controller.stop(driver.read(), DT)  # no program is solved: some ten microseconds
    driver.send(step)
    if step.status in ("stopping", "recovering"):
        print(f"{step.status}: {step.reason}")
    due = max(due + DT, time.perf_counter() - DT)  # lost time stays lost: do not hurry after it
    time.sleep(max(0.0, due - time.perf_counter()))

print(step)
print(f"the tool is {step.error * 1e3:.1f} mm (and mrad) from its target; nearest bodies: {step.nearest}")
