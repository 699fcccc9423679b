"""Error messages as clients may see them: files by the names that problems give them, no folder of this server."""

import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

import optiplan
from optiplan.resources import problems_dir, robots_dir


def path_hider(named: Iterable[Path]) -> Callable[[str], str]:
    """Return a function that takes the folders of this machine out of a text.

    Args:
        named: folders below which clients name files: `uploads/part.obj` is `part.obj`. Of others `…/` is left.
    """
    own = [robots_dir(), problems_dir(), Path(optiplan.__file__).parent, Path(sys.prefix), Path(sys.base_prefix)]
    own += [Path(tempfile.gettempdir()), Path.cwd()]
    try:
        own.append(Path.home())
    except RuntimeError:  # this user has none
        pass
    instead = {f"{root}/": "…/" for folder in own for root in (folder, folder.resolve())}
    instead |= {f"{root}/": "" for folder in named for root in (folder.absolute(), folder.resolve())}
    instead = {root: word for root, word in instead.items() if root.count("/") > 1}
    longest_first = sorted(instead, key=len, reverse=True)

    def hide(text: str) -> str:
        for root in longest_first:
            text = text.replace(root, instead[root])
        return text

    return hide
