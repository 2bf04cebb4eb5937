"""Check whether a sensor calibration is accurate enough for a gain.

If the calibration is not accurate enough, the check recommends measurements.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, finite_or_none
from pretouch._core.progress import note_work
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch._core.warning_codes import split_code
from pretouch.designs import Task
from pretouch.designs.quantities import size_of
from pretouch.simulation import SensorChain
from pretouch.uncertainty.reservations import recess_advice

from .appraisal import simulated_quantity

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport
    from pretouch.calibration.contact_check import WitnessCheck
    from pretouch.calibration.result import DrawnCurve


_DRAWS: Final = 100
_ALIKE: Final = 20  # factor on the draws; those with the nearest offsets are kept, as if the offset were known
_FAILING: Final = 0.05  # largest share of the draws that may fail
_HARDER: Final = 0.15  # allowed relative increase of the speed at contact
_ROOM: Final = 0.03  # share of a limit by which a design that lies exactly on the limit may exceed it
_SEED: Final = 1
_CLOSE: Final = 1e-9  # m


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationCheck(Value):
    """Simulated results of one gain with many possible sensor curves.

    All curves agree with the calibration readings. Each draw is another sensor: a curve, its offset, and the misfit of
    the chain. The controller subtracts its configured offset on all of them. The loop runs without noise, so that the
    calibration causes all differences.

    Args:
        draws: number of sensors.
        predicted: |l'| at contact on the fitted curve, on the same loop [m/s].
        low: 5 % quantile of |l'| over the sensors [m/s]; all three quantiles are None if some sensors have no contact.
        median: median of |l'| [m/s].
        high: 95 % quantile of |l'| [m/s].
        missing: number of sensors without contact.
        harder_count: number of sensors with a contact more than 15 % harder than predicted.
        broken: number of sensors on which the gain misses a limit that it meets on the fitted curve.
        failing: number of sensors with any of these faults.
        witness: results of the nominal encounter, in continuous time, on curves through the readings; None without
            contact.
        decisive: the largest source of error: `offset`, `curve` or `misfit`; empty if the calibration is good enough.
        remedy: what to measure, in words; empty if the calibration is good enough.
    """

    draws: int
    predicted: float
    low: float | None
    median: float | None
    high: float | None
    missing: int
    harder_count: int
    broken: int
    failing: int
    witness: WitnessCheck | None = None
    decisive: str = ""
    remedy: str = ""

    @property
    def is_good_enough(self) -> bool:
        """True if the calibration is accurate enough for the gain.

        At least 95 % of the sampled sensors, and the other fitted curves, must confirm the predicted contact.
        """
        return self.failing <= _FAILING * self.draws and (self.witness is None or self.witness.is_supported)

    @property
    def reason(self) -> str:
        """Why the calibration is not good enough, as a clause."""
        named = (
            (
                self.harder_count,
                f"with {self.harder_count} of these sensors, contact is more than {100 * _HARDER:.0f} % "
                "harder than predicted",
            ),
            (self.broken, f"a limit is missed with {self.broken} of these sensors"),
            (self.missing, f"there is no contact with {self.missing} of these sensors"),
        )
        counts = ", ".join(text for count, text in named if count)
        against = None if self.witness is None else self.witness.headline
        if counts:
            return (
                f"the calibration is not good enough: pretouch simulated {self.draws} sensors that agree with the "
                f"calibration readings. Result: {counts}"
            )
        return "the calibration is not good enough" + ("" if against is None else f": {_lower(against)}")

    @property
    def text(self) -> str:
        """A few sentences that summarize the calibration check."""
        if self.is_good_enough:
            kept = f"all but {self.failing}" if self.failing else "all"
            sentences = [
                f"The calibration is good enough for this gain: {kept} of {self.draws} simulated sensors agree with "
                "the fitted curve.",
                "These sensors were drawn at random from the fits to the readings.",
                self._spread,
                "Other curves through the readings do not contradict the result.",
            ]
            if self.witness is not None:
                sentences.append(f"Prediction in continuous time: {self.witness.text}.")
            return " ".join(sentences)
        reason = f"{self.reason[:1].upper()}{self.reason[1:]}."
        against = None if self.witness is None else self.witness.headline
        second = "" if against is None or _lower(against) in self.reason else f" {against}"
        source = f"The largest source of error in the calibration is its {self.decisive}: {self.remedy}."
        return f"{reason} {self._spread}{second} {source}"

    @property
    def _spread(self) -> str:
        """Text that compares contact speeds on the fitted and the sampled curves."""
        text = (
            "On the sampled loop without noise, the contact speed is "
            f"{format_quantity(self.predicted, 'm/s', 3)} with the fitted curve"
        )
        if self.low is None or self.high is None:
            return f"{text}."
        low, high = format_quantity(self.low, "m/s", 3), format_quantity(self.high, "m/s", 3)
        text = f"{text}, and {low} to {high} with 90 % of these sensors."
        from pretouch.calibration.contact_check import is_within  # noqa: PLC0415 - fits, only with a calibration

        if is_within(self.predicted, self.low, self.high):
            return text
        softer = self.predicted < self.low
        sentences = [
            text,
            f"So the fitted curve predicts a {'softer' if softer else 'harder'} contact than most of these sensors.",
        ]
        if softer:
            sentences.append(f"A contact that is up to {100 * _HARDER:.0f} % harder counts as agreement.")
        return " ".join([*sentences, "The sensors differ in curve, offset and curve error."])

    def to_dict(self) -> dict[str, Any]:
        """Return the calibration check as one JSON object in SI units."""
        open_ends = {"decisive": self.decisive or None, "remedy": self.remedy or None}
        return {"is_good_enough": self.is_good_enough, **asdict(self), **open_ends}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """Contact speeds and limited quantities of one gain with several sensors.

    A ratio is a limited quantity, divided by its limit. Speeds are NaN and ratios infinite without contact.
    """

    speed: FloatArray
    ratios: FloatArray

    def failures(self, predicted: _Outcome) -> tuple[BoolArray, BoolArray, BoolArray]:
        """Return which of three failures each sensor causes.

        The failures are missing contact, contact harder than predicted, and a missed limit.
        """
        missing = np.isnan(self.speed)
        allowed = np.maximum(1.0, (1 + _ROOM) * predicted.ratios[0])
        return (
            missing,
            ~missing & (self.speed > (1 + _HARDER) * predicted.speed[0]),
            ~missing & (self.ratios > allowed).any(axis=1),
        )

    def badness(self, predicted: _Outcome) -> tuple[int, float]:
        """Return a key for ranking sources of error.

        It consists of the number of failing sensors and the 95 % quantile of the contact speed.
        """
        failing = int(np.any(self.failures(predicted), axis=0).sum())
        return failing, float(np.quantile(np.where(np.isnan(self.speed), np.inf, self.speed), 0.95, method="higher"))


def check_calibration(task: Task, report: CalibrationReport, gain: float) -> CalibrationCheck | None:
    """Simulate the nominal encounter with many possible sensor curves.

    All curves agree with the calibration readings.

    Returns:
        The results; None if there are too few readings, or if the fitted curve leads to no contact.
    """
    if report.curves is None or report.offset is None:  # too few readings to draw other curves
        return None
    chain = _without_noise(task.loop.chain)
    from pretouch.calibration.contact_check import check_on_readings, measurement_that_helps  # noqa: PLC0415 - fits
    from pretouch.calibration.result import DrawnCurve  # noqa: PLC0415

    nominal = DrawnCurve(sensor=task.sensor, offset=report.offset.value)
    predicted = _run(task, gain, replace(chain, misfit=0.0), (nominal,))
    if np.isnan(predicted.speed[0]):
        return None
    sensors = tuple(_mount(curve, task) for curve in report.curves.draw(_DRAWS, _SEED))
    witness = check_on_readings(report.curves, report.offset.value, task.scenario, task.sensor, gain=gain, law=task.law)
    outcome = _run(task, gain, chain, sensors)
    missing, harder, broken = outcome.failures(predicted)
    ends = [finite_or_none(v) for v in np.quantile(outcome.speed, (0.05, 0.5, 0.95))]
    check = CalibrationCheck(
        draws=_DRAWS,
        predicted=float(predicted.speed[0]),
        low=ends[0],
        median=ends[1],
        high=ends[2],
        missing=int(missing.sum()),
        harder_count=int(harder.sum()),
        broken=int(broken.sum()),
        failing=int((missing | harder | broken).sum()),
        witness=witness,
    )
    if check.is_good_enough:
        return check
    if witness is not None and witness.suspect is not None:
        window = report.window
        repeat = measurement_that_helps(witness, report.offset, window.l_min, window.l_max)
        return replace(check, decisive="curve", remedy=repeat)
    decisive = _decisive(task, gain, sensors, outcome, predicted)
    return replace(check, decisive=decisive, remedy=_remedy(task, report, decisive))


def _without_noise(chain: SensorChain) -> SensorChain:
    """Return the sensor chain without noise. Runs then differ only by the error of the sensor curve."""
    return replace(
        chain, noise=0.0, relative_noise=0.0, distance_noise=0.0, jitter=0.0, dropout=0.0, random_phase=False
    )


def _mount(drawn: DrawnCurve, task: Task) -> DrawnCurve:
    """Return a sampled sensor curve, mounted like the fitted curve.

    It gets the same mounting depth and distance range. The sensor chain already has the controller's offset.
    """
    from pretouch.calibration.contact_check import mount  # noqa: PLC0415

    start = float(np.max(task.scenario.distance))
    return replace(drawn, sensor=mount(drawn, task.sensor, drawn.offset, start))


def _run(task: Task, gain: float, chain: SensorChain, sensors: tuple[DrawnCurve, ...]) -> _Outcome:
    """Simulate the nominal encounter once with each sensor; the i-th has the misfit of the i-th run."""
    own = 0.0 if task.calibration is None or task.calibration.offset is None else task.calibration.offset.value
    limits = [limit for limit in task.limits if limit.name != "gain"]
    speed, ratios = np.full(len(sensors), np.nan), np.full((len(sensors), len(limits)), np.inf)
    for i, drawn in enumerate(sensors):
        note_work(f"simulating the encounter with possible sensor {i + 1} of {len(sensors)}")
        there = replace(chain, offset=chain.offset + drawn.offset - own)
        loop = replace(task.loop.after(i), chain=there)
        result = loop.run(task.scenario, drawn.sensor, gain)
        if not np.all(result.touched):
            continue
        speed[i] = abs(float(result.relative_velocity))
        for k, limit in enumerate(limits):
            quantity = simulated_quantity(limit.quantity, result, gain, loop, task.impact)
            ratios[i, k] = float(size_of(limit.quantity, quantity)) / limit.limit
    return _Outcome(speed=speed, ratios=ratios)


def _decisive(task: Task, gain: float, drawn: tuple[DrawnCurve, ...], outcome: _Outcome, predicted: _Outcome) -> str:
    """Return the largest source of error in the calibration.

    It is `offset`, `curve` or `misfit`. Offset and curve are correlated, because another offset bends the curve through
    the same readings. Draws whose offset is nearest to the fitted one show the uncertainty that remains if the offset
    is known.
    """
    report: Any = task.calibration
    chain = _without_noise(task.loop.chain)
    value = report.offset.value
    many = report.curves.draw(_ALIKE * _DRAWS, _SEED)
    nearest = sorted(many, key=lambda curve: abs(curve.offset - value))[:_DRAWS]
    from pretouch.calibration.result import DrawnCurve  # noqa: PLC0415

    fitted = DrawnCurve(sensor=task.sensor, offset=value)
    smooth = _run(task, gain, replace(chain, misfit=0.0), drawn).badness(predicted)
    known_offset = _run(task, gain, chain, tuple(_mount(curve, task) for curve in nearest)).badness(predicted)
    rest = _run(task, gain, chain, (fitted,) * _DRAWS).badness(predicted)
    if chain.misfit and smooth < rest:
        return "misfit"
    failing = outcome.badness(predicted)
    return "offset" if known_offset[0] <= failing[0] / 2 and known_offset < failing else "curve"


def _remedy(task: Task, report: CalibrationReport, decisive: str) -> str:
    """Return advice on what to measure for a better calibration."""
    window, recess = report.window, getattr(task.sensor, "recess", 0.0)
    if decisive == "offset":
        readings = "more readings" if report.offset is not None and report.offset.kind == "measured" else "readings"
        return (
            f"record {readings} without an object in range, and add these readings to the calibration as "
            "its argument `no_object`"
        )
    if decisive == "misfit":
        apart = format_quantity(task.loop.chain.misfit_length, "m", 2)
        return (
            f"check how the distances were set, and calibrate again with steps of at most {apart} between "
            "distances. If the curve does not fit the readings near contact, mount the sensor farther behind the "
            "contact surface"
        )
    where = "" if report.slope is None else f" around {format_quantity(report.slope.worst_at, 'm', 3)}"
    parts = ["record readings at more distances, and more readings at each distance" + where]
    if window.l_min - recess > _CLOSE:
        nearest = format_quantity(window.l_min, "m")
        parts.append(f"record distances below {nearest}, or {recess_advice(window.l_min, recess)}")
    start = float(np.max(task.scenario.distance))
    if window.l_max - recess < start:
        parts.append(f"record distances up to {format_quantity(start + recess, 'm')}")
    if report.offset is not None and report.offset.kind == "fitted":
        parts.append("record readings without an object in range, which separate curve and offset")
    return "; ".join(parts)


def _lower(sentence: str) -> str:
    """Remove warning code, capital letter and period from a sentence."""
    text = split_code(sentence)[1]
    return f"{text[:1].lower()}{text[1:].removesuffix('.')}"
