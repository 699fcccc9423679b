"""A controller of Universal Robots on a loopback address: RTDE, dashboard and the port for programs.

After the published description of RTDE: packets of a size, a kind and data; recipes of named variables, both ways. It
is a process of its own, since the client waits for answers without letting other threads of Python run.
"""

import contextlib
import itertools
import json
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from functools import partial

RTDE, DASHBOARD, PROGRAMS = 30004, 29999, (30001, 30002, 30003)
SERVOJ, WATCHDOG, STOP_PROGRAM = 11, 35, 255
ANSWERS = {
    b"PolyscopeVersion": b"URSoftware 5.11.1.108318 (Oct 01 2021)",
    b"get serial number": b"20215500000",
    b"is in remote control": b"true",
    b"robotmode": b"Robotmode: RUNNING",
}
FORMATS = {"DOUBLE": "d", "INT32": "i", "UINT32": "I", "VECTOR6D": "6d"}
SIX = ("actual_q", "actual_qd", "external_force_torque")
UNSIGNED = ("robot_status_bits", "safety_status_bits", "runtime_state")
_numbers = itertools.count(os.getpid() % 200 * 200)


class ControllerProcess:
    """A `Controller` in a process, to look at and to change."""

    def __init__(self, q):
        number = next(_numbers)
        self.host = f"127.{1 + number // 60000 % 200}.{number // 250 % 240}.{1 + number % 250}"
        command = [sys.executable, __file__, self.host, *map(repr, map(float, q))]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.seen()["commands"] == []

    def set(self, name, value):
        self._ask([name, value])

    def seen(self):
        return self._ask([])

    def _ask(self, what):
        self.process.stdin.write(json.dumps(what) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


def kind_of(name):
    if name in SIX:
        return "VECTOR6D"
    if name in UNSIGNED:
        return "UINT32"
    return "INT32" if "int_register" in name or name.endswith("_mode") else "DOUBLE"


class Controller:
    """A robot that is at once where `servoj` has it."""

    def __init__(self, host, q):
        self.host = host
        self.q, self.running, self.register = list(q), False, 1
        self.commands, self.safety, self.slider = [], 1, 1.0
        self._begin = time.monotonic()
        for port, handle in (
            (RTDE, self.rtde),
            (DASHBOARD, self.dashboard),
            *((one, self.program) for one in PROGRAMS),
        ):
            listening = socket.create_server((self.host, port))
            threading.Thread(target=self.accept, args=(listening, handle), daemon=True).start()

    def accept(self, listening, handle):
        while True:
            connection, _ = listening.accept()
            threading.Thread(target=self.guarded, args=(handle, connection), daemon=True).start()

    def guarded(self, handle, connection):
        with contextlib.suppress(OSError, EOFError):
            handle(connection)

    def dashboard(self, connection):
        connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
        for line in connection.makefile("rb"):
            connection.sendall(ANSWERS.get(line.strip(), b"ok") + b"\n")

    def program(self, connection):
        while content := connection.recv(1 << 16):
            self.running = self.running or content.rstrip().endswith(b"end")

    def rtde(self, connection):
        recipes, stream = [], connection.makefile("rb")
        while head := stream.read(3):
            size, kind = struct.unpack(">HB", head)
            content = stream.read(size - 3)
            if kind == ord("V") or kind == ord("P"):
                self.answer(connection, kind, b"\1")
            elif kind == ord("v"):
                self.answer(connection, kind, struct.pack(">4I", 5, 11, 1, 0))
            elif kind == ord("O"):
                rate, names = struct.unpack(">d", content[:8])[0], content[8:].decode().strip(",").split(",")
                self.answer(connection, kind, b"\1" + ",".join(map(kind_of, names)).encode())
            elif kind == ord("I"):
                recipes.append([kind_of(name) for name in content.decode().strip(",").split(",")])
                self.answer(connection, kind, bytes([len(recipes)]) + ",".join(recipes[-1]).encode())
            elif kind == ord("S"):
                self.answer(connection, kind, b"\1")
                send = partial(self.states, rate=rate, names=names)
                threading.Thread(target=self.guarded, args=(send, connection), daemon=True).start()
            elif kind == ord("U"):
                layout = ">" + "".join(FORMATS[one] for one in recipes[content[0] - 1])
                self.take(struct.unpack(layout, content[1:]))

    def answer(self, connection, kind, content):
        connection.sendall(struct.pack(">HB", 3 + len(content), kind) + content)

    def take(self, values):
        command = values[0]
        if command == SERVOJ:
            self.q = list(values[1:7])
        elif command == STOP_PROGRAM:
            self.running = False
        self.register = 1 if command in (0, SERVOJ) else 2  # ready, or done with the command
        self.commands.append(values)

    def states(self, connection, rate, names):
        while True:
            known = {
                "timestamp": [time.monotonic() - self._begin],
                "actual_q": self.q,
                "actual_qd": [0.0] * 6,
                "speed_scaling": [self.slider],
                "target_speed_fraction": [1.0],
                "robot_mode": [7],
                "safety_mode": [1],
                "robot_status_bits": [1 + 2 * self.running],
                "safety_status_bits": [self.safety],
                "runtime_state": [2 if self.running else 1],
                "output_int_register_0": [self.register],
            }
            content = b"\1"
            for name in names:
                content += struct.pack(">" + FORMATS[kind_of(name)], *known.get(name, [0]))
            self.answer(connection, ord("U"), content)
            time.sleep(1.0 / rate)


def main():
    controller = Controller(sys.argv[1], [float(value) for value in sys.argv[2:]])
    for line in sys.stdin:
        if what := json.loads(line):
            setattr(controller, *what)
        seen = {"q": controller.q, "running": controller.running, "commands": controller.commands}
        print(json.dumps(seen), flush=True)


if __name__ == "__main__":
    main()
