"""Warn if a motion passes distances without calibration readings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

import numpy as np

from pretouch._core.files import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution
from pretouch.motion import DAMPER, ContactStatus, ContinuousLaw, Obstacle, Plant, Reference, Scenario, find_contact
from pretouch.sensors import SensorModel
from pretouch.sensors.recessed import recess_in_words

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport
    from pretouch.calibration.contact_check import WitnessCheck
    from pretouch.calibration.result import OffsetEstimate


_DECISIVE: Final = 0.05  # largest share of the impulse that may act beyond the data without a warning
_EFFECTS: Final = {1: "impulse of the virtual force", 2: "effect of the drag, ln(1/\u03c1)"}
_PLACES: Final = 2001
_ROUNDING: Final = 1e-9  # smaller shares of the impulse are rounding errors
_NO_DISTANCE: Final = 1e-9  # [m], far below any calibration, far above the rounding of l_min - recess
_SAME_OFFSET: Final = 1e-9  # relative, far above rounding
_HARDER: Final = 1.001  # times the speed without mitigation, beyond rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Reservations(Value):
    """Warnings about an encounter that passes distances without calibration readings.

    Distances count from the contact surface.

    The letter's virtual force is F_p = D_p d(ln xi)/dt, L(2). So its impulse between two distances is D_p times the
    change of ln xi, whatever the motion. The decisive part of the motion gives all but 5 % of the impulse. Under a
    virtual drag, ln l' changes by an integral of g^2, which does not depend on the motion either.

    Args:
        report: the report of the fit.
        recess: how far the sensor's zero, from which the calibration counts, lies behind the contact surface [m].
        supported: the distances between which readings support the curve [m].
        start: the distance at which the encounter starts [m].
        share_nearer: the share of the impulse, or of a drag's effect, that acts nearer than any reading.
        share_beyond: the share that acts beyond all readings.
        degree: power of d(ln xi)/dt in the force of the law; 1: shares of the impulse, 2: shares of a drag's effect.
        leaves_range: whether the nominal motion leaves the distances at which the curve is used, and so never
            reaches contact.
        recedes: whether the object recedes at the start, in one encounter or more.
        speed: the speed at contact on the extended curve [m/s]; None if readings support contact, or the speed is
            unknown.
        speed_without_force: the speed at contact if no virtual force acts nearer than any reading [m/s], as with a
            sensor whose output does not change there; None in the same cases.
        speed_without_mitigation: the speed at contact without any virtual force [m/s]; None in the same cases.
        subtracted: the offset that the controller subtracts [unit of the outputs]; None if it is that of the
            calibration.
        witness: the check of the gain on the readings; None if there is no gain, or no contact.
    """

    report: CalibrationReport
    recess: float
    supported: tuple[float, float]
    start: float
    share_nearer: float
    share_beyond: float
    degree: int = 1
    leaves_range: bool = False
    recedes: bool = False
    speed: float | None = None
    speed_without_force: float | None = None
    speed_without_mitigation: float | None = None
    subtracted: float | None = None
    witness: WitnessCheck | None = None

    @property
    def is_refuted(self) -> bool:
        """True if a sensor curve that fits the readings predicts harder contact.

        Contact is then harder than without mitigation.
        """
        return self.witness is not None and self.witness.harder_count > 0

    @property
    def is_contact_supported(self) -> bool:
        """Whether calibration readings cover all distances down to contact."""
        return self.supported[0] <= _NO_DISTANCE

    @property
    def headline(self) -> str | None:
        """The main warning about the calibration, with a remedy.

        It is None if there is no reason for a warning.
        """
        contradiction = None if self.witness is None else self.witness.headline
        parts = [contradiction, self._extension] if self.is_refuted else [self._extension, contradiction]
        if contradiction is not None and self._extension is None:
            parts.append(self._measurement)
        parts += self.report.contradictions
        if not any(parts):
            return None
        return " ".join(part for part in (self._receding, *parts) if part)

    @property
    def spread(self) -> str | None:
        """The range of contact speeds that the readings allow, with the measurement that narrows it.

        It is None if the range agrees with the prediction within 15 %, or if the headline says that the readings do not
        support the prediction.
        """
        if self.witness is None or self.witness.spread is None:
            return None
        return f"{self.witness.spread} {self._measurement}"

    @property
    def _measurement(self) -> str:
        """Advice on what to measure so that the readings allow fewer contact speeds."""
        near, far = max(self.supported[0], 0.0), min(self.supported[1], self.start)
        from pretouch.calibration.contact_check import measurement_that_helps  # noqa: PLC0415 - fits, only with a calibration

        advice = measurement_that_helps(self.witness, self.report.offset, near, far)
        because = ""
        if self.witness is not None and self.witness.suspect is not None:
            because = ": it disagrees with the other readings, or no other reading confirms it"
        elif self.witness is not None and self.witness.is_offset_decisive:
            because = ", because the offset causes most of this range"
        return f"{advice[0].upper()}{advice[1:]}{because}."

    @property
    def _receding(self) -> str:
        """A warning that the object moves away at the start. The text is empty if the object approaches."""
        if not self.recedes:
            return ""
        remedy = " For an approach, give the obstacle a negative velocity." if self.leaves_range else ""
        return caution("PT203", f"The object recedes at the start.{remedy}")

    @property
    def _extension(self) -> str | None:
        """A warning about important distances without calibration readings."""
        (near, far), (nearest, farthest) = self._limits, self._reasons
        start = format_quantity(self.start, "m")
        parts, remedies, extrapolated = [], [], ""
        if not self.is_contact_supported:
            parts.append(f"from {near}{nearest} to contact at 0 mm")
            remedies.append(
                recess_advice(self.report.window.l_min, self.recess)
                + ", or calibrate the sensor down to contact, with a lower amplification if its output clips"
            )
        if self.share_beyond > _DECISIVE:
            parts.append(f"from the start at {start} to {far}{farthest}")
            extrapolated = (
                f" The sensor curve beyond {far} contributes {100 * self.share_beyond:.0f} % of the "
                f"{_EFFECTS[self.degree]}."
            )
            remedies.append(
                f"calibrate the sensor up to a distance of {start} with more readings at each distance, or start the "
                f"encounter at {far}"
            )
        if self.leaves_range:
            remedy = "; ".join(remedies) or "calibrate farther out"
            ending = "" if self.recedes else f" To remove this warning, {remedy}."
            return caution(
                "PT202",
                "Not supported by data: the motion leaves the calibrated distances before contact. The "
                f"calibration supports the fitted {self._model} curve from {near}{nearest} to "
                f"{far}{farthest}.{self._zero}{ending}",
            )
        if not parts:
            return None
        return caution(
            "PT202",
            f"Not supported by data: this result uses the fitted {self._model} curve where "
            f"the calibration has no usable readings: {' and '.join(parts)}."
            f"{extrapolated}{self._zero}{self._without_force(near)} To remove this warning, {'; '.join(remedies)}.",
        )

    @property
    def _zero(self) -> str:
        """A sentence that explains from which point distances in brackets are measured."""
        return f" Distances in brackets count from {self._sensor_zero}." if self.recess else ""

    @property
    def _sensor_zero(self) -> str:
        return (
            f"the zero of the sensor's distance scale, which is {format_quantity(self.recess, 'm')} behind the "
            "contact surface"
        )

    def _without_force(self, near: str) -> str:
        """Describe the contact speed without virtual force below the nearest measured distance."""
        if self.speed is None or self.speed_without_force is None:
            return ""
        speed, predicted = (format_quantity(v, "m/s") for v in (self.speed_without_force, self.speed))
        text = (
            f" If no virtual force acted at distances below {near}, the contact speed would be {speed} instead of "
            f"{predicted}."
        )
        unmitigated = self.speed_without_mitigation
        if unmitigated is None or self.speed_without_force <= _HARDER * unmitigated:
            return text
        return (
            f"{text} Contact at this speed is harder than without mitigation. Without mitigation, the contact speed is "
            f"{format_quantity(unmitigated, 'm/s')}."
        )

    @property
    def _model(self) -> str:
        return "" if self.report.best is None else self.report.best.model

    @property
    def _limits(self) -> tuple[str, str]:
        """The smallest and the largest distance that calibration readings cover, as text."""
        near, far = self.supported
        return "contact" if self.is_contact_supported else format_quantity(near, "m"), format_quantity(far, "m")

    @property
    def _reasons(self) -> tuple[str, str]:
        """The reasons why the calibration excludes smaller and larger distances.

        The distances in these reasons count from the sensor's zero.
        """
        window, near = self.report.window, self.supported[0]
        return f" ({window.start_reason})" if near >= -_NO_DISTANCE else "", f" ({window.end_reason})"

    @property
    def lines(self) -> tuple[str, ...]:
        """Notes on the sensor curve, its calibration and the subtracted offset."""
        (near, far), (nearest, farthest) = self._limits, self._reasons
        lines = [f"data support the {self._model} curve from {near}{nearest} to {far}{farthest}"]
        if self.recess:
            lines.append(
                f"distances in brackets and distances of excluded readings count from {self._sensor_zero}; all "
                "other distances count from the contact surface"
            )
        for share, where in ((self.share_nearer, f"nearer than {near}"), (self.share_beyond, f"beyond {far}")):
            if share > _ROUNDING:
                lines.append(
                    f"at distances {where}, the sensor curve is extrapolated; this part of the curve contributes "
                    f"{100 * share:.2g} % of the {_EFFECTS[self.degree]}"
                )
        if self.witness is not None and self.witness.is_supported:
            lines.append(self.witness.text)
        lines += [f"left out: {text}" for text in self.report.left_out]
        if self.report.offset is not None:
            lines.append(_offset_in_words(self.report.offset, self.report.calibration.unit, self._other_offset))
        return tuple(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return the warnings about the calibration as a JSON dictionary.

        The offset has the unit of the sensor output. All other numbers are in SI units.

        The offset is not in SI but in the unit of the outputs.
        """
        window, offset = self.report.window, self.report.offset
        names = ("recess", "supported", "is_contact_supported", "share_nearer", "share_beyond", "leaves_range")
        offset_names = ("value", "standard_error", "low", "high", "kind")
        return {
            "headline": self.headline,
            "name": self.report.calibration.name,
            "verdict": self.report.verdict,
            "reasons": list(self.report.reasons),
            "model": self._model,
            "window": [window.l_min, window.l_max],
            "window_reasons": [window.start_reason, window.end_reason],
            **{name: plain(getattr(self, name)) for name in (*names, "speed", "speed_without_force")},
            "witness": None if self.witness is None else self.witness.to_dict(),
            "contact_speed": self._contact_speed(),
            "left_out": list(self.report.left_out),
            "output_unit": self.report.calibration.unit,
            "offset": None if offset is None else {name: plain(getattr(offset, name)) for name in offset_names},
            "subtracted_offset": plain(self.subtracted if offset is None or self._other_offset else offset.value),
        }

    def _contact_speed(self) -> dict[str, Any] | None:
        """Return the contact speed on the fitted curve, and its range on the curves that the readings allow."""
        w = self.witness
        if w is None:
            return None
        return {"predicted": w.predicted, "low": w.allowed_low, "high": w.allowed_high, "unit": "m/s"}

    def __str__(self) -> str:
        head = f"calibration {self.report.calibration.name}: {self.report.verdict}"
        return "\n".join(
            [head, *(f"  - {text}" for text in self.report.reasons), *(f"  {text}" for text in self.lines)]
        )

    @property
    def verdict(self) -> str:
        """The verdict on the calibration and its offset in one line."""
        offset, unit = self.report.offset, self.report.calibration.unit
        text = f"Calibration {self.report.calibration.name}: {self.report.verdict}"
        if self.witness is not None and self.witness.headline is not None:
            text += ", but not accurate enough for this contact speed"
        if self.recess > 0:
            text += f", for a sensor that is mounted {format_quantity(self.recess, 'm')} behind the contact surface"
        if offset is None:
            return text
        level = f"{offset.value:.{offset.digits()}g} {unit}".rstrip()
        if self._other_offset:
            other = f"{self._other_offset} {unit}".rstrip()
            return (
                f"{text}, with an offset of {level}; the controller and exported laws subtract {other}, the offset of "
                "the scenario"
            )
        return f"{text}; the controller and exported laws subtract the offset {level}"

    @property
    def _other_offset(self) -> str:
        """The offset that the controller subtracts as text; empty if it is that of the calibration."""
        offset, subtracted = self.report.offset, self.subtracted
        if offset is None or subtracted is None or math.isclose(subtracted, offset.value, rel_tol=_SAME_OFFSET):
            return ""
        return f"{subtracted:.6g}"

    def with_spread(self, answer: str) -> str:
        """Return the first sentences of a result, followed by the range of contact speeds that the readings allow."""
        return answer if self.spread is None else f"{answer} {self.spread}"

    def around_text(self, text: str) -> str:
        """Add the calibration warnings and notes to a result's text.

        Returns:
            The main warning, the text with the allowed range of contact speeds, and all notes on the calibration.
        """
        answer, line_end, rest = text.partition("\n")
        text = f"{self.with_spread(answer)}{line_end}{rest}"
        return "\n\n".join(part for part in (self.headline, text, str(self)) if part)

    def around_dict(self, result: dict[str, Any]) -> dict[str, Any]:
        """Add the calibration warnings to the JSON dictionary of a result.

        Returns:
            The combined dictionary; a refuted result has the status `not-supported`.
        """
        combined = {**result, "calibration": self.to_dict()}
        if self.is_refuted:
            combined |= {"status": "not-supported", "status_on_fitted_curve": result.get("status")}
        if self.headline is None and self.spread is None:
            return combined
        parts = (self.headline, combined.pop("headline", None))
        return {"headline": self.with_spread(" ".join(part for part in parts if part)), **combined}


