"""What an encounter comes to: a status for every run, and the state in which it ended."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any

import numpy as np

from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import BoolArray

__all__ = ["ContactResult", "ContactState", "ContactStatus"]


class ContactStatus(IntEnum):
    """How a run ended. `label` is the word for it in files and JSON."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactState:
    """The state at the end of a run, and the largest demands on the robot until then; floats or arrays of one shape.

    Args:
        time: t [s], from the entry into the detection range.
        distance: l [m]; 0 at contact.
        position: x of the plant [m], absolute.
        velocity: x' of the plant [m/s].
        acceleration: x'' of the plant [m/s^2].
        displacement: x - x_d [m], the deviation from the reference.
        relative_velocity: l' [m/s]; negative at contact.
        virtual_force: F_p [N].
        largest_excursion: max |x - x_d| [m] over the whole motion.
        largest_travel: max |x - x(0)| [m] over the whole motion.
        largest_speed: max |x'| [m/s] over the whole motion.
        largest_acceleration: max |x''| [m/s^2] over the whole motion.
        largest_virtual_force: max |F_p| [N] over the whole motion.
    """

    time: Any
    distance: Any
    position: Any
    velocity: Any
    acceleration: Any
    displacement: Any
    relative_velocity: Any
    virtual_force: Any
    largest_excursion: Any
    largest_travel: Any
    largest_speed: Any
    largest_acceleration: Any
    largest_virtual_force: Any

    def as_dict(self) -> dict[str, Any]:
        """Return the fields by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactResult:
    """What `find_contact` returns, for one encounter or an array of them.

    Args:
        status: how each run ended: a ContactStatus, or an array of their numbers.
        method: "closed-form", "integration" or "uniform-motion".
        gain: the gain D_p of each run [N s].
        end: the state in which each run ended, whatever its status; always finite.
        closest_distance: the smallest distance of each run [m]; 0 at contact.
        settling_distance: the distance at which a run without contact comes to rest [m]; infinite where it does not.
        impulse_residual: |M dx~' + D dx~ + K int x~ dt - D_p d ln xi| relative to the largest of these terms and the
            momentum of the approach: an identity of L(1) and L(2) for every curve, so this certifies the computed
            motion. NaN for the uniform motion, which does not start from the given state.
    """

    status: Any
    method: str
    gain: Any
    end: ContactState
    closest_distance: Any
    settling_distance: Any
    impulse_residual: Any

    @property
    def reached(self) -> BoolArray:
        """Which runs ended in contact."""
        return np.asarray(np.asarray(self.status) == ContactStatus.CONTACT)

    @property
    def contact(self) -> ContactState:
        """The state at contact.

        Raises:
            ResultUnavailableError: a run did not end in contact; `status` says how it ended.
        """
        if not self.reached.all():
            status = ContactStatus(int(np.atleast_1d(self.status)[~np.atleast_1d(self.reached)][0]))
            count = int((~self.reached).sum())
            which = "the run" if self.reached.size == 1 else f"{count} of {self.reached.size} runs"
            raise ResultUnavailableError(
                f"contact: {which} did not end in contact ({status.label}: {status.meaning} "
                f"Nearest distance {float(np.min(np.asarray(self.closest_distance)[~self.reached])):.4g} m); "
                "read .end for the state in which it ended"
            )
        return self.end
