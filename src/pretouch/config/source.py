"""The file that a problem was read from, and where in it a mistake stands that is found later."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from pretouch._core.errors import InvalidInputError, OutOfRangeError, ScenarioFileError

from .document import Mistake, listed
from .placing import place
from .positions import key_lines

__all__ = ["ScenarioSource"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioSource:
    """The file that a problem was read from.

    Args:
        path: where it stood.
        text: its text, so that a report can show it.
        sha256: the hash of its bytes, in hexadecimal.
        supported: where the calibration of its sensor supports the curve, as a sentence; empty without one.
    """

    path: Path
    text: str = field(repr=False)
    sha256: str
    supported: str = field(default="", repr=False)

    @contextmanager
    def placing(self) -> Iterator[None]:
        """Turn what a verb refuses into a mistake of the file, with its line and its key as near as they are known.

        Yields:
            Nothing.

        Raises:
            ScenarioFileError: the verb refused something.
        """
        try:
            yield
        except InvalidInputError as error:
            raise ScenarioFileError(self._placed(self.explained(error))) from error

    def explained(self, error: InvalidInputError) -> str:
        """Return the message of an error, with the calibration as the reason where a sensor says nothing.

        Args:
            error: what was raised.

        Returns:
            The message.
        """
        return f"{error}; {self.supported}" if self.supported and isinstance(error, OutOfRangeError) else str(error)

    def _placed(self, message: str) -> str:
        lines = key_lines(self.text)
        path, sentence = place(message, "")
        known = next((path[:n] for n in range(len(path), 0, -1) if path[:n] in lines), None)
        if known is None:
            return f"{self.path}: {message}"
        return listed(self.path, [Mistake(line=lines[known], key=".".join(map(str, path)), sentence=sentence)])
