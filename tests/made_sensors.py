"""Sensors whose truth is known: random curves, and everything that was met between them and a file of readings.

A sensor has an ideal curve u(l) of a family, an output y(l) = o + S(u) as its electronics leave it, and readings of
it at some distances, with noise and with what else goes wrong. Lengths in m, outputs in counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pretouch.calibration import Calibration
from pretouch.sensors import mittag_leffler

Array = NDArray[np.float64]

MECHANISMS = (
    "plain",
    "soft saturation",
    "clipping",
    "near-field peak",
    "second reflection",
    "misfit",
    "lost readings",
    "a bad distance",
    "dense",
    "offset withheld",
    "offset too high",
    "offset too low",
)
FAMILIES = ("inverse-power", "exponential-1", "exponential-2", "mittag-leffler")


@dataclass(frozen=True, kw_only=True)
class MadeSensor:
    """A sensor with its truth.

    Args:
        family: of the ideal curve.
        mechanism: what goes wrong.
        ideal: u(l) for l in m, in counts above the offset.
        mean: y(l) [counts] without noise, as a controller reads it.
        offset: o [counts].
        declared: the offset that is declared for it; None where none is.
        calibration: the readings.
        good: how many distances are read where nothing is wrong with the curve, above the floor.
        trusted_from: from where on the curve is the ideal one [m].
        noise: standard deviation of one reading where there is no signal [counts].
        jitter: of one reading relative to the signal, on top.
    """

    family: str
    mechanism: str
    ideal: Callable[[Array], Array]
    mean: Callable[[Array], Array]
    offset: float
    declared: float | None
    calibration: Calibration
    good: int
    trusted_from: float
    noise: float
    jitter: float

    @property
    def is_offset_known(self) -> bool:
        """Whether readings without an object are there."""
        return len(self.calibration.no_object) > 0

    def log_slope(self, distance: Array) -> Array:
        """Return g of what a controller sees that subtracts the true offset [1/m]."""
        high, low = (np.log(np.maximum(self.mean(distance + s) - self.offset, 1e-9)) for s in (2e-6, 0.0))
        return (high - low) / 2e-6


def ideal_curve(rng: np.random.Generator, family: str, length: float) -> Callable[[Array], Array]:
    """Draw u(l) / u(0) of a family that falls by about 1 of ln within a length [m]."""
    if family == "inverse-power":
        exponent = float(np.exp(rng.uniform(np.log(0.8), np.log(5))))
        near = length * max(exponent, 1.0) * float(rng.uniform(0.5, 1.2))
        return lambda l: (1 + np.maximum(l, -0.5 * near) / near) ** -exponent  # noqa: E741
    if family == "exponential-1":
        return lambda l: np.exp(-l / length)  # noqa: E741
    if family == "exponential-2":
        bend = float(rng.uniform(0.005, 0.03)) / length**2
        turn = 0.9 / (2 * bend * length)  # beyond, it goes on as an exponential

        def log(l: Array) -> Array:  # noqa: E741
            inside = np.minimum(l, turn)
            return -inside / length + bend * inside**2 - 0.1 / length * (l - inside)

        return lambda l: np.exp(log(l))  # noqa: E741
    order = float(rng.uniform(0.7, 0.98))
    return lambda l: mittag_leffler(order, -np.maximum(l, 0.0) / length)[0]  # noqa: E741


def make_sensor(rng: np.random.Generator, mechanism: str, family: str | None = None) -> MadeSensor:
    """Draw a sensor with its readings.

    Args:
        rng: the generator.
        mechanism: one of MECHANISMS, or "rising".
        family: one of FAMILIES; any where None.

    Returns:
        The sensor.
    """
    family = str(rng.choice(FAMILIES)) if family is None else family
    length = float(np.exp(rng.uniform(np.log(0.006), np.log(0.04))))
    shape = ideal_curve(rng, family, length)
    full = float(rng.choice([1023.0, 4095.0, 16383.0]))
    offset = float(rng.uniform(0.005, 0.15)) * full
    top = float(rng.uniform(0.3, 0.8)) * full
    noise = full * float(np.exp(rng.uniform(np.log(2e-4), np.log(3e-3))))
    jitter = float(np.exp(rng.uniform(np.log(5e-4), np.log(1e-2))))
    last = length * float(rng.uniform(2.5, 6.0))
    count, repeats = int(rng.integers(8, 41)), int(rng.choice([1, 3, 5, 10, 30]))
    if mechanism == "dense":
        count, repeats = int(rng.integers(200, 800)), int(rng.choice([1, 2]))
    distance = np.linspace(0.0, last, count)
    if rng.random() < 0.4:
        distance = last * np.linspace(0, 1, count) ** float(rng.uniform(1.2, 2.0))

    def ideal(l: Array) -> Array:  # noqa: E741
        return top * shape(l)

    mean, trusted_from = _electronics(rng, mechanism, ideal, offset=offset, last=last, full=full)
    readings = np.repeat(distance, repeats)
    clean = mean(readings)
    signal = np.abs(clean - offset)
    outputs = clean + rng.normal(0, noise, len(readings)) + rng.normal(0, jitter, len(readings)) * signal
    outputs = _spoiled(rng, mechanism, outputs, distance=readings, offset=offset, noise=noise)
    outputs = np.round(np.clip(outputs, 0, full))
    hidden = mechanism.startswith("offset") or mechanism in {"rising"}
    empty = (
        np.empty(0) if hidden else np.round(np.clip(offset + rng.normal(0, noise, int(rng.integers(5, 30))), 0, full))
    )
    floor = 5 * noise / np.sqrt(repeats) + 0.01 * top
    good = int(((distance >= trusted_from) & (ideal(distance) > floor)).sum())
    declared = None
    if mechanism in {"offset too high", "offset too low"}:
        far = float(ideal(np.array(last)))
        size = float(rng.uniform(0.3, 0.9)) * far + 8 * noise
        declared = offset + size if mechanism == "offset too high" else offset - size
    return MadeSensor(
        family=family,
        mechanism=mechanism,
        ideal=ideal,
        mean=mean,
        offset=offset,
        declared=declared,
        calibration=Calibration(distances=readings, outputs=outputs, unit="counts", no_object=empty),
        good=good,
        trusted_from=trusted_from,
        noise=noise,
        jitter=jitter,
    )


CEILINGS: dict[str, Callable[[Array, float, float], Array]] = {
    "soft": lambda u, c, p: u / (1 + (u / c) ** p) ** (1 / p),
    "tanh": lambda u, c, _: c * np.tanh(u / c),
    "exponential": lambda u, c, _: c * (1 - np.exp(-u / c)),
    "logarithmic": lambda u, c, _: np.where(u < c, u, c * (1 + np.log(np.maximum(u, c) / c))),
}
"""Outputs of an ideal signal u under a ceiling c, some with a sharpness p."""


def make_sparse_sensor(rng: np.random.Generator, ceiling: str = "soft") -> MadeSensor:
    """Draw a sensor that was read once at each of 6 to 18 distances, as people do by hand.

    An inverse power over 80 to 200 mm on an offset of 0 to 300 of 4095 counts; 70 % have a ceiling that begins anywhere
    in the nearer two thirds, 60 % have 3 to 11 readings without an object, 40 % have distances that are off by 0.05 to
    0.5 mm each, and 10 % have one distance that is off by 3 to 10 mm.

    Args:
        rng: the generator.
        ceiling: one of CEILINGS.

    Returns:
        The sensor.
    """
    full = 4095.0
    exponent, near = float(np.exp(rng.uniform(np.log(0.8), np.log(4)))), float(np.exp(rng.uniform(-5.5, -2.8)))
    last, count = float(rng.uniform(0.08, 0.2)), int(rng.integers(6, 19))
    offset, top = float(rng.uniform(0, 300)), float(rng.uniform(0.3, 0.9)) * full
    noise, jitter = float(np.exp(rng.uniform(np.log(0.3), np.log(8)))), float(np.exp(rng.uniform(-7.6, -4.6)))
    first = float(rng.choice([0.0, 0.001, 0.005]))
    power = float(rng.choice([1.0, 1.0, rng.uniform(1.2, 2.0)]))
    distance = np.unique(np.round(first + (last - first) * np.linspace(0, 1, count) ** power, 3))

    def shape(l: Array) -> Array:  # noqa: E741
        return (1 + np.maximum(l, -0.5 * near) / near) ** -exponent

    knee = last * float(rng.uniform(0.02, 2 / 3)) if rng.random() < 0.7 else 0.0
    sharpness, scale = float(rng.uniform(2, 10)), top / float(shape(np.array(knee)))

    def mean(l: Array) -> Array:  # noqa: E741
        u = scale * shape(l)
        return offset + np.minimum(CEILINGS[ceiling](u, top, sharpness) if knee else u, full - offset)

    place, kind = distance.copy(), rng.random()
    if kind < 0.4:
        place += rng.normal(0, float(np.exp(rng.uniform(np.log(5e-5), np.log(5e-4)))), len(distance))
    elif kind < 0.5:
        place[int(rng.integers(0, len(distance)))] += float(rng.choice([-1, 1]) * rng.uniform(0.003, 0.01))
    clean = mean(np.maximum(place, 0.0))
    outputs = (
        clean
        + noise * rng.standard_normal(len(distance))
        + jitter * (clean - offset) * rng.standard_normal(len(distance))
    )
    empty = np.empty(0)
    if rng.random() < 0.6:
        empty = np.round(np.clip(offset + rng.normal(0, noise, int(rng.integers(3, 12))), 0, full))
    outputs = np.round(np.clip(outputs, 0, full))
    return MadeSensor(
        family="inverse-power",
        mechanism=f"read once, {ceiling}",
        ideal=lambda l: scale * shape(l),  # noqa: E741
        mean=mean,
        offset=offset,
        declared=None,
        calibration=Calibration(distances=distance, outputs=outputs, unit="counts", no_object=empty),
        good=int((distance >= knee).sum()),
        trusted_from=knee,
        noise=noise,
        jitter=jitter,
    )


def make_sensor_with_wrong_nearest(rng: np.random.Generator) -> MadeSensor:
    """Draw a sensor that was read once at each of 6 to 12 distances, with 5 to 30 % of error in the nearest reading.

    An inverse power over 40 to 120 mm on an offset of 0 to 300 of 4095 counts; 60 % have 3 to 11 readings without an
    object.

    Args:
        rng: the generator.

    Returns:
        The sensor.
    """
    full, count = 4095.0, int(rng.integers(6, 13))
    exponent, near = float(np.exp(rng.uniform(np.log(0.8), np.log(4)))), float(np.exp(rng.uniform(-5.0, -2.8)))
    distance = np.round(float(rng.uniform(0.04, 0.12)) * np.linspace(0, 1, count) ** float(rng.choice([1.0, 1.5])), 4)
    offset, top = float(rng.uniform(0, 300)), float(rng.uniform(0.3, 0.75)) * full
    noise, jitter = float(np.exp(rng.uniform(np.log(0.3), np.log(4)))), float(np.exp(rng.uniform(-7.6, -5.3)))

    def ideal(l: Array) -> Array:  # noqa: E741
        return top * (1 + np.maximum(l, -0.5 * near) / near) ** -exponent

    def mean(l: Array) -> Array:  # noqa: E741
        return offset + ideal(l)

    signal = ideal(distance)
    outputs = offset + signal + noise * rng.standard_normal(count) + jitter * signal * rng.standard_normal(count)
    outputs[0] += signal[0] * float(rng.uniform(0.05, 0.3)) * float(rng.choice([-1, 1]))
    empty = np.empty(0)
    if rng.random() < 0.6:
        empty = np.round(np.clip(offset + rng.normal(0, noise, int(rng.integers(3, 12))), 0, full))
    outputs = np.round(np.clip(outputs, 0, full))
    return MadeSensor(
        family="inverse-power",
        mechanism="nearest reading wrong",
        ideal=ideal,
        mean=mean,
        offset=offset,
        declared=None,
        calibration=Calibration(distances=distance, outputs=outputs, unit="counts", no_object=empty),
        good=count - 1,
        trusted_from=0.0,
        noise=noise,
        jitter=jitter,
    )


def _electronics(  # noqa: PLR0911 - a mechanism each
    rng: np.random.Generator,
    mechanism: str,
    ideal: Callable[[Array], Array],
    *,
    offset: float,
    last: float,
    full: float,
) -> tuple[Callable[[Array], Array], float]:
    """Return the output without noise, and from where on it is the ideal one [m]."""
    grid = np.linspace(0.0, last, 4001)
    if mechanism == "soft saturation":
        power = float(rng.uniform(2, 10))
        end = last * float(rng.uniform(0.05, 2 / 3))
        ceiling = float(ideal(np.array(end)))  # u = S there
        end = float(grid[np.argmax((ideal(grid) / ceiling) ** power < 0.1)])
        return lambda l: offset + ideal(l) / (1 + (ideal(l) / ceiling) ** power) ** (1 / power), end  # noqa: E741
    if mechanism == "clipping":
        end = last * float(rng.uniform(0.05, 0.4))
        ceiling = float(ideal(np.array(end)))
        return lambda l: np.minimum(offset + ideal(l), offset + ceiling), end  # noqa: E741
    if mechanism == "near-field peak":
        peak = last * float(rng.uniform(0.03, 0.15))
        end = float(peak * 2.5)
        return lambda l: offset + ideal(l) * (1 - 0.6 * np.exp(-((np.maximum(l, 0) / peak) ** 2) * 1.5)), end  # noqa: E741
    if mechanism == "second reflection":
        rise, center = float(rng.uniform(0.03, 0.2)), last * float(rng.uniform(1.0, 1.3))
        width = last * float(rng.uniform(0.12, 0.25))
        top = float(ideal(np.array(0.0)))
        return lambda l: offset + ideal(l) + rise * top * np.exp(-(((l - center) / width) ** 2)), 0.0  # noqa: E741
    if mechanism == "rising":
        top = float(ideal(np.array(0.0)))
        return lambda l: offset + 1.05 * top - ideal(l), last  # noqa: E741
    if mechanism == "misfit":
        size, waves = float(rng.uniform(0.005, 0.03)), rng.uniform(0.5, 1.5, 2) * 2 * np.pi / last
        phase = rng.uniform(0, 2 * np.pi, 2)

        def ripple(l: Array) -> Array:  # noqa: E741
            return size * (np.sin(waves[0] * l + phase[0]) + np.sin(waves[1] * l + phase[1])) / 1.4

        return lambda l: offset + ideal(l) * np.exp(ripple(l)), 0.0  # noqa: E741
    return lambda l: np.minimum(offset + ideal(l), full), 0.0  # noqa: E741


def _spoiled(
    rng: np.random.Generator, mechanism: str, outputs: Array, *, distance: Array, offset: float, noise: float
) -> Array:
    """Return outputs with single readings, or all readings at a distance, off."""
    if mechanism == "lost readings":
        bad = rng.choice(len(outputs), max(1, len(outputs) // 30), replace=False)
        outputs = outputs.copy()
        outputs[bad] = np.where(rng.random(len(bad)) < 0.5, 0.0, outputs[bad] * rng.uniform(1.5, 2.0, len(bad)))
    if mechanism == "a bad distance":
        places = np.unique(distance)
        at = places[int(rng.integers(1, max(2, len(places) * 2 // 3)))]
        outputs = outputs.copy()
        here = distance == at
        size = float(rng.uniform(0.3, 0.6)) * rng.choice([-1, 1])
        outputs[here] += size * np.maximum(outputs[here] - offset, 20 * noise)
    return outputs
