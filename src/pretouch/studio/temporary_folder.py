"""Make a folder of temporary files for a running studio, and remove the folders that killed studios left behind."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final

from pretouch._core.files import remove_tree

_PREFIX: Final = "pretouch-studio-"
_LOCK: Final = "in-use.lock"


class TemporaryFolder:
    """A folder of temporary files, which is removed at the end.

    The studio holds a lock on a file in the folder. The system releases the lock when the process ends, also if it is
    killed. The next studio removes the folders whose lock is free.

    Attributes:
        path (Path): the folder.
    """

    def __init__(self) -> None:
        remove_abandoned_folders()
        self._folder = tempfile.TemporaryDirectory(prefix=_PREFIX)
        self.path = Path(self._folder.name)
        self._lock = (self.path / _LOCK).open("wb")
        _acquire(self._lock)
        self._lock.write(b"locked")  # a lock file without content is not locked yet
        self._lock.flush()

    def close(self) -> None:
        """Remove the folder."""
        self._lock.close()  # Windows removes no open file
        self._folder.cleanup()


def remove_abandoned_folders() -> None:
    """Remove this user's folders of studios that have ended."""
    with suppress(OSError):  # a folder that cannot be listed may still be writable
        for entry in os.scandir(tempfile.gettempdir()):
            if entry.name.startswith(_PREFIX) and entry.is_dir(follow_symlinks=False) and _is_abandoned(entry):
                remove_tree(Path(entry.path))


def _is_abandoned(folder: os.DirEntry[str]) -> bool:
    """Return whether a folder belongs to this user, and no process holds its lock."""
    with suppress(OSError):
        if hasattr(os, "getuid") and folder.stat(follow_symlinks=False).st_uid != os.getuid():
            return False
        lock = Path(folder.path, _LOCK)
        if lock.stat().st_size == 0:  # its studio has not locked it yet
            return False
        with lock.open("r+b") as stream:
            return _acquire(stream)
    return False


def _acquire(stream: IO[Any]) -> bool:
    """Lock a file for this process, and return whether no other process holds its lock."""
    try:
        if os.name == "nt":
            import msvcrt  # noqa: PLC0415 - exists on Windows only

            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl  # noqa: PLC0415 - exists everywhere but on Windows

            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
