"""Problem files as a person names them: a path, or the bare name of an example that comes with OptiPlan."""

import difflib
from pathlib import Path

from optiplan.data import problems_dir
from optiplan.errors import InputError, Issue


def find_problem(name: str) -> Path:
    """The file meant by `name`: a path that exists, else `01_reach`, `01_reach.yaml` or `problems/01_reach.yaml`.

    Raises:
        InputError: naming the examples nearest to it.
    """
    path = Path(name)
    if path.is_file():
        return path
    examples = {example.stem: example for example in sorted(problems_dir().glob("*.yaml"))}
    if path.parent in (Path(), Path("problems")) and path.suffix in ("", ".yaml") and path.stem in examples:
        return examples[path.stem]
    near = difflib.get_close_matches(path.stem, examples, n=1)
    hint = f" (did you mean '{near[0]}'?)" if near else ""
    found = "is a folder" if path.is_dir() else "no such file"
    expected = f"a problem file, or one of the examples: {', '.join(examples)}{hint}"
    raise InputError([Issue(name or "''", None, "file", found, expected)])
