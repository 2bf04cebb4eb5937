"""Print examples/month-later.csv: the sensor of examples/loop.toml a month after its calibration, at known distances.

It has the columns of a raw file of `pretouch record`: the empty scene for 2 s, then an object at 2, 15 and 40 mm, with
pauses while it moves. Its offset has risen from 150 to 171 counts, dust on the cover has
cost 8 % of the signal, and each distance is wrong by up to 0.2 mm.
"""

import numpy as np

RATE, NOISE, OFFSET, DUST = 250.0, 22.0, 171.0, 0.92  # Hz, counts, counts, 1
PLACES = ((np.inf, 0.0), (0.002, 0.1e-3), (0.015, -0.15e-3), (0.04, 0.05e-3))  # m: distance as typed, and its error
HELD, MOVED = 2.0, 0.4  # s


def main() -> None:
    """Print the CSV file."""
    rng = np.random.default_rng(20261222)
    print("# a sensor a month after its calibration; made by examples/make_month_later.py")
    print("time [s],distance [mm],output [counts]")
    start = 0.0
    for place, error in PLACES:
        signal = 0.0 if np.isinf(place) else DUST * 0.533 * (place + error + 0.0419) ** -3.32
        for i in range(round((HELD + MOVED) * RATE)):
            time = i / RATE
            distance = "" if time >= HELD else "inf" if np.isinf(place) else f"{1e3 * place:g}"
            reading = OFFSET + signal + np.hypot(NOISE, 0.002 * signal) * rng.standard_normal()
            print(f"{start + time:.3f},{distance},{reading:.0f}")
        start += HELD + MOVED


if __name__ == "__main__":
    main()
