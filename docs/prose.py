"""Check the prose of pages and docstrings: the length of sentences, and words that hide who does what.

    python docs/prose.py             # every page and docstring of the repository; exit code 1 with a list of faults
    python docs/prose.py --totals    # words a sentence, for each folder
    python docs/prose.py PATH ...    # these files and folders only

Code, tables, headings and formulas are left out, and so is what scripts write between markers. `make lint` runs this
beside proselint, which knows the clichés and misspellings of English at large (`docs/proselint.json`).
"""

import argparse
import ast
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
PLACES = ("README.md", "CONTRIBUTING.md", "docs", "benchmarks", "examples", "optiplan")
AVOIDED = {
    "told": "reported, given, known",
    "said": "stated, given",
    "asked": "requested, queried, checked",
    "looked at": "checked",
    "let pass": "wait for, ignore",
    "lets pass": "waits for, ignores",
    "at hand": "available",
    "held apart": "separated",
    "hold apart": "separate",
    "what is left": "the rest, remaining",
    "of which": "whose, or a second sentence",
    "wherein": "in which",
    "so-manieth": "k-th",
    "whoever": "the one that does it",
    "what stands": "the thing's name",
    "nothing else than": "only",
    "is no part of": "is not part of",
    "goes before": "precedes",
}
"""Words that hide who does what, and what to write instead. A word with a right use of its own is not here."""

_AVOIDED = re.compile(rf"\b({'|'.join(AVOIDED)})\b", re.IGNORECASE)
_FENCED = re.compile(r"```.*?```", re.DOTALL)
_MEASURED = re.compile(r"<!-- table: .*?<!-- end -->", re.DOTALL)  # a table and its notes, written by a script
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_DOCTEST = re.compile(r"^\s*(?:>>>|\.\.\.).*$", re.MULTILINE)
_INDENTED = re.compile(r"\n\n(?: {4}.*\n)+")  # a formula or a command
_COMMAND = re.compile(r"^ {4,}(?:python|optiplan) .*$", re.MULTILINE)
_FIELD = r"[ ]*[\w*]+(?: \([^)\n]*\))?: "  # `name: ` or `name (type): ` of a Google docstring
_BLOCKS = re.compile(rf"\n\s*\n|\n(?=\s*(?:[-*+]|\d+\.)\s)|\n(?={_FIELD})|\n(?=\s*\|)")
_SECTION = re.compile(r"^\s*(?:Args|Returns|Raises|Example|Yields|Attributes):\s*")
_END = re.compile(r"(?<=[.!?])[\"')*_]*\s+(?=[A-Z`*\"(\[])")
_WORD = re.compile(r"[^\W\d_][\w'’-]*")


class Allowed(NamedTuple):
    """What a kind of file may have: lower these numbers as the text becomes plainer, never raise them."""

    words: int  # of the longest sentence
    avoided: int  # uses of avoided words, in all files together


ALLOWED = {".md": Allowed(words=30, avoided=0), ".py": Allowed(words=80, avoided=300)}


class Sentence(NamedTuple):
    """A sentence with its number of words; code in it is one word."""

    text: str
    words: int


class Prose(NamedTuple):
    """A page, or one docstring: the line where it begins and its text."""

    line: int
    text: str


@dataclass(frozen=True)
class Fault:
    """A sentence that is too long or uses an avoided word."""

    path: Path
    line: int
    reason: str
    text: str
    is_word: bool  # an avoided word, not a long sentence

    def __str__(self) -> str:
        """`path:line: reason: the sentence`, cut to 160 characters."""
        path = self.path.relative_to(ROOT) if self.path.is_relative_to(ROOT) else self.path
        return f"{path}:{self.line}: {self.reason}: {self.text[:160]}"


def sentences(text: str) -> Iterator[Sentence]:
    """The sentences of three words or more in a page or docstring."""
    for code in (_FENCED, _MEASURED, _COMMENT, _DOCTEST, _COMMAND):
        text = code.sub(" ", text)
    for block in _BLOCKS.split(text):
        if block.lstrip().startswith(("|", "#", "<", ":::")):
            continue
        plain = re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "X", block))
        plain = " ".join(_SECTION.sub("", re.sub(rf"^{_FIELD}", "", plain)).split())
        for sentence in _END.split(plain):
            words = len(_WORD.findall(sentence))
            if words >= 3:
                yield Sentence(sentence, words)


def prose(path: Path) -> Iterator[Prose]:
    """The text of a Markdown page, or every docstring of a Python file."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        yield Prose(1, _INDENTED.sub(lambda match: "\n" * match.group().count("\n"), text))
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield Prose(node.lineno, node.value.value)


def faults(path: Path) -> Iterator[Fault]:
    """The sentences of a file that are too long or use an avoided word."""
    longest = ALLOWED[path.suffix].words
    for part in prose(path):
        for sentence in sentences(part.text):
            line = part.line + (_line_of(sentence.text, part.text) if path.suffix == ".md" else 0)
            if sentence.words > longest:
                yield Fault(path, line, f"{sentence.words} words, at most {longest}", sentence.text, False)
            for match in _AVOIDED.finditer(sentence.text):
                word = match.group()
                yield Fault(path, line, f"'{word}' → {AVOIDED[word.lower()]}", sentence.text, True)


def _line_of(sentence: str, text: str) -> int:
    """Lines before the sentence, found by its first words."""
    start = text.find(" ".join(re.split(r"X|\]", sentence)[0].split()[:4]))
    return text.count("\n", 0, start) if start > 0 else 0


def files(paths: Iterable[Path]) -> list[Path]:
    """The Markdown and Python files below the paths, sorted."""
    found = {
        file for path in paths for file in ([path] if path.is_file() else [*path.rglob("*.md"), *path.rglob("*.py")])
    }
    return sorted(found)


def excess(found: Iterable[Fault]) -> list[Fault]:
    """The faults without the avoided words of a kind of file that has no more of them than allowed."""
    found = list(found)
    uses = Counter(fault.path.suffix for fault in found if fault.is_word)
    within = {suffix for suffix, count in uses.items() if count <= ALLOWED[suffix].avoided}
    return [fault for fault in found if not (fault.is_word and fault.path.suffix in within)]


def totals(paths: Iterable[Path]) -> Iterator[str]:
    """A line for each path: files, sentences, words a sentence, the longest."""
    for path in paths:
        counts = [s.words for file in files([path]) for part in prose(file) for s in sentences(part.text)]
        mean, longest = sum(counts) / max(len(counts), 1), max(counts, default=0)
        yield f"{path}: {len(counts)} sentences, {mean:.1f} words a sentence, {longest} at most"


def main(arguments: list[str] | None = None) -> int:
    """Print the faults, or the totals; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("paths", nargs="*", type=Path, help="files and folders (default: those of the repository)")
    parser.add_argument("--totals", action="store_true", help="print words a sentence instead of faults")
    given = parser.parse_args(arguments)
    paths = given.paths or [ROOT / place for place in PLACES]
    if given.totals:
        print(*totals(paths), sep="\n")
        return 0
    found = excess(fault for file in files(paths) for fault in faults(file))
    if found:
        print(*found, f"{len(found)} faults of prose", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
