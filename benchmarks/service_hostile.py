"""Problem files with random damage, sent to a server: no internal error, nothing that hangs, no file read from outside.

    python benchmarks/service_hostile.py --count 10000

All begin as example problems: values are exchanged for extreme or foreign ones, keys doubled, dropped and renamed,
lines cut and repeated, bytes flipped, files named that lead to a canary outside the folders allowed. The canary is a
mesh with a name in it that nothing else has; no answer may hold it.
"""

import random
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import httpx
from published import table_parser, write_markdown
from service_process import serving, wait_until_ready

from optiplan.resources import problems_dir

CANARY = "canary-7f3a"
LIMIT = 30.0
"""s that any answer may take: reading has a hard limit of 10 s."""
VALUES = (
    *("0", "-1", "1e308", "-1e308", "1e-320", ".nan", ".inf", "9" * 30, "null", "true", "[]", "{}", "''", '"\\u0000"'),
    *("[1, 2]", "{a: {b: {c: 1}}}", "*a", "&a x", "!!python/object:os.system x", "!!binary aGk=", "2020-01-01", "0x1F"),
    *("{file: CANARY}", "CANARY", "{mesh: {file: CANARY}}", "{urdf: CANARY}", "/dev/zero", "../../../etc/passwd"),
    *(
        "[[[[[[[[]]]]]]]]",
        "é\U0001f916",
        "x" * 5000,
        "quintic",
        "os:system",
        "{box: [1e9, 1e-9, 1]}",
        "{sphere: 1e300}",
    ),
)


@dataclass
class Answers:
    """The server's answers to all files."""

    statuses: Counter[int] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    slowest: float = 0.0
    valid: int = 0


def damaged(rng: random.Random, text: str, canary: Path) -> str:
    """A problem file with one to four things wrong with it."""
    for _ in range(rng.randint(1, 4)):
        lines = text.split("\n")
        at = rng.randrange(len(lines))
        match rng.randrange(8):
            case 0 | 1 | 2:  # another value
                key, colon, _ = lines[at].partition(":")
                lines[at] = f"{key}{colon} {rng.choice(VALUES)}" if colon else rng.choice(VALUES)
            case 3:  # one number of a line
                words = lines[at].split(" ")
                words[rng.randrange(len(words))] = rng.choice(VALUES)
                lines[at] = " ".join(words)
            case 4:
                del lines[at]
            case 5:
                lines.insert(at, lines[rng.randrange(len(lines))])
            case 6:
                lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
            case 7:
                place = rng.randrange(max(1, len(text)))
                lines = (text[:place] + chr(rng.randrange(1, 0x2FF)) + text[place + 1 :]).split("\n")
        text = "\n".join(lines)
    return text.replace("CANARY", str(canary))


def attack(url: str, folder: Path, count: int, seed: int = 0) -> Answers:
    """Send so many damaged problems to be checked; every tenth is submitted as well, and cancelled at once."""
    rng, found = random.Random(seed), Answers()
    canary = folder / f"{CANARY}.stl"
    canary.write_text(f"solid {CANARY}\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n")
    seeds = [path.read_text() for path in sorted(problems_dir().glob("*.yaml"))]
    with httpx.Client(base_url=url, trust_env=False, timeout=LIMIT + 30.0) as http:
        for number in range(count):
            problem = damaged(rng, rng.choice(seeds), canary)
            path = "/api/runs" if number % 10 == 9 else "/api/problems/validate"
            began = time.monotonic()
            answer = http.post(
                path, json={"problem": problem, "budget": 0.2} if number % 10 == 9 else {"problem": problem}
            )
            seconds = time.monotonic() - began
            found.statuses[answer.status_code] += 1
            found.slowest = max(found.slowest, seconds)
            fault = _fault(answer, seconds, canary)
            if fault:
                found.faults.append(f"{fault}\n{problem[:3000]}\n{answer.text[:500]}")
            if answer.status_code == 202:
                http.post(f"/api/runs/{answer.json()['id']}/cancel")
            found.valid += answer.status_code == 202 or (answer.status_code == 200 and answer.json()["valid"])
    return found


def _fault(answer: httpx.Response, seconds: float, canary: Path) -> str:
    """What is wrong with an answer; empty where nothing is."""
    if answer.status_code not in (200, 202, 400, 413, 422):
        return f"status {answer.status_code}"
    if seconds > LIMIT:
        return f"{seconds:.1f} s"
    told = answer.text.replace(canary.name, "")  # the name was sent, so it may be told
    return "the canary was read" if CANARY in told else ""


def main() -> None:
    """Attack and tell."""
    parser = table_parser(__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, serving(Path(name) / "data", "--log-level", "error") as server:
        wait_until_ready(server.url)
        began = time.monotonic()
        found = attack(server.url, Path(name), given.count, given.seed)
        rate = given.count / (time.monotonic() - began)
    print(f"{given.count} damaged problems, {rate:.0f} a second: {dict(found.statuses)}, {found.valid} still valid")
    print(f"slowest answer {found.slowest:.1f} s; {len(found.faults)} faults")
    print("\n\n".join(found.faults[:10]))
    told = ", ".join(f"{status}: {count}" for status, count in sorted(found.statuses.items()))
    row = [str(given.count), told, str(found.valid), f"{found.slowest:.1f}", str(len(found.faults))]
    write_markdown(given.markdown, ("problems", "answers by status", "still valid", "slowest s", "faults"), [row])
    raise SystemExit(1 if found.faults else 0)


if __name__ == "__main__":
    main()
