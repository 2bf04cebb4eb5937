"""Calibration cases for the page on good calibrations: one reflective sensor, measured well and with each mistake.

The sensor follows an inverse power (l_0 = 30 mm, n = 3; 9000 counts at contact) with an offset of 600 counts. A reading
has a noise of 6 counts and a jitter of 0.3 % of the signal. Every case is generated from a seed, so its true curve is
known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

import pretouch as pt

Array = NDArray[np.float64]

PEDESTAL, NOISE, JITTER, FULL_SCALE = 600.0, 6.0, 0.003, 16383.0
DISTANCES = np.array([0, 2, 4, 6, 8, 10, 13, 16, 20, 24, 29, 34, 40, 47, 55, 65, 80]) * 1e-3
"""Distances of the good calibration [m]: the signal falls by about a fifth from one to the next."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One calibration case of the page.

    Args:
        name: of the case.
        title: of its panel.
        calibration: the readings.
        signal: noiseless signal above the offset at l [m], in counts.
        offset: argument of `fit`.
    """

    name: str
    title: str
    calibration: pt.Calibration
    signal: Callable[[Array], Array]
    offset: str | float = "auto"

    def slope(self, distance: Array) -> Array:
        """Return the slope g of the signal [1/m]."""
        step = 1e-6
        return np.asarray(np.log(self.signal(distance + step) / self.signal(distance)) / step)


def true_signal(distance: Array) -> Array:
    """Return the signal of the sensor [counts] at distances [m]."""
    return np.asarray(9000.0 * (1 + distance / 0.030) ** -3)


def compressed(distance: Array) -> Array:
    """Return the signal behind an amplifier that compresses toward 4000 counts."""
    signal = true_signal(distance)
    return np.asarray(signal / (1 + (signal / 4000.0) ** 4) ** 0.25)


def amplified(distance: Array) -> Array:
    """Return the signal with a gain four times as large."""
    return 4 * true_signal(distance)


def clipped(distance: Array) -> Array:
    """Return the signal with a gain four times as large, clipped at the full scale of the converter."""
    return np.asarray(np.minimum(amplified(distance), FULL_SCALE - PEDESTAL))


def peaked(distance: Array) -> Array:
    """Return the signal of a source and a receiver that are apart: near the sensor the object is not lit."""
    return np.asarray(true_signal(distance) * (1 - 0.75 * np.exp(-((distance / 0.007) ** 2))))


def reflected(distance: Array) -> Array:
    """Return the signal with a wall behind the object."""
    return np.asarray(true_signal(distance) + 700 * np.exp(-(((distance - 0.085) / 0.013) ** 2)))


def wavy(distance: Array) -> Array:
    """Return the signal with a wavy distance error, as from a bent ruler: 3 % of the signal."""
    return np.asarray(true_signal(distance) * np.exp(0.03 * np.sin(2 * np.pi * distance / 0.045)))


def rising(distance: Array) -> Array:
    """Return the signal of inverting electronics."""
    return np.asarray(9600.0 - true_signal(distance))


def _inverted(calibration: pt.Calibration) -> pt.Calibration:
    return replace(calibration, outputs=11000 - calibration.outputs, no_object=11000 - calibration.no_object)


def read(
    signal: Callable[[Array], Array],
    seed: int,
    *,
    distances: Array = DISTANCES,
    repeats: int = 5,
    empty: int = 10,
    noise: float = NOISE,
    spoil: Callable[[Array, Array], Array] = lambda _, outputs: outputs,
) -> pt.Calibration:
    """Read a sensor.

    Args:
        signal: signal above the offset at l [m], in counts.
        seed: of the noise.
        distances: of the readings [m].
        repeats: readings per distance.
        empty: number of readings with no object.
        noise: standard deviation of a reading [counts].
        spoil: function that changes outputs at distances before they are recorded.

    Returns:
        The readings.
    """
    rng = np.random.default_rng(seed)
    place = np.repeat(distances, repeats)
    clean = signal(place)
    outputs = (
        PEDESTAL + clean * (1 + JITTER * rng.standard_normal(len(place))) + noise * rng.standard_normal(len(place))
    )
    outputs = np.clip(np.round(spoil(place, outputs)), 0, FULL_SCALE)
    no_object = np.round(PEDESTAL + noise * rng.standard_normal(empty))
    return pt.Calibration(distances=place, outputs=outputs, unit="counts", no_object=no_object)


def _one_distance_wrong(distance: Array, output: Array) -> Array:
    return np.where(distance == 0.016, PEDESTAL + true_signal(distance + 0.003), output)


def _some_readings_lost(_: Array, output: Array) -> Array:
    lost = output.copy()
    lost[[11, 43]] = 0.0
    lost[27] *= 1.6
    return lost


@cache
def cases() -> dict[str, Case]:
    """Return all cases, by name."""
    near = DISTANCES[DISTANCES <= 0.025]
    every = np.linspace(0.0, 0.080, 801)
    upward = read(rising, 7)
    upward = replace(upward, no_object=upward.no_object + 9600)
    found = (
        Case(name="good", title="Right: a good calibration", calibration=read(true_signal, 1), signal=true_signal),
        Case(
            name="offset measured",
            title="Right: empty scene recorded",
            calibration=read(true_signal, 2, distances=near),
            signal=true_signal,
        ),
        Case(
            name="offset withheld",
            title="Wrong: empty scene not recorded",
            calibration=read(true_signal, 2, distances=near, empty=0),
            signal=true_signal,
        ),
        Case(
            name="offset too low",
            title="Wrong: 0 declared, 600 is true",
            calibration=read(true_signal, 3, empty=0),
            signal=true_signal,
            offset="zero",
        ),
        Case(
            name="offset too high",
            title="Wrong: 720 declared, 600 is true",
            calibration=read(true_signal, 3, empty=0),
            signal=true_signal,
            offset=720.0,
        ),
        Case(
            name="soft saturation",
            title="Wrong: an amplifier that compresses",
            calibration=read(compressed, 4),
            signal=compressed,
        ),
        Case(name="clipping", title="Wrong: gain four times too large", calibration=read(amplified, 5), signal=clipped),
        Case(name="near-field peak", title="Wrong: a near-field peak", calibration=read(peaked, 6), signal=peaked),
        Case(name="rising", title="Wrong: an output that rises", calibration=upward, signal=rising),
        Case(
            name="inverted", title="Right: 11000 minus that output", calibration=_inverted(upward), signal=true_signal
        ),
        Case(
            name="second reflection", title="Wrong: a wall at 85 mm", calibration=read(reflected, 8), signal=reflected
        ),
        Case(
            name="noise",
            title="Noise: 60 counts a reading",
            calibration=read(true_signal, 9, noise=60.0, repeats=10),
            signal=true_signal,
        ),
        Case(name="misfit", title="Misfit: distances off in waves", calibration=read(wavy, 10), signal=wavy),
        Case(
            name="a bad distance",
            title="Wrong: 19 mm written down as 16 mm",
            calibration=read(true_signal, 11, spoil=_one_distance_wrong),
            signal=true_signal,
        ),
        Case(
            name="lost readings",
            title="Survived: two readings lost, one high",
            calibration=read(true_signal, 12, spoil=_some_readings_lost),
            signal=true_signal,
        ),
        Case(
            name="dense",
            title="Right: 801 distances, each read once",
            calibration=read(true_signal, 13, distances=every, repeats=1),
            signal=true_signal,
        ),
        Case(
            name="few",
            title="Wrong: five distances, each read once",
            calibration=read(true_signal, 14, distances=np.array([0.0, 0.010, 0.020, 0.040, 0.080]), repeats=1),
            signal=true_signal,
        ),
    )
    return {case.name: case for case in found}


@cache
def report(name: str) -> pt.calibration.CalibrationReport:
    """Return the calibration report of a case, as `pretouch fit` makes it."""
    case = cases()[name]
    return pt.fit(case.calibration, offset=case.offset)
