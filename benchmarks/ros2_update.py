"""Time `update` of the exported ros2_control controller against stub headers, next to the law alone.

The longest call contains interruptions by other processes and by the operating system, which the law alone shows, too.
The slowest step shows what the code itself needs: each step of the test vectors counts with its fastest repetition.
Reading the two clocks takes a part of each time.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import pretouch as pt
from pretouch.exports import export
from ros2_harness import build, drive

CALLS = 1_000_000
STATES = 2_000
RATE = 1000  # Hz, that of the scenario
SCENARIO = Path(__file__).parents[1] / "examples/loop.toml"
INTERFACES = {
    "reading.interface": "proximity/reading",
    "reading.count_interface": "proximity/count",
    "reading.age_interface": "proximity/age",
    "contact_force.interface": "contact/force",
}


def main() -> None:
    """Print times of `update` for three outputs, then those of an activation and a deactivation."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        export(pt.load_scenario(SCENARIO).replace(gain=-0.86), folder / "package", "ros2", verify=False)
        program = build(folder / "package", folder, optimization="-O2")
        vectors = folder / "package/law/vectors.csv"
        print(f"\n{'us per call, of a million':27s} longest  computing  slowest step  median   the law alone")
        states: list[str] = []
        for output in ("position", "effort", "wrench"):
            lines = [f"param {key} {value}" for key, value in INTERFACES.items()]
            lines += [f"state {value} 0" for value in (*INTERFACES.values(), "slide/position", "slide/velocity")]
            lines += ["param joint slide", "param reading.new_when count", f"param output {output}"]
            lines += ["configure 1000"] if output == "wrench" else [f"command slide/{output}"]
            start = ["configure 1000", "activate"]
            *_, whole, law = drive(program, *lines, f"measure {CALLS} {RATE} {vectors}")
            columns = [f"{float(x):10.2f}" for x in whole.split()]
            print(f"{output:26s} {' '.join(columns)}   {' '.join(f'{float(x):.2f}' for x in law.split())}")
            *_, times = drive(program, *lines, *start, f"time_states {STATES}")
            ending, beginning, sleeps = times.split()
            states += [f"{output:26s} {float(beginning):10.2f} {float(ending):12.2f} {sleeps:>7s}"]
        print(f"\n{f'us, longest computing of {STATES}':26s} activation deactivation  sleeps", *states, sep="\n")


if __name__ == "__main__":
    main()
