"""A robot behind rosbridge: its WebSocket protocol, and a controller that interpolates goals as ROS 2's does."""

import json
import threading
import time

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

AHEAD = 1.7e9
"""s: its clock beside time.monotonic."""


def seconds(stamp):
    return stamp["sec"] + 1e-9 * stamp["nanosec"]


def cubic(t0, q0, v0, t1, q1, v1, t):
    w, x = t1 - t0, (t - t0) / (t1 - t0)
    h = (2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x, -2 * x**3 + 3 * x**2, x**3 - x**2)
    q = h[0] * q0 + h[1] * w * v0 + h[2] * q1 + h[3] * w * v1
    d = (6 * x**2 - 6 * x, 3 * x**2 - 4 * x + 1, 6 * x - 6 * x**2, 3 * x**2 - 2 * x)
    return q, (d[0] * q0 + d[2] * q1) / w + d[1] * v0 + d[3] * v1


class Robot:
    """The controller's knots: times by its clock, positions, velocities; the first is where it was at the goal."""

    def __init__(self, names, q, slow=False):
        self.names, self.slow = list(names), slow
        self.lock = threading.Lock()
        self.t, self.q, self.v = np.array([0.0]), np.array([q]), np.zeros((1, len(q)))
        self.seen, self.goals, self.answers, self.subscribed = [], [], [], set()
        self.scaling, self.refuse, self.goal = None, False, None
        self.leap, self.connections, self.leads = 0.0, [], []  # s: of stamps; s from a goal to its begin

    def clock(self):
        return AHEAD + time.monotonic()

    def at(self, t):
        k = int(np.searchsorted(self.t, t, side="right"))
        if k == 0 or k == len(self.t):
            return self.q[min(k, len(self.t) - 1)], 0.0 * self.q[0]
        return cubic(self.t[k - 1], self.q[k - 1], self.v[k - 1], self.t[k], self.q[k], self.v[k], t)

    def take(self, message):
        trajectory, now = message["args"]["trajectory"], self.clock()
        assert trajectory["joint_names"] == self.names
        start, points = seconds(trajectory["header"]["stamp"]), trajectory["points"]
        self.leads.append(start - now)
        t = np.array([start + seconds(point["time_from_start"]) for point in points])
        q, v = (np.array([point[key] for point in points]) for key in ("positions", "velocities"))
        assert (np.diff(t) > 0.0).all()
        assert (v[-1] == 0.0).all()
        with self.lock:
            here = self.at(now)
            late = t > now
            self.t, self.q, self.v = (
                np.append(now, t[late]),
                np.vstack([here[0], q[late]]),
                np.vstack([here[1], v[late]]),
            )
            if self.goal is not None:
                self.answers.append((self.goal, 5))
            self.goal = message["id"]
            if self.refuse:
                self.answers.append((self.goal, 6))
        self.goals.append(message)

    def handle(self, connection):
        self.connections.append(connection)
        try:
            while True:
                self.receive(connection)
                with self.lock:
                    now = self.clock()
                    q, v = self.at(now)
                    if self.goal is not None and now > self.t[-1]:
                        self.answers.append((self.goal, 4))
                        self.goal = None
                    answers, self.answers = self.answers, []
                self.seen.append(q)
                told = now + self.leap
                stamp = {"sec": int(told), "nanosec": int(1e9 * (told % 1.0))}
                order = [*self.names[::-1], "gripper"]
                message = {"header": {"stamp": stamp}, "name": order, "position": [*q[::-1], 0.02]}
                self.publish(connection, "/joint_states", {**message, "velocity": [*v[::-1], 0.0]})
                if self.scaling is not None:
                    self.publish(connection, "/speed_scaling_state_broadcaster/speed_scaling", {"data": self.scaling})
                for number, status in answers:
                    values = {"error_code": 0 if status == 4 else -1, "error_string": "" if status == 4 else "no"}
                    told = {"op": "action_result", "id": number, "action": "", "values": values}
                    connection.send(json.dumps({**told, "status": status, "result": status == 4}))
        except ConnectionClosed:
            pass

    def receive(self, connection):
        try:
            message = json.loads(connection.recv(timeout=0.005))
        except TimeoutError:
            return
        if message["op"] == "subscribe":
            self.subscribed.add(message["topic"])
        elif message["op"] == "send_action_goal":
            assert message["action_type"] == "control_msgs/action/FollowJointTrajectory"
            self.take(message)

    def publish(self, connection, topic, message):
        if topic in self.subscribed:
            connection.send(json.dumps({"op": "publish", "topic": topic, "msg": message}))


class Server:
    """Serve a robot on a free port of this machine."""

    def __init__(self, robot):
        self.robot = robot
        self._server = serve(robot.handle, "127.0.0.1", 0, compression=None)
        self.port = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *error):
        self._server.shutdown()
        self._thread.join(5.0)
