"""Choose the object distances of a calibration.

A person types the distances, or they come from a list.
"""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Sequence
from typing import Final, Protocol

from pretouch._core.errors import InvalidInputError, PretouchError, SourceError
from pretouch._core.units import format_quantity, read_quantity, with_point

from .record_judgment import Judgment

_SLOWEST: Final = 120.0  # s, after which a command that moves a stage is considered stuck


class RecordDisplay(Protocol):
    """Interface of the display during a calibration recording."""

    def ask(self, question: str) -> str | None:
        """Ask the person a question, and return the answer.

        The answer is None at the end of the input.
        """

    def say(self, text: str) -> None:
        """Show a sentence to the person."""

    def show(self, distance: float, outputs: Sequence[float], counted: int, wanted: int, settling: bool) -> None:
        """Show the latest sensor outputs at an object distance.

        The distance [m] is infinite without an object.
        """

    def show_distance(self, distance: float, outputs: Sequence[float]) -> None:
        """Show the calibration readings of a distance when its recording is complete."""


class DistancePlan(Protocol):
    """Interface for choosing the next object distance.

    `suggests` is True if a person chooses the distances, and so wants to know which are missing.
    """

    suggests: bool

    def move(self, judgment: Judgment, display: RecordDisplay) -> float | None:
        """Wait until the object is at the next distance.

        The result is this distance [m], or None after the last distance.
        """


class TypedDistances:
    """Distances that a person types after placing the object."""

    suggests = True

    def move(self, judgment: Judgment, display: RecordDisplay) -> float | None:
        """Ask the person for the next object distance."""
        suggested = judgment.missing.all[0] if judgment.missing.all else None
        question = "Place the object, then type its distance in mm, or q to end: "
        if suggested is not None:
            place = format_quantity(suggested, "m")
            question = f"Place the object, then type its distance in mm, Enter for the distance {place}, or q to end: "
        while True:
            answer = display.ask(question)
            if answer is None or answer.strip().lower() in {"q", "quit", "end", "done"}:
                return None
            if not answer.strip():
                if suggested is not None:
                    return suggested
                continue
            try:
                return read_distance(answer)
            except PretouchError as error:
                display.say(str(error))


class ListedDistances:
    """A list of object distances for a calibration.

    A person or a linear stage moves the object to each distance.

    Args:
        distances: the distances in their order [m].
        done: distances that were recorded before [m], which are skipped.
        stage: command that moves a linear stage, with `{mm}` or `{m}` for the distance; None if a person sets it.
    """

    suggests = False

    def __init__(self, distances: Sequence[float], done: Sequence[float] = (), stage: str | None = None) -> None:
        self._rest = [d for d in distances if not any(abs(d - other) < 1e-9 for other in done)]
        self._stage = stage
        if stage is not None and "{mm}" not in stage and "{m}" not in stage:
            raise InvalidInputError(
                f"--stage: found {stage!r}, expected a command with {{mm}} or {{m}} in place of the distance, such as "
                "'move-stage {mm}'"
            )

    def move(self, judgment: Judgment, display: RecordDisplay) -> float | None:  # noqa: ARG002 - of the interface
        """Move the object to the next distance of the list."""
        if not self._rest:
            return None
        distance = self._rest.pop(0)
        if self._stage is not None:
            _run_stage(self._stage, distance)
        elif display.ask(f"Place the object at {format_quantity(distance, 'm')}, then press Enter: ") is None:
            return None
        return distance


def read_distance(text: str) -> float:
    """Read a distance such as `12 mm`, `1.2 cm` or `12`.

    A number without a unit is in mm.

    Args:
        text: the distance.

    Returns:
        The distance [m].

    Raises:
        InvalidInputError: the text is no distance, or it is negative or infinite.

    Examples:
        >>> read_distance("12"), read_distance("1.5 cm")
        (0.012, 0.015)
    """
    written = with_point(text.strip(), name="distance")
    is_bare = written.replace(".", "", 1).replace("-", "", 1).isdigit()
    distance = read_quantity(f"{written} mm" if is_bare else written, "m", name="distance")
    if not 0 <= distance < float("inf"):
        raise InvalidInputError(f"distance: found {written}, expected a distance of 0 mm or more")
    return distance


def read_distances(text: str) -> tuple[float, ...]:
    """Read a list of distances such as `0 mm, 5 mm`.

    In `0, 5, 10 mm`, the last unit applies to all numbers.

    Args:
        text: the list.

    Returns:
        The distances in their order [m].

    Raises:
        InvalidInputError: the list is empty, or a part of it is no distance.

    Examples:
        >>> read_distances("0, 5, 10 mm")
        (0.0, 0.005, 0.01)
    """
    parts = [part.strip() for part in text.split(";" if ";" in text else ",") if part.strip()]
    if not parts:
        raise InvalidInputError('--distances: found none, expected a list such as "0 mm, 5 mm, 10 mm"')
    parts = [with_point(part, name="--distances") for part in parts]
    unit = parts[-1].lstrip("-+.0123456789eE").strip()
    bare = [part.replace(".", "", 1).isdigit() for part in parts]
    return tuple(
        read_distance(f"{part} {unit}" if is_bare and unit else part) for part, is_bare in zip(parts, bare, strict=True)
    )


def _run_stage(command: str, distance: float) -> None:
    """Run the user's command that moves the linear stage."""
    words = shlex.split(command)
    values = {"{mm}": f"{1000 * distance:.9g}", "{m}": f"{distance:.12g}"}
    for mark, value in values.items():
        words = [word.replace(mark, value) for word in words]
    place = format_quantity(distance, "m")
    try:
        done = subprocess.run(  # noqa: S603 - the user's own command, without a shell
            words, capture_output=True, text=True, check=False, timeout=_SLOWEST, stdin=subprocess.DEVNULL
        )
    except FileNotFoundError:
        raise InvalidInputError(f"--stage: the command {words[0]!r} was not found; check its name and path") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SourceError(f"--stage: the stage did not reach the distance {place}; check the stage ({error})") from None
    if done.returncode:
        said = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise SourceError(
            f"--stage: the command {shlex.join(words)} failed with exit status {done.returncode}; check the stage "
            f"(output of the command: {said})"
        )
