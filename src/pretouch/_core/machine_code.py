"""Machine code of plain functions: compiled by Numba when asked for, kept in the first folder that can be written.

A plain function calls others through the names of its module. `compiled` follows those names, so a function and all
that it calls stay ordinary Python, to be read, tested and exported, and become machine code together.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

__all__ = ["compiled", "writable_folder"]

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F, **bindings: Callable[..., Any]) -> F:
    """Compile a plain function and the plain functions that it calls through names of its module.

    Args:
        function: numbers and tuples in, numbers and tuples out; it may fill arrays that it is given.
        **bindings: functions that take the place of names that `function` itself uses, such as the step of a
            controller in a loop over it.

    Returns:
        The compiled function; it is compiled on its first call and its machine code is kept for later processes.
    """
    return cast("F", _compiled(function, tuple(sorted(bindings.items()))))


@lru_cache(maxsize=256)
def _compiled(function: Callable[..., Any], bindings: tuple[tuple[str, Callable[..., Any]], ...]) -> Any:
    top = _plain(function)
    tree = _reachable(top, {name: _plain(value) for name, value in bindings})
    folder = writable_folder(f"functions-{_digest(tree)}")
    numba = import_module("numba")
    config = numba.core.config
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder) if folder else before
    made: dict[FunctionType, Any] = {}
    try:
        for plain, calls in tree.items():  # those that are called come first
            names = plain.__globals__ | {name: made[called] for name, called in calls.items()}
            copy = FunctionType(plain.__code__, names, plain.__name__, plain.__defaults__)
            copy.__qualname__, copy.__module__ = plain.__qualname__, plain.__module__
            part = {"forceinline": True} if plain is not top else {}
            made[plain] = numba.njit(cache=folder is not None, error_model="numpy", nogil=True, **part)(copy)
    finally:
        config.CACHE_DIR = before
    return made[top]


def _plain(function: Callable[..., Any]) -> FunctionType:
    """Return the Python function that a compiled one was made of, or the function itself."""
    return cast("FunctionType", getattr(function, "py_func", function))


def _reachable(
    function: FunctionType, bindings: dict[str, FunctionType]
) -> dict[FunctionType, dict[str, FunctionType]]:
    """List a function and all plain ones that it calls, each after those that it calls itself; NumPy's are Numba's."""
    found: dict[FunctionType, dict[str, FunctionType]] = {}

    def visit(plain: FunctionType, bound: dict[str, FunctionType]) -> None:
        calls = {}
        for name in plain.__code__.co_names:
            called = bound.get(name, plain.__globals__.get(name))
            if isinstance(called, FunctionType) and called.__module__.partition(".")[0] != "numpy":
                if called not in found:
                    visit(called, {})
                calls[name] = called
        found[plain] = calls

    visit(function, bindings)
    return found


def _digest(tree: dict[FunctionType, dict[str, FunctionType]]) -> str:
    """Name a set of functions by all sources of their folders, and by what the names in them stand for."""
    digest = hashlib.sha256()
    for path in sorted({path for plain in tree for path in _sources(plain)}):
        digest.update(str(path).encode() if path.name.startswith("<") else path.read_bytes())
    for plain, calls in tree.items():
        digest.update(f"{plain.__module__}.{plain.__qualname__}".encode())
        for name, called in calls.items():
            digest.update(f"{name}={called.__module__}.{called.__qualname__}".encode())
    return digest.hexdigest()[:16]


def _sources(function: FunctionType) -> list[Path]:
    """List the files whose functions and constants may be part of a function's machine code."""
    path = Path(function.__code__.co_filename)
    called = (function.__globals__.get(name) for name in function.__code__.co_names)
    made = [value.py_func.__code__ for value in called if value is not None and hasattr(value, "py_func")]
    beside = sorted(path.parent.glob("*.py")) if path.is_file() else [path]
    return beside + [Path(code.co_filename) for code in made]


def writable_folder(name: str) -> Path | None:
    """Find a folder for machine code.

    Args:
        name: what it is called, below the first parent that can be written.

    Returns:
        The folder, made where it was not there, or None where none can be written.
    """
    for parent in _candidates():
        folder = parent / name
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    return None


def _candidates() -> Iterator[Path]:
    """Yield the folders that may hold machine code, best first."""
    config = import_module("numba").core.config
    if config.CACHE_DIR:
        yield Path(config.CACHE_DIR) / "pretouch"
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA")
    elif sys.platform == "darwin":
        base = os.path.expanduser("~/Library/Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if base and os.path.isabs(base):
        yield Path(base) / "pretouch"
    yield from _private_temporary()


def _private_temporary() -> Iterator[Path]:
    """Yield a folder among the temporary files that no other user can have prepared: machine code is run from it."""
    user = os.getuid() if hasattr(os, "getuid") else None
    try:
        folder = Path(tempfile.gettempdir()) / f"pretouch-{'user' if user is None else user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return
    private = stat.S_ISDIR(found.st_mode) and (user is None or (found.st_uid == user and not found.st_mode & 0o077))
    if private:
        yield folder
