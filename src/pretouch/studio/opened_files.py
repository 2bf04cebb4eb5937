"""Restrict the studio to files that the user has opened."""

from __future__ import annotations

import re
import shutil
import tomllib
from codecs import BOM_UTF8
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.errors import InvalidInputError, ScenarioFileError, UnitError, require
from pretouch._core.files import temporary_path
from pretouch._core.units import to_si
from pretouch.motion.scenario import SCENARIO_INPUTS

from .temporary_folder import TemporaryFolder

if TYPE_CHECKING:
    from pretouch.designs import Task

_FILE_KEYS: Final = (("sensor", "calibration"), ("sensor", "no_object"), ("robot", "model"))
"""The keys of a scenario file whose values are names of other files."""

_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_SHOWN: Final = 40  # largest number of characters of a name in a message
_RANGES: Final = frozenset({"between", "uniform", "interval", "samples"})
_EFFECTS: Final = frozenset({"ratio", "excursion", "acceleration", "contact_speed", "impact_force"})


class OpenedFiles:
    """The files that a running studio may read.

    It also has a folder of temporary files.

    The page sends the text of a scenario and no paths. A scenario may name only files that the opened scenario file
    names, and uploaded files.

    Args:
        opened: the scenario file with which the studio was started; None if it was started without a file.
    """

    def __init__(self, opened: Path | None = None) -> None:
        self._folder = TemporaryFolder()
        self.folder = self._folder.path
        self.opened = opened
        self._files: dict[str, Path] = {}
        self._count = 0
        self._lock = Lock()  # requests are answered in several threads
        if opened is not None:
            self._allow_files(self.text, opened.parent.resolve())

    @property
    def text(self) -> str:
        """The text of the opened scenario file as it is now; empty if the studio was started without a file."""
        return "" if self.opened is None else self.opened.read_text(encoding="utf-8-sig")

    def close(self) -> None:
        """Remove the temporary files."""
        self._folder.close()

    def _allow_files(self, text: str, folder: Path) -> None:
        """Allow access to the files named in the user's scenario."""
        try:
            document = tomllib.loads(text)
        except tomllib.TOMLDecodeError:
            return  # the page shows the message of load_scenario
        for _, _, name in _names(document):
            self._files[name] = folder / name

    def add_file(self, name: str, content: bytes) -> str:
        """Store an uploaded file.

        Returns:
            The name of the file for scenarios.

        Raises:
            InvalidInputError: the system allows no file with this name, or has no space for it.
        """
        plain = re.sub(r"[^\w.-]", "_", name.replace("\\", "/").rpartition("/")[2]).lstrip(".") or "calibration.csv"
        path = self.folder / f"upload-{plain}"
        try:
            path.write_bytes(content)
        except OSError as error:
            shown = plain if len(plain) <= _SHOWN else f"{plain[:_SHOWN]}..."
            raise InvalidInputError(
                f"upload: the file {shown} could not be stored ({error.strerror or error}). Its name has {len(plain)} "
                "characters; choose one of at most 100 characters, and check that the disk has free space"
            ) from None
        self._files[plain] = path
        return plain

    def file(self, name: str) -> Path:
        """Return the path of an uploaded or opened file.

        Opened files are those that the opened scenario file names.

        Raises:
            InvalidInputError: the name is of another file.
        """
        if name not in self._files:
            raise InvalidInputError(
                f"file: the scenario names the file {name!r}, but this file has not been opened in the studio. Upload "
                "this file, or start the studio with the scenario file that names it"
            )
        return self._files[name]

    def write_scenario(self, text: str, path: Path) -> Path:
        """Write a scenario to a temporary file.

        The full path of each opened file replaces its name.

        Args:
            text: the text of the scenario file (TOML).
            path: the temporary file.

        Returns:
            The path of the temporary file.
        """
        document = _parse(text)
        for section, key, name in _names(document):
            document[section][key] = str(self.file(name))
        path.write_text(_require_tomlkit().dumps(document), encoding="utf-8")
        return path

    def load(self, text: str) -> Task:
        """Read a scenario from its text.

        Args:
            text: the text of the scenario file (TOML).

        Returns:
            The task of the scenario.
        """
        from pretouch.config import load_scenario  # noqa: PLC0415 - only when a scenario is read

        with self._lock:
            self._count += 1
            path = self.folder / f"scenario-{self._count}.toml"
        try:
            return load_scenario(self.write_scenario(text, path))
        finally:
            path.unlink(missing_ok=True)

    def save(self, text: str, known: str | None) -> dict[str, str]:
        """Write a text to the opened scenario file, unless the file has changed since the page read it.

        The studio was started with this file. Its permissions and line ends stay, and a symbolic link stays a link.

        Args:
            text: the new text.
            known: the text of the file that the page knows; None to overwrite any text.

        Returns:
            `saved` with the name of the file, or `changed` with the present text of the file if it is another one than
            the known text.

        Raises:
            InvalidInputError: the studio was started without a file.
        """
        if self.opened is None:
            raise InvalidInputError(
                "save: the studio was started without a file; download the scenario, or run: pretouch studio FILE"
            )
        for _, _, name in _names(_parse(text)):
            self.file(name)  # raises an error if the file has not been opened
        target = self.opened.resolve()  # of a link, the file
        before = target.read_bytes() if target.exists() else b""
        if known is not None and before and before.decode("utf-8-sig").replace("\r\n", "\n") != known:
            return {"changed": self.text}
        content = text.encode("utf-8-sig" if before.startswith(BOM_UTF8) else "utf-8")
        if b"\r\n" in before:
            content = content.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")
        partial = temporary_path(target)
        try:
            partial.write_bytes(content)
            if before:
                shutil.copymode(target, partial)
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
        return {"saved": self.opened.name}


