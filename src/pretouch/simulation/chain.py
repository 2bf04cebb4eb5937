"""Model a proximity sensor, which turns distances into delayed and noisy readings.

The stability of a loop depends on the motion and on its timing: when it samples, when its force acts, and for how long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.arguments import check_arguments
from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import OUTPUT, OUTPUT_RATE, check_declared, flag, quantity
from pretouch._core.units import format_quantity
from pretouch.control import Controller
from pretouch.control.components import format_output

from .disturbance import checked_disturbances, native_disturbances

if TYPE_CHECKING:
    from pretouch.calibration import SensorFit


Row = tuple[str, Cell]

_LOCKED: Final = 1e-6  # share of a period: with less phase drift, both clocks keep their phase for a million readings
_DRIFT: Final = 0.01  # share of a period: with less phase drift per reading, the phase stays similar in an encounter
_LONGEST_BEAT: Final = 102  # readings: by Dirichlet's theorem, a beat of at most 1 / _DRIFT exists for any ratio


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorChain:
    """Model of a sensor with sampling, noise and delay.

    The steps are exposure, offset, noise, clipping, quantization, dropouts and delay, in this order.

    The k-th exposure starts at phase + k / rate, shifted by its jitter, and the output is averaged over it. The sensor
    deviates from its curve by the misfit h: its output has the logarithm ln xi + h(l). Here h is a smooth random
    function of distance, drawn once per run, with the covariance misfit^2 exp(-d^2 / (2 misfit_length^2)) over runs. A
    reading is

        y = quantize(clip(mean xi + offset + crosstalk + drift t + noise)),

    available `delay` after the end of the exposure. Outputs are in the sensor's output unit, that of xi.

    Args:
        rate: readings per second [Hz], > 0.
        phase: start of the first exposure [s].
        random_phase: whether the phase is random in each run, uniform over a period, because the arrival of an object
            is not synchronized with the sensor.
        exposure: time over which a reading is averaged [s], at most one period.
        delay: time from the end of an exposure until the reading is available [s]: conversion and transfer.
        jitter: standard deviation of the start of an exposure [s], at most a quarter of the period.
        noise: standard deviation of a reading without a signal [output unit].
        relative_noise: additional standard deviation relative to xi; like `noise`, independent for every reading.
        misfit: standard deviation of h: relative deviation of the sensor from its curve, fixed during a run.
        misfit_length: correlation length of h [m]; on average, h changes its sign every pi misfit_length.
        offset: output from ambient light [output unit].
        crosstalk: output from emitter light without an object, such as reflections in a cover [output unit].
        drift: change of the offset [output unit per s].
        lowest: lower limit at which readings clip [output unit].
        highest: upper limit at which readings saturate [output unit].
        resolution: step of the readings [output unit]; 0 for none.
        dropout: probability that a reading is missing, below 1.
        measures_distance: whether the part measures a distance, such as a time-of-flight sensor; its driver converts
            the distance to xi by the sensor curve. Exposure, noise and resolution of the distance are applied before
            that.
        distance_noise: standard deviation of such a distance [m].
        distance_resolution: step of such distances [m]; 0 for none.
        disturbances: events that change the readings, such as a broken cable.

    Examples:
        >>> SensorChain(rate=100.0, exposure=0.002, delay=0.001).latency
        0.002
    """

    rate: float = quantity("Hz", sign="positive", example='"1 kHz"')
    phase: float = quantity("s", 0.0, sign="nonnegative")
    random_phase: bool = flag(False)
    exposure: float = quantity("s", 0.0, sign="nonnegative")
    delay: float = quantity("s", 0.0, sign="nonnegative")
    jitter: float = quantity("s", 0.0, sign="nonnegative")
    noise: float = quantity(OUTPUT, 0.0, sign="nonnegative")
    relative_noise: float = quantity("", 0.0, sign="nonnegative")
    misfit: float = quantity("", 0.0, sign="nonnegative")
    misfit_length: float = quantity("m", 0.0, sign="nonnegative")
    offset: float = quantity(OUTPUT, 0.0)
    crosstalk: float = quantity(OUTPUT, 0.0)
    drift: float = quantity(OUTPUT_RATE, 0.0)
    lowest: float = quantity(OUTPUT, -math.inf, infinite=True)
    highest: float = quantity(OUTPUT, math.inf, infinite=True)
    resolution: float = quantity(OUTPUT, 0.0, sign="nonnegative")
    dropout: float = quantity("", 0.0, sign="nonnegative")
    measures_distance: bool = flag(False)
    distance_noise: float = quantity("m", 0.0, sign="nonnegative")
    distance_resolution: float = quantity("m", 0.0, sign="nonnegative")
    disturbances: Any = field(default=(), metadata={"takes": "tuple[Disturbance, ...]"})

    def __post_init__(self) -> None:
        check_declared(self)
        object.__setattr__(self, "disturbances", checked_disturbances(self.disturbances))
        self._check_disturbances()
        if self.exposure > self.period * (1 + 1e-9):
            raise InvalidInputError(
                f"exposure: found {self.exposure:g} s, expected at most the period of {self.period:g} s between two "
                f"readings. The sensor rate is {self.rate:g} Hz",
                value=self.exposure,
                limit=self.period,
            )
        if self.random_phase and self.phase:
            raise InvalidInputError(
                f"phase: the argument phase = {self.phase:g} s is given together with random_phase = true; "
                "remove one of these two arguments"
            )
        if self.jitter > self.period / 4:
            raise InvalidInputError(
                f"jitter: found {self.jitter:g} s, expected at most a quarter of the sensor's period of "
                f"{self.period:g} s",
                value=self.jitter,
            )
        if not self.lowest < self.highest:
            raise InvalidInputError(
                f"highest: found the upper clipping limit {self.highest:g}, expected more than the lower clipping "
                f"limit {self.lowest:g}",
                value=self.highest,
            )
        if not self.dropout < 1:
            raise InvalidInputError(
                f"dropout: found {self.dropout:g}, expected a probability below 1. At a probability of 1, every "
                "reading is lost",
                value=self.dropout,
            )
        if self.misfit and not self.misfit_length:
            raise InvalidInputError(
                f"misfit_length: the sensor curve error (misfit) of {self.misfit:g} needs a correlation length. "
                'Set misfit_length to a length above 0 m, for example "5 mm"'
            )
        if (self.distance_noise or self.distance_resolution) and not self.measures_distance:
            raise InvalidInputError(
                "distance_noise, distance_resolution: allowed only for a sensor that measures a distance; set "
                "measures_distance to true, or omit both"
            )

    @property
    def additive_noise(self) -> float:
        """Standard deviation of a reading without the noise that depends on the signal [output unit].

        It includes the quantization.
        """
        return math.hypot(self.noise, self.resolution * 12**-0.5)

    @property
    def period(self) -> float:
        """The time between two sensor readings [s]."""
        return 1.0 / self.rate

    def _check_disturbances(self) -> None:
        """Raise an error if a disturbance does not fit the sensor."""
        kinds = {one.kind for one in self.disturbances}
        if "full-scale" in kinds and not math.isfinite(self.highest):
            raise InvalidInputError(
                "highest: the reading at full scale is unknown, but a disturbance sets the readings to full scale; set "
                "highest of the chain to the largest reading of the sensor"
            )
        if "reflectance" in kinds and self.measures_distance:
            raise InvalidInputError(
                "disturbances: found a change of reflectance for a sensor that measures a distance, which does not "
                "depend on the reflectance; remove this disturbance"
            )

    @property
    def latency(self) -> float:
        """The latency of the sensor [s].

        It is the time from the middle of an exposure until its reading is available.
        """
        return self.exposure / 2 + self.delay

    def numbers(self) -> tuple[float, ...]:
        """Return the parameters of the sensor for the compiled simulation.

        The structure is pretouch_chain in native/core/pretouch.h; booleans are 0 or 1.
        """
        return (
            *(self.rate, self.phase, self.exposure, self.delay, self.jitter, self.noise, self.relative_noise),
            *(self.offset + self.crosstalk, self.drift, self.lowest, self.highest, self.resolution, self.dropout),
            *(float(bool(self.measures_distance)), self.distance_noise, self.distance_resolution),
            *(float(bool(self.random_phase)), self.misfit, self.misfit_length),
            *native_disturbances(self.disturbances),
        )

    def rows(self) -> Iterator[Row]:
        """Yield table rows with the parameters of the sensor.

        Optional parameters that are zero are omitted.
        """
        yield "readings", f"{format_quantity(self.rate, 'Hz')}, one every {format_quantity(self.period, 's')}"
        start = f"after {format_quantity(self.phase, 's')} in every run"
        yield "first exposure", "at a random time within the period, in each run" if self.random_phase else start
        yield "exposure", Measured(self.exposure, "s")
        yield "delay after the exposure", Measured(self.delay, "s")
        yield "latency of a reading", f"{format_quantity(self.latency, 's')}, from the middle of its exposure"
        if self.measures_distance:
            yield "output", "a distance, which the sensor's driver converts to \u03be with the sensor curve"
            yield "noise of the distance", Measured(self.distance_noise, "m")
            yield "resolution of the distance", Measured(self.distance_resolution, "m")
        yield "noise without a signal", format_output(self.noise)
        yield "noise relative to \u03be", _percent(self.relative_noise)
        if self.misfit:
            length = f"correlation length {format_quantity(self.misfit_length, 'm')}"
            yield "misfit of the curve relative to \u03be", f"{_percent(self.misfit)}, random in each run, {length}"
        for label, value in (("ambient offset", self.offset), ("crosstalk", self.crosstalk), ("step", self.resolution)):
            if value:
                yield label, format_output(value)
        if self.drift:
            yield "drift", f"{self.drift:.4g} per s, in the sensor's output unit"
        if math.isfinite(self.lowest) or math.isfinite(self.highest):
            yield "clipping", f"below {self.lowest:.6g} and above {format_output(self.highest)}"
        if self.jitter:
            yield "jitter of an exposure", Measured(self.jitter, "s")
        if self.dropout:
            yield "missing readings", _percent(self.dropout)
        for one in self.disturbances:
            yield "disturbance", one.text


@check_arguments
def chain_of_fit(fit: SensorFit, *, rate: float, exposure: float = 0.0, delay: float = 0.0) -> SensorChain:
    """Return a sensor model from the fit of a calibration.

    Noise, curve error, offset, resolution and saturation level are those of the calibration.

    Args:
        fit: a fit by `fit_sensor` or `fit`; its noise is that of a single reading.
        rate: readings per second [Hz], which is unknown from a static calibration.
        exposure: time over which a reading is averaged [s].
        delay: time from the end of an exposure until the reading is available [s].

    Returns:
        The chain. Its noise is the scatter of readings at one distance; its misfit is the deviation of their means from
        the curve.

    Raises:
        InvalidInputError: `fit` is not a fit, but, for example, a report with several fits.
    """
    from pretouch.calibration import SensorFit as Fit  # noqa: PLC0415 - loops without a calibration start faster

    if not isinstance(fit, Fit):
        raise InvalidInputError(f"fit: found {type(fit).__name__}, expected a SensorFit", argument="fit", value=fit)
    saturation = fit.window.saturation
    return SensorChain(
        rate=rate,
        exposure=exposure,
        delay=delay,
        noise=fit.noise.output,
        relative_noise=fit.noise.relative,
        misfit=fit.noise.misfit,
        misfit_length=fit.noise.misfit_length,
        offset=fit.offset.value,
        resolution=fit.noise.resolution,
        highest=math.inf if saturation is None else saturation,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """Timing of a sampled control loop.

    It has the rate of the readings, and the delay and duration of the virtual force.

    Args:
        rate: readings per second 1/T > 0 [Hz].
        delay: time from the middle of an exposure until its force begins to act, tau >= 0 [s]: half of the exposure,
            processing, transfer, and waiting for the controller's next step. A median over N readings adds
            (N - 1) / 2 periods.
        hold: time for which the force of one difference acts [s]; by default one period. The impulse
            D_p (ln xi_k - ln xi_k-1) does not depend on it: a force that acts for a shorter time is larger.
        exposure: time over which a reading is averaged [s], at most one period.
        sections: second-order sections of a digital filter that runs at `rate`, in SciPy's format, one tuple of six
            numbers each; none by default.
        smoothing: time constant tau_s [s] of a first-order low-pass after these sections, with the weight
            1 - exp(-hold/tau_s) of a new reading; 0 for none.
        delay_range: largest reduction of the delay [s]. The delay is constant in a run and differs between runs, like
            the phase between sensor and controller. Limits are computed for the worst delay of the range.

    Examples:
        >>> LoopTiming(rate=100.0, delay=0.005).period
        0.01
    """

    rate: float = quantity("Hz", sign="positive")
    delay: float = quantity("s", 0.0, sign="nonnegative")
    hold: float | None = quantity("s", None, sign="positive")
    exposure: float = quantity("s", 0.0, sign="nonnegative")
    sections: Any = field(default=(), metadata={"takes": "tuple[tuple[float, ...], ...]"})
    smoothing: float = quantity("s", 0.0, sign="nonnegative")
    delay_range: float = quantity("s", 0.0, sign="nonnegative")

    def __post_init__(self) -> None:
        check_declared(self)
        object.__setattr__(self, "sections", _sections(self.sections))
        if self.exposure > self.period * (1 + 1e-9):
            raise InvalidInputError(
                f"exposure: found {self.exposure:g} s, expected at most the period of {self.period:g} s between two "
                f"readings. The sensor rate is {self.rate:g} Hz",
                value=self.exposure,
                limit=self.period,
            )
        if self.delay_range > self.delay * (1 + 1e-9):
            raise InvalidInputError(
                f"delay_range: found {self.delay_range:g} s, expected at most the delay of {self.delay:g} s",
                value=self.delay_range,
                limit=self.delay,
            )
        shortest = self.delay - self.delay_range
        if shortest < self.exposure / 2 * (1 - 1e-9):
            raise InvalidInputError(
                f"delay: found a shortest delay of {shortest:g} s, expected at least half of the exposure time of "
                f"{self.exposure:g} s. The delay starts in the middle of the exposure, and must last until its end",
                value=shortest,
            )

    @property
    def period(self) -> float:
        """The time T between two sensor readings [s]."""
        return 1.0 / self.rate

    @property
    def holding(self) -> float:
        """The time [s] for which the controller holds each virtual force.

        The controller computes the force from two successive readings.
        """
        return self.period if self.hold is None else self.hold

    @property
    def filters(self) -> tuple[tuple[float, ...], ...]:
        """All digital filters of the readings, in order.

        The smoothing filter is the last one.
        """
        if self.smoothing == 0:
            return tuple(self.sections)
        kept = math.exp(-self.holding / self.smoothing)
        return (*self.sections, (1 - kept, 0.0, 0.0, 1.0, -kept, 0.0))


@check_arguments
def timing_of(chain: SensorChain, controller: Controller, *, worst_ratio: bool = False) -> LoopTiming:
    """Compute the timing of a sampled control loop.

    A new reading waits for the next step of the controller. If the ratio of both rates is an integer, this wait is the
    same for all readings of a run. It follows from the chain's phase; with a random phase it is any time up to a
    period. For other ratios, the mean wait at the worst phase is used. The force of a difference acts for the sensor
    period in the controller's settings. A controller that is slower than its sensor uses the newest reading, so the
    loop has the controller's rate. A median over N readings counts as a delay of (N - 1) / 2 periods, which is exact
    for signals that only rise.

    Args:
        chain: the sensor chain; its jitter, noise and dropouts are ignored.
        controller: the controller; its limits are ignored. Of its law, only the gain and a `smoothing_time` count, see
            `pretouch.control.laws.Law`.
        worst_ratio: whether to assume the longest wait, as with an integer ratio of rates at the worst phase. This is
            needed for statements about all rates above a limit.

    Returns:
        The timing, with the moving average and the Butterworth filter of the controller, and the smoothing of its law.

    Examples:
        >>> from pretouch.control import Conditioning, VirtualAdmittance, VirtualDamper
        >>> controller = Controller(
        ...     period=1e-3,
        ...     conditioning=Conditioning(sensor_period=0.01, floor=1e-3, median_window=3),
        ...     law=VirtualDamper(gain=-0.7),
        ...     admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ... )
        >>> timing = timing_of(SensorChain(rate=100.0, exposure=0.002, delay=0.0015), controller)
        >>> round(timing.delay, 6)  # 1 ms of exposure, 1.5 ms, 0.5 ms until the next step, one period of 10 ms
        0.013
    """
    conditioning, period = controller.conditioning, controller.period
    rate = min(chain.rate, 1 / period)
    longest, shortest = (min(period, chain.period), 0.0) if worst_ratio else _waits(chain, period)
    median = (conditioning.median_window - 1) / 2 / rate
    designed = conditioning.sections(rate)
    hold = period if conditioning.sensor_period is None else conditioning.sensor_period
    return LoopTiming(
        rate=rate,
        delay=chain.latency + longest + median,
        hold=hold,
        exposure=chain.exposure,
        sections=[(s.b0, s.b1, s.b2, 1.0, s.a1, s.a2) for s in designed],
        smoothing=getattr(controller.law, "smoothing_time", 0.0),
        delay_range=longest - shortest,
    )


def _waits(chain: SensorChain, period: float) -> tuple[float, float]:
    """Return the longest and shortest time [s] that a finished reading waits for the controller."""
    step = min(period, chain.period)  # a newer reading replaces one that still waits
    ratio = max(chain.period, period) / step
    deviation = abs(ratio - round(ratio))
    if deviation < _LOCKED and not chain.random_phase:
        ready = (chain.phase + chain.exposure + chain.delay) / step
        wait = (math.ceil(ready - _LOCKED) - ready) * step
        return max(wait, 0.0), max(wait, 0.0)
    if deviation <= _DRIFT or chain.rate > 1 / period:
        return step, 0.0
    # the wait repeats after `beat` readings and takes values in steps of period / beat
    beat = next(q for q in range(2, _LONGEST_BEAT) if abs(q * ratio - round(q * ratio)) <= _DRIFT)
    return period / 2 * (1 + 1 / beat), period / 2 * (1 - 1 / beat)


def _sections(sections: Any) -> tuple[tuple[float, ...], ...]:
    rows = tuple(tuple(map(float, row)) for row in sections)
    for row in rows:
        if len(row) != 6 or not all(map(math.isfinite, row)) or row[3] == 0:
            raise InvalidInputError(
                f"sections: found the filter coefficients {row}, expected six finite numbers b0, b1, b2, a0, a1 and "
                "a2. The coefficient a0 must not be 0",
                value=row,
            )
    return tuple(tuple(v / row[3] for v in row) for row in rows)


def _percent(share: float) -> str:
    return f"{100 * share:.4g} %"
