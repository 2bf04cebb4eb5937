"""Read input files, write output files atomically, and serialize results to JSON."""

from __future__ import annotations

import errno
import json
import math
import os
import re
import shutil
import stat
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Final

from .errors import InvalidInputError, OutputError, OutputExistsError

_SIGNATURE: Final = re.compile(r'<meta name="generator" content="pretouch sha256:([0-9a-f]{64})">\n?')
_HEAD: Final = re.compile(r"<head>\n?")
_MARK: Final = '<meta name="generator" content="pretouch sha256:'
_LEFTOVER: Final = re.compile(r"\.[0-9a-f]{12}\.tmp")
_ABANDONED: Final = 3600.0  # s without a change, after which a temporary file is considered abandoned


def read_regular_file(path: str | os.PathLike[str], *, most: int, refuse: Callable[..., InvalidInputError]) -> bytes:
    """Read a regular file of limited size.

    Devices and pipes are refused, because reading them may never end.

    Args:
        path: the file.
        most: largest allowed size [bytes].
        refuse: makes the error from a message; it is raised for a device, a pipe, or a larger file.

    Returns:
        The bytes of the file.
    """
    mode = os.stat(path).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a device or a socket"
        raise refuse(
            f"{path}: this path is {kind}, but pretouch needs a regular file; save the content as a regular file first"
        )
    with open(path, "rb") as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise refuse(f"{path}: this file is too large; the largest allowed size is {most / 1e6:,.0f} MB", limit=most)
    return content


def refuse_input(path: str | os.PathLike[str], inputs: Iterable[str | os.PathLike[str]]) -> None:
    """Refuse to overwrite an input file.

    Links to an input file are refused too.

    Args:
        path: the output file.
        inputs: the files that were read.

    Raises:
        OutputExistsError: the output is one of the inputs.
    """
    for each in inputs:
        try:
            same = os.path.samefile(path, each)
        except OSError:  # one of the two does not exist
            same = os.path.realpath(path) == os.path.realpath(each)
        if same:
            raise OutputExistsError(
                f"{path}: the output would overwrite the input file {each}. Choose another name with --output",
                value=str(each),
                remedy="--output",
            )


def temporary_path(target: Path) -> Path:
    """Return an unused path for a temporary file.

    The path is in the folder of the target file. The caller renames the temporary file to the target when the file is
    complete. This function also removes temporary files of the same target that a killed process left behind, one hour
    after their last change.

    Args:
        target: the file to be written.

    Returns:
        A free path, with a hidden name.
    """
    name = target.name[:100]
    with suppress(OSError):  # a folder that cannot be listed may still be writable
        siblings = [entry for entry in os.scandir(target.parent) if entry.name.startswith(f".{name}.")]
        for entry in siblings:
            leftover = _LEFTOVER.fullmatch(entry.name.removeprefix(f".{name}"))
            if leftover and entry.stat(follow_symlinks=False).st_mtime < time.time() - _ABANDONED:
                remove_tree(Path(entry.path))
    return target.with_name(f".{name}.{os.urandom(6).hex()}.tmp")


