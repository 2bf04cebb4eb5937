"""A TOML file as text and as data; where it is neither, in which line, and what was probably meant."""

from __future__ import annotations

import difflib
import os
import re
import tomllib
from pathlib import Path
from typing import Any, Final

from pretouch._core.errors import ScenarioFileError

from .quantities import printable

__all__ = ["read_document"]

_PLACE: Final = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
_TWICE: Final = re.compile(r"Cannot (overwrite|declare|mutate|redefine)|already")


def read_document(path: str | os.PathLike[str]) -> tuple[bytes, str, dict[str, Any]]:
    """Return bytes, text and data of a file; raise ScenarioFileError where it cannot be read or is no valid TOML."""
    place = Path(path)
    content = _read(place)
    text = _decode(place, content)
    return content, text, _parse(place, text)


def _read(path: Path) -> bytes:
    """Read the bytes of a file, or say why not."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        near = difflib.get_close_matches(path.name, _names_beside(path), n=1)
        hint = f"; did you mean {path.with_name(near[0])}?" if near else ""
        raise ScenarioFileError(f"{path}: there is no such file{hint}") from None
    except IsADirectoryError:
        raise ScenarioFileError(f"{path}: found a folder, expected a scenario file (TOML)") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioFileError(f"{path}: cannot be read ({reason})") from None


def _names_beside(path: Path) -> list[str]:
    try:
        return [p.name for p in path.parent.glob("*.toml")]
    except OSError:
        return []


def _decode(path: Path, content: bytes) -> str:
    """Turn bytes into text: UTF-8, with or without a mark at its start, any line ends."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise ScenarioFileError(f"{path}, line 1: found text in UTF-16, expected UTF-8; save the file as UTF-8")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        found = content[error.start : error.start + 1].hex()
        raise ScenarioFileError(
            f"{path}, line {line}: found the byte 0x{found}, expected text in UTF-8; save the file as UTF-8"
        ) from None


def _parse(path: Path, text: str) -> dict[str, Any]:
    """Read TOML, or say in which line it breaks, and what people often mean there."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ScenarioFileError(f"{path}, line 1: found lists nested too deeply, expected a scenario file") from None
    except ValueError as error:  # TOMLDecodeError, or an integer with thousands of digits
        lines = text.split("\n")
        message = str(error)
        place = _PLACE.search(message)
        number = int(place.group(1)) if place and place.group(1) else len(text.rstrip().split("\n"))
        if place is None:
            number = max(range(len(lines)), key=lambda i: len(lines[i])) + 1
        what = _PLACE.sub("", message)
        found = lines[number - 1].strip() if number <= len(lines) else ""
        found = found if len(found) <= 60 else f"{found[:57]}..."
        hint = printable(_hint(path, what, found))
        raise ScenarioFileError(f"{path}, line {number}: found {found!r}, which is not valid TOML: {hint}") from None


def _hint(path: Path, what: str, found: str) -> str:
    """Say what the parser says, or what is probably meant."""
    key, _, value = (part.strip() for part in re.sub(r"\s#.*", "", found).partition("="))
    if path.suffix.lower() in {".csv", ".tsv", ".txt"}:
        return "expected a scenario file; for a calibration use: pretouch fit"
    if _TWICE.search(what):
        return f"this {'section' if found.startswith('[') else 'key'} is given twice, expected it once"
    if re.fullmatch(r"[-+]?\d+,\d+.*", value):
        return f"expected a decimal point in the place of the comma: {key} = {value.replace(',', '.', 1)}"
    if re.fullmatch(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*[^\W\d].*", value) and '"' not in value:
        return f'a quantity with a unit is text, expected {key} = "{value}"'
    if re.fullmatch(r"[^\W\d][^\"'\[\]{}=#]*", value):
        return f'text stands in quotes, expected {key} = "{value}"'
    return f"{what[:1].lower()}{what[1:]}"
