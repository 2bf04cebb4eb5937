"""Simulate random robots, and check that their results say whatever differs from the prediction.

    python -m benchmarks.random_robots --count 500 --seed 0

The robots have bases that are fixed, welded, on rails, floating, falling or standing, coupled fingers, passive joints,
flush flanges, prongs, dry friction, servos, filters and tendons. The objects are balls and plates, on the axis and
beside it, moving sideways, transparent, or with margins. Contact speed, time, excursion and peak force are compared
with the prediction. Each difference of more than 10 % has to be in a warning with its cause. Reflected mass, moved mass
and recoil share are compared with MuJoCo's response to small pushes.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

from pretouch.errors import InvalidInputError

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from random_scenes import LARGE, QUANTITIES, mass_errors, random_scene, simulate_scene

MASSES = 1e-6  # largest relative error of masses


def check(count: int, seed: int) -> int:
    """Simulate random robots, print what they have in common, and return the number of faults."""
    unsaid: list[str] = []
    errors: dict[str, float] = {}
    refused: Counter[str] = Counter()
    differs: Counter[str] = Counter()
    simulated = weighed = touched = elsewhere = 0
    for number in range(seed, seed + count):
        scene = random_scene(number)
        found = mass_errors(scene)
        weighed += bool(found)
        for name, error in found.items():
            errors[name] = max(errors.get(name, 0.0), error)
            if not error <= MASSES:
                unsaid.append(f"robot {number}: the {name} differs from MuJoCo's response by {error:.1e}")
        try:
            outcome = simulate_scene(scene)
        except InvalidInputError as error:
            refused[str(error).partition(":")[0]] += 1
            continue
        simulated += 1
        touched += bool(outcome.result.order())
        elsewhere += any(not touch.site for touch in outcome.result.touches[0])
        for quantity, difference in outcome.differences.items():
            differs[quantity] += difference > LARGE
        unsaid += [f"robot {number} ({', '.join(scene.parts)}): {text}" for text in outcome.unsaid]
    reasons = ", ".join(f"{count} for {name}" for name, count in refused.items())
    print(f"{simulated} of {count} robots simulated, {count - simulated} refused{f' ({reasons})' if reasons else ''}")
    print(f"touched at the site: {touched}; hit elsewhere: {elsewhere}")
    for quantity, words in QUANTITIES.items():
        print(f"{words} differs by more than {100 * LARGE:.0f} %: {differs[quantity]}")
    listed = ", ".join(f"{name} {error:.1e}" for name, error in errors.items())
    print(f"largest errors of {weighed} robots (required {MASSES:g}): {listed}")
    print(f"without a warning and its cause: {len(unsaid)} (required 0)")
    print("".join(f"  {text}\n" for text in unsaid), end="")
    return len(unsaid)


def main() -> None:
    """Check the robots that the options ask for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.random_robots", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0, help="number of the first robot")
    options = parser.parse_args()
    sys.exit(check(options.count, options.seed) > 0)


if __name__ == "__main__":
    main()
