"""Find the distances of an encounter at which no calibration data support the curve, and say what to do about it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.files import plain
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.motion import DAMPER, ContactStatus, ContinuousLaw, Obstacle, Plant, Reference, Scenario, find_contact
from pretouch.sensors import SensorModel

from .witness_check import WitnessCheck, check_on_readings

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport
    from pretouch.calibration.result import OffsetEstimate


_DECISIVE: Final = 0.05  # of the impulse of the virtual force: what may be given where no data support the curve
_EFFECTS: Final = {1: "impulse of the virtual force", 2: "effect of the drag, ln(1/\u03c1),"}
_PLACES: Final = 2001
_ROUNDING: Final = 1e-9  # of the impulse, likewise
_NO_DISTANCE: Final = 1e-9  # [m], far below any calibration, far above the rounding of l_min - recess


@dataclass(frozen=True, slots=True, kw_only=True)
class Reservations(Value):
    """What a calibration leaves open of one encounter; distances are from the contact surface.

    The virtual force is F_p = D_p d(ln xi)/dt, L(2), so whatever the motion, D_p times the change of ln xi between two
    distances is the impulse that it gives between them. The decisive part of the motion is where all but 5 % of that
    impulse are given. Under a virtual drag it is the integral of g^2, by which ln l' changes, that no motion changes.

    Args:
        report: the report of the fit.
        recess: how far the sensor's zero, from which the calibration counts, lies behind the contact surface [m].
        supported: the distances between which readings support the curve [m].
        start: the distance at which the encounter starts [m].
        share_nearer: the share of the impulse, or of the effect of a drag, that is given nearer than any reading.
        share_beyond: the share that is given beyond all readings.
        degree: of s' in the force of the law, by which shares are of one or the other.
        left: whether the nominal motion leaves the distances at which the curve is used, and so never comes to contact.
        recedes: whether it does so because the object recedes from the start on.
        speed: the speed at contact on the curve as it is extended [m/s]; None where contact is supported, or unknown.
        speed_without_force: the same where no virtual force acts nearer than any reading: what a sensor that says
            nothing there leaves of the mitigation.
        witness: the answer tried on the readings; None where it has no gain, or leads to no contact.
    """

    report: CalibrationReport
    recess: float
    supported: tuple[float, float]
    start: float
    share_nearer: float
    share_beyond: float
    degree: int = 1
    left: bool = False
    recedes: bool = False
    speed: float | None = None
    speed_without_force: float | None = None
    witness: WitnessCheck | None = None

    @property
    def is_refuted(self) -> bool:
        """Whether readings allow a contact that is harder than without mitigation, where the answer promises less."""
        return self.witness is not None and self.witness.harder > 0

    @property
    def is_contact_supported(self) -> bool:
        """Whether readings support the curve down to contact."""
        return self.supported[0] <= _NO_DISTANCE

    @property
    def headline(self) -> str | None:
        """What readings contradict, or which distances no data support, and what to measure; None where neither is."""
        against = None if self.witness is None else self.witness.headline
        if against is None:
            return self._extension
        if self._extension is None:
            return f"{against} Measure more distances between {' and '.join(self._measured_span)}, each several times."
        return f"{against} {self._extension}" if self.is_refuted else f"{self._extension} {against}"

    @property
    def _measured_span(self) -> tuple[str, str]:
        """The nearest and the farthest distance that matter, from the contact surface."""
        return format_quantity(max(self.supported[0], 0.0), "m"), format_quantity(
            min(self.supported[1], self.start), "m"
        )

    @property
    def _extension(self) -> str | None:
        """Which decisive distances no data support, and what to measure; None where data support all of them."""
        (near, far), (nearest, farthest) = self._limits, self._reasons
        start = format_quantity(self.start, "m")
        parts, remedies = [], []
        if not self.is_contact_supported:
            parts.append(f"from {near}{nearest} to contact at 0 mm")
            recess = recess_in_words(self.report.window.l_min)
            remedies.append(
                f'sink the sensor by recess = "{recess}", or calibrate it down to contact, at a lower gain of the '
                "sensor where its output clips"
            )
        if self.share_beyond > _DECISIVE:
            share = f"{100 * self.share_beyond:.0f} % of the {_EFFECTS[self.degree]} are given"
            parts.append(f"from the start at {start} to {far}{farthest}, where {share}")
            remedies.append(f"calibrate out to {start} with more readings at each distance, or start at {far}")
        if self.left:
            if self.recedes:
                remedies = ["give the obstacle a negative velocity, as of an approach: this object recedes"]
            mend = "; ".join(remedies) or "calibrate farther out"
            return (
                f"Not supported by data: before contact the motion leaves the distances at which data support the "
                f"fitted {self._model} curve, from {near}{nearest} to {far}{farthest}. To mend it, {mend}."
            )
        if not parts:
            return None
        return (
            f"Not supported by data: this answer rests on the fitted {self._model} curve being extended "
            f"{' and '.join(parts)}.{self._without_force(near)} To mend it, {'; '.join(remedies)}."
        )

    def _without_force(self, near: str) -> str:
        if self.speed is None or self.speed_without_force is None:
            return ""
        left, promised = (format_quantity(speed, "m/s") for speed in (self.speed_without_force, self.speed))
        return f" With no virtual force nearer than {near}, contact is at {left} instead of {promised}."

    @property
    def _model(self) -> str:
        return "" if self.report.best is None else self.report.best.model

    @property
    def _limits(self) -> tuple[str, str]:
        """The distances between which data support the curve."""
        near, far = self.supported
        return "contact" if self.is_contact_supported else format_quantity(near, "m"), format_quantity(far, "m")

    @property
    def _reasons(self) -> tuple[str, str]:
        """Why data support the curve no nearer and no farther, in brackets."""
        window, near = self.report.window, self.supported[0]
        counted = f", counted from the sensor's zero {format_quantity(self.recess, 'm')} behind the contact surface"
        told = [f" ({reason}{counted if self.recess else ''})" for reason in (window.start_reason, window.end_reason)]
        return told[0] if near >= -_NO_DISTANCE else "", told[1]

    @property
    def lines(self) -> tuple[str, ...]:
        """Which curve is used and where data support it, and what the controller must subtract, in sentences."""
        (near, far), (nearest, farthest) = self._limits, self._reasons
        found = [f"data support the {self._model} curve from {near}{nearest} to {far}{farthest}"]
        for share, where in ((self.share_nearer, f"nearer than {near}"), (self.share_beyond, f"beyond {far}")):
            if share > _ROUNDING:
                found.append(f"{100 * share:.2g} % of the {_EFFECTS[self.degree]} are given {where}")
        if self.witness is not None and self.witness.is_supported:
            found.append(self.witness.text)
        found += [f"left out: {text}" for text in self.report.left_out]
        if self.report.offset is not None:
            found.append(_offset_in_words(self.report.offset, self.report.calibration.unit))
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Return everything that JSON can hold, in SI; the offset is in the unit of the outputs."""
        window, offset = self.report.window, self.report.offset
        own = ("recess", "supported", "is_contact_supported", "share_nearer", "share_beyond", "left")
        told = ("value", "standard_error", "low", "high", "kind")
        return {
            "headline": self.headline,
            "name": self.report.calibration.name,
            "verdict": self.report.verdict,
            "reasons": list(self.report.reasons),
            "model": self._model,
            "window": [window.l_min, window.l_max],
            "window_reasons": [window.start_reason, window.end_reason],
            **{name: plain(getattr(self, name)) for name in (*own, "speed", "speed_without_force")},
            "witness": None if self.witness is None else self.witness.to_dict(),
            "left_out": list(self.report.left_out),
            "output_unit": self.report.calibration.unit,
            "offset": None if offset is None else {name: plain(getattr(offset, name)) for name in told},
        }

    def __str__(self) -> str:
        head = f"calibration {self.report.calibration.name}: {self.report.verdict}"
        return "\n".join(
            [head, *(f"  - {text}" for text in self.report.reasons), *(f"  {text}" for text in self.lines)]
        )

    def around_text(self, text: str) -> str:
        """Return the text of a result with the headline before it and the reservations after it."""
        return "\n\n".join(part for part in (self.headline, text, str(self)) if part)

    def around_dict(self, found: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON object of a result with `calibration` in it, and the headline first where there is one."""
        told = {**found, "calibration": self.to_dict()}
        if self.is_refuted:
            told |= {"status": "not-supported", "status_on_fitted_curve": found.get("status")}
        if self.headline is None:
            return told
        own = told.pop("headline", None)
        return {"headline": f"{self.headline} {own}" if own else self.headline, **told}


def reservations_of(report: CalibrationReport, answer: Any) -> Reservations:
    """Tell what a calibration leaves open of an answer.

    Args:
        report: the report of the fit that the sensor comes from.
        answer: a result of any verb, or a task: what has `scenario` and `sensor`, and `gain` where it has one.

    Returns:
        The reservations.

    Examples:
        >>> from pretouch.calibration import Calibration, rank_models
        >>> from pretouch.motion import Admittance
        >>> distances = [0.002 * i for i in range(1, 16)]
        >>> readings = Calibration(distances=distances, outputs=[2 * np.exp(-60 * d) for d in distances], unit="V")
        >>> report = rank_models(readings, models=("exponential-1",), offset="zero")
        >>> class Answer:
        ...     scenario = Scenario(
        ...         admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...         obstacle=Obstacle(position=0.03, velocity=-0.3),
        ...     )
        ...     sensor = replace(report.best.sensor, minimum_distance=0.0)
        ...     gain = -0.8
        >>> found = reservations_of(report, Answer())
        >>> found.supported, round(found.share_nearer, 3), found.speed < found.speed_without_force
        ((0.002, 0.03), 0.067, True)
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
    )
    gain: Any = getattr(answer, "gain", None)
    if gain is not None and report.curves is not None and report.offset is not None and not scenario.obstacle.course:
        witness = check_on_readings(report.curves, report.offset.value, scenario, sensor, gain=gain, law=law)
        reservations = replace(reservations, witness=witness)
    if scenario.shape or (gain is not None and np.ndim(gain)):
        return reservations
    run = law.contact(scenario, sensor, 0.0 if gain is None else gain)
    if run.status is ContactStatus.LEFT_RANGE:
        return replace(reservations, left=True, recedes=bool(scenario.relative_velocity > 0))
    if gain is None or reservations.is_contact_supported or not run.reached.all() or near >= min(start, far):
        return reservations
    return replace(
        reservations,
        speed=abs(float(run.end.relative_velocity)),
        speed_without_force=_speed_without_force(scenario, sensor, law, gain, near),
    )


