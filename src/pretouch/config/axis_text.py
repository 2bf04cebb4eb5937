"""An axis of a sweep, as it is written on the command line."""

from __future__ import annotations

import math
from collections.abc import Mapping
from difflib import get_close_matches

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import read_quantity

__all__ = ["read_axis"]

_MOST = 10_000_000  # values of one axis: 80 MB
_DIGITS = 20
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
        return name, np.array([read_quantity(part.strip(), units[name], name=name) for part in given.split(",")])
    if len(parts) not in {3, 4} or parts[3:] not in ([], ["log"]):
        raise InvalidInputError(f"--axis: found {text!r}, {_FORM}")
    start, stop = (read_quantity(part, units[name], name=name) for part in parts[:2])
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise InvalidInputError(f"--axis: found {text!r}, expected finite ends")
    count = int(parts[2]) if parts[2].isdecimal() and len(parts[2]) < _DIGITS else 0
    if not 1 <= count <= _MOST:
        raise InvalidInputError(
            f"--axis: found {parts[2]!r} values of {name}, expected a whole number from 1 to {_MOST:,}"
        )
    if not parts[3:]:
        return name, np.linspace(start, stop, count)
    if not start * stop > 0:
        raise InvalidInputError(f"--axis: found {text!r}, expected ends of one sign and not zero for equal ratios")
    return name, np.geomspace(start, stop, count)
