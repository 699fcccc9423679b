"""Let a learned policy move a robot: its chunks of set-points are proved before they are sent.

Run it: python examples/18_action_chunks.py
"""

from collections import Counter

import numpy as np

import optiplan as op

DT = 0.02  # s between set-points
USED = 8  # set-points of a chunk that pass until the next one comes


class CertifiedEnv:
    """An environment with the calls of gymnasium; an action is a chunk of joint set-points (k, n), rad."""

    def __init__(self, problem, goal):
        self.problem, self.goal = problem, np.asarray(goal)
        self.passed = []  # configurations, every millisecond
        self.reset()

    def reset(self, *, seed=None, options=None):
        """Stand at the start; seed and options are those of gymnasium and change nothing here."""
        self.chunk, self.time, self.steps = None, 0.0, 0
        self.state = op.State(self.problem.start)
        return self.observation(), {}

    def observation(self):
        """Position and velocity of the joints, and where they shall go."""
        return {"q": self.state.q, "v": self.state.v, "goal": self.goal}

    def step(self, action):
        """Prove the chunk, send it, and let the robot move until the next one."""
        start = self.state if self.chunk is None else self.chunk.rest(self.time)
        found = op.certify(self.problem, action, DT * np.arange(1, len(action) + 1), start=start)
        if found.is_proved:
            self.chunk, self.time = found, 0.0
        # A refused chunk is not sent: the robot goes on with the motion that it has, which ends at rest.
        if self.chunk is not None:
            times = self.time + np.arange(0.0, USED * DT, 1e-3)
            self.passed.append(self.chunk.trajectory(np.minimum(times, self.chunk.trajectory.duration)))
            self.time += USED * DT
            self.state = self.chunk.state(self.time)
        self.steps += 1
        distance = float(np.linalg.norm(self.state.q - self.goal))
        return self.observation(), -distance, distance < 0.05, self.steps >= 40, {"chunk": found}


def policy(observation, rng):
    """A toy policy: towards the goal like a damped spring, straight through obstacles, with noise and faults."""
    q, v, goal = observation["q"], observation["v"], observation["goal"]
    chunk = []
    for _ in range(16):
        before = v
        v = np.clip(v + DT * np.clip(36.0 * (goal - q) - 12.0 * v, -4.0, 4.0), -1.2, 1.2)
        q = q + 0.5 * DT * (before + v)
        chunk.append(q)
    chunk = np.array(chunk) + rng.normal(0.0, rng.choice([3e-5, 1e-3]), (16, len(q)))
    fault = rng.random()
    if fault < 0.03:
        chunk[5:] += rng.normal(0.0, 1.0, len(q))  # a jump
    elif fault < 0.06:
        chunk[rng.integers(16), 0] = np.nan
    return chunk


def main():
    """Run some episodes, and look at every millisecond of them."""
    boxes = [
        op.Box("left", size=(0.1, 0.1, 0.5), position=(0.29, 0.26, 0.4)),
        op.Box("shelf", size=(0.3, 0.5, 0.02), position=(0.6, 0.0, 0.3)),
    ]
    problem, rng = op.Problem("panda", "ready", "ready", boxes), np.random.default_rng(1)
    outcomes, asked, touched, looked_at, arrived = Counter(), 0, 0, 0, 0
    for _ in range(8):
        while True:
            goal = problem.start + rng.uniform(-0.6, 0.6, 7)
            if problem.is_free(goal):
                break
        env = CertifiedEnv(problem, goal)
        observation, _ = env.reset()
        terminated = truncated = False
        while not (terminated or truncated):
            action = policy(observation, rng)
            asked += sum(not free for free in problem.is_free(np.nan_to_num(action)))
            observation, _, terminated, truncated, info = env.step(action)
            outcomes[info["chunk"].outcome] += 1
            if info["chunk"].outcome == "stopped" and outcomes["stopped"] == 1:
                print(f"the first stop: {info['chunk'].reason}")
        arrived += terminated
        passed = np.vstack(env.passed)
        touched += sum(not free for free in problem.is_free(passed))
        looked_at += len(passed)
    total = sum(outcomes.values())
    for outcome in ("proved", "nearest", "stopped", "refused"):
        print(f"{outcome}: {100 * outcomes[outcome] / total:.0f} % of {total} chunks")
    print(f"{asked} of {16 * total} set-points of the policy touch something")
    print(f"{arrived} of 8 goals reached; {touched} touched of {looked_at} configurations on the way")


if __name__ == "__main__":
    main()
