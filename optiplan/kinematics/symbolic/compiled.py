"""CasADi functions as machine code: compiled once, kept on disk, the virtual machine where there is no compiler."""

import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from optiplan import cache

FLAGS = ("-O2", "-shared", "-fPIC")
MOST_INSTRUCTIONS = 2000
"""Instructions of a function that is compiled while planning: gcc takes about a second for a thousand."""

_VERSION = "1"  # counted up when code is generated in another way


def load_casadi() -> Any:
    """Return the module CasADi, which takes a while to import and ships no types."""
    import casadi

    return casadi


def compiler() -> list[str] | None:
    """Command of the C compiler: $CC, or the first of cc, gcc and clang that is installed; None without one."""
    chosen = shlex.split(os.environ.get("CC", ""))
    if chosen:
        return chosen if shutil.which(chosen[0]) else None
    return next(([name] for name in ("cc", "gcc", "clang") if shutil.which(name)), None)


def compiled(name: str, parts: list[bytes], build: Callable[[], Any]) -> Any:
    """The function that `build` returns, with its Jacobian, as machine code.

    The library is cached under a hash of `name`, `parts` and the version of CasADi. If it is missing, the result of
    `build` is compiled. Without a compiler or a cache, the result of `build` itself is returned, which CasADi's virtual
    machine runs. Both give the same numbers up to rounding, and both can be mapped and differentiated.

    Args:
        name: a C identifier, and the name of the function built.
        parts: all that the function depends on.
        build: makes the `casadi.Function`.
    """
    if compiler() is None:
        return build()
    tags = [_VERSION, load_casadi().CasadiMeta.version(), platform.machine(), name, *FLAGS]
    file = f"twin/{name}-{cache.digest([*(tag.encode() for tag in tags), *parts])}.so"
    return _open(name, file) or _compile(build(), file, True)


def as_machine_code(function: Any) -> Any:
    """Return a function as machine code without derivatives, or the function itself where it cannot be compiled.

    The library is cached under a hash of the function's content. A function of more than `MOST_INSTRUCTIONS` without a
    cached library is returned itself: the compiler would take seconds.
    """
    if compiler() is None:
        return function
    name, content = function.name(), function.serialize().encode()
    tags = [_VERSION, platform.machine(), name, *FLAGS]
    file = f"terms/{name}-{cache.digest([*(tag.encode() for tag in tags), content])}.so"
    found = _open(name, file)
    if found is not None or function.n_instructions() > MOST_INSTRUCTIONS:
        return found or function
    return _compile(function, file, False)


def _open(name: str, file: str) -> Any | None:
    """The function of a cached library; None if there is none, or if it cannot be loaded and has to be made again."""
    try:
        return None if cache.load(file) is None else load_casadi().external(name, str(cache.cache_dir() / file))
    except RuntimeError:
        return None


def _compile(function: Any, file: str, derivative: bool) -> Any:
    """Return a function, with its Jacobian if wanted, from a new library; itself if compiler or disk refuse."""
    code = load_casadi().CodeGenerator(f"{function.name()}.c")
    code.add(function)
    if derivative:
        code.add(function.jacobian())
    try:
        with tempfile.TemporaryDirectory() as folder:
            source, library = Path(folder, "twin.c"), Path(folder, "twin.so")
            source.write_text(code.dump(), encoding="utf-8")
            # Contraction to fused multiply-add depends on the machine; without it results are the same everywhere.
            run = [*(compiler() or ()), *FLAGS, "-ffp-contract=off", "-o", str(library), str(source), "-lm"]
            subprocess.run(run, check=True, capture_output=True)
            cache.store(file, library.read_bytes())
    except (OSError, subprocess.CalledProcessError):
        return function
    return _open(function.name(), file) or function
