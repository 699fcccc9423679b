"""Put a table that a benchmark wrote with --markdown into the README, between its markers.

    python benchmarks/publish.py mbm-fetch fetch.md

The README has the markers `<!-- table: NAME -->` … `<!-- end -->`; the file replaces the text between them. Refused,
with exit code 2, unless the file names a commit (`Commit `abc1234`, …`) that is HEAD or one of its ancestors: no table
of other code, and none of a checkout with changes (`-dirty`).
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

from published import ROOT

README = ROOT / "benchmarks" / "README.md"
COMMIT = re.compile(r"^Commit `([^`]+)`", re.MULTILINE)


def main() -> None:
    """Check the table, replace the block."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", help="of the markers, such as mbm-panda")
    parser.add_argument("table", type=Path, help="what --markdown wrote")
    parser.add_argument("--readme", type=Path, default=README)
    options = parser.parse_args()
    try:
        table = options.table.read_text()
        check(table)
        options.readme.write_text(replaced(options.readme.read_text(), options.name, table))
    except (OSError, ValueError) as error:
        print(f"{options.table}: {error}", file=sys.stderr)
        sys.exit(2)


def check(table: str) -> None:
    """Raise ValueError unless every commit that the table names is HEAD or one of its ancestors."""
    commits = COMMIT.findall(table)
    if not commits:
        raise ValueError("no line `Commit …` says by which commit it was made")
    for commit in commits:
        command = ["git", "-C", str(ROOT), "merge-base", "--is-ancestor", commit, "HEAD"]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            raise ValueError(f"commit {commit} is no ancestor of HEAD")


def replaced(text: str, name: str, table: str) -> str:
    """The text with the table between the markers of that name; ValueError without such markers."""
    begin, end = f"<!-- table: {name} -->\n", "<!-- end -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        names = re.findall(r"<!-- table: (\S+) -->", text)
        raise ValueError(f"no table '{name}' in the README; valid: {', '.join(names)}")
    lines = table.strip("\n")
    return f"{before}{begin}\n{lines}\n\n{end}{after}"


if __name__ == "__main__":
    main()
