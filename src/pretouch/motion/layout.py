"""Name the input and output columns of the compiled solvers.

The module also lists the ways in which an encounter can end.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final, NamedTuple

from pretouch._core.numbers import FloatArray


class Relative(NamedTuple):
    """Gain and inputs of encounters, relative to the reference position.

    They are the inputs of L(8) and L(9). Each column has one number that all encounters share, or one number per
    encounter. The motion of the reference is needed only for absolute quantities.
    """

    mass: FloatArray  # M_a [kg]
    damping: FloatArray  # D_a [N s/m]
    stiffness: FloatArray  # K_a [N/m]
    x0: FloatArray  # x~(0) of the plant [m]
    u0: FloatArray  # x~'(0) of the plant [m/s]
    p: FloatArray  # x_o - x_d at t = 0 [m]
    v: FloatArray  # its velocity [m/s]
    a: FloatArray  # its acceleration [m/s^2]
    gain: FloatArray  # the law's number, such as D_p [N s]
    reference_velocity: FloatArray  # x_d' at t = 0 [m/s]
    reference_acceleration: FloatArray  # x_d'' [m/s^2]


RELATIVE_INPUTS: Final = Relative._fields[:9]
"""The inputs that determine the distance: admittance, plant and obstacle relative to the reference, and D_p."""

INPUTS: Final = len(RELATIVE_INPUTS)

PEAKS: Final = (
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_acceleration",
    "largest_virtual_force",
)
"""The peak values until the end, max |x~| [m], |x - x(0)| [m], |x'| [m/s], |x''| [m/s^2] and |F_p| [N]."""

COLUMNS: Final = (
    "time",
    "distance",
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "virtual_force",
    *PEAKS,
    "closest_distance",
    "settling_distance",
    "displacement_integral",
)
"""Results of the most robust solver, one row per encounter."""

STATES: Final = (
    "time",
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "displacement_integral",
)
"""Results of the fast paths at a contact."""

TRACE_COLUMNS: Final = ("distance", "displacement", "displacement_velocity", "displacement_acceleration")

SECTION_COLUMNS: Final = ("since", "p", "v", "a")
"""A later section of an obstacle's path: start [s], and p, v, a of p + v t + a t^2 / 2 relative to the reference.

The time t starts with the encounter.
"""

DRAG_ROWS: Final = ("time", "distance", "square", "slope", "growth", "error")
"""Results of approaches under the virtual drag: t [s], l [m], l'^2, g [1/m], 2 k int g^2 dl, and the error of t."""

DRAG_PEAKS: Final = (
    "largest_rate",
    "rate_distance",
    "smallest_rate",
    "largest_velocity",
    "smallest_velocity",
    "largest_travel",
    "smallest_travel",
)
"""Peaks of approaches under the virtual drag.

They are those of k g^2 l'^2 [m/s^2], with the distance [m] of the largest one, and of velocity and travel of the robot.
"""

DRAG_NODES: Final = 16
"""Quadrature nodes of a distance interval of an approach under the virtual drag."""

RESOLUTION: Final = 1e-12
"""Smallest distance that counts as zero, relative to the terms whose difference is l."""


def by_name(rows: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of a result table by name.

    The columns are views, not copies.
    """
    return dict(zip(COLUMNS, rows.T, strict=True))


class ContactStatus(IntEnum):
    """How an encounter ended, for example in contact or without contact.

    `label` is the word for it in files and JSON.

    A distance that reaches zero and turns there is a touch: the run ends in CONTACT with l' = 0, by every method. A
    smallest distance counts as zero within 1e-12 of the terms whose difference it is. A distance that only decays to
    zero ends as NEVER, with a settling distance of 0.
    """

    CONTACT = 0
    NEVER = 1
    HORIZON = 2
    LEFT_RANGE = 3
    UNRESOLVED = 4
    NO_UNIFORM_MOTION = 5

    @property
    def label(self) -> str:
        """The name of this status in files and JSON."""
        return _ENDINGS[self][0]

    @property
    def words(self) -> str:
        """The description of this status in reports."""
        return _ENDINGS[self][1]

    @property
    def meaning(self) -> str:
        """A sentence that explains how an encounter with this status ended."""
        return _ENDINGS[self][2]


_ENDINGS: Final = (
    ("contact", "contact", "The distance reached zero."),
    ("never-in-contact", "never in contact", "The distance never reaches zero, even for an unlimited time."),
    ("not-within-horizon", "no contact within the longest time", "The distance did not reach zero within the horizon."),
    (
        "left-valid-range",
        "out of the range of the sensor curve",
        "The distance left the valid range of the sensor curve.",
    ),
    (
        "unresolved",
        "not computed to the end",
        "The motion cannot be computed to its end: it is too fast, or it starts beyond 8.8e12 m.",
    ),
    (
        "no-uniform-motion",
        "no uniform motion",
        "The uniform motion L(17) has no approaching root with 0 <= |A| <= |v_o|.",
    ),
)
