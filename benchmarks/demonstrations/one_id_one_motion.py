"""Show that the motion that a server answers with is the motion that it keeps under the id it gave.

    python benchmarks/demonstrations/one_id_one_motion.py

`POST /api/plan` of one problem, seed and budget, many times, two callers at a time: a budget of seconds lets each
attempt find another motion. Afterwards the run of each answer's id is fetched and compared with the answer.
"""

import argparse
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1]))
from service_process import HTTP, serving, wait_until_ready

from optiplan.resources import problems_dir


def kept_as_answered(url: str, answer: dict[str, Any]) -> bool:
    """Whether the server keeps an answer's state, duration and motion under its id."""
    run = HTTP.get(f"{url}/api/runs/{answer['id']}").json()
    stored = HTTP.get(f"{url}/api/runs/{answer['id']}/trajectory.json")
    motion = stored.json() if stored.status_code == 200 else None
    same = all(run.get(key) == answer[key] for key in ("status", "verified", "duration"))
    return same and bool(motion == answer["trajectory"])


def main() -> int:
    """Ask, compare, print; 1 where an answer is not what is kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--requests", type=int, default=18)
    parser.add_argument("--problem", default="05_cage", help="name of an example")
    parser.add_argument("--budget", type=float, default=0.25, help="s")
    given = parser.parse_args()
    asked = {"problem": (problems_dir() / f"{given.problem}.yaml").read_text(), "budget": given.budget, "seed": 0}

    with tempfile.TemporaryDirectory() as folder, serving(Path(folder) / "data", "--log-level", "error") as server:
        wait_until_ready(server.url)

        def plan(number: int) -> dict[str, Any]:
            answer = HTTP.post(f"{server.url}/api/plan", json=asked)
            answer.raise_for_status()
            print(f"answer {number + 1} of {given.requests}", file=sys.stderr, flush=True)
            found: dict[str, Any] = answer.json()
            return found

        with ThreadPoolExecutor(2) as callers:
            answers = list(callers.map(plan, range(given.requests)))
        same = sum(kept_as_answered(server.url, answer) for answer in answers)
    ids = len({answer["id"] for answer in answers})
    durations = sorted(answer["duration"] for answer in answers if answer["duration"])
    spread = f"{durations[0]:.3f} to {durations[-1]:.3f} s" if durations else "none"
    print(f"motions: durations {spread}")
    print(f"kept as answered: asked {given.requests} of {given.requests}, seen {same} of {given.requests}")
    print(f"ids: asked {given.requests}, seen {ids}")
    return 0 if same == ids == given.requests else 1


if __name__ == "__main__":
    sys.exit(main())