def remove_tree(path: Path) -> None:
    """Remove a file or a folder with its content, and ignore errors."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    with suppress(OSError):
        path.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> Path:
    """Write a UTF-8 text file atomically.

    The text is written to a temporary file in the same folder first, so that a crash leaves no partial file. Unless
    `overwrite` is true, renaming the temporary file fails if the target exists.

    Args:
        path: the file; its folder must exist.
        text: the content; line ends are not changed.
        overwrite: whether an existing file may be replaced.

    Returns:
        The path.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     print(write_text(f"{folder}/note.txt", "unchanged").read_text())
        unchanged
    """
    return write_bytes(path, text.encode(), overwrite=overwrite)


def write_bytes(path: str | os.PathLike[str], content: bytes, *, overwrite: bool = False) -> Path:
    """Write a binary file atomically.

    A pipe or a device, such as `/dev/stdout`, gets the bytes directly.

    Args:
        path: the file; its folder must exist.
        content: the bytes.
        overwrite: whether an existing file may be replaced.

    Returns:
        The path.

    Raises:
        OutputExistsError: the file exists and `overwrite` is false.
        InvalidInputError: the folder does not exist.
        OutputError: the file cannot be written, for example because the disk is full.
    """
    named = Path(path)
    if is_stream(named):
        _write_stream(named, content)
        return named
    target = Path(os.path.realpath(named))  # a link remains a link; its target is written
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
            f"{named}: this {'folder' if target.is_dir() else 'file'} already exists, and pretouch does not "
            "overwrite it. Choose another name with --output, or replace the file with --force (overwrite=True "
            "in Python)",
            remedy="--force",
        ) from None
    except OSError as error:
        if not target.parent.is_dir():
            raise InvalidInputError(f"{named}: the folder {named.parent} does not exist; create it first") from None
        raise OutputError(f"{named}: cannot be written ({error.strerror or error})", value=error.strerror) from None
    return named


def is_stream(path: str | os.PathLike[str]) -> bool:
    """Return True for a pipe, a device or a socket, which is written directly and never read.

    Args:
        path: the output, which need not exist.

    Examples:
        >>> is_stream("nothing-here.html")
        False
    """
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _write_stream(path: Path, content: bytes) -> None:
    """Write to a pipe or device; a pipe that no program reads is an error."""
    no_wait = getattr(os, "O_NONBLOCK", 0)
    try:
        descriptor = os.open(path, os.O_WRONLY | no_wait)
        with os.fdopen(descriptor, "wb") as stream:
            if no_wait:
                os.set_blocking(descriptor, True)
            stream.write(content)
    except OSError as error:
        reason = "no program reads this pipe" if error.errno == errno.ENXIO else error.strerror or str(error)
        raise OutputError(f"{path}: cannot be written ({reason})") from None


def _write_through(path: Path, content: bytes) -> None:
    """Write a new file and flush it to the disk."""
    binary = getattr(os, "O_BINARY", 0)  # exists on Windows only
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
    """Rename a file, and raise FileExistsError if the new name already exists."""
    try:
        os.link(source, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links: create the target exclusively, then replace it
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        source.replace(target)


def sign(html: str) -> str:
    """Sign an HTML report of pretouch.

    The signature is a `generator` tag with a hash. The hash shows later whether the report was changed.

    Args:
        html: a page with a `<head>`; an earlier signature is replaced.

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
        raise InvalidInputError("html: found no <head>, expected a complete page")
    return f'{rest[: head.end()]}{_MARK}{_digest(rest)}">\n{rest[head.end() :]}'


def is_own_unchanged(path: str | os.PathLike[str]) -> bool:
    """Check whether a file is an unchanged HTML report of pretouch.

    Args:
        path: the file, which need not exist.

    Returns:
        True only for an unchanged, signed report; such a file may be replaced without --force.

    Examples:
        >>> is_own_unchanged("nothing-here.html")
        False
    """
    if is_stream(path):
        return False
    try:
        html = Path(path).read_bytes().decode()
    except (OSError, UnicodeDecodeError):
        return False
    signatures = _SIGNATURE.findall(html)
    return len(signatures) == 1 and signatures[0] == _digest(_SIGNATURE.sub("", html))


def _digest(text: str) -> str:
    import hashlib  # noqa: PLC0415 - keeps `pretouch --help` quick

    return hashlib.sha256(text.encode()).hexdigest()


def as_json(value: Mapping[str, Any], *, indent: int | None = 2) -> str:
    """Serialize a dictionary as standard JSON.

    Args:
        value: the object.
        indent: spaces per level; None for one line without spaces.

    Returns:
        JSON in ASCII; numbers that are not finite are null.

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
    """Convert a value to a JSON-compatible type; NaN and infinity become None.

    Args:
        value: any part of a result: NumPy numbers and arrays, tuples, enumerations, paths, and containers of these. A
            dataclass is converted by its `to_dict`, or else by its fields.

    Returns:
        The value as dict, list, text, number, bool or None.

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
    """Return a dataclass as a dictionary with its class name.

    The class name has the key `kind`.
    """
    return {"kind": type(value).__name__, **{f.name: getattr(value, f.name) for f in fields(value)}}


_LISTS: Final = (list, tuple, set, frozenset)


def _plain_one(value: Any) -> Any:
    """Convert a single value to a JSON-compatible type. NaN and infinity become None."""
    if isinstance(value, Enum):
        return plain(value.value)
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
