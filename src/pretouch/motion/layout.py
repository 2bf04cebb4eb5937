"""What the kernels read and write, by name and in their order. Shared by all that calls them."""

from __future__ import annotations

from enum import IntEnum
from typing import Final, NamedTuple

from pretouch._core.numbers import FloatArray


class Relative(NamedTuple):
    """Encounters relative to their reference, as L(8) and L(9) have them, with their gains: flat columns.

    Each has one number that all encounters share, or one for each. The motion of the reference is only needed for what
    is absolute.
    """

    mass: FloatArray  # M_a [kg]
    damping: FloatArray  # D_a [N s/m]
    stiffness: FloatArray  # K_a [N/m]
    x0: FloatArray  # x~(0) of the plant [m]
    u0: FloatArray  # x~'(0) of the plant [m/s]
    p: FloatArray  # x_o - x_d at t = 0 [m]
    v: FloatArray  # its velocity [m/s]
    a: FloatArray  # its acceleration [m/s^2]
    gain: FloatArray  # D_p [N s]
    reference_velocity: FloatArray  # x_d' at t = 0 [m/s]
    reference_acceleration: FloatArray  # x_d'' [m/s^2]


RELATIVE_INPUTS: Final = Relative._fields[:9]
"""What moves the distance: the admittance, plant and obstacle relative to the reference, and D_p."""

INPUTS: Final = len(RELATIVE_INPUTS)

PEAKS: Final = (
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_acceleration",
    "largest_virtual_force",
)
"""The largest demands until the end, max |x~| [m], |x - x(0)| [m], |x'| [m/s], |x''| [m/s^2] and |F_p| [N]."""

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
"""What the guaranteed paths write, one row per encounter."""

STATES: Final = (
    "time",
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "displacement_integral",
)
"""What the fast paths find at a contact."""

TRACE_COLUMNS: Final = ("distance", "displacement", "displacement_velocity", "displacement_acceleration")

RESOLUTION: Final = 1e-12
"""How close to zero a smallest distance is taken for zero, of the terms that l is the difference of."""


def named(rows: FloatArray) -> dict[str, FloatArray]:
    """Return views of rows of COLUMNS by their names."""
    return dict(zip(COLUMNS, rows.T, strict=True))


class ContactStatus(IntEnum):
    """How a run ended. `label` is the word for it in files and JSON.

    A distance that comes down to zero and turns there has touched: within 1e-12 of the terms that it is the difference
    of, a smallest distance is zero, and the run ends in CONTACT with l' = 0, by every method. A distance that only
    decays to zero never arrives: NEVER, with a settling distance of 0.
    """

    CONTACT = 0
    NEVER = 1
    HORIZON = 2
    LEFT_RANGE = 3
    UNRESOLVED = 4
    NO_UNIFORM_MOTION = 5

    @property
    def label(self) -> str:
        """The word for this status in files and JSON."""
        return _ENDINGS[self][0]

    @property
    def meaning(self) -> str:
        """One sentence for a person."""
        return _ENDINGS[self][1]


_ENDINGS: Final = (
    ("contact", "The distance reached zero."),
    ("never-in-contact", "The distance never reaches zero, however long one waits."),
    ("not-within-horizon", "The distance did not reach zero within the horizon."),
    ("left-valid-range", "The distance left the range in which the sensor curve holds."),
    ("unresolved", "The motion cannot be followed to its end: it is too fast, or starts beyond 8.8e12 m."),
    ("no-uniform-motion", "L(17) has no root with 0 <= |A| <= |v_o| that approaches."),
)
