"""Find control files by path, or by the name of an example shipped with OptiPlan."""

from pathlib import Path

from optiplan.config.messages import choices
from optiplan.errors import InputError, Issue
from optiplan.resources import control_dir


def find_control(name: str) -> Path:
    """Find the file of `name`: a path that exists, else `delbot_circle`, `delbot_circle.yaml` or `control/…`.

    Raises:
        InputError: no such file, with the examples.
    """
    path = Path(name)
    if path.is_file():
        return path
    examples = {example.stem: example for example in sorted(control_dir().glob("*.yaml"))}
    if path.parent in (Path(), Path("control")) and path.suffix in ("", ".yaml") and path.stem in examples:
        return examples[path.stem]
    found = "is a folder" if path.is_dir() else "no such file" if name else "an empty name"
    expected = f"a control file, or an example, {choices(path.stem, list(examples))}"
    raise InputError([Issue(name or "''", None, "file", found, expected)])
