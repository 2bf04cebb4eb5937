"""From the law's impulse to the motion: delivery, force limit, contact force, admittance, limits of the motion."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pretouch.control import Output, Sample, Status
from pretouch.control.components import NO_LIMIT

from .damping import Push
from .motion import advance_admittance, limit_motion
from .sensing import Observation

FORCE_LIMITED, MOTION_LIMITED = int(Status.FORCE_LIMITED), int(Status.MOTION_LIMITED)
IN_CONTACT, INPUT_FAULT = int(Status.IN_CONTACT), int(Status.INPUT_FAULT)
_LARGEST_REFERENCE = 1e6  # beyond it, in SI units, a number is a fault and no reference of a robot
_ROUNDING = 1e-9


class Motion(NamedTuple):
    """The virtual object's motion relative to the reference: x~ [m] and x~' [m/s]."""

    position: float
    velocity: float


class Delivery(NamedTuple):
    """Impulse in delivery: constant force [N], remaining impulse [N s], impulse delivered ahead [N s], fading."""

    force: float
    rest: float
    ahead: float
    fading: float


class DriveState(NamedTuple):
    """State of `drive`: the impulse in delivery, the motion, the last reference position."""

    delivery: Delivery
    motion: Motion
    reference: float


def start_drive(position: float, velocity: float) -> DriveState:
    """Return the state at the start, without force, for a plant relative to its reference."""
    return DriveState(Delivery(0.0, 0.0, 0.0, 0.0), Motion(position, velocity), 0.0)


def drive(numbers: Any, state: DriveState, seen: Observation, push: Push, sample: Sample) -> tuple[DriveState, Output]:
    """Move the virtual object over one period.

    Args:
        numbers: parameters.
        state: what was before.
        seen: what the sensor said.
        push: what the law gives.
        sample: contact force and reference.

    Returns:
        The next state and the output.
    """
    n, s = numbers, state
    status = seen.status
    delivery, delivered = deliver(n, s.delivery, seen, push.impulse)
    virtual_force = max(min(delivered + push.force, n.largest_force), -n.largest_force)
    if abs(virtual_force) >= n.largest_force:
        status += FORCE_LIMITED
    contact_force, faulty = _checked(sample.contact_force, NO_LIMIT)
    if abs(contact_force) >= n.contact_threshold:
        status += IN_CONTACT
    total = virtual_force + n.contact_gain * contact_force
    wanted_position, wanted_velocity = advance_admittance(n.admittance, s.motion.position, s.motion.velocity, total)
    position, velocity, limited = limit_motion(
        n.limits, s.motion.position, s.motion.velocity, wanted_position, wanted_velocity
    )
    if limited:
        status += MOTION_LIMITED
    x, fault_x = _checked(sample.reference_position, _LARGEST_REFERENCE)
    v, fault_v = _checked(sample.reference_velocity, _LARGEST_REFERENCE)
    a, fault_a = _checked(sample.reference_acceleration, _LARGEST_REFERENCE)
    if fault_x or fault_v or fault_a:
        x, v, a = s.reference, 0.0, 0.0
        faulty = True
    if faulty:
        status += INPUT_FAULT
    period = n.limits.period
    output = Output(
        position=x + period * (v + period / 2 * a) + position,
        velocity=v + period * a + velocity,
        acceleration=a + (velocity - s.motion.velocity) / period,
        virtual_force=virtual_force,
        log_level=seen.log_level,
        status=status,
    )
    return DriveState(delivery, Motion(position, velocity), x), output


def deliver(numbers: Any, delivery: Delivery, seen: Observation, impulse: float) -> tuple[Delivery, float]:
    """Turn impulses into the force of this period.

    What the force limit does not let through is dropped: it would act when it is no longer called for.

    Args:
        numbers: parameters.
        delivery: what is on its way.
        seen: what the sensor said.
        impulse: what the law gives for a new reading [N s].

    Returns:
        What is on its way then, and the force [N].
    """
    n, period = numbers, numbers.limits.period
    steady, rest, ahead, fading = delivery
    if seen.usable:
        owed = impulse + rest
        due = owed - ahead
        # what was given ahead is taken off, but makes no force of its own: it waits for what it can be taken off
        covers = owed > 0.0 < due or owed < 0.0 > due
        steady = max(min(due / n.hold, n.largest_force), -n.largest_force) if covers else 0.0
        rest, ahead, fading = steady * n.hold, 0.0 if covers else -due, 1.0
    if seen.no_object:  # what was measured is still delivered; nothing follows it, and the next object owes nothing
        ahead = fading = 0.0
    if rest != 0.0:
        given = steady * period
        if abs(rest) <= abs(given) * (1 + _ROUNDING):
            return Delivery(steady, 0.0, ahead, fading), rest / period
        return Delivery(steady, rest - given, ahead, fading), steady
    if not seen.stale:
        return Delivery(steady, 0.0, ahead, fading), 0.0
    fading = max(fading - n.fade_step, 0.0)
    force = steady * fading
    ahead = 0.0 if seen.lost else ahead + force * period
    return Delivery(steady, 0.0, ahead, fading), force


def _checked(value: float, largest: float) -> tuple[float, bool]:
    """Return a number and False, or 0 and True if it is NaN or too large."""
    if math.isfinite(value) and abs(value) <= largest:
        return value, False
    return 0.0, True
