"""Files."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import secrets
import shutil
import stat
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final

from .errors import InvalidInputError, OutputExistsError

_SIGNATURE: Final = re.compile(r'<meta name="generator" content="pretouch sha256:([0-9a-f]{64})">\n?')
_HEAD: Final = re.compile(r"<head>\n?")
_MARK: Final = '<meta name="generator" content="pretouch sha256:'
_LEFTOVER: Final = re.compile(r"\.[0-9a-f]{12}\.tmp")
_ABANDONED: Final = 3600.0  # s without a change, after which nobody writes to a temporary file any more


def read_regular_file(path: str | os.PathLike[str], *, most: int, refuse: Callable[[str], InvalidInputError]) -> bytes:
    """Read a file that is a file and not too large: a device or a pipe may never end.

    Args:
        path: the file.
        most: bytes that it may have.
        refuse: makes the error that says what is wrong with it.

    Returns:
        Its bytes. What `refuse` makes is raised for a device, a pipe, and a larger file.
    """
    mode = os.stat(path).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a device or a socket"
        raise refuse(f"{path}: found {kind}, expected a file; write what comes from it into a file first")
    with open(path, "rb") as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise refuse(f"{path}: found a file of more than {most / 1e6:,.0f} MB, expected at most that")
    return content


def refuse_input(path: str | os.PathLike[str], inputs: Iterable[str | os.PathLike[str]]) -> None:
    """Refuse to write over a file that was read, however either is spelled or linked.

    Args:
        path: where something is to be written.
        inputs: the files that were read.

    Raises:
        OutputExistsError: it is one of them.
    """
    for each in inputs:
        try:
            same = os.path.samefile(path, each)
        except OSError:  # one of them is not there
            same = os.path.realpath(path) == os.path.realpath(each)
        if same:
            raise OutputExistsError(
                f"{path}: is an input of this command ({each}) and is never overwritten; choose another name with "
                "--output"
            )


def temporary_path(target: Path) -> Path:
    """Return a free name in the folder of a target, under which it is written before it gets its own name.

    What a killed process left behind under such a name of the same target is removed, an hour after its last change.

    Args:
        target: what is to be written.

    Returns:
        The name, hidden.
    """
    name = target.name[:100]
    with suppress(OSError):  # a folder that cannot be listed may still be written, and says so itself if not
        siblings = [entry for entry in os.scandir(target.parent) if entry.name.startswith(f".{name}.")]
        for entry in siblings:
            ours = _LEFTOVER.fullmatch(entry.name.removeprefix(f".{name}"))
            if ours and entry.stat(follow_symlinks=False).st_mtime < time.time() - _ABANDONED:
                remove_tree(Path(entry.path))
    return target.with_name(f".{name}.{secrets.token_hex(6)}.tmp")


def remove_tree(path: Path) -> None:
    """Remove a file, or a folder with all that is in it, as far as that is possible."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    with suppress(OSError):
        path.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> Path:
    """Write a text file whole or not at all, in UTF-8, and never over another file unless asked to.

    The text goes to a temporary file in the same folder first, so that a crash leaves no half file, and an
    existing file is found out at the moment of writing, not before it.

    Args:
        path: where the file goes; its folder must exist.
        text: what is written, its line ends as they are.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     print(write_text(f"{folder}/note.txt", "as it is").read_text())
        as it is
    """
    return write_bytes(path, text.encode(), overwrite=overwrite)


