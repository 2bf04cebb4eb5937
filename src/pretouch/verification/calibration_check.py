"""Is the calibration good enough? The gain on the sensors that its readings allow, and what to measure where not."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import BoolArray, FloatArray, finite_or_none
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.calibration import CalibrationReport
from pretouch.calibration.result import DrawnCurve
from pretouch.design import Task
from pretouch.simulation import SensorChain
from pretouch.uncertainty.reservations import recess_in_words
from pretouch.uncertainty.witness_check import WitnessCheck, check_on_readings, mount

from .appraisal import simulated_quantity

_DRAWS: Final = 100
_ALIKE: Final = 20  # times as many are drawn, of which those with the nearest offsets are taken: as if it were known
_FAILING: Final = 0.05  # of the draws
_HARDER: Final = 0.15  # of the speed at contact
_ROOM: Final = 0.03  # of a limit's quantity: what is on its limit by design is not moved beyond it by a calibration
_SEED: Final = 1
_CLOSE: Final = 1e-9  # m


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationCheck(Value):
    """What becomes of a gain on the sensors that the readings of its calibration allow.

    Each draw is another sensor: a curve, the offset that goes with it, and the misfit of the chain. The controller goes
    on subtracting the offset that it subtracts. The loop runs without noise, so that what differs is the calibration's.

    Args:
        draws: how many sensors.
        promised: |l'| at contact on the fitted curve, on the same loop [m/s].
        low: 5 % of the sensors stay below this |l'| [m/s]; None where some come to no contact, as the next two.
        median: half of them stay below.
        high: 95 % of them stay below.
        missing: on how many the gain comes to no contact.
        harder: on how many contact is more than 15 % harder than promised.
        broken: on how many a limit is missed that the fitted curve keeps.
        failing: on how many any of these.
        witness: the nominal encounter in continuous time, tried on curves through the readings; None where it comes to
            no contact.
        decisive: what matters most: `offset`, `curve` or `misfit`; empty where the calibration is good enough.
        remedy: what to measure, in words; likewise.
    """

    draws: int
    promised: float
    low: float | None
    median: float | None
    high: float | None
    missing: int
    harder: int
    broken: int
    failing: int
    witness: WitnessCheck | None = None
    decisive: str = ""
    remedy: str = ""

    @property
    def is_good_enough(self) -> bool:
        """Whether the gain does on 95 % of the sensors what it does on the fitted curve, and no reading contradicts."""
        return self.failing <= _FAILING * self.draws and (self.witness is None or self.witness.is_supported)

    @property
    def reason(self) -> str:
        """Why the calibration is not good enough, and what to measure, as one clause."""
        named = (
            (self.harder, f"contact is more than {100 * _HARDER:.0f} % harder than promised on {self.harder}"),
            (self.broken, f"a limit is missed on {self.broken}"),
            (self.missing, f"no contact comes on {self.missing}"),
        )
        counts = ", ".join(text for count, text in named if count)
        parts = [f"of {self.draws} sensors that its readings allow, {counts} ({self._spread})"] if counts else []
        against = None if self.witness is None else self.witness.headline
        if against is not None:
            parts.append(f"{against[:1].lower()}{against[1:-1]}")
        parts.append(f"its {self.decisive} matters most: {self.remedy}")
        return f"the calibration is not good enough: {'; '.join(parts)}"

    @property
    def text(self) -> str:
        """What was found, in a sentence."""
        if self.is_good_enough:
            wider = "" if self.witness is None else f" ({self.witness.text})"
            kept = f"{f'all but {self.failing}' if self.failing else 'all'} of {self.draws} sensors"
            return (
                f"The calibration is good enough for this gain: {kept} drawn from fits to its readings keep what the "
                f"fitted curve promises ({self._spread}), and curves through the readings do not contradict it{wider}."
            )
        return f"{self.reason[:1].upper()}{self.reason[1:]}."

    @property
    def _spread(self) -> str:
        promised = f"{format_quantity(self.promised, 'm/s')} promised"
        if self.low is None or self.high is None:
            return promised
        low, high = format_quantity(self.low, "m/s"), format_quantity(self.high, "m/s")
        return f"contact at {low} to {high} on 90 % of them, {promised}"

    def to_dict(self) -> dict[str, Any]:
        """Return everything that JSON can hold, in SI."""
        open_ends = {"decisive": self.decisive or None, "remedy": self.remedy or None}
        return {"is_good_enough": self.is_good_enough, **asdict(self), **open_ends}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """How the gain does on some sensors: speed and largest share of a limit of each, NaN and inf without contact."""

    speed: FloatArray
    ratios: FloatArray

    def failures(self, promised: _Outcome) -> tuple[BoolArray, BoolArray, BoolArray]:
        """Tell of each sensor whether it comes to no contact, to a harder one, to a broken limit."""
        missing = np.isnan(self.speed)
        allowed = np.maximum(1.0, (1 + _ROOM) * promised.ratios[0])
        return (
            missing,
            ~missing & (self.speed > (1 + _HARDER) * promised.speed[0]),
            ~missing & (self.ratios > allowed).any(axis=1),
        )

    def badness(self, promised: _Outcome) -> tuple[int, float]:
        """Return on how many sensors it fails and, among as many, how hard contact is."""
        failing = int(np.any(self.failures(promised), axis=0).sum())
        return failing, float(np.quantile(np.where(np.isnan(self.speed), np.inf, self.speed), 0.95, method="higher"))


def check_calibration(task: Task, report: CalibrationReport, gain: float) -> CalibrationCheck | None:
    """Return how the nominal encounter does with a gain [N s] on sensors that the readings of the calibration allow."""
    if report.curves is None or report.offset is None:  # too few readings to tell what they allow
        return None
    chain = _quiet(task.loop.chain)
    nominal = DrawnCurve(sensor=task.sensor, offset=report.offset.value)
    promised = _run(task, gain, replace(chain, misfit=0.0), (nominal,))
    if np.isnan(promised.speed[0]):
        return None
    drawn = tuple(_mounted(curve, task) for curve in report.curves.draw(_DRAWS, _SEED))
    witness = check_on_readings(report.curves, report.offset.value, task.scenario, task.sensor, gain=gain, law=task.law)
    found = _run(task, gain, chain, drawn)
    missing, harder, broken = found.failures(promised)
    ends = [finite_or_none(v) for v in np.quantile(found.speed, (0.05, 0.5, 0.95))]
    check = CalibrationCheck(
        draws=_DRAWS,
        promised=float(promised.speed[0]),
        low=ends[0],
        median=ends[1],
        high=ends[2],
        missing=int(missing.sum()),
        harder=int(harder.sum()),
        broken=int(broken.sum()),
        failing=int((missing | harder | broken).sum()),
        witness=witness,
    )
    if check.is_good_enough:
        return check
    decisive = _decisive(task, gain, drawn, found, promised)
    return replace(check, decisive=decisive, remedy=_remedy(task, report, decisive))


def _quiet(chain: SensorChain) -> SensorChain:
    """Return a chain that does the same in every run, but for its misfit."""
    return replace(
        chain, noise=0.0, relative_noise=0.0, distance_noise=0.0, jitter=0.0, dropout=0.0, random_phase=False
    )


def _mounted(drawn: DrawnCurve, task: Task) -> DrawnCurve:
    """Extend and sink a curve as the one that was fitted; the controller's offset is a matter of the chain."""
    start = float(np.max(task.scenario.distance))
    return replace(drawn, sensor=mount(drawn, task.sensor, drawn.offset, start))


