"""How an encounter can end."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["ContactStatus"]


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
        return _LABELS[self][0]

    @property
    def meaning(self) -> str:
        """One sentence for a person."""
        return _LABELS[self][1]


_LABELS = {
    ContactStatus.CONTACT: ("contact", "The distance reached zero."),
    ContactStatus.NEVER: ("never-in-contact", "The distance never reaches zero, however long one waits."),
    ContactStatus.HORIZON: ("not-within-horizon", "The distance did not reach zero within the horizon."),
    ContactStatus.LEFT_RANGE: ("left-valid-range", "The distance left the range in which the sensor curve holds."),
    ContactStatus.UNRESOLVED: ("unresolved", "The motion is too fast beside its duration to be followed to its end."),
    ContactStatus.NO_UNIFORM_MOTION: ("no-uniform-motion", "L(17) has no root with 0 <= |A| <= |v_o| that approaches."),
}