def _require_tomlkit() -> Any:
    return require("tomlkit", extra="studio")


def _parse(text: str) -> Any:
    """Return the TOML document of a text.

    Raises:
        ScenarioFileError: the text is not TOML.
    """
    tomlkit = _require_tomlkit()
    try:
        return tomlkit.parse(text)
    except (
        tomlkit.exceptions.TOMLKitError,
        ValueError,
        RecursionError,
    ) as error:
        raise ScenarioFileError(f"the scenario is not valid TOML: {error}") from None


def _names(document: Any) -> Iterator[tuple[str, str, str]]:
    """Yield the files that a scenario names. Each item is section, key and file name."""
    for section, key in _FILE_KEYS:
        table = document.get(section)
        name = table.get(key) if isinstance(table, dict) else None
        if isinstance(name, str) and not (key == "no_object" and _is_reading(name)):
            yield section, key, str(name)


def _is_reading(value: str) -> bool:
    """Return True if the value of `no_object` is a reading. Otherwise, it is the name of a file."""
    from pretouch.config.sensor import read_output  # noqa: PLC0415 - only for a file with this key

    try:
        read_output(value, name="no_object")
    except UnitError:
        return False
    return True


def change_text(text: str, changes: dict[str, Any]) -> str:
    """Change some keys of a scenario file.

    Everything else stays as it is, including comments. If an input of the encounter has a distribution in
    [uncertainty], the distribution moves with its value.

    Args:
        text: the scenario file (TOML).
        changes: values by `section.key`; None removes a key.

    Returns:
        The changed file.

    Raises:
        InvalidInputError: a section is no table, or a value is neither a text nor a number nor a list of these.
    """
    tomlkit, document = _require_tomlkit(), _parse(text)
    for name, value in changes.items():
        section, _, key = name.partition(".")
        if not isinstance(document.get(section, {}), dict) or not _is_value(value):
            raise InvalidInputError(
                f"changes: {name} cannot be changed, expected a key of a table, and a text, a number or a list of these"
            )
        if value is None:
            if section in document:
                document[section].pop(key, None)
                if not document[section]:
                    document.pop(section)
            continue
        if section not in document:
            if document.as_string().strip():
                document.add(tomlkit.nl())
            document.add(section, tomlkit.table())
        if section == "law" and key in _EFFECTS:
            for other in _EFFECTS - {key}:
                document[section].pop(other, None)
        before = document[section].get(key)
        document[section][key] = _like(before, value)
        if before is not None and name in SCENARIO_INPUTS:
            _move_distribution(_table(document, "uncertainty", section, key), before, value, name)
    result: str = tomlkit.dumps(document)
    return result


def _table(document: Any, *names: str) -> Any:
    """Return a table in a document; an empty one if it is missing, or another value takes its place."""
    for name in names:
        document = document.get(name) if isinstance(document, dict) else None
    return document if isinstance(document, dict) else {}


def _is_value(value: Any) -> bool:
    """Return whether the page may set this value: a text, a number, a list of these, or None to remove the key."""
    if isinstance(value, list):
        return all(isinstance(part, str | int | float) for part in value)
    return value is None or isinstance(value, str | int | float)


def _move_distribution(distribution: Any, before: Any, after: Any, name: str) -> None:
    """Shift an input's distribution by the change of its nominal value. The distribution is changed in place."""
    unit = SCENARIO_INPUTS[name]
    read = partial(to_si, unit=unit, name=name, bare_text=True)
    try:
        change = read(str(after)) - read(str(before))
        for kind, numbers in distribution.items():
            if not isinstance(numbers, list) or not numbers:
                continue
            located = len(numbers) if kind in _RANGES else 1 if kind == "normal" else 0
            for i in range(located):  # the second number of "normal" is a deviation
                numbers[i] = f"{read(str(numbers[i])) + change:.6g} {unit}"
    except UnitError:  # reported when the scenario is read
        return


def _like(before: Any, value: Any) -> Any:
    """Convert a value to a TOML item, and keep the old comment."""
    tomlkit = _require_tomlkit()
    if isinstance(value, list):
        item = tomlkit.array()
        item.extend(_like(None, part) for part in value)
    elif isinstance(value, str) and _NUMBER.fullmatch(value):
        item = tomlkit.value(value if "." in value or "e" in value.lower() else str(int(value)))
    else:
        item = tomlkit.item(value)
    if before is not None and hasattr(before, "trivia"):
        item.trivia.comment, item.trivia.comment_ws = before.trivia.comment, before.trivia.comment_ws
        item.trivia.trail = before.trivia.trail
    return item
