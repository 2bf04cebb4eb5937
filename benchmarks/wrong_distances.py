"""Measure what a wrong distance does to a fitted slope, and whether it can be left out without asking.

    python -m benchmarks.wrong_distances --count 60 --seed 1

Sensors of two families are generated, read three times at 8 to 12 distances, half of them with readings without an
object. To each, readings at one more distance are added:

- code: readings without an object, with a code such as 255 or 999 mm as their distance;
- typing error: a distance in the range of the others, with a zero too many (700 for 70);
- far and right: a true distance, 2.6 to 8 times the largest of the others;
- zero: readings without an object, with 0 as their distance.

It prints for each what PT114 finds, and the error of the slope g in the middle of the other distances: with these
readings in the fit, without them, with them as readings without an object, and with their true distances. A rule that
does not ask is right if it never makes far and right readings worse, and wrong distances better.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NamedTuple
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from pretouch.calibration import Calibration, fit, ranking

Array = NDArray[np.float64]
CASES = ("code", "typing error", "far and right", "zero")
FINDINGS = {"empty": "taken without an object", "disagrees": "disagrees with every", "zero": "0 is a code"}
CODES = (0.255, 0.8, 0.999, 2.0, 8.19)


class Readings(NamedTuple):
    """Distances [m] and outputs [V], the slope g [1/m] at the distance `middle` [m], and readings without an object."""

    distances: Array
    outputs: Array
    empty: Array
    middle: float
    slope: float


class Outcome(NamedTuple):
    """What PT114 finds, and the relative errors of g."""

    finding: str
    kept: float
    left_out: float
    empty: float
    corrected: float


def made(case: str, rng: np.random.Generator) -> tuple[Readings, Array, Array, Array]:
    """Return the right readings of a sensor; the distances and outputs that are added, and their true distances."""
    far = float(rng.uniform(0.04, 0.1))
    places = np.linspace(rng.uniform(0.0, 0.01), far, int(rng.integers(8, 13)))
    offset, noise = float(rng.uniform(0.0, 0.3)), float(rng.uniform(0.003, 0.02))
    length, exponent = float(rng.uniform(0.02, 0.06)), float(rng.uniform(1.5, 3.5))
    is_power = rng.random() < 0.5

    def signal(d: Array) -> Array:
        return 3.0 * ((length / (length + d)) ** exponent if is_power else np.exp(-d * exponent / (length + far)))

    def read(d: Array) -> Array:
        scatter = rng.normal(0.0, 0.004, len(d)) + noise * signal(d) * rng.normal(size=len(d))
        return offset + signal(d) + scatter

    distances = np.repeat(places, 3)
    middle = float((places[0] + places[-1]) / 2)
    slope = -exponent / (length + middle) if is_power else -exponent / (length + far)
    empty = read(np.full(8, np.inf)) if rng.random() < 0.5 else np.empty(0)
    true = np.full(3, np.inf)
    if case == "typing error":
        true = np.full(3, float(rng.uniform(0.5, 1.0)) * far)
    elif case == "far and right":
        true = np.full(3, float(rng.uniform(2.6, 8.0)) * far)
    written = {"code": np.full(3, rng.choice(CODES)), "typing error": 10 * true, "far and right": true}
    added = written.get(case, np.zeros(3))
    if case == "zero":
        distances = distances + 0.004 * (places[0] < 0.004)
    return Readings(distances, read(distances), empty, middle, slope), added, read(true), true


def fitted(readings: Readings, distances: Array, outputs: Array, empty: Array) -> tuple[float, str]:
    """Return the relative error of g after a fit with more readings, infinite without a fit, and what PT114 finds."""
    kept = mock.patch.object(ranking, "without_distance", lambda calibration, _: calibration)
    with kept:  # `fit` leaves out what disagrees
        report = fit(
            Calibration(
                distances=np.concatenate([readings.distances, distances]),
                outputs=np.concatenate([readings.outputs, outputs]),
                no_object=np.concatenate([readings.empty, empty]),
                unit="V",
            )
        )
    found = next((text for text in (*report.reasons, *report.notes) if text.startswith("PT114")), "")
    finding = next((name for name, words in FINDINGS.items() if words in found), "other" if found else "nothing")
    if report.best is None or not report.best.sensor.contains(readings.middle):
        return np.inf, finding
    return abs(float(report.best.sensor.log_slope(readings.middle)) / readings.slope - 1), finding


def outcome(case: str, rng: np.random.Generator) -> Outcome:
    """Fit one sensor with the added readings, without them, and with their true distances."""
    readings, added, outputs, true = made(case, rng)
    nothing = np.empty(0)
    kept, finding = fitted(readings, added, outputs, nothing)
    left_out, _ = fitted(readings, nothing, nothing, nothing)
    empty, _ = fitted(readings, nothing, nothing, outputs)
    without = np.isinf(true)
    corrected, _ = fitted(readings, true[~without], outputs[~without], outputs[without])
    return Outcome(finding, kept, left_out, empty, corrected)


def row(case: str, outcomes: Sequence[Outcome], name: str) -> str:
    """Return the median and the 90 % quantile of the errors of some sensors in one line."""
    errors = [100 * np.array([each[i] for each in outcomes]) for i in (1, 2, 3, 4)]
    shown = "  ".join(f"{np.median(e):6.1f} {np.quantile(e, 0.9, method='lower'):7.1f}" for e in errors)
    return f"{case:<14} {name:<14} {len(outcomes):>5}  {shown}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print what PT114 finds, and the errors of g."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=60, help="sensors of each case")
    parser.add_argument("--seed", type=int, default=1, help="of all sensors")
    parser.add_argument("--case", choices=CASES, help="only this case")
    asked = parser.parse_args(arguments)
    head = f"{'':<14} {'PT114':<14} {'count':>5}  {'kept':>14}  {'left out':>14}  {'as empty':>14}  {'corrected':>14}"
    sys.stdout.write(f"error of g in % (median, 90 % quantile)\n{head}\n")
    for number, case in enumerate(CASES):
        if asked.case not in {None, case}:
            continue
        rngs = (np.random.default_rng((asked.seed, number, index)) for index in range(asked.count))
        outcomes = [outcome(case, rng) for rng in rngs]
        for name in (*FINDINGS, "other", "nothing"):
            some = [each for each in outcomes if each.finding == name]
            if some:
                sys.stdout.write(row(case, some, name) + "\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
