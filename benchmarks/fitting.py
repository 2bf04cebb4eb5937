"""Measure the processor time of `fit`: 40 curves of one file, and one curve, next to a single fit by SciPy.

    python -m benchmarks.fitting --count 40 --seed 1
    python -m benchmarks.fitting --other /path/to/another/source/tree

The file has the layout of a robot with eight sensors that were read on five days, once every 10 mm. It is read and
fitted as by `pretouch fit FILE`. After each curve, `scipy.optimize.curve_fit` fits one family of three parameters and
an offset to it, from one start, without a window, outliers, intervals or a verdict. With --other, both source trees
run `pretouch fit examples/sensor.csv` and `pretouch fit FILE` as whole commands in turn.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit

from pretouch.calibration import Calibration, fit
from pretouch.config.sensor import FitRequest

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
DISTANCES = np.arange(0.0, 100.0, 10.0)
FULL_SCALE = 1023.0
SENSORS = 8


def write(path: Path, count: int, seed: int) -> None:
    """Write readings of sensors that clip near contact, on an offset, with noise of some counts."""
    rng = np.random.default_rng(seed)
    lines = ["day,sensor,distance [mm],output [counts]"]
    for number in range(count):
        near, exponent = float(rng.uniform(8.0, 25.0)), float(rng.uniform(1.8, 3.2))
        top, offset, noise = (
            float(rng.uniform(500.0, 2500.0)),
            float(rng.uniform(30.0, 170.0)),
            float(rng.uniform(1, 4)),
        )
        clean = offset + top * (1 + DISTANCES / near) ** -exponent
        outputs = np.round(np.clip(clean + noise * rng.standard_normal(len(DISTANCES)), 0, FULL_SCALE))
        rows = zip(DISTANCES, outputs, strict=True)
        lines += [f"{number // SENSORS + 1},{number % SENSORS},{d:g},{y:g}" for d, y in rows]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")


def inverse_power(distance: Array, log_scale: float, near: float, exponent: float, offset: float) -> Array:
    """Return the output of an inverse power curve [counts]; distances and `near` in mm."""
    return np.asarray(offset + np.exp(log_scale) * (1 + distance / np.maximum(near, 1e-3)) ** -exponent)


def fit_by_scipy(curve: Calibration) -> None:
    """Fit one family to a curve by SciPy."""
    distance, output = 1e3 * curve.distances, curve.outputs
    start = [np.log(np.ptp(output) + 1.0), 15.0, 2.0, float(output.min())]
    with warnings.catch_warnings(), suppress(RuntimeError):  # one that has not converged counts all the same
        warnings.simplefilter("ignore")
        curve_fit(inverse_power, distance, output, p0=start, maxfev=2000)


def in_turn(path: Path) -> tuple[list[float], list[float]]:
    """Return the processor time of each curve, by pretouch and by SciPy [s]."""
    curves = FitRequest(path=path).read()
    fit(curves[0])  # imports
    fit_by_scipy(curves[0])
    own, other = [], []
    for curve in curves:
        start = time.process_time()
        fit(curve)
        middle = time.process_time()
        fit_by_scipy(curve)
        own.append(middle - start)
        other.append(time.process_time() - middle)
    return own, other


def whole_command(tree: Path, file: Path, folder: str) -> float:
    """Return the processor time of a whole command with the package of a source tree [s]."""
    start = os.times()
    command = [sys.executable, "-m", "pretouch", "fit", str(file), "--no-report"]
    environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: ended with {done.returncode}")
    end = os.times()
    return end.children_user + end.children_system - start.children_user - start.children_system


def main() -> None:
    """Run and print all measurements."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=40, help="how many curves")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--other", type=Path, help="another source tree, with its compiled core, for whole commands")
    parser.add_argument("--rounds", type=int, default=5, help="how often whole commands run")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "sensors.csv")
        write(file, options.count, options.seed)
        own, scipy = in_turn(file)
        median, peer = 1e3 * statistics.median(own), 1e3 * statistics.median(scipy)
        print(f"{len(own)} curves of one file: {sum(own):.2f} s of processor, {median:.0f} ms a curve (median)")
        print(f"one family from one start, by SciPy: {peer:.2f} ms a curve; ratio {median / peer:.0f}")
        if options.other is None:
            return
        for name, path in (("one curve", ROOT / "examples/sensor.csv"), (f"{len(own)} curves", file)):
            times: dict[Path, list[float]] = {ROOT: [], options.other: []}
            for _ in range(options.rounds):
                for tree, values in times.items():
                    values.append(whole_command(tree, path, folder))
            here, there = (statistics.median(values) for values in times.values())
            print(f"pretouch fit, {name}: {here:.2f} s, the other tree {there:.2f} s, ratio {here / there:.2f}")


if __name__ == "__main__":
    main()
