"""How kernels are compiled and where their machine code is kept.

Numba keeps machine code beside the source or in the home folder and raises where it can write to neither. Here it
goes to the first place that can be written: the folder that NUMBA_CACHE_DIR names, the user's cache folder, a
private folder among the temporary files; where there is none, kernels are compiled anew in each process. The folder
is named after a digest of all kernel sources: Numba watches only the file of the function that is called, not those
of the functions that it calls.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

__all__ = ["block_kernel", "block_part", "cache_folder", "kernel"]

config: Any = numba.core.config
F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a function on its first call, without the GIL, with NumPy's rules for division by zero."""
    return _compiled(function)


def block_kernel(function: F) -> F:
    """Compile a function that runs over blocks of encounters side by side: products and sums may be fused."""
    return _compiled(function, fastmath={"contract", "nsz"})


def block_part(function: F) -> F:
    """Compile a function that becomes part of each block kernel that calls it: a call would keep a loop scalar."""
    return _compiled(function, fastmath={"contract", "nsz"}, forceinline=True)


def _compiled(function: F, **options: Any) -> F:
    folder = cache_folder()
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder) if folder else before
    try:
        compiled = numba.njit(cache=folder is not None, error_model="numpy", nogil=True, **options)(function)
    finally:
        config.CACHE_DIR = before
    return cast("F", compiled)


@lru_cache(maxsize=1)
def cache_folder() -> Path | None:
    """Find the folder for machine code.

    Returns:
        The first candidate that can be written, or None where there is none.
    """
    package = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(package.glob("*/kernels/*.py")):
        digest.update(path.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
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
