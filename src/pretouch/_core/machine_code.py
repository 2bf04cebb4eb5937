"""Where machine code that is made by Numba is kept: the first folder that can be written."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

__all__ = ["writable_folder"]


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