def _effect(sensor: SensorModel, degree: int, distance: float, start: float) -> float:
    """Return what a law does from the start of an encounter to a distance, as far as the curve holds."""
    low, high = sensor.valid_range
    if degree == 1:
        return float(sensor.log_output(np.clip(distance, low, high)))
    near, far = (float(np.clip(place, low, high)) for place in (distance, start))
    places = np.linspace(near, far, _PLACES)
    return float(np.trapezoid(np.asarray(sensor.log_slope(places)) ** 2, places))


def _speed_without_force(
    scenario: Scenario, sensor: SensorModel, law: ContinuousLaw, gain: float, near: float
) -> float | None:
    """Return the speed at contact where the virtual force ends at a distance; None where there is no contact."""
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
    left = find_contact(rest, sensor, 0.0)
    return abs(float(left.end.relative_velocity)) if left.reached.all() else None


def recess_in_words(nearest: float) -> str:
    """Return the recess that puts contact where a curve starts [m from the sensor's zero], in whole um, never less.

    Examples:
        >>> recess_in_words(0.0075), recess_in_words(0.0123441)
        ('7.5 mm', '12.345 mm')
    """
    return f"{math.ceil(1e6 * nearest * (1 - 1e-12)) / 1e3:.10g} mm"


def _offset_in_words(offset: OffsetEstimate, unit: str) -> str:
    value = f"{offset.value:.4g} ± {offset.standard_error:.2g} {unit}".strip()
    return (
        f"the controller must subtract the offset {value} ({offset.kind}; 95 %: {offset.low:.4g} to {offset.high:.4g}) "
        "from each reading"
    )