def _run(task: Task, gain: float, chain: SensorChain, sensors: tuple[DrawnCurve, ...]) -> _Outcome:
    """Run the nominal encounter once on each sensor, the i-th with the misfit of the i-th run."""
    own = 0.0 if task.calibration is None or task.calibration.offset is None else task.calibration.offset.value
    limits = [limit for limit in task.limits if limit.name != "gain"]
    speed, ratios = np.full(len(sensors), np.nan), np.full((len(sensors), len(limits)), np.inf)
    for i, drawn in enumerate(sensors):
        there = replace(chain, offset=chain.offset + drawn.offset - own)
        loop = replace(task.loop.after(i), chain=there)
        result = loop.run(task.scenario, drawn.sensor, gain)
        if not np.all(result.touched):
            continue
        speed[i] = abs(float(result.relative_velocity))
        for k, limit in enumerate(limits):
            quantity = simulated_quantity(limit.quantity, result, gain, loop, task.impact)
            ratios[i, k] = abs(float(quantity)) / limit.limit
    return _Outcome(speed=speed, ratios=ratios)


def _decisive(task: Task, gain: float, drawn: tuple[DrawnCurve, ...], found: _Outcome, promised: _Outcome) -> str:
    """Return what matters most, found by leaving out the misfit, what is open of the offset, and all but the misfit."""
    # offset and curve are open together: a pedestal that is moved bends the curve through the same readings; so what is
    # left where the offset is known is told by those of many draws whose offset is nearest to the fitted one
    report: Any = task.calibration
    chain = _quiet(task.loop.chain)
    value = report.offset.value
    many = report.curves.draw(_ALIKE * _DRAWS, _SEED)
    nearest = sorted(many, key=lambda curve: abs(curve.offset - value))[:_DRAWS]
    fitted = DrawnCurve(sensor=task.sensor, offset=value)
    smooth = _run(task, gain, replace(chain, misfit=0.0), drawn).badness(promised)
    known = _run(task, gain, chain, tuple(_mounted(curve, task) for curve in nearest)).badness(promised)
    rest = _run(task, gain, chain, (fitted,) * _DRAWS).badness(promised)
    if chain.misfit and smooth < rest:
        return "misfit"
    failing = found.badness(promised)
    return "offset" if known[0] <= failing[0] / 2 and known < failing else "curve"


def _remedy(task: Task, report: CalibrationReport, decisive: str) -> str:
    """Say what to measure."""
    window, recess = report.window, getattr(task.sensor, "recess", 0.0)
    if decisive == "offset":
        again = "again, more often, " if report.offset is not None and report.offset.kind == "measured" else ""
        return f"record the output {again}with no object in range, and give it to the calibration as no_object"
    if decisive == "misfit":
        apart = format_quantity(task.loop.chain.misfit_length, "m", 2)
        return (
            f"check how distances were set, and calibrate anew at distances no farther apart than {apart}, or sink the "
            "sensor by a larger recess where the curve is missed near contact"
        )
    where = "" if report.slope is None else f" around {format_quantity(report.slope.worst_at, 'm', 3)}"
    parts = [f"measure at more distances and more often at each{where}"]
    if window.l_min - recess > _CLOSE:
        deeper = recess_in_words(window.l_min)
        parts.append(f'nearer than {format_quantity(window.l_min, "m")}, or sink the sensor by recess = "{deeper}"')
    start = float(np.max(task.scenario.distance))
    if window.l_max - recess < start:
        parts.append(f"out to {format_quantity(start + recess, 'm')}")
    if report.offset is not None and report.offset.kind == "fitted":
        parts.append("and record the output with no object in range, which tells curve and offset apart")
    return "; ".join(parts)
