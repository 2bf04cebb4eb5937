"""Show the progress of a calibration recording.

A terminal shows live values; a log has plain lines.
"""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, Final, TextIO

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity
from pretouch.recording.record_curve import text_curve
from pretouch.recording.record_settling import robust_spread

_LIVE: Final = 10.0  # updates of the terminal per second
_ROWS: Final = 24  # recorded distances that are shown


class PlainDisplay:
    """Display of a recording as plain lines for logs.

    Each step is one line on standard error.

    Args:
        readings_on_stdin: whether standard input carries the readings, so that questions go to the terminal.
    """

    def __init__(self, *, readings_on_stdin: bool = False) -> None:
        self._answers: TextIO | None = _terminal() if readings_on_stdin else sys.stdin

    def ask(self, question: str) -> str | None:
        """Print a question and return the user's answer. The result is None at the end of the input."""
        if self._answers is None:
            raise InvalidInputError(
                "--stdin: standard input carries the readings, so pretouch cannot ask you to set the object; use "
                "--stage or --distance-column, with --no-empty-scene"
            )
        self._write(question, end="")
        answer = self._answers.readline()
        if not self._answers.isatty():
            self._write("")
        return answer.removesuffix("\n") if answer else None

    def say(self, text: str) -> None:
        """Print a sentence."""
        self._write(text)

    def show(self, distance: float, outputs: Sequence[float], counted: int, wanted: int, settling: bool) -> None:
        """Print nothing, because a log needs no live values."""

    def show_distance(self, distance: float, outputs: Sequence[float]) -> None:
        """Print the sensor output at a distance.

        The line has the median, the spread and the number of readings.
        """
        self._write(f"{place_in_words(distance)}: {value_in_words(outputs)}, {len(outputs)} readings")

    def close(self) -> None:
        """Do nothing, because plain lines need no cleanup."""

    def _write(self, text: str, end: str = "\n") -> None:
        with contextlib.suppress(OSError):  # a log that cannot be written must not end the recording
            sys.stderr.write(text + end)
            sys.stderr.flush()


class LiveDisplay(PlainDisplay):
    """Live display of a recording in a terminal.

    It shows live value, recorded distances and curve, updated ten times per second.

    Args:
        readings_on_stdin: whether standard input carries the readings, so that questions go to the terminal.
    """

    def __init__(self, *, readings_on_stdin: bool = False) -> None:
        super().__init__(readings_on_stdin=readings_on_stdin)
        from rich.console import Console  # noqa: PLC0415 - `pretouch --help` stays fast
        from rich.live import Live  # noqa: PLC0415

        self._console = Console(stderr=True)
        self._make: Callable[[], Any] = lambda: Live(
            console=self._console, refresh_per_second=_LIVE, transient=True, get_renderable=self._view
        )
        self._live: Any = None
        self._now = ""
        self._points: dict[float, tuple[str, int, float]] = {}

    def ask(self, question: str) -> str | None:
        """Show the recorded curve, then ask the user a question."""
        self._pause()
        if self._points:
            self._console.print(self._view())
        return super().ask(question)

    def say(self, text: str) -> None:
        """Print a sentence above the live values."""
        self._console.print(text, highlight=False, markup=False)

    def show(self, distance: float, outputs: Sequence[float], counted: int, wanted: int, settling: bool) -> None:
        """Show the live sensor output at the current distance."""
        count = "settling" if settling else f"{counted} of {wanted} readings" if wanted else f"{counted} readings"
        self._now = f"{place_in_words(distance)}: {value_in_words(outputs)}, {count}"
        if self._live is None:
            self._live = self._make()
            self._live.start()

    def show_distance(self, distance: float, outputs: Sequence[float]) -> None:
        """Show the readings at a completed distance.

        They are added to the table and the curve.
        """
        if len(outputs):
            self._points[distance] = (value_in_words(outputs), len(outputs), float(np.median(outputs)))
        self._now = ""

    def close(self) -> None:
        """Stop the live display.

        The recorded distances and the curve remain in the terminal.
        """
        self._pause()
        if self._points:
            self._console.print(self._view())

    def _pause(self) -> None:
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _view(self) -> Any:
        """Return the content of the live display. It consists of a table of distances, the curve and the live value."""
        from rich.console import Group  # noqa: PLC0415
        from rich.table import Table  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        table = Table("distance", "output", "readings", box=None, padding=(0, 2))
        for distance in sorted(self._points)[-_ROWS:]:
            value, count, _ = self._points[distance]
            table.add_row(place_in_words(distance), value, str(count))
        near = sorted(d for d in self._points if math.isfinite(d))
        curve = text_curve([1000 * d for d in near], [self._points[d][2] for d in near], unit="mm")
        return Group(table, Text("\n".join(curve)), Text(self._now, style="bold"))


def place_in_words(distance: float) -> str:
    """Return a distance as text.

    An infinite distance means an empty scene without an object.
    """
    return "empty scene" if math.isinf(distance) else format_quantity(distance, "m")


def value_in_words(outputs: Sequence[float]) -> str:
    """Return the median and the robust spread of readings as text."""
    values = np.asarray(outputs)
    return f"{np.median(values):.6g} ± {robust_spread(values):.2g}" if len(values) else "no reading"


def _terminal() -> TextIO | None:
    """Open the terminal for answers, because standard input may carry readings; None without a terminal."""
    try:
        return open("/dev/tty", encoding="utf-8")
    except OSError:
        return None
