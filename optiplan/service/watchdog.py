"""systemd's watchdog: the service manager starts a process anew that does not say, now and then, that it lives.

Source: sd_notify(3), sd_watchdog_enabled(3): a datagram `WATCHDOG=1` to the socket that `NOTIFY_SOCKET` names, twice in
`WATCHDOG_USEC` at least.
"""

import logging
import os
import socket
import threading
from collections.abc import Callable

_log = logging.getLogger("optiplan.service")

SHARE = 1 / 3
"""Of the time that systemd waits, between two words."""


def feed_watchdog(alive: Callable[[], bool]) -> threading.Event:
    """Say that this process lives as long as it does, from a thread of its own; nothing where systemd does not ask.

    Returns:
        What ends that.
    """
    stop = threading.Event()
    address, wait = os.environ.get("NOTIFY_SOCKET", ""), os.environ.get("WATCHDOG_USEC", "")
    if not address or not wait.isdigit() or os.environ.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return stop
    name = "\0" + address[1:] if address.startswith("@") else address

    def feed() -> None:
        while not stop.wait(SHARE * 1e-6 * int(wait)):
            try:
                if alive():
                    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
                        sock.sendto(b"WATCHDOG=1", name)
            except Exception:  # another word comes soon, or systemd acts
                _log.exception("the watchdog cannot be told")

    threading.Thread(target=feed, name="watchdog", daemon=True).start()
    return stop