@runtime_checkable
class PredictedEncounter(Protocol):
    """A result, or a task, with an encounter that is predicted by a sensor curve."""

    @property
    def scenario(self) -> Scenario:
        """The encounter."""

    @property
    def sensor(self) -> SensorModel:
        """The sensor curve."""


def reservations_apply(answer: Any) -> bool:
    """Return whether warnings about the calibration apply to a result.

    They do not apply to results without a predicted encounter, such as the replay of a recording.

    Args:
        answer: a result of any verb, or a task.

    Returns:
        Whether the result has an encounter and a sensor.
    """
    return isinstance(answer, PredictedEncounter)


def reservations_of(report: CalibrationReport, answer: Any, *, subtracted: float | None = None) -> Reservations:
    """Find the calibration warnings that apply to a result.

    Args:
        report: the report of the fit that the sensor comes from.
        answer: a result of any verb, or a task: any value with `scenario`, `sensor` and, optionally, `gain`.
        subtracted: the offset that the controller subtracts [unit of the outputs]; by default, that of the calibration.

    Returns:
        The reservations.

    Examples:
        >>> from pretouch.calibration import Calibration, fit
        >>> from pretouch.motion import Admittance
        >>> distances = [0.002 * i for i in range(1, 16)]
        >>> readings = Calibration(distances=distances, outputs=[2 * np.exp(-60 * d) for d in distances], unit="V")
        >>> report = fit(readings, models=("exponential-1",), offset="zero")
        >>> class Answer:
        ...     scenario = Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.03, velocity=-0.3),
        ...     )
        ...     sensor = replace(report.best.sensor, minimum_distance=0.0)
        ...     gain = -0.8
        >>> reservations = reservations_of(report, Answer())
        >>> reservations.supported, round(reservations.share_nearer, 3)
        ((0.002, 0.03), 0.067)
        >>> reservations.speed < reservations.speed_without_force
        True
    """
    sensor, scenario = answer.sensor, answer.scenario
    recess = getattr(sensor, "recess", 0.0)
    near, far = report.window.l_min - recess, report.window.l_max - recess
    start = float(np.max(scenario.distance))
    law = getattr(answer, "law", DAMPER)
    degree = 2 if law.degree == 2 else 1
    places = (0.0, max(near, 0.0), min(far, start), start)
    contact, nearest, farthest, begin = (_effect(sensor, degree, d, start) for d in places)
    change = contact - begin
    reservations = Reservations(
        report=report,
        recess=recess,
        supported=(near, far),
        start=start,
        share_nearer=(contact - nearest) / change if change > 0 else 0.0,
        share_beyond=(farthest - begin) / change if change > 0 else 0.0,
        degree=degree,
        recedes=bool(np.any(np.asarray(scenario.relative_velocity) > 0)),
        subtracted=subtracted,
    )
    gain: Any = getattr(answer, "gain", None)
    if gain is not None and report.curves is not None and report.offset is not None and not scenario.obstacle.course:
        from pretouch.calibration.contact_check import check_on_readings  # noqa: PLC0415 - fits, only with a calibration

        witness = check_on_readings(report.curves, report.offset.value, scenario, sensor, gain=gain, law=law)
        reservations = replace(reservations, witness=witness)
    if scenario.shape or (gain is not None and np.ndim(gain)):
        return reservations
    run = law.contact(scenario, sensor, 0.0 if gain is None else gain)
    if run.status is ContactStatus.LEFT_RANGE:
        return replace(reservations, leaves_range=True)
    if gain is None or reservations.is_contact_supported or not run.reached.all() or near >= min(start, far):
        return reservations
    unmitigated = law.contact(scenario, sensor, 0.0)
    return replace(
        reservations,
        speed=abs(float(run.end.relative_velocity)),
        speed_without_mitigation=abs(float(unmitigated.end.relative_velocity)) if unmitigated.reached.all() else None,
        speed_without_force=_speed_without_force(scenario, sensor, law, gain, near),
    )


