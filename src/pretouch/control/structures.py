"""Define the C structures of a control step.

They hold inputs, outputs, parameters and state. native/law/pretouch_law.h explains the fields of the structures.
"""

from __future__ import annotations

import ctypes
from enum import IntEnum, IntFlag
from functools import partial
from typing import Final, NamedTuple

from pretouch._core.native import Structure, numbers

_MEDIAN, _SECTIONS = 16, 4
_integers = partial(numbers, kind=ctypes.c_int32)


class Status(IntFlag):
    """Status flags of a control step.

    Several flags may be set together. DETECTING: the filtered output is above the floor. STALE: a reading is due and no
    usable one arrived. SATURATED, INVALID (not finite, late or out of order), IMPLAUSIBLE (faster than any approach):
    the reason why a reading was rejected. LOST: no usable reading for longer than the timeout. FORCE_LIMITED,
    MOTION_LIMITED: a limit acts. IN_CONTACT: the contact force exceeds its threshold. INPUT_FAULT: the contact force or
    the reference is not finite; then the force counts as 0, and the reference keeps its last position.
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

    @property
    def meaning(self) -> str:
        """The meaning of a single status flag, in words."""
        return _MEANINGS[self]


_MEANINGS: Final = {
    Status.DETECTING: "an object is detected",
    Status.STALE: "the expected reading did not arrive, or could not be used",
    Status.SATURATED: "readings of a saturated sensor were ignored",
    Status.INVALID: "readings that are not finite, too old or out of order were ignored",
    Status.IMPLAUSIBLE: "readings that changed faster than largest_rate were ignored",
    Status.LOST: "there was no usable reading for longer than the timeout",
    Status.FORCE_LIMITED: "the virtual force was limited",
    Status.MOTION_LIMITED: "excursion, speed or acceleration was limited",
    Status.IN_CONTACT: "the contact force exceeds its threshold",
    Status.INPUT_FAULT: "contact force or reference was not finite",
}


class Arrival(IntEnum):
    """What the sensor delivered since the last control step.

    NOTHING; a READING; or NO_OBJECT: the sensor works and reports that it sees no object, as sensors of distances do.
    An object that vanishes or appears has not moved, so NO_OBJECT causes no force, and the next reading is a new start.
    """

    NOTHING = 0
    READING = 1
    NO_OBJECT = 2


class Sample(NamedTuple):
    """Inputs of the controller in one control period.

    The controller reads them at the start of the period. Any number is accepted, also NaN.

    Args:
        reading: raw output of the sensor [its unit]; ignored if the sensor sees no object.
        fresh: what arrived since the last step: True for the reading, False for nothing, or an `Arrival`.
        age: time since the reading was measured [s].
        contact_force: force of the object on the plant along x [N]; negative if it pushes the plant back.
        reference_position: x_d at t_k [m].
        reference_velocity: x_d' at t_k [m/s].
        reference_acceleration: x_d'' [m/s^2], assumed constant over the period.
    """

    reading: float
    fresh: bool | Arrival = True
    age: float = 0.0
    contact_force: float = 0.0
    reference_position: float = 0.0
    reference_velocity: float = 0.0
    reference_acceleration: float = 0.0


class Output(NamedTuple):
    """Reference motion of the robot for one control period.

    It is the output of a control step. The period lasts from t_k to t_k + T.

    Args:
        position: x_v at t_k + T [m].
        velocity: x_v' at t_k + T [m/s].
        acceleration: x_v'' [m/s^2], its mean over the period.
        virtual_force: F_p [N], constant over the period, after its limit.
        log_level: ln(xi / floor) after the filters; 0 if nothing is detected.
        status: sum of the flags of `Status`.
    """

    position: float
    velocity: float
    acceleration: float
    virtual_force: float
    log_level: float
    status: int


class RawSample(Structure):
    """Inputs of a control step as a C structure."""

    _fields_ = (
        *numbers("reading", "age", "contact_force"),
        *numbers("reference_position", "reference_velocity", "reference_acceleration"),
        *_integers("fresh"),
    )


class RawOutput(Structure):
    """Output of a control step as a C structure."""

    _fields_ = (
        *numbers("position", "velocity", "acceleration", "virtual_force", "log_level"),
        *_integers("status"),
    )


class FilterSection(Structure):
    """Coefficients of one second-order section of the low-pass filter for sensor readings."""

    _fields_ = numbers("b0", "b1", "b2", "a1", "a2")


class SensingNumbers(Structure):
    """Parameters for processing the sensor readings, as a C structure.

    See `Conditioning`.
    """

    _fields_ = (
        *numbers("period", "sensor_period", "offset", "floor", "saturation", "timeout", "largest_rate"),
        *_integers("median_length", "sections"),
        ("low_pass", FilterSection * _SECTIONS),
    )


class MedianState(Structure):
    """The latest readings in the median filter.

    They are stored in order of arrival and sorted by size.
    """

    _fields_ = (
        ("arrived", ctypes.c_double * _MEDIAN),
        ("ordered", ctypes.c_double * (_MEDIAN + 1)),
        *_integers("oldest"),
    )


class SensingState(Structure):
    """State of the sensor signal processing.

    It holds the latest usable reading and the filter states.
    """

    _fields_ = (
        *numbers("quiet", "measured", "level", "filtered", "log_level"),
        ("low_pass", (ctypes.c_double * 2) * _SECTIONS),
        ("median", MedianState),
        *_integers("latest"),
    )


class Observation(Structure):
    """The processed sensor signal, from which a control law computes its force.

    Args:
        change: change of ln xi since the previous usable reading; 0 if there is none.
        log_level: ln(xi / floor) >= 0, after the filters.
        level: xi after the filters, at least the floor.
        elapsed: time between the two readings of `change` [s]; 0 if there is no change.
        usable: a usable reading arrived.
        restarted: the reading is the first one, or the first one after `no_object` or after the sensor was lost.
        no_object: the sensor works and sees no object: the change of ln xi is undefined, thus 0.
        detecting: xi is above the floor and the sensor is not lost.
        stale: a reading is due and has not arrived.
        lost: no reading arrived for longer than the timeout.
        status: status flags.
    """

    _fields_ = (
        *numbers("change", "log_level", "level", "elapsed"),
        *_integers("usable", "restarted", "no_object", "detecting", "stale", "lost", "status"),
    )


class DamperNumbers(Structure):
    """Parameters of the virtual damper as a C structure.

    They include the gain [N s]. The others are the width of the release, the rise of the ramp per period, and whether
    the law acts on approaches only.
    """

    _fields_ = (*numbers("gain", "release", "ramp_step"), *_integers("approach_only"))


class DamperState(Structure):
    """State of the virtual damper.

    It holds the active fraction of the gain, and the level of ln(xi / floor) above which a rise counts. The level
    matters only if the law acts on approaches only.
    """

    _fields_ = numbers("ramp", "mark")


class DragNumbers(Structure):
    """Parameters of the virtual drag as a C structure.

    See `VirtualDrag` and native/law/pretouch_law.h.
    """

    _fields_ = (
        *numbers("drag", "variance", "relative_variance", "level_share", "rate_share", "width", "still"),
        *numbers("sensor_period", "hold", "own_advance", "known_acceleration", "period"),
        *numbers("mass", "damping", "stiffness"),
    )


class DragState(Structure):
    """State of the virtual drag.

    It holds the smoothed signal, its rate, the threshold for a rise, and the time until the approach ends. The signal
    is ln(xi / floor). The approach ends unless the signal rises above the threshold within this time [s].
    """

    _fields_ = numbers("level", "rate", "mark", "hold")


class Push(Structure):
    """Force and impulse of a control law in one step.

    Negative values push the robot back.

    Args:
        impulse: impulse of a new reading [N s], delivered as a constant force over one sensor period; else 0.
        force: force over this loop period [N].
    """

    _fields_ = numbers("impulse", "force")


class AdmittanceNumbers(Structure):
    """Transition matrix and input vector of the discretized admittance.

    The discretization is exact for a constant force per period. The admittance is equation L(1). The state is (x~,
    x~'), position and velocity relative to the reference.
    """

    _fields_ = numbers(
        "position_from_position",
        "position_from_velocity",
        "velocity_from_position",
        "velocity_from_velocity",
        "position_from_force",
        "velocity_from_force",
    )


class MotionLimits(Structure):
    """Control period and motion limits as a C structure.

    `NO_LIMIT` stands for a missing limit.
    """

    _fields_ = numbers("period", "speed", "acceleration", "excursion")


class DriveNumbers(Structure):
    """Parameters of the admittance and its limits as a C structure.

    They turn a force into the reference motion of the robot. See `Controller`.
    """

    _fields_ = (
        *numbers("hold", "fade_step", "largest_force", "contact_gain", "contact_threshold"),
        ("admittance", AdmittanceNumbers),
        ("limits", MotionLimits),
    )


class Delivery(Structure):
    """Remaining impulse of the control law, and the force that delivers it.

    This impulse acts on the admittance as a constant force over one sensor period. The fields are constant force [N],
    remaining impulse [N s], impulse delivered ahead [N s], and fading.
    """

    _fields_ = numbers("steady", "rest", "ahead", "fading")


class MotionState(Structure):
    """Position [m] and velocity [m/s] of the admittance, relative to the reference."""

    _fields_ = numbers("position", "velocity")


class DriveState(Structure):
    """State of the controller's admittance.

    It holds position and velocity, the last reference position, and the impulse not yet applied.
    """

    _fields_ = (("delivery", Delivery), ("motion", MotionState), *numbers("reference"))


class ControllerNumbers(Structure):
    """Parameters of a control step as a C structure.

    The control law is the virtual damper.
    """

    _fields_ = (("sensing", SensingNumbers), ("drive", DriveNumbers), ("law", DamperNumbers))


class ControllerState(Structure):
    """State of a control step as a C structure.

    The control law is the virtual damper.
    """

    _fields_ = (("sensing", SensingState), ("drive", DriveState), ("law", DamperState))
