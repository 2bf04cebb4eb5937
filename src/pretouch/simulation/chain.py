"""The sensor chain: what lies between the distance and the number that the controller is handed, and when it comes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pretouch._core.declared import OUTPUT, OUTPUT_RATE, check_declared, flag, quantity
from pretouch._core.errors import InvalidInputError
from pretouch.calibration import SensorFit

__all__ = ["SensorChain", "chain_of_fit"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorChain:
    """From distance to reading: exposure, pedestal, noise, clipping, quantization, dropouts, delay, in this order.

    The k-th exposure starts at phase + k / rate, shifted by its jitter, and the output is averaged over it. That is xi
    but for the misfit of the curve: ln xi + h(l), where h is a smooth function of distance, drawn once per run, that
    has the covariance misfit^2 exp(-d^2 / (2 misfit_length^2)) over runs. A reading is

        y = quantize(clip(mean xi + offset + crosstalk + drift t + noise)),

    handed over `delay` after the end of the exposure. Outputs are in the unit of the sensor curve's xi.

    Args:
        rate: readings per second [Hz], > 0.
        phase: start of the first exposure [s].
        random_phase: whether it is another one in each run, equally likely over a period: nobody tells an object when
            to come.
        exposure: over which time a reading averages [s], at most one period.
        delay: from the end of an exposure until the controller can have the reading [s]: conversion and transfer.
        jitter: standard deviation of the start of an exposure [s], at most a quarter of the period.
        noise: standard deviation of a reading where there is no signal [unit of xi].
        relative_noise: standard deviation relative to xi, on top; as `noise`, drawn anew for every reading.
        misfit: standard deviation of h: how far the sensor lies off its curve, relative to xi, in every reading of a
            run alike.
        misfit_length: correlation length of h [m]; it changes its sign every pi of these, on average.
        offset: ambient pedestal [unit of xi].
        crosstalk: light from emitter to receiver without an object, such as from a cover [unit of xi].
        drift: change of the pedestal [unit of xi per s].
        lowest: where readings clip below [unit of xi].
        highest: where readings saturate [unit of xi].
        resolution: step of the readings [unit of xi]; 0 for none.
        dropout: chance that a reading is missing, below 1.
        reports_distance: whether the part measures a distance, as one by time of flight does; its driver turns that
            into xi by the sensor curve. Exposure, noise and resolution of the distance then come before xi.
        distance_noise: standard deviation of such a distance [m].
        distance_resolution: step of such distances [m]; 0 for none.

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
    reports_distance: bool = flag(False)
    distance_noise: float = quantity("m", 0.0, sign="nonnegative")
    distance_resolution: float = quantity("m", 0.0, sign="nonnegative")

    def __post_init__(self) -> None:
        check_declared(self)
        if self.exposure > self.period * (1 + 1e-9):
            raise InvalidInputError(
                f"exposure: found {self.exposure:g} s, longer than the period of {self.period:g} s at {self.rate:g} Hz"
            )
        if self.random_phase and self.phase:
            raise InvalidInputError(f"phase: found {self.phase:g} s beside a random phase, expected one of the two")
        if self.jitter > self.period / 4:
            raise InvalidInputError(
                f"jitter: found {self.jitter:g} s, more than a quarter of the period of {self.period:g} s"
            )
        if not self.lowest < self.highest:
            raise InvalidInputError(
                f"highest: found {self.highest:g}, which must exceed the lowest reading ({self.lowest:g})"
            )
        if not self.dropout < 1:
            raise InvalidInputError(f"dropout: found {self.dropout:g}, which must be below 1: no reading would come")
        if self.misfit and not self.misfit_length:
            raise InvalidInputError(
                f"misfit_length: found 0 m beside a misfit of {self.misfit:g} of xi, expected the distance over which "
                'it is alike, such as "5 mm"'
            )
        if (self.distance_noise or self.distance_resolution) and not self.reports_distance:
            raise InvalidInputError("distance_noise, distance_resolution: only for a part that reports_distance")

    @property
    def period(self) -> float:
        """The time between two readings [s]."""
        return 1.0 / self.rate

    @property
    def latency(self) -> float:
        """The time from the middle of an exposure until its reading can be had [s]."""
        return self.exposure / 2 + self.delay

    def numbers(self) -> tuple[float, ...]:
        """Return the fields of pretouch_chain in native/core/pretouch.h; truth values are 0 or 1."""
        return (
            *(self.rate, self.phase, self.exposure, self.delay, self.jitter, self.noise, self.relative_noise),
            *(self.offset + self.crosstalk, self.drift, self.lowest, self.highest, self.resolution, self.dropout),
            *(float(bool(self.reports_distance)), self.distance_noise, self.distance_resolution),
            *(float(bool(self.random_phase)), self.misfit, self.misfit_length),
        )


def chain_of_fit(fit: SensorFit, *, rate: float, exposure: float = 0.0, delay: float = 0.0) -> SensorChain:
    """Make a chain whose noise, misfit, offset, resolution and saturation are those of a fitted calibration.

    Args:
        fit: what `fit_sensor` or `rank_models` gave; its noise is that of a single reading.
        rate: readings per second [Hz], which a static calibration does not tell.
        exposure: over which time a reading averages [s].
        delay: from the end of an exposure until the reading can be had [s].

    Returns:
        The chain. Its noise is how readings at one distance scatter, its misfit how far their means lie off the curve.
    """
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
