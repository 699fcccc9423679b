"""Show that a server and its worker live through an outage of their database, and say so while it lasts.

    python benchmarks/demonstrations/database_outage.py

Three rounds side by side, each with a run under way: PostgreSQL is stopped for 2 s, SQLite's file is held by another
process for 2 s, and the disk of a SQLite database is full for 10 s (which takes root). In each, every run submitted
before, during and after it has to end once, `/readyz` has to tell, no thread may die, and SIGTERM has to end server and
worker within their grace. `benchmarks/service_faults.py --outages` does the same for many rounds and longer outages.
"""

import argparse
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))
from service_outages import SECONDS_FULL, Kind, Round, can_mount, outage_rounds
from service_process import postgres_folder

from optiplan.service.server import GRACE


def shown(kind: Kind, outage: float | None, one: Round) -> list[str]:
    """The figures of a round, a line each: required, measured."""
    what = f"{kind}, " + (f"disk full for {SECONDS_FULL:g} s" if outage is None else f"away for {outage:g} s")
    told = "never" if one.told is None else f"after {one.told:.1f} s"
    again = "never" if one.again is None else f"after {one.again:.1f} s"
    slowest = max(one.stopped, default=float("inf"))
    return [
        f"{what}: runs that end as what they are: asked all, seen {one.answered}, of which "
        f"{one.storage} could not be kept at first and {one.refused} were refused at first",
        f"{what}: /readyz tells the outage: asked while it lasts, seen {told}; ok again {again}",
        f"{what}: SIGTERM ends server and worker: asked within {GRACE:g} s, seen within {slowest:.1f} s",
        f"{what}: faults: asked 0, seen {len(one.faults)}",
        *(f"    {fault}" for fault in one.faults),
    ]


def main() -> int:
    """Run the rounds and print; 1 where one has a fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=2.0, help="of the two short outages")
    given = parser.parse_args()
    cases: list[tuple[Kind, float | None]] = [("SQLite", given.seconds)]
    if postgres_folder() is None:
        print("PostgreSQL is not installed: its outage is not shown", file=sys.stderr)
    else:
        cases.append(("PostgreSQL", given.seconds))
    if can_mount():
        cases.append(("SQLite", None))
    else:
        print("not root: the full disk is not shown", file=sys.stderr)
    print("three outages side by side, about a minute …", file=sys.stderr)
    with ThreadPoolExecutor(len(cases)) as threads:
        rounds = list(threads.map(lambda case: outage_rounds(*case, rounds=1, at_once=1)[0], cases))
    for (kind, outage), one in zip(cases, rounds, strict=True):
        print("\n".join(shown(kind, outage, one)))
    return int(any(one.faults for one in rounds))


if __name__ == "__main__":
    raise SystemExit(main())
