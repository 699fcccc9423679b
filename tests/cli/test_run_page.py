"""`optiplan run --view`: nothing moves until it is begun on the page, and Ctrl-C ends in a robot that stands still."""

import json
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import httpx
import pytest

from tests.small_problems import QUICK
from tests.waiting import wait_until


@pytest.mark.timeout(300)
def test_a_motion_is_begun_on_the_page_and_ended_by_ctrl_c(tmp_path):
    (tmp_path / "free.yaml").write_text(QUICK)
    words = ["run", "free.yaml", "--view", "--json", "--driver", "file", "--to", "table.csv", "--override", "0.1"]
    with started(words, tmp_path) as program:
        line = next(line for line in program.stderr if "open http" in line)
        server, execution = re.search(r"(http://\S+)/execution#(\w{32})", line).groups()
        url = f"{server}/api/executions/{execution}"
        wait_until(lambda: state(url))
        assert (state(url)["phase"], state(url)["progress"]) == ("paused", 0.0)
        httpx.post(f"{url}/resume", trust_env=False).raise_for_status()
        wait_until(lambda: state(url)["progress"] > 0.05)
        program.send_signal(signal.SIGINT)
        out, error = program.communicate(timeout=60.0)
    done = json.loads(out)
    assert (program.returncode, done["exit_code"], error) == (130, 130, "")
    assert (done["phase"], done["speed"], done["ended"], done["clean"]) == ("stopped", 0.0, "asked to end", True)
    assert 0.05 < done["progress"] < 1.0


@contextmanager
def started(words, folder):
    """The program, killed at the end if it has not ended."""
    program = subprocess.Popen([sys.executable, "-m", "optiplan", *words], stdout=-1, stderr=-1, text=True, cwd=folder)
    try:
        yield program
    finally:
        program.kill()
        program.wait()


def state(url):
    return httpx.get(url, trust_env=False).json()["state"]
