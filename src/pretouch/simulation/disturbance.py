"""Define disturbances of the sensor readings, such as a broken cable or an object that leaves the beam."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch._core.units import format_quantity

KINDS: Final = ("cable", "reflectance", "object-leaves", "full-scale", "stuck")
"""The kinds of disturbances, in the order of their numbers in native/core/pretouch.h, which start with 1."""

MOST_DISTURBANCES: Final = 8
"""The largest number of disturbances of one sensor."""

_WORDS: Final = {
    "cable": "a broken cable: every reading is 0",
    "object-leaves": "the object leaves the beam: no signal",
    "full-scale": "every reading is at full scale",
    "stuck": "every reading repeats the last one",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """A disturbance of the sensor readings in a simulated run.

    It begins at a time, or when the object is first nearer than a distance. Give one of both.

    Args:
        kind: what happens to the readings while the disturbance lasts:
            "cable": every reading is 0, whatever offset and noise are;
            "reflectance": the signal xi is multiplied by `factor`;
            "object-leaves": the signal xi is 0; offset and noise remain. A sensor of distances reports that it sees no
        object;
            "full-scale": every reading is `highest` of the chain;
            "stuck": every reading repeats the last one before.
        time: the time at which it begins [s].
        distance: the distance of the object at which it begins [m].
        duration: how long it lasts [s]; by default until the end of the run.
        factor: for "reflectance", the ratio of the signals with and without the disturbance.

    Examples:
        >>> Disturbance(kind="reflectance", distance=0.02, factor=2.0).text
        'the signal is multiplied by 2 from a distance of 20 mm on'
    """

    kind: str
    time: float | None = quantity("s", None, sign="nonnegative", example='"60 ms"')
    distance: float | None = quantity("m", None, sign="positive", example='"20 mm"')
    duration: float | None = quantity("s", None, sign="positive", example='"50 ms"')
    factor: float | None = quantity("", None, sign="positive", example="2.0")

    def __post_init__(self) -> None:
        check_declared(self)
        if self.kind not in KINDS:
            raise InvalidInputError(
                f"kind: found {self.kind!r}, expected one of {', '.join(map(repr, KINDS))}",
                value=self.kind,
                limit=KINDS,
            )
        if (self.time is None) == (self.distance is None):
            found = "neither time nor distance" if self.time is None else "both time and distance"
            raise InvalidInputError(
                f"time: found {found}, expected one of them: the time at which the disturbance begins, or the distance "
                "of the object",
                value=(self.time, self.distance),
            )
        if (self.factor is not None) != (self.kind == "reflectance"):
            found = "no factor" if self.factor is None else f"the factor {self.factor:g}"
            raise InvalidInputError(
                f'factor: found {found} for the kind "{self.kind}", expected a factor for "reflectance" only, such as '
                "factor = 2.0",
                value=self.factor,
            )

    @property
    def text(self) -> str:
        """The disturbance in words."""
        what = _WORDS.get(self.kind, f"the signal is multiplied by {self.factor or 1.0:g}")
        if self.time is not None:
            text = f"{what} from {format_quantity(self.time, 's')} on"
        else:
            text = f"{what} from a distance of {format_quantity(self.distance or 0.0, 'm')} on"
        return text if self.duration is None else f"{text}, for {format_quantity(self.duration, 's')}"

    def numbers(self) -> tuple[float, ...]:
        """Return the parameters of the disturbance for the compiled simulation.

        The structure is pretouch_disturbance in native/core/pretouch.h.
        """
        return (
            float(KINDS.index(self.kind) + 1),
            math.inf if self.time is None else self.time,
            -math.inf if self.distance is None else self.distance,
            math.inf if self.duration is None else self.duration,
            1.0 if self.factor is None else self.factor,
        )


def checked_disturbances(disturbances: Any) -> tuple[Disturbance, ...]:
    """Check the disturbances of a sensor, and return them as a tuple."""
    try:
        listed = tuple(disturbances)
    except TypeError:
        listed = (None,)
    if not all(isinstance(one, Disturbance) for one in listed):
        raise InvalidInputError(
            f"disturbances: found {disturbances!r}, expected a list of Disturbance(...)", value=disturbances
        )
    if len(listed) > MOST_DISTURBANCES:
        raise InvalidInputError(
            f"disturbances: found {len(listed)} disturbances, expected at most {MOST_DISTURBANCES}; simulate the "
            "others in further runs",
            limit=MOST_DISTURBANCES,
        )
    return listed


def native_disturbances(disturbances: Iterable[Disturbance]) -> tuple[float, ...]:
    """Return the parameters of all disturbances, filled with zeros, for the compiled simulation."""
    rows = [one.numbers() for one in disturbances]
    return tuple(number for row in (*rows, *[(0.0,) * 5] * (MOST_DISTURBANCES - len(rows))) for number in row)
