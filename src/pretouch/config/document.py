"""Read a scenario file, parse its TOML, and explain syntax errors."""

from __future__ import annotations

import difflib
import os
import re
import tomllib
from pathlib import Path
from typing import Any, Final

from pretouch._core.errors import ScenarioFileError
from pretouch._core.files import read_regular_file

from .quantities import printable

_PLACE: Final = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
_MOST_BYTES: Final = 1_000_000
_DEEPEST: Final = 32
_PART: Final = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP: Final = re.compile(rf"(?<![\w.\"'-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_DEEPEST},}}+")
_TWICE: Final = re.compile(r"Cannot (overwrite|declare|mutate|redefine)|already")


def read_document(path: str | os.PathLike[str]) -> tuple[bytes, str, dict[str, Any]]:
    """Return the contents of a scenario file.

    The result has the bytes, the text and the parsed contents of the file.
    """
    place = Path(path)
    content = _read(place)
    text = _decode(place, content)
    return content, text, _parse(place, text)


def _read(path: Path) -> bytes:
    """Read the bytes of a scenario file."""
    try:
        return read_regular_file(path, most=_MOST_BYTES, refuse=ScenarioFileError)
    except FileNotFoundError:
        near = difflib.get_close_matches(path.name, _scenarios_in_folder(path), n=1)
        similar = str(path.with_name(near[0])) if near else ""
        hint = f"; did you mean {similar}?" if near else ""
        raise ScenarioFileError(f"{path}: there is no such file{hint}", remedy=similar) from None
    except IsADirectoryError:
        raise ScenarioFileError(f"{path}: this path is a folder, but a scenario file (TOML) is needed") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioFileError(f"{path}: cannot be read ({reason})") from None


def _scenarios_in_folder(path: Path) -> list[str]:
    try:
        return [p.name for p in path.parent.glob("*.toml")]
    except OSError:
        return []


def _decode(path: Path, content: bytes) -> str:
    """Decode a scenario file as UTF-8 with normalized line ends. A byte order mark is removed."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise ScenarioFileError(f"{path}, line 1: the text is encoded in UTF-16; save the file as UTF-8")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        byte = content[error.start : error.start + 1].hex()
        raise ScenarioFileError(
            f"{path}, line {line}: the byte 0x{byte} is not valid UTF-8 text; save the file with the encoding UTF-8"
        ) from None


def _parse(path: Path, text: str) -> dict[str, Any]:
    """Parse the TOML text; the message of a syntax error gives the line and a suggested correction."""
    deep = _DEEP.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise ScenarioFileError(
            f"{path}, line {line}: the key has more than {_DEEPEST} parts, but keys of a scenario file have the "
            "form section.key"
        )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ScenarioFileError(
            f"{path}, line 1: the lists or inline tables are nested too deeply; lists of a scenario file contain "
            "only numbers, texts or tables"
        ) from None
    except ValueError as error:  # TOMLDecodeError, or an integer with thousands of digits
        lines = text.split("\n")
        message = str(error)
        place = _PLACE.search(message)
        number = int(place.group(1)) if place and place.group(1) else len(text.rstrip().split("\n"))
        if place is None:
            number = max(range(len(lines)), key=lambda i: len(lines[i])) + 1
        if "set_int_max_str_digits" in message:  # Python refuses to parse integers with thousands of digits
            message = "a number has thousands of digits, expected a number such as 0.0422 or 1e6"
        what = _PLACE.sub("", message)
        line_text = lines[number - 1].strip() if number <= len(lines) else ""
        line_text = line_text if len(line_text) <= 60 else f"{line_text[:57]}..."
        hint = printable(_hint(path, what, line_text))
        raise ScenarioFileError(
            f"{path}, line {number}: the text {line_text!r} is not valid TOML: {hint}",
            value=line_text,
            remedy="pretouch fit" if _is_table(path) else "",
        ) from None


def _is_table(path: Path) -> bool:
    return path.suffix.lower() in {".csv", ".tsv", ".txt"}


def _hint(path: Path, message: str, line: str) -> str:
    """Suggest a correction of a wrong TOML line. Without a suggestion, the result is the message of the TOML parser."""
    key, _, value = (part.strip() for part in re.sub(r"\s#.*", "", line).partition("="))
    if _is_table(path):
        return "expected a scenario file (TOML); for a calibration run: pretouch fit"
    if _TWICE.search(message):
        return f"this {'section' if line.startswith('[') else 'key'} is given twice, expected once"
    if re.fullmatch(r"[-+]?\d+,\d+.*", value):
        return f"write a decimal point instead of the comma: {key} = {value.replace(',', '.', 1)}"
    if re.fullmatch(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*[^\W\d].*", value) and '"' not in value:
        return f'a quantity with a unit needs quotation marks: {key} = "{value}"'
    if re.fullmatch(r"[^\W\d][^\"'\[\]{}=#]*", value):
        return f'text needs quotes, expected {key} = "{value}"'
    return f"{message[:1].lower()}{message[1:]}"
