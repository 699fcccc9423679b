"""Files kept between runs: what takes long to make from a robot and can always be made again."""

import hashlib
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path


def cache_dir() -> Path:
    """`$XDG_CACHE_HOME/optiplan`, by default `~/.cache/optiplan`."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "optiplan"


def digest(parts: Iterable[bytes]) -> str:
    """SHA-256, in hex, of several byte strings; where one ends and the next begins counts."""
    total = hashlib.sha256()
    for part in parts:
        total.update(hashlib.sha256(part).digest())
    return total.hexdigest()


def load(name: str) -> bytes | None:
    """Content of a cached file; None if it is not there."""
    try:
        return (cache_dir() / name).read_bytes()
    except OSError:
        return None


def store(name: str, content: bytes) -> None:
    """Write a cached file whole or not at all; a cache that cannot be written is no error."""
    path = cache_dir() / name
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except OSError:
        return
