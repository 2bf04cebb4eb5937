"""Write the files of an export into a new folder.

After an error, no incomplete folder remains.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from pretouch._core.errors import InvalidInputError, OutputError, OutputExistsError
from pretouch._core.files import remove_tree, temporary_path

MANIFEST: Final = "pretouch-export.json"
"""File that lists all files of an exported folder with their hashes."""

BUILD: Final = "build"
"""Subfolder for compiled files, which may be removed with an export."""


def write_folder(
    folder: str | os.PathLike[str], files: Mapping[str, bytes], *, overwrite: bool = False
) -> tuple[Path, ...]:
    """Write files into a new folder, completely or not at all.

    Args:
        folder: the folder; its parent folder must exist.
        files: content of each file by its path in the folder, such as `src/law.c`.
        overwrite: whether a folder of an earlier export may be replaced. A folder that holds anything else, or an
            exported file that was changed, is never replaced; only its subfolder `build` is ignored.

    Returns:
        The paths of the files, in the order of `files`.

    Raises:
        OutputError: the folder cannot be written, for example because the disk is full.
    """
    target = check_free(folder, overwrite=overwrite)
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    manifest = json.dumps({"files": digests}, indent=2) + "\n"
    temporary = temporary_path(target.resolve())
    try:
        for name, content in {**files, MANIFEST: manifest.encode()}.items():
            path = temporary / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        _move(temporary, target)
    except OSError as error:
        reason = error.strerror
        raise OutputError(f"{target}: the folder cannot be written ({reason or error})", value=reason) from None
    finally:
        remove_tree(temporary)
    return tuple(target / name for name in files)


def check_free(folder: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Return the path of the export folder, after a check that it may be written.

    Raises:
        InvalidInputError: the parent folder does not exist, or the folder may not be replaced.
    """
    target = Path(folder)
    if not target.parent.is_dir():
        raise InvalidInputError(f"{target}: the parent folder {target.parent} does not exist; create it first")
    if os.path.lexists(target):
        _check_replaceable(target, overwrite=overwrite)
    return target


def _check_replaceable(target: Path, *, overwrite: bool) -> None:
    """Raise an error if an export may not replace a folder."""
    if not target.is_dir() or target.is_symlink():
        raise OutputExistsError(f"{target}: a file or link with this name exists; choose another name for the folder")
    if not any(target.iterdir()):
        return
    if not overwrite:
        raise OutputExistsError(
            f"{target}: this folder already exists; choose another folder, or replace an earlier export with --force "
            "(in Python: overwrite=True)",
            remedy="--force",
        )
    foreign = _foreign_file(target)
    if foreign is not None:
        raise OutputExistsError(
            f"{target}: pretouch does not replace this folder; choose another folder, or remove this folder first. "
            f"{foreign}"
        )


def _foreign_file(target: Path) -> str | None:
    """Explain how a folder differs from an unchanged export.

    Returns:
        The explanation; None if the folder is an unchanged export.
    """
    try:
        digests = json.loads((target / MANIFEST).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return "The folder contains no list of exported files"
    for path in sorted(target.rglob("*")):
        name = path.relative_to(target).as_posix()
        if path.is_dir() or name == MANIFEST or name.startswith(f"{BUILD}/"):
            continue
        if name not in digests or hashlib.sha256(path.read_bytes()).hexdigest() != digests[name]:
            return f"The file {name} was added or changed after the export"
    return None


def _move(temporary: Path, target: Path) -> None:
    """Replace the target folder by the temporary folder."""
    place = target.resolve()
    if not place.exists():
        temporary.rename(place)
        return
    old = temporary_path(place)
    place.rename(old)
    try:
        temporary.rename(place)
    except OSError:
        old.rename(place)
        raise
    remove_tree(old)
