"""What goes into the controller and comes out at each step, and the structures of C in which its law has them.

The fields of the structures are explained in native/law/pretouch_law.h.
"""

from __future__ import annotations

import ctypes
from enum import IntFlag
from functools import partial
from typing import NamedTuple

from pretouch._core.native import Structure, numbers

_MEDIAN, _SECTIONS = 16, 4
_integers = partial(numbers, kind=ctypes.c_int32)


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


class RawSample(Structure):
    """A `Sample` in C."""

    _fields_ = (
        *numbers("reading", "age", "contact_force"),
        *numbers("reference_position", "reference_velocity", "reference_acceleration"),
        *_integers("fresh"),
    )


class RawOutput(Structure):
    """An `Output` in C."""

    _fields_ = (
        *numbers("position", "velocity", "acceleration", "virtual_force", "log_level"),
        *_integers("status"),
    )


class FilterSection(Structure):
    """A second-order section of the low-pass."""

    _fields_ = numbers("b0", "b1", "b2", "a1", "a2")


class SensingNumbers(Structure):
    """What `observe` needs to know: see `Conditioning`."""

    _fields_ = (
        *numbers("period", "sensor_period", "offset", "floor", "saturation", "timeout", "largest_rate"),
        *_integers("median_length", "sections"),
        ("low_pass", FilterSection * _SECTIONS),
    )


class MedianState(Structure):
    """The last readings, by arrival and in order."""

    _fields_ = (
        ("arrived", ctypes.c_double * _MEDIAN),
        ("ordered", ctypes.c_double * (_MEDIAN + 1)),
        *_integers("oldest"),
    )


class SensingState(Structure):
    """What `observe` remembers: the last usable reading, and the filters."""

    _fields_ = (
        *numbers("quiet", "measured", "level", "filtered", "log_level"),
        ("low_pass", (ctypes.c_double * 2) * _SECTIONS),
        ("median", MedianState),
        *_integers("running"),
    )


class Observation(Structure):
    """What a law is told about the sensor.

    Args:
        change: change of ln xi since the usable reading before; 0 where there is none.
        log_level: ln(xi / floor) >= 0, after the filters.
        level: xi itself, after the filters, at least the floor.
        elapsed: time in which ln xi changed so [s], between the two readings; 0 where there is no change.
        usable: a reading came that can be used.
        restarted: it is the first one, or the first one after the sensor was lost.
        detecting: xi is above the floor and the sensor is not lost.
        stale: a reading is due and has not come.
        lost: none has come for longer than the timeout.
        status: what is to be reported.
    """

    _fields_ = (
        *numbers("change", "log_level", "level", "elapsed"),
        *_integers("usable", "restarted", "detecting", "stale", "lost", "status"),
    )


class DamperNumbers(Structure):
    """Gain [N s], width of the release, rise of the ramp per period, whether only approaches are damped."""

    _fields_ = (*numbers("gain", "release", "ramp_step"), *_integers("approach_only"))


class DamperState(Structure):
    """Share of the gain in force, 0 to 1, and the mark that ln xi has to exceed where only approaches are damped."""

    _fields_ = numbers("ramp", "mark")


class DragNumbers(Structure):
    """What the virtual drag needs to know: see `VirtualDrag`, and native/law/pretouch_law.h for each."""

    _fields_ = (
        *numbers("drag", "variance", "relative_variance", "level_share", "rate_share", "width", "still"),
        *numbers("sensor_period", "hold", "own_advance", "known_acceleration", "period"),
        *numbers("mass", "damping", "stiffness"),
    )


class DragState(Structure):
    """Level and rate of ln xi, smoothed, the mark that the level has to exceed, and how long an approach lasts yet."""

    _fields_ = numbers("level", "rate", "mark", "hold")


class Push(Structure):
    """What a law gives in a step, negative where it pushes back.

    Args:
        impulse: for a new reading [N s], delivered as a constant force over one sensor period; 0 without one.
        force: over this period of the loop [N].
    """

    _fields_ = numbers("impulse", "force")


class AdmittanceNumbers(Structure):
    """The exact step from (x~, x~') under the force F: transition matrix and input vector."""

    _fields_ = numbers(
        "position_from_position",
        "position_from_velocity",
        "velocity_from_position",
        "velocity_from_velocity",
        "position_from_force",
        "velocity_from_force",
    )


class MotionLimits(Structure):
    """Period, largest speed, acceleration and excursion as numbers, `NO_LIMIT` where there is none."""

    _fields_ = numbers("period", "speed", "acceleration", "excursion")


class DriveNumbers(Structure):
    """What `drive` needs to know: see `Controller`."""

    _fields_ = (
        *numbers("hold", "fade_step", "largest_force", "contact_gain", "contact_threshold"),
        ("admittance", AdmittanceNumbers),
        ("limits", MotionLimits),
    )


class Delivery(Structure):
    """An impulse on its way: constant force [N], rest of the impulse [N s], what was given ahead [N s], fading."""

    _fields_ = numbers("steady", "rest", "ahead", "fading")


class MotionState(Structure):
    """The virtual object's motion relative to the reference: x~ [m] and x~' [m/s]."""

    _fields_ = numbers("position", "velocity")


class DriveState(Structure):
    """What `drive` remembers: the impulse on its way, the motion, the last reference position."""

    _fields_ = (("delivery", Delivery), ("motion", MotionState), *numbers("reference"))


class ControllerNumbers(Structure):
    """The parameters of a step with the letter's law."""

    _fields_ = (("sensing", SensingNumbers), ("drive", DriveNumbers), ("law", DamperNumbers))


class ControllerState(Structure):
    """The state of a step with the letter's law."""

    _fields_ = (("sensing", SensingState), ("drive", DriveState), ("law", DamperState))