def write_bytes(path: str | os.PathLike[str], content: bytes, *, overwrite: bool = False) -> Path:
    """Write a file as `write_text` does.

    Args:
        path: where the file goes; its folder must exist.
        content: what is written.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.

    Raises:
        OutputExistsError: a file stands there and `overwrite` is false.
        InvalidInputError: the folder does not exist or cannot be written.
    """
    asked = Path(path)
    target = Path(os.path.realpath(asked))  # a link stays a link, its target is written
    temporary = temporary_path(target)
    try:
        _write_through(temporary, content)
        try:
            if overwrite:
                temporary.replace(target)
            else:
                _move_to_free_name(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
    except FileExistsError:
        raise OutputExistsError(
            f"{asked}: this {'folder' if target.is_dir() else 'file'} exists and is not overwritten unasked; "
            "choose another name with --output, or replace the file with --force (overwrite=True in Python)"
        ) from None
    except FileNotFoundError:
        raise InvalidInputError(f"{asked}: the folder {asked.parent} does not exist; create it first") from None
    except OSError as error:
        raise InvalidInputError(f"{asked}: cannot be written ({error.strerror})") from None
    return asked


def _write_through(path: Path, content: bytes) -> None:
    """Write a new file and wait until the disk has it."""
    binary = getattr(os, "O_BINARY", 0)  # on Windows only
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | binary, 0o666)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _move_to_free_name(source: Path, target: Path) -> None:
    """Give a file a name that must be free; raise FileExistsError, without a race, where it is taken."""
    try:
        os.link(source, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links: take the name first, then replace what is ours by now
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        source.replace(target)


def sign(html: str) -> str:
    """Put a `generator` line into an HTML page that says: pretouch wrote this, and this is the hash of the rest.

    Args:
        html: a page with a `<head>`; a signature that it already carries is replaced.

    Returns:
        The page with its signature, which `is_own_unchanged` recognizes.

    Raises:
        InvalidInputError: the page has no `<head>`.

    Examples:
        >>> page = sign("<html><head><title>Fit</title></head></html>")
        >>> 'content="pretouch sha256:' in page
        True
        >>> sign(page) == page
        True
    """
    rest = _SIGNATURE.sub("", html)
    head = _HEAD.search(rest)
    if head is None:
        raise InvalidInputError("html: found no <head>, expected a whole page")
    return f'{rest[: head.end()]}{_MARK}{_digest(rest)}">\n{rest[head.end() :]}'


def is_own_unchanged(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is a report that pretouch signed and that nobody has changed since.

    Args:
        path: the file, which need not exist.

    Returns:
        True only for an intact, signed report; such a file may be replaced without asking.

    Examples:
        >>> is_own_unchanged("nothing-here.html")
        False
    """
    try:
        html = Path(path).read_bytes().decode()
    except (OSError, UnicodeDecodeError):
        return False
    signatures = _SIGNATURE.findall(html)
    return len(signatures) == 1 and signatures[0] == _digest(_SIGNATURE.sub("", html))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def as_json(value: Mapping[str, Any], *, indent: int | None = 2) -> str:
    """Write an object as JSON that every reader accepts.

    Args:
        value: the object.
        indent: spaces per level; None for one line without any space.

    Returns:
        JSON in ASCII.

    Examples:
        >>> print(as_json({"gain": -0.75, "horizon": float("inf")}))
        {
          "gain": -0.75,
          "horizon": null
        }
        >>> as_json({"gain": -0.75, "bounds": (-10, 0)}, indent=None)
        '{"gain":-0.75,"bounds":[-10,0]}'
    """
    separators = (",", ":") if indent is None else None
    return json.dumps(plain(value), indent=indent, separators=separators, allow_nan=False)


def plain(value: Any) -> Any:
    """Turn a value into what JSON can hold; a number that is not finite becomes null.

    Args:
        value: anything a result may hold: numbers and arrays of NumPy, tuples, enumerations, paths, and what is made
            of these: a dataclass becomes its fields, or what its `to_dict` returns.

    Returns:
        The same in dicts, lists, text, numbers, truth values and None.

    Examples:
        >>> plain({"low": float("-inf"), "pair": (1, 2.5)})
        {'low': None, 'pair': [1, 2.5]}
    """
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, _LISTS) else _plain_one(value)


def with_kind(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass, and the name of its class as `kind`: where one of several may stand."""
    return {"kind": type(value).__name__, **{f.name: getattr(value, f.name) for f in fields(value)}}


_LISTS: Final = (list, tuple, set, frozenset)


def _plain_one(value: Any) -> Any:
    """Turn what holds no other value into what JSON can hold."""
    if isinstance(value, Enum):
        return plain(value.value)
    if hasattr(value, "tolist"):  # scalars and arrays of NumPy
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
