"""Measure the accuracy of contacts: random encounters compared with an independent integration of order 8.

The encounters and the integrator are those of the tests; this program prints the errors.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from encounters import CURVES, KINDS, random_encounters
from pretouch.motion import find_contact
from reference_integrator import integrate

PER_CASE = 200
STEPS = 600


def main() -> None:
    """Print the largest errors per curve, over the encounters that the reference resolves to 1e-10."""
    print(f"\n{'accuracy of contacts':32s} encounters  compared   time, relative   l', relative   impulse balance")
    for name, sensor in CURVES.items():
        if name == "table":  # fixed steps pass its corners: tests compare it from knot to knot
            continue
        total = compared = 0
        worst = np.zeros(3)
        for kind in KINDS:
            batch = random_encounters(kind, PER_CASE, seed=20261121)
            found = find_contact(batch.scenario, sensor, batch.gain, horizon=30.0)
            end, speed = found.end.time, np.where(found.reached, found.end.relative_velocity, -1.0)
            coarse, fine = (integrate(batch.scenario, sensor, batch.gain, end, n) for n in (STEPS, 2 * STEPS))
            with np.errstate(invalid="ignore"):
                moved = np.abs(fine["distance"] - coarse["distance"]) / np.abs(speed) / end
            trusted = found.reached & (moved < 1e-10)
            time = np.abs(fine["distance"] / speed / end)[trusted].max()
            drift = np.abs(fine["relative_velocity"] / speed - 1)[trusted].max()
            worst = np.maximum(worst, [time, drift, found.impulse_residual.max()])
            total, compared = total + PER_CASE, compared + int(trusted.sum())
        print(f"{name:32s} {total:10d} {compared:9d} {worst[0]:16.0e} {worst[1]:14.0e} {worst[2]:17.0e}")


if __name__ == "__main__":
    main()
