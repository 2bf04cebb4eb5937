"""An axis of a sweep, as it is written on the command line."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import to_si

__all__ = ["read_axis"]

_FORM = "expected NAME=START:STOP:COUNT, with :log for equal ratios, or NAME=VALUE,VALUE,..."


def read_axis(text: str, units: Mapping[str, str]) -> tuple[str, FloatArray]:
    """Read the name of an input and its values.

    Args:
        text: `NAME=START:STOP:COUNT`, `NAME=START:STOP:COUNT:log` or `NAME=VALUE,VALUE,...`; values with their units,
            or bare in SI. Both ends are among the values.
        units: the SI unit of every input that may be named.

    Returns:
        The name and the values in SI.

    Raises:
        InvalidInputError: the text is not of that form, or the input is unknown.

    Examples:
        >>> name, values = read_axis("obstacle.velocity=-1 m/s:-1 cm/s:100", {"obstacle.velocity": "m/s"})
        >>> len(values), float(values[0]), float(values[-1])
        (100, -1.0, -0.01)
    """
    name, equals, given = (part.strip() for part in text.partition("="))
    if not (name and equals and given):
        raise InvalidInputError(f"--axis: found {text!r}, {_FORM}")
    if name not in units:
        near = get_close_matches(name, units, n=1)
        hint = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(units)}"
        raise InvalidInputError(f"--axis: found {name!r}, which is no input of this sweep; {hint}")
    parts = [part.strip() for part in given.split(":")]
    if len(parts) == 1:
        return name, np.array([to_si(part.strip(), units[name], name=name) for part in given.split(",")])
    if len(parts) not in {3, 4} or parts[3:] not in ([], ["log"]):
        raise InvalidInputError(f"--axis: found {text!r}, {_FORM}")
    start, stop = (to_si(part, units[name], name=name) for part in parts[:2])
    if not parts[2].isdecimal() or int(parts[2]) < 1:
        raise InvalidInputError(f"--axis: found {parts[2]!r} values of {name}, expected a whole number, 1 or more")
    if not parts[3:]:
        return name, np.linspace(start, stop, int(parts[2]))
    if not start * stop > 0:
        raise InvalidInputError(f"--axis: found {text!r}, expected ends of one sign and not zero for equal ratios")
    return name, np.geomspace(start, stop, int(parts[2]))
