"""What the driver `sim` and its process say to each other: packets of a kind and float64 numbers or JSON."""

import json
import socket
import time
from enum import Enum
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.execution.status import Ahead, Tick

BUFFER = 1 << 20
"""Bytes in a socket; a set-point of seven joints has 185, a way ahead 40,000."""

LONGEST = 1 << 18
"""Bytes of a packet at most."""


class Packet(Enum):
    """Kinds of packets; the comment says what follows the first byte."""

    TICK = b"T"  # time.monotonic, t, place on the path, q, v, a
    AHEAD = b"A"  # turn, t (K,), q (K, n), v (K, n), a (K, n)
    STOP = b"S"
    READY = b"R"
    STATE = b"X"  # time simulated, and by time.monotonic, q, v
    FAILED = b"F"  # JSON: why
    REPORT = b"C"  # JSON: what came of it


def connected() -> tuple[socket.socket, socket.socket]:
    """Return both ends of a connection that keeps packets whole, and in order."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
        end.setblocking(False)
    return ends


def received(end: socket.socket) -> list[tuple[Packet, bytes]]:
    """Return what has come since the last call, without waiting.

    Raises:
        ConnectionError: the other side is gone, and all that it sent was returned before.
    """
    found: list[tuple[Packet, bytes]] = []
    while True:
        try:
            packet = end.recv(LONGEST)
        except BlockingIOError:
            return found
        except ConnectionError:
            packet = b""
        if not packet:
            if found:
                return found
            raise ConnectionResetError("the other side is gone")
        found.append((Packet(packet[:1]), packet[1:]))


def numbers_packet(kind: Packet, *values: Array | float) -> bytes:
    """Return a packet of numbers."""
    return kind.value + np.concatenate([np.ravel(value) for value in values]).astype(np.float64).tobytes()


def tick_packet(tick: Tick) -> bytes:
    """Return a set-point as a packet."""
    return numbers_packet(Packet.TICK, time.monotonic(), tick.t, tick.status.place, tick.q, tick.v, tick.a)


def ahead_packet(ahead: Ahead) -> bytes:
    """Return a way ahead as a packet."""
    return numbers_packet(Packet.AHEAD, ahead.turn, ahead.t, ahead.q, ahead.v, ahead.a)


def data_packet(kind: Packet, data: Any) -> bytes:
    """Return a packet of JSON."""
    return kind.value + json.dumps(data).encode()


def data_of(content: bytes) -> Any:
    """Return the data of a packet of JSON."""
    return json.loads(content)