def _effect(sensor: SensorModel, degree: int, distance: float, start: float) -> float:
    """Return a measure of the control law's effect down to a distance.

    It is the log output or, for a drag, the integral of the squared slope.

    Degree 1: ln xi at the distance. Degree 2: the integral of g^2 from the distance to the start. Both within the valid
    range.
    """
    low, high = sensor.valid_range
    if degree == 1:
        return float(sensor.log_output(np.clip(distance, low, high)))
    near, far = (float(np.clip(place, low, high)) for place in (distance, start))
    places = np.linspace(near, far, _PLACES)
    return float(np.trapezoid(np.asarray(sensor.log_slope(places)) ** 2, places))


def _speed_without_force(
    scenario: Scenario, sensor: SensorModel, law: ContinuousLaw, gain: float, near: float
) -> float | None:
    """Return the contact speed if no virtual force acts below a distance."""
    end = law.contact(scenario, replace(sensor, minimum_distance=near), gain).end
    o, r, t = scenario.obstacle, scenario.reference, end.time
    rest = Scenario(
        admittance=scenario.admittance,
        obstacle=Obstacle(
            position=end.position + end.distance, velocity=o.velocity + o.acceleration * t, acceleration=o.acceleration
        ),
        plant=Plant(position=end.position, velocity=end.velocity),
        reference=Reference(
            position=r.position + r.velocity * t + 0.5 * r.acceleration * t**2,
            velocity=r.velocity + r.acceleration * t,
            acceleration=r.acceleration,
        ),
    )
    contact = find_contact(rest, sensor, 0.0)
    return abs(float(contact.end.relative_velocity)) if contact.reached.all() else None


def recess_advice(nearest: float, present: float) -> str:
    """Return advice on mounting the sensor behind the contact surface.

    At the advised recess, the sensor curve covers contact. Distances count from the sensor's zero [m].

    Examples:
        >>> recess_advice(0.021, 0.015)[:77]
        'mount the sensor 21 mm (now 15 mm) behind the contact surface, and set recess'
    """
    now, recess = f" (now {format_quantity(present, 'm')})" if present else "", recess_in_words(nearest)
    mounting = f'mount the sensor {recess}{now} behind the contact surface, and set recess = "{recess}"'
    return f"{mounting} (positions count from the new surface)"


def _offset_in_words(offset: OffsetEstimate, unit: str, other: str) -> str:
    if other:
        return (
            f"the controller and exported laws subtract {f'{other} {unit}'.rstrip()} from each reading, the offset of "
            f"the scenario; the {offset.kind} offset of the calibration is {offset.in_words(unit)} (95 % interval: "
            f"{offset.interval_in_words('')})"
        )
    return (
        f"the controller and exported laws subtract the {offset.kind} offset from each reading: "
        f"{offset.in_words(unit)} (95 % interval: {offset.interval_in_words('')})"
    )
