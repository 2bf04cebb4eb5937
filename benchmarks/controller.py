"""How long one step of the controller takes, compiled and in plain Python, with and without the letter's filters."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from control_samples import LETTER_FILTERS, LIMITS, controller, rows_of, run_plain, run_rows
from pretouch._core.machine_code import compiled

STEPS = 1_000_000
ROUNDS = 7
CASES = {
    "no filters, no limits": {},
    "median 10, Butterworth 5": LETTER_FILTERS,
    "the same, within limits": LETTER_FILTERS | {"limits": LIMITS},
    "median 16, Butterworth 8, guarded": {
        "median_window": 16,
        "low_pass_order": 8,
        "cutoff": 500.0,
        "largest_rate": 300.0,
        "saturation": 5.0,
        "approach_only": True,
        "release": 0.02,
        "ramp_time": 0.05,
        "contact_gain": 1.0,
        "limits": LIMITS,
    },
}


def main() -> None:
    """Print the best and the median of several rounds over a noisy approach, which no branch predictor foresees."""
    noise = np.random.default_rng(1).normal(size=STEPS)
    rows = rows_of(0.1 + 0.09 * np.sin(np.arange(STEPS) * 1e-3) + 1e-3 * noise)
    out = np.empty((STEPS, 6))
    print(f"\n{'one step of the controller':36s} compiled, best   median   plain Python")
    for name, changed in CASES.items():
        made = controller(period=1e-4, **changed)
        run = compiled(run_rows, step=made.step)
        run(made.parameters(), made.start(), rows[:10], out)
        times = []
        for _ in range(ROUNDS):
            start = time.perf_counter()
            run(made.parameters(), made.start(), rows, out)
            times.append((time.perf_counter() - start) / STEPS * 1e9)
        start = time.perf_counter()
        run_plain(made, rows[:20_000])
        plain = (time.perf_counter() - start) / 20_000 * 1e6
        print(f"{name:36s} {min(times):11.0f} ns {np.median(times):6.0f} ns {plain:11.1f} us")


if __name__ == "__main__":
    main()
