"""Print examples/sensor.csv: readings of a synthetic reflective sensor with realistic errors, from a fixed seed.

The sensor follows an inverse power curve (l_0 = 14 mm, n = 2.4) with an offset of 62 counts, read by a 10-bit
converter that clips at 1023, with noise of 2 counts, three readings per distance, one dropped reading, and ten
readings without an object. It runs in any folder.
"""

import numpy as np

PEDESTAL, NOISE, CLIP = 62.0, 2.0, 1023


def main() -> None:
    """Print the CSV file."""
    rng = np.random.default_rng(20261121)
    print("# synthetic reflective sensor, 10-bit converter; made by examples/make_sensor_csv.py")
    print("distance [mm],output [counts]")
    for distance in np.arange(0, 92.5, 2.5):
        signal = 9.0e5 / (distance + 14.0) ** 2.4
        for repeat in range(3):
            reading = min(CLIP, round(PEDESTAL + signal + rng.normal(0, NOISE)))
            if distance == 40 and repeat == 1:
                reading = 0  # a dropped reading
            print(f"{distance:g},{reading}")
    for _ in range(10):
        print(f"inf,{round(PEDESTAL + rng.normal(0, NOISE))}")


if __name__ == "__main__":
    main()
