"""Execute a plan at a speed that changes on the way, pause it, let a new motion take over, and slow down for a ball.

Run it: python examples/17_execute.py
"""

import optiplan as op


def main():
    """Run along the proved path, then along another one."""
    problem = op.load_problem("01_reach")
    executor = op.Executor(op.plan(problem))

    # A controller asks for a set-point every millisecond. Override, pause and resume take effect at once.
    executor.override = 0.4
    for _ in range(200):
        executor.tick(0.001)  # tick.q, tick.v, tick.a, tick.torque
    executor.pause()
    while executor.status.phase != "paused":
        executor.tick(0.001)
    print(f"paused at {executor.status.place:.3f} s of the plan, on the path")
    executor.override = 1.0
    executor.resume()
    for _ in range(100):
        executor.tick(0.001)

    # A new goal while the robot moves: plan from where it is in 50 ms, and hand the motion over before that.
    state = executor.state_in(0.05)
    home = op.plan(problem.with_start(state).with_goal(problem.start), budget=1.0)
    print("the new motion takes over" if executor.splice(home) else f"stopped: {executor.status.reason}")
    while executor.status.phase not in ("done", "stopped"):
        executor.tick(0.001)
    print(executor.status.phase)

    # A ball flies through the path. The policy slows the robot down until it has passed; `replan` would go around it.
    executor = op.Executor(home, policy=op.Policy("slow", period=0.02))
    ahead = problem.robot.fk(home.trajectory(0.8 * home.duration)).matrix[:3, 3]
    while executor.status.phase != "done":
        y = ahead[1] + executor.time - 0.8 * home.duration  # it is there when the robot would be
        executor.update_scene(
            {"ball": op.Sphere("ball", 0.05, position=(ahead[0], y, ahead[2]))}, {"ball": (0.0, 1.0, 0.0)}
        )
        for _ in range(20):
            executor.tick(0.001)
    print(f"home in {home.duration:.2f} s, behind the ball in {executor.time:.2f} s")

    # How far the robot goes along its path until it stands still, from any place at full speed.
    stops = op.Executor(home).stopping(5)
    for place, seconds in zip(stops.place, stops.time, strict=True):
        print(f"from {place:.2f} s: {1e3 * seconds:.0f} ms")


if __name__ == "__main__":
    main()
