"""Compare contact speeds on different sensor curves that fit the readings."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.motion import DAMPER, Admittance, ContactResult, ContinuousLaw, Obstacle, Scenario, find_contact
from pretouch.motion.many_curves import many_curves
from pretouch.motion.request import make_request
from pretouch.motion.scenario import map_fields
from pretouch.motion.solution import Solution
from pretouch.sensors import PiecewiseCubic, Recessed, SensorModel

from .result import AllowedCurves, DrawnCurve, OffsetEstimate

CLOSE: Final = 0.15
"""Relative tolerance of the speed at contact: a curve within it agrees with the prediction."""

_THROUGH: Final = 40  # curves through the readings
_UNDER: Final = 100  # weighted curves
_FEW: Final = 4, 6  # numbers of both kinds of curves for a law that is integrated one encounter after the other
_SEED: Final = 1
_DISAGREE: Final = 0.25  # largest share of the weighted curves that may disagree with the prediction
_QUANTILES: Final = (0.05, 0.95)  # a range that contradicts the prediction lies between these quantiles of each kind
_ALLOWED: Final = (0.01, 0.99)  # the range of allowed speeds lies between these quantiles of the weighted curves
_CAUSE: Final = 0.5  # share of the deviating curves, or of the variance, from which on a cause is decisive
_BEYOND: Final = 12  # points on the fitted curve on either side of the readings
_SMALLEST: Final = 1e-3  # smallest share of a drawn signal that remains after another offset is subtracted
_MOST: Final = 500  # encounters of an array that are checked
_HARDER: Final = 1.001  # times the speed without mitigation, beyond rounding
_SHOWN: Final = 0.005  # relative; a smaller difference does not show in three digits
_SAMPLES: Final = 60  # points at which a drawn curve that is not piecewise cubic is sampled
_REFERENCE_SPEED: Final = 0.3  # m/s
_PACE: Final = 2.0  # natural frequency of the reference encounter times its duration without mitigation
_REDUCED: Final = 1 / 3  # contact speed of the reference encounter relative to the speed without mitigation
_GAINS: Final = np.geomspace(0.05, 50.0, 80)  # gains among which that of the reference encounter is found


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessCheck(Value):
    """Result of testing a gain on many sensor curves.

    All curves fit the calibration readings. Some curves pass through the readings. The others are drawn from weighted
    fits, which may flatten under a soft ceiling, or ignore the nearest reading. The weights say how probable each curve
    is, so the weighted curves give the probable range of the contact speed.

    For an array of encounters, the numbers are those of the encounter with the largest disagreement.

    Args:
        curves: the number of curves.
        predicted: |l'| at contact on the fitted curve, the prediction [m/s].
        unmitigated: |l'| at contact without mitigation [m/s].
        low: the smallest |l'| at contact on these curves [m/s], without the lowest 5 % of either kind.
        high: the largest |l'| [m/s], without the highest 5 %.
        allowed_low: the smallest |l'| at contact on the weighted curves [m/s], without the lowest 1 %. A curve without
            contact counts as 0.
        allowed_high: the largest |l'| on the weighted curves [m/s], without the highest 1 %.
        share_outside: the share of the weighted curves on which |l'| differs from the prediction by more than 15 %.
        harder_count: the number of curves on which contact is harder than without mitigation, contrary to the
            prediction.
        is_contradicted: whether no curve through the readings agrees with the prediction within 15 %.
        suspect: the distance of a reading that causes most of the deviations if it is wrong [m]; None without.
        is_offset_decisive: whether the uncertain offset causes most of the deviations.
        encounters: the number of encounters that were checked.
        unsupported: the number of these whose prediction the readings do not support.
    """

    curves: int
    predicted: float
    unmitigated: float
    low: float
    high: float
    allowed_low: float
    allowed_high: float
    share_outside: float
    harder_count: int
    is_contradicted: bool
    suspect: float | None = None
    is_offset_decisive: bool = False
    encounters: int = 1
    unsupported: int = 0

    @property
    def is_supported(self) -> bool:
        """Whether the readings support the predicted contact speed."""
        return self.is_determined and not (self.is_contradicted or self.harder_count)

    @property
    def is_determined(self) -> bool:
        """Whether three of four weighted curves agree with the predicted contact speed.

        Unlike `is_supported`, it does not depend on curves through readings that the fit leaves out as outliers.
        """
        return self.share_outside <= _DISAGREE

    @property
    def is_precise(self) -> bool:
        """Whether the range of allowed contact speeds agrees with the predicted speed within 15 %."""
        return self.allowed_low >= (1 - CLOSE) * self.predicted and self.allowed_high <= (1 + CLOSE) * self.predicted

    @property
    def headline(self) -> str | None:
        """A warning that the readings do not support the predicted contact speed; None if they support it."""
        if self.is_supported:
            return None
        low, high, predicted, free = (
            format_quantity(v, "m/s", 3) for v in (self.low, self.high, self.predicted, self.unmitigated)
        )
        of = (
            " These speeds are those of the worst encounter. The readings do not support the prediction in "
            f"{self.unsupported} of {self.encounters} encounters."
            if self.encounters > 1
            else ""
        )
        if self.harder_count:
            return caution(
                "PT201",
                f"Not supported by the readings: on {self.harder_count} of {self.curves} sensor curves that fit "
                "the readings, contact is harder than without mitigation. Without mitigation, the contact speed is "
                f"{free}. The fitted curve predicts a contact speed of {predicted}.{of}",
            )
        return caution(
            "PT201",
            f"Not supported by the readings: the fitted curve predicts a contact speed of {predicted}, but other "
            f"curves that fit the readings predict {low} to {high}.{of}",
        )

    @property
    def spread(self) -> str | None:
        """The range of contact speeds that the readings allow, as a sentence.

        It is None if the readings do not support the prediction, or if the range agrees with it within 15 %.
        """
        if not self.is_supported or self.is_precise:
            return None
        low, high = (format_quantity(v, "m/s", 3) for v in (self.allowed_low, self.allowed_high))
        unit = low.rpartition(" ")[2]
        ends = f"{low.removesuffix(f' {unit}')} to {high}" if high.endswith(f" {unit}") else f"{low} to {high}"
        of = f" in the worst of {self.encounters} encounters" if self.encounters > 1 else ""
        if is_within(self.predicted, self.allowed_low, self.allowed_high):
            return f"The readings also allow sensor curves with which contact occurs at {ends}{of}."
        return f"But nearly all other sensor curves that fit the readings lead to contact at {ends}{of}."

    @property
    def text(self) -> str:
        """Text that compares the contact speeds on different sensor curves."""
        ends = (self.allowed_low, self.allowed_high) if self.is_supported else (self.low, self.high)
        low, high, predicted = (format_quantity(v, "m/s", 3) for v in (*ends, self.predicted))
        share = "98 %" if self.is_supported else "90 %"
        sentences = [
            f"on {share} of the sensor curves that fit the readings, the contact speed is {low} to {high}",
            f"The fitted curve predicts {predicted}",
        ]
        if not is_within(self.predicted, *ends):
            sentences += [
                "This prediction is outside of the range",
                f"A difference of up to {100 * CLOSE:.0f} % counts as agreement",
            ]
        return ". ".join(sentences)

    def to_dict(self) -> dict[str, Any]:
        """Return the gain test as a JSON dictionary in SI units."""
        return {"is_supported": self.is_supported, "is_precise": self.is_precise, **asdict(self)}


def is_within(value: float, low: float, high: float) -> bool:
    """Return True if a value lies in a range.

    The tolerance is 0.5 % at both ends.
    """
    return (1 - _SHOWN) * low <= value <= (1 + _SHOWN) * high


def reference_check(
    curves: AllowedCurves, offset: float, sensor: SensorModel, *, nearest: float, farthest: float
) -> WitnessCheck | None:
    """Test a calibration with the contact speed of a typical encounter.

    The object approaches at a constant speed from the largest usable distance. The gain reduces the contact speed to a
    third on the fitted curve, or as far as any gain can. The result is None if the fitted curve predicts no contact.

    The admittance is critically damped. Its natural frequency is twice the inverse of the time to contact without
    mitigation. So the ratios of contact speeds do not depend on the approach speed or on the mass.

    Args:
        curves: the curves that fit the readings.
        offset: the offset that the controller subtracts, in the unit of the outputs.
        sensor: the fitted curve, over the distance from the sensor's zero.
        nearest: the smallest usable distance [m], at which contact is placed.
        farthest: the largest usable distance [m].

    Returns:
        The check.
    """
    start = farthest - nearest
    mounted = Recessed(sensor=sensor, recess=nearest) if nearest > 0 else sensor
    frequency = _PACE * _REFERENCE_SPEED / start
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=2 * frequency, stiffness=frequency**2),
        obstacle=Obstacle(position=start, velocity=-_REFERENCE_SPEED),
    )
    fall = float(mounted.log_output(0.0) - mounted.log_output(start))
    if not fall > 0:
        return None
    gains = -_REFERENCE_SPEED / fall * _GAINS  # without spring and damper, the first factor would stop the approach
    speeds = _speed(find_contact(scenario, mounted, gains))
    if not np.isfinite(speeds).any():
        return None
    strong = np.flatnonzero(speeds <= _REDUCED * _REFERENCE_SPEED)
    gain = gains[strong[0] if len(strong) else int(np.nanargmin(speeds))]
    return check_on_readings(curves, offset, scenario, mounted, gain=float(gain), law=DAMPER)


def measurement_that_helps(check: WitnessCheck | None, offset: OffsetEstimate | None, near: float, far: float) -> str:
    """Return what to measure so that the readings allow fewer contact speeds, as a clause.

    Args:
        check: the test of a gain on curves that fit the readings.
        offset: the offset that the controller subtracts.
        near: the nearest measured distance [m].
        far: the farthest measured distance [m].

    Returns:
        The advice.
    """
    if check is not None and check.suspect is not None:
        at = format_quantity(check.suspect, "m")
        return f"repeat the reading at the distance {at} of the calibration, five times or more"
    if check is not None and check.is_offset_decisive and offset is not None:
        again = "ten more times" if offset.kind == "measured" else "ten times"
        return f"record the sensor output with no object {again}"
    ends = f"{format_quantity(near, 'm')} and {format_quantity(far, 'm')}"
    return f"measure the sensor output at more distances between {ends}, several times at each distance"


def check_on_readings(
    curves: AllowedCurves, offset: float, scenario: Scenario, sensor: SensorModel, *, gain: Any, law: ContinuousLaw
) -> WitnessCheck | None:
    """Test a gain with many sensor curves that fit the readings.

    The result is None if the fitted curve predicts no contact.

    Args:
        curves: the curves that fit the readings.
        offset: the offset that the controller subtracts, in the unit of the outputs.
        scenario: the encounters, of any shape.
        sensor: the fitted curve, as mounted and extended.
        gain: the gain of the law, of a shape that broadcasts with the scenario.
        law: the law in continuous time.

    Returns:
        The check.
    """
    if sensor.valid_range[0] > 0:
        return None
    shape = np.broadcast_shapes(scenario.shape, np.shape(gain))
    flat = map_fields(scenario, lambda v: np.broadcast_to(v, shape).ravel() if np.ndim(v) else v)
    gains, start = np.broadcast_to(gain, shape).ravel(), float(np.max(scenario.distance))
    every = np.unique(np.linspace(0, len(gains) - 1, min(len(gains), _MOST)).astype(int)) if shape else np.zeros(1, int)
    encounters = map_fields(flat, lambda v: v[every, None] if np.ndim(v) else v)
    gains = gains[every, None]
    predicted, free = (_speed(law.contact(encounters, sensor, g))[:, 0] for g in (gains, 0.0 * gains))
    through, under = (_THROUGH, _UNDER) if law.degree is not None else _FEW
    drawn = (*curves.through_readings(through, _SEED), *curves.draw(under, _SEED))
    mounted = tuple(mount(curve, sensor, offset, start) for curve in drawn)
    speeds = _speeds(law, encounters, mounted, gains)
    valid = np.isfinite(predicted) & np.isfinite(free)
    rows = zip(speeds[valid], predicted[valid], free[valid], strict=True)
    weighted = drawn[through:]
    checks = [_judge(row[:through], row[through:], p, f, weighted) for row, p, f in rows]
    if not checks:
        return None
    worst = max(
        checks,
        key=lambda check: (
            not check.is_supported,
            not check.is_precise,
            check.harder_count,
            check.share_outside,
            check.high,
        ),
    )
    unsupported = sum(not check.is_supported for check in checks)
    return replace(worst, encounters=len(checks), unsupported=unsupported)


def _judge(
    through: FloatArray, under: FloatArray, predicted: float, free: float, weighted: tuple[DrawnCurve, ...]
) -> WitnessCheck:
    """Compare the predicted contact speed with the speeds on other curves.

    The speeds `under` are those on the `weighted` curves.

    Returns:
        The comparison.
    """
    allowed_low, allowed_high = np.quantile(np.where(np.isfinite(under), under, 0.0), _ALLOWED)
    groups = [group[np.isfinite(group)] for group in (through, under)]
    ends = np.concatenate([np.quantile(group, _QUANTILES) for group in groups if len(group)] or [np.array([np.nan])])
    agreeing = np.abs(under - predicted) <= CLOSE * predicted
    reached = through[np.isfinite(through)]
    suspect, is_offset_decisive = _causes(under, ~agreeing, weighted)
    agrees = len(reached) > 0 and (1 - CLOSE) * reached.min() <= predicted <= (1 + CLOSE) * reached.max()
    return WitnessCheck(
        curves=len(through) + len(under),
        predicted=float(predicted),
        unmitigated=float(free),
        low=float(ends.min()),
        high=float(ends.max()),
        allowed_low=float(allowed_low),
        allowed_high=float(allowed_high),
        share_outside=float(np.mean(~agreeing)),
        harder_count=int((np.concatenate([through, under]) > _HARDER * free).sum()) if predicted <= free else 0,
        is_contradicted=not agrees,
        suspect=suspect,
        is_offset_decisive=is_offset_decisive,
    )


def _causes(speeds: FloatArray, deviating: BoolArray, curves: tuple[DrawnCurve, ...]) -> tuple[float | None, bool]:
    """Return why the contact speeds differ from the prediction.

    The first result is the distance of a nearest reading that must be wrong in most of the deviating curves, or None.
    The second result is whether the offset explains most of the variance of the speeds.
    """
    if not deviating.any():
        return None, False
    suspects = [curve.ignored for curve, deviates in zip(curves, deviating, strict=True) if deviates]
    known = [distance for distance in suspects if distance is not None]
    if len(known) > _CAUSE * len(suspects):
        return known[0], False
    complete = np.isfinite(speeds) & np.array([curve.ignored is None for curve in curves])
    offsets, speeds = np.array([curve.offset for curve in curves])[complete], speeds[complete]
    if len(speeds) < 3 or not np.ptp(offsets) > 0 or not np.ptp(speeds) > 0:
        return None, False
    return None, bool(np.corrcoef(offsets, speeds)[0, 1] ** 2 > _CAUSE)


def _speed(result: ContactResult) -> FloatArray:
    """Return the contact speed of each encounter [m/s]. The speed is NaN without contact."""
    return np.where(result.reached, np.abs(result.end.relative_velocity), np.nan)


def _speeds(
    law: ContinuousLaw, scenario: Scenario, curves: tuple[PiecewiseCubic, ...], gains: FloatArray
) -> FloatArray:
    """Return the contact speed [m/s] of each encounter with each sensor curve.

    Encounters have the shape (n, 1), and the result (n, m) for m curves.
    """
    if law != DAMPER:
        return np.column_stack([_speed(law.contact(scenario, curve, gains))[:, 0] for curve in curves])
    several = map_fields(scenario, lambda v: np.broadcast_to(v, (len(gains), len(curves))) if np.ndim(v) else v)
    wide = np.broadcast_to(gains, (len(gains), len(curves)))
    many = many_curves(curves[0], {}, curves, "auto")
    request = make_request(several, curves[0], wide, "auto", 600.0, many=many)
    return _speed(ContactResult(Solution(request), request.method))


def mount(drawn: DrawnCurve, sensor: SensorModel, offset: float, start: float) -> PiecewiseCubic:
    """Return a sensor curve after mounting and subtraction of the offset.

    The offset is subtracted, and the sensor's recess is included.

    Args:
        drawn: the curve, over the distance from the sensor's zero, and the offset that belongs to it.
        sensor: the fitted curve, as mounted; beyond the readings, the drawn curve continues with its shape.
        offset: the offset that the controller subtracts, in the unit of the outputs.
        start: the distance at which the encounter starts [m].

    Returns:
        The curve over the distance from the contact surface, from 0 to the start.
    """
    recess = sensor.bare[1]
    low, high = drawn.sensor.valid_range
    near, far = np.clip([low - recess, high - recess], 0.0, start)
    pieces = []
    if near > 0:
        pieces.append(_points_of(sensor, np.linspace(0.0, near, _BEYOND)))
    if far > near:
        inner = np.clip([recess + near, recess + far], low, high)
        pieces.append(_observed_points(drawn, float(inner[0]), float(inner[1]), offset, recess))
    if far < start:
        pieces.append(_points_of(sensor, np.linspace(far, start, _BEYOND)))
    distances, levels, slopes = (column.tolist() for column in pieces[0])
    for places, values, ends in pieces[1:]:
        levels += (values[1:] - values[0] + levels[-1]).tolist()
        distances += places[1:].tolist()
        slopes += ends.tolist()
    distances[0], distances[-1] = 0.0, start
    return PiecewiseCubic(distances=tuple(distances), log_outputs=tuple(levels), slopes=tuple(map(tuple, slopes)))


Points: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Distances [m], ln xi, and g [1/m] at both ends of each interval, as `PiecewiseCubic` has them."""


def _points_of(sensor: SensorModel, places: FloatArray) -> Points:
    slopes = np.asarray(sensor.log_slope(places))
    return places, np.asarray(sensor.log_output(places)), np.column_stack([slopes[:-1], slopes[1:]])


def _observed_points(drawn: DrawnCurve, low: float, high: float, offset: float, recess: float) -> Points:
    """Return points of a sensor curve after subtraction of the offset."""
    if isinstance(drawn.sensor, PiecewiseCubic):
        places, level, slopes = drawn.sensor.points(low, high)
    else:
        places, level, slopes = _points_of(drawn.sensor, np.linspace(low, high, _SAMPLES))
    shift = drawn.offset - offset
    if shift:
        signal = np.exp(level)
        share = signal / np.maximum(signal + shift, _SMALLEST * signal)
        level = level - np.log(share)
        slopes = slopes * np.column_stack([share[:-1], share[1:]])
    return places - recess, level, slopes
