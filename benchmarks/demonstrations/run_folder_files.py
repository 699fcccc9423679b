"""Show that a run of a server has the files that the command line writes: same keys, same motion, same wheels.

    python benchmarks/demonstrations/run_folder_files.py

Delbot's platform drives on mecanum wheels, whose rates stand in `trajectory.json` beside the samples of the joints. The
problem is planned by `optiplan plan --out`, by the queue of a server and by `POST /api/plan`, with a planner that
gives the same motion each time.
"""

import argparse
import io
import json
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1]))
from service_process import HTTP, PROGRAM, serving, wait_until_ready

PROBLEM = """\
version: 1
name: drive
robot: delbot
group: base
start: {configuration: home}
goal: {joints: [0.3, 0.1, 0.2]}
planner: quintic
"""

Files = dict[str, dict[str, Any]]


def of_the_command_line(folder: Path) -> Files:
    """The files of `optiplan plan --out`."""
    (folder / "drive.yaml").write_text(PROBLEM)
    command = [sys.executable, "-c", PROGRAM, "plan", str(folder / "drive.yaml"), "--out", str(folder / "run")]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return {file.name: json.loads(file.read_text()) for file in (folder / "run").glob("*.json")}


def of_a_run(url: str, run: str) -> Files:
    """The files of a server's run, as its `run.zip` holds them."""
    while HTTP.get(f"{url}/api/runs/{run}").json()["status"] in ("queued", "running"):
        time.sleep(0.1)
    packed = HTTP.get(f"{url}/api/runs/{run}/run.zip").raise_for_status().content
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        return {name: json.loads(archive.read(name)) for name in archive.namelist()}


def main() -> int:
    """Plan three times, compare, print; 1 where the files differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder) / "data", "--log-level", "error") as server:
        wait_until_ready(server.url)
        print("command line", file=sys.stderr, flush=True)
        wanted = of_the_command_line(Path(folder))
        asked = {"problem": PROBLEM, "budget": 20.0}
        found = {}
        for way in ("runs", "plan"):
            print(f"POST /api/{way}", file=sys.stderr, flush=True)
            run = HTTP.post(f"{server.url}/api/{way}", json=asked).raise_for_status().json()["id"]
            found[f"POST /api/{way}"] = of_a_run(server.url, run)
    good = True
    for way, files in found.items():
        for name, own in wanted.items():
            more, less = files[name].keys() - own.keys(), own.keys() - files[name].keys()
            good = good and not (more or less)
            print(f"{way}: keys of {name}: asked {len(own)}, seen {len(files[name])}, differing {len(more | less)}")
        same = files["trajectory.json"] == wanted["trajectory.json"]
        wheels = len(files["trajectory.json"].get("wheels", ()))
        good = good and same
        print(f"{way}: rows of wheels: asked {len(wanted['trajectory.json']['wheels'])}, seen {wheels}")
        print(f"{way}: trajectory.json: asked the same, seen {'the same' if same else 'another'}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
