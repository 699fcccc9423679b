import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import urllib.error
import urllib.request

import pytest

from optiplan.errors import OptiPlanError
from optiplan.viewer import server
from optiplan.viewer.server import PageServer, serve_runs
from tests.waiting import PATIENCE


@pytest.fixture
def busy():
    """A port that somebody listens on."""
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        yield holder.getsockname()[1]


def test_page_at_the_root_and_nothing_else():
    with PageServer("<p>ü</p>", port=0) as served:
        threading.Thread(target=served.serve_forever, daemon=True).start()
        with urllib.request.urlopen(served.url + "?x#t=1") as answer:
            assert answer.read().decode() == "<p>ü</p>"
            assert answer.headers["Content-Type"] == "text/html; charset=utf-8"
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(served.url + "etc/passwd")
        served.shutdown()


def test_a_browser_that_goes_away_is_no_error(capfd):
    with PageServer("x" * 20_000_000, port=0) as served:
        threading.Thread(target=served.serve_forever, daemon=True).start()
        with socket.create_connection(served.server_address) as browser:
            browser.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            browser.recv(1000)
            browser.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # as a reload does
        served.shutdown()
        for thread in threading.enumerate():
            if "process_request_thread" in thread.name:
                thread.join(PATIENCE)
    assert capfd.readouterr().err == ""


def test_busy_port_means_the_next_free_one(busy):
    with PageServer("", port=busy) as served:
        assert busy < served.server_address[1] < busy + server.PORTS_TRIED


def test_no_port_at_all_is_a_clear_error(busy, monkeypatch):
    monkeypatch.setattr(server, "PORTS_TRIED", 1)
    with pytest.raises(OptiPlanError, match=f"cannot serve the page on 127.0.0.1, port {busy}: .*in use"):
        PageServer("", port=busy)


def test_serve_ends_on_ctrl_c(shelf, monkeypatch):
    urls = []

    def interrupted(self, poll_interval):
        raise KeyboardInterrupt

    monkeypatch.setattr(PageServer, "serve_forever", interrupted)
    serve_runs(shelf, [], port=0, on_ready=urls.append)
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(urls[0], timeout=5)


def test_ctrl_c_from_the_outside_ends_the_process_with_nothing_left():
    code = """
import signal
import numpy as np
signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in a shell's background ignores it
from optiplan.robot.robot import load_robot
from optiplan.problem.problem import Problem
from optiplan.viewer.server import serve_runs
robot = load_robot("planar2r")
problem = Problem(robot, np.zeros(2), np.zeros(2))
serve_runs(problem, [], port=0, on_ready=lambda url: print(url, flush=True))
"""
    child = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ
    )
    assert child.stdout is not None
    assert child.stdout.readline().startswith(b"http://127.0.0.1:")
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=PATIENCE)
    assert (child.returncode, errors) == (0, b"")
