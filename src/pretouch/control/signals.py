"""What goes into the controller and what comes out of it, at each step."""

from __future__ import annotations

from enum import IntFlag
from typing import NamedTuple

__all__ = ["Output", "Sample", "Status"]


class Status(IntFlag):
    """What a step met: flags, of which any number may be set together.

    DETECTING: the filtered output is above the floor. STALE: a reading is due and none that can be used came.
    SATURATED, INVALID (no finite number, late, out of order), IMPLAUSIBLE (faster than any approach): why a reading was
    not used. LOST: no usable reading for longer than the timeout. FORCE_LIMITED, MOTION_LIMITED: a limit acts.
    IN_CONTACT: the contact force exceeds its threshold. INPUT_FAULT: contact force or reference are no finite numbers;
    the force is taken as 0, the reference stays where it was last.
    """

    NONE = 0
    DETECTING = 1
    STALE = 2
    SATURATED = 4
    INVALID = 8
    IMPLAUSIBLE = 16
    LOST = 32
    FORCE_LIMITED = 64
    MOTION_LIMITED = 128
    IN_CONTACT = 256
    INPUT_FAULT = 512


class Sample(NamedTuple):
    """What the controller is told at the start t_k of a period; any number may come, also NaN.

    Args:
        reading: the sensor's raw output [its unit].
        fresh: whether this reading came since the step before.
        age: how long ago it was measured [s].
        contact_force: force of the object on the plant along x [N]; negative where it pushes the plant back.
        reference_position: x_d at t_k [m].
        reference_velocity: x_d' at t_k [m/s].
        reference_acceleration: x_d'' [m/s^2], taken as constant over the period.
    """

    reading: float
    fresh: bool = True
    age: float = 0.0
    contact_force: float = 0.0
    reference_position: float = 0.0
    reference_velocity: float = 0.0
    reference_acceleration: float = 0.0


class Output(NamedTuple):
    """What the robot is to do over the period from t_k to t_k + T: the reference of the controller behind it.

    Args:
        position: x_v at t_k + T [m].
        velocity: x_v' at t_k + T [m/s].
        acceleration: x_v'' [m/s^2], its mean over the period.
        virtual_force: F_p [N], constant over the period, after its limit.
        log_level: ln(xi / floor) after the filters, 0 where nothing is detected.
        status: the flags of `Status`, added.
    """

    position: float
    velocity: float
    acceleration: float
    virtual_force: float
    log_level: float
    status: int
