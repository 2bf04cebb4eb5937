"""Time one step of the controller, from C and from Python, with and without the letter's filters."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from control_samples import LETTER_FILTERS, LIMITS, Batch, controller, rows_of
from pretouch.control import Sample, VirtualDrag

STEPS = 1_000_000
ROUNDS = 7
CALLS = 50_000
CASES = {
    "no filters, no limits": {},
    "median 10, Butterworth 5": LETTER_FILTERS,
    "the same, within limits": LETTER_FILTERS | {"limits": LIMITS},
    "virtual drag, no filters, no limits": {
        "law": VirtualDrag(drag=0.0144, noise=1e-3, relative_noise=3e-3, own_advance=-0.7)
    },
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
    """Print the best and the median of several rounds over a noisy approach, which defeats branch prediction."""
    noise = np.random.default_rng(1).normal(size=STEPS)
    rows = rows_of(0.1 + 0.09 * np.sin(np.arange(STEPS) * 1e-3) + 1e-3 * noise)
    print(f"\n{'one step of the controller':36s} from C, best   median   a run in Python   controller.step")
    for name, changed in CASES.items():
        made = controller(period=1e-4, **changed)
        batch = Batch(made, rows)
        times = []
        for _ in range(ROUNDS):
            start = time.perf_counter()
            batch.run()
            times.append((time.perf_counter() - start) / STEPS * 1e9)
        readings = rows[:CALLS, 0].tolist()
        step, begun = made.begin().step, time.perf_counter()
        for reading in readings:
            step(reading)
        held = (time.perf_counter() - begun) / CALLS * 1e6
        parameters, state, pure, begun = made.parameters(), made.start(), made.step, time.perf_counter()
        for reading in readings:
            state, _ = pure(parameters, state, Sample(reading))
        whole = (time.perf_counter() - begun) / CALLS * 1e6
        print(f"{name:36s} {min(times):9.0f} ns {np.median(times):6.0f} ns {held:14.2f} us {whole:14.2f} us")


if __name__ == "__main__":
    main()
