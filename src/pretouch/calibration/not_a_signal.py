"""Recognize outputs that do not fall with the distance, such as distances or decay times, and say what to do."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pretouch._core.errors import UnitError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity, parse_unit, supported_digits
from pretouch._core.warning_codes import caution

from .averaging import AveragedCurve, ReadingNoise, average
from .data import Calibration
from .window import valley

_SCENARIO: Final = (
    "write a scenario file with `pretouch init --part VL53L0X`, and correct rate and noise in `[chain]` of this file."
)
_FOLLOWS: Final = 0.5, 2.0  # change of the reported distance, over that of the distance, between which it follows
_CORNER: Final = 0.05  # share of the largest lag of the reported distance within which the corner lies
_TIME: Final = parse_unit("s").exponents
_SOUND: Final = 2 / 370, 2 / 310  # increase of an echo time per distance [s/m], for speeds of sound of 370 to 310 m/s
_STEEPER: Final = 2.0  # times the rise in the nearer half, from which on an output rises most at its end
_STRAIGHT: Final = 0.05  # share of the range of the outputs by which a straight line may miss them
_FEWEST: Final = 5  # distances needed to see a straight line or an overflow
_INTEGERS: Final = (8, 16, 32)  # bits
_RESISTANCES: Final = ("ohm", "\u03a9", "\u2126")


def reported_distance(calibration: Calibration, curve: AveragedCurve) -> str:
    """Return the warning about a sensor that outputs distances."""
    unit = calibration.unit
    reported = curve.output * parse_unit(unit).factor
    text = f"The sensor output is a distance in {unit}"
    if len(reported) > 1:
        end = stuck_until(curve.distance, reported)
        far = format_quantity(float(curve.distance[end]), "m")
        if end == len(reported) - 1:
            level = format_quantity(float(np.median(reported)), "m", 3)
            return caution(
                "PT113",
                f"{text}, but up to the distance {far} it remains at about {level}: check power and wiring, the units "
                "of both columns, and whether the sensor sees the object.",
            )
        rate = _rate(curve.distance[end:], reported[end:])
        if not _FOLLOWS[0] <= rate <= _FOLLOWS[1]:
            return caution(
                "PT113",
                f"{text}, but it changes by {rate:.2g} mm per mm: check the units of both columns.",
            )
        if end:
            level = format_quantity(float(np.median(reported[:end])), "m", 3)
            return caution(
                "PT113",
                f"{text}, but it remains at about {level} up to the distance {far}, so the robot cannot see an object "
                f"that is nearer: use a sensor with a smaller minimum distance, or mount this sensor {far} or more "
                f"behind the contact surface; then {_SCENARIO}",
            )
    return caution("PT113", f"{text} and needs no calibration: {_SCENARIO}")


def stuck_until(distance: FloatArray, reported: FloatArray) -> int:
    """Return the index of the last distance up to which a reported distance does not follow; 0 if it always follows.

    A sensor that follows the distance reports at least half of any change. Near the sensor, many report their smallest
    distance.
    """
    changed = reported - reported[0]
    stays = np.abs(changed) < _FOLLOWS[0] * (distance - distance[0])
    stays[0] = False
    rest = np.flatnonzero(stays)
    if not len(rest):
        return 0
    # the last of them is beyond the corner, because the output has to catch up; from the corner on, it lags most
    last = int(rest[-1])
    if last == len(distance) - 1 and abs(changed[-1]) < _FOLLOWS[0] * (distance[-1] - distance[len(distance) // 2]):
        return last
    lag = (distance - distance[0] - changed)[: last + 1]
    return int(np.argmax(lag >= (1 - _CORNER) * lag.max()))


def _rate(distance: FloatArray, reported: FloatArray) -> float:
    """Return the median change of a reported distance per change of the distance."""
    first, second = np.triu_indices(len(distance), 1)
    return float(np.median((reported[second] - reported[first]) / (distance[second] - distance[first])))


def rising_output(calibration: Calibration, curve: AveragedCurve, noise: ReadingNoise) -> str:
    """Return the warning about a sensor whose output rises with distance."""
    both = falls_and_rises(calibration, curve, noise)
    if both:
        return both
    if _is_time(calibration.unit) and _is_straight(curve):
        rate = float(np.polyfit(curve.distance, curve.output * parse_unit(calibration.unit).factor, 1)[0])
        sound = ", like an echo at the speed of sound" if _SOUND[0] <= rate <= _SOUND[1] else ""
        return caution(
            "PT113",
            f"The sensor output is a time in {calibration.unit} that grows evenly with the distance, by "
            f"{rate * 1e3:.3g} us per mm{sound}, so it is a distance and needs no calibration: convert it to a "
            f"distance on the robot, and {_SCENARIO}",
        )
    if _is_inverse(calibration.unit):
        return caution(
            "PT113",
            f"The sensor output is in {calibration.unit} and rises with the distance, as a decay time or a resistance "
            f"does: replace each reading by its inverse, 1 / reading [1/{calibration.unit}], in the file and on the "
            "robot.",
        )
    top = float(max([calibration.outputs.max(), *calibration.no_object]))
    step = 10.0 ** (math.floor(math.log10(float(np.ptp(calibration.outputs)))) - 1)
    highest = f"{(math.floor(top / step) + 1) * step:g} {calibration.unit}".rstrip()  # above all, since 0 means lost
    backward = (
        "if the distances are positions that count toward contact, such as those of a stage, replace each by P minus "
        "the position, where P is the position at contact"
    )
    inverted = (
        f"if the electronics invert the signal, replace each reading by {highest} minus the reading, in the file and "
        "on the robot"
    )
    steep = _is_steepest_far(curve)
    where, first, second = (", most at its end", backward, inverted) if steep else ("", inverted, backward)
    return caution(
        "PT113",
        f"The sensor output rises with the distance{where}: {first}; {second}; if it is a decay time or a resistance, "
        f"replace it by its inverse instead; if the sensor reports a distance, {_SCENARIO}",
    )


def _is_steepest_far(curve: AveragedCurve) -> bool:
    """Return True if an output rises most at the largest distances, as an output does toward contact."""
    rise = np.interp([0.0, 0.5, 1.0], (curve.distance - curve.distance[0]) / np.ptp(curve.distance), curve.steady)
    return bool(rise[2] - rise[1] > _STEEPER * (rise[1] - rise[0]))


def falls_and_rises(calibration: Calibration, curve: AveragedCurve, noise: ReadingNoise) -> str:
    """Return the warning about an output that falls and rises again; empty if it does not."""
    turn = valley(curve, noise)
    if turn is None:
        return ""
    outputs = curve.steady[[turn, turn + int(np.argmax(curve.steady[turn:]))]]
    low, high = (f"{v:.{supported_digits(float(v))}g} {calibration.unit}".rstrip() for v in outputs)
    at = format_quantity(float(curve.distance[turn]), "m")
    return caution(
        "PT113",
        f"The sensor output falls up to the distance {at}, and rises again from {low} to {high} at larger distances, "
        "so an output does not determine the distance: find the cause, such as a wall, a second reflection or an "
        f"object that leaves the beam, and measure again, or remove the readings beyond to use only approaches "
        f"from nearer than {at}.",
    )


def overflowed_output(calibration: Calibration, curve: AveragedCurve) -> str:
    """Return the warning about integers that overflow near the sensor; empty if they do not.

    There the output of a signed integer continues with large negative values. Without the overflow, it falls with the
    distance.
    """
    outputs = calibration.outputs
    if not (outputs < 0).any() or (np.diff(curve.output) < 0).all() or (outputs % 1).any():
        return ""
    for bits in _INTEGERS:
        limit = 2 ** (bits - 1)
        if np.abs(outputs).max() > limit or np.ptp(outputs) < limit:
            continue
        restored = average(replace(calibration, outputs=np.where(outputs < 0, outputs + 2**bits, outputs))).output
        if len(restored) >= _FEWEST and (np.diff(restored) < 0).all():
            at = format_quantity(float(curve.distance[int(np.flatnonzero(curve.output < 0)[-1])]), "m")
            unit, digits = f" {calibration.unit}".rstrip(), supported_digits(float(curve.output.max()))
            return caution(
                "PT113",
                f"The sensor output jumps from {curve.output.max():.{digits}g}{unit} to negative values at distances "
                f"up to {at}, probably by an overflow of a signed {bits}-bit integer: read the output as an unsigned "
                f"integer, or add {2**bits} to each negative reading, in the file and on the robot.",
            )
    return ""


def _is_straight(curve: AveragedCurve) -> bool:
    """Return True if the averaged outputs lie on a straight line over the distance. A decay time bends upward."""
    if len(curve.distance) < _FEWEST:
        return False
    line = np.polyval(np.polyfit(curve.distance, curve.output, 1), curve.distance)
    return bool(np.abs(curve.output - line).max() < _STRAIGHT * np.ptp(curve.output))


def _is_inverse(unit: str) -> bool:
    """Return True for units of quantities that are inversely proportional to a photocurrent."""
    return unit.lower().endswith(_RESISTANCES) or _is_time(unit)


def _is_time(unit: str) -> bool:
    try:
        return parse_unit(unit).exponents == _TIME
    except UnitError:
        return False
