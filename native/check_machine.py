"""Compare the results of the compiled kernels on another kind of machine, such as ARM, with those on this machine.

    python native/check_machine.py --compiler "zig c++ -target aarch64-linux-musl -static" --run qemu-aarch64

The script writes inputs and this machine's results into a C++ program, compiles it for the other machine and runs it
there or in an emulator.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from ctypes import byref
from pathlib import Path
from typing import Any

import numpy as np

import pretouch as pt
from pretouch._core.native import address
from pretouch.designs.search.compiled import find_gains
from pretouch.motion.curve import curve_pieces, curve_windows, shared_curve
from pretouch.motion.kernels import contact_times, find_contacts, of_core, pieces_of_core, solve_series

NATIVE = Path(__file__).resolve().parent
N = 203


def cases() -> dict[str, Any]:
    """Return the inputs and results of this machine, with the names that check_machine.cpp uses."""
    rng = np.random.default_rng(8)
    sensor = pt.InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32, maximum_distance=0.3)
    scenario = pt.Scenario(
        admittance=pt.Admittance(
            mass=rng.uniform(0.5, 2, N), damping=rng.uniform(5, 30, N), stiffness=rng.uniform(0, 10, N)
        ),
        obstacle=pt.Obstacle(position=rng.uniform(0.02, 0.08, N), velocity=-rng.uniform(0.05, 1, N)),
    )
    gain = -rng.uniform(0.05, 2, N)
    columns = [np.ascontiguousarray(np.broadcast_to(c, (N,)), dtype=np.float64) for c in scenario.relative_columns()]
    inputs, values = [*columns[:8], gain], np.ascontiguousarray(np.stack(columns, axis=1))
    slope = float(sensor.log_slope(0.0))
    curves = shared_curve(curve_windows(sensor, 0.0, 0.08))
    time, status, states = np.empty(N), np.empty(N, dtype=np.int8), np.empty((5, N))
    find_contacts(inputs, slope, 30.0, time, status, states=states)
    lanes = np.empty((6, N))
    contact_times(inputs, curves, 30.0, lanes, status)
    pieces, rows, ended = curve_pieces(sensor, 0.0, 0.3), np.empty((N, 15)), np.empty(N, dtype=np.int64)
    solve_series(values, gain, pieces, (30.0, True, False), rows, ended)
    terms, designs, of_all = np.array([[4.0, 1, 2, 0], [1, 25, 2, 0]]), np.empty((3, N)), np.stack(columns)
    ends = (0.05, float(np.arcsinh(-10 / 0.05)), float(np.arcsinh(-0.01 / 0.05)), -10.0, -0.01)
    limit = np.array([[6.0, 1.0 / 0.06, 1.0]])
    curve = (slope, byref(of_core(curves, 1)), byref(pieces_of_core(pieces, True, False)), 0.0, np.inf, 1)
    request = (*curve, 30.0, address(terms), 2, address(limit), 1, *ends)
    find_gains(address(of_all), N, *request, address(designs))
    table, starts, curve_of = curves
    return {
        "N": N,
        "SLOPE": slope,
        "WINDOW_ROWS": table.shape[0],
        "WINDOW_WIDTH": table.shape[1],
        "PIECE_ROWS": pieces.shape[0],
        "PIECE_WIDTH": pieces.shape[1],
        **{"INPUTS": np.stack(inputs), "VALUES": values, "DESIGN_INPUTS": of_all, "WINDOWS": table, "PIECES": pieces},
        **{"STARTS": starts, "CURVE_OF": curve_of},
        **{"EXPECTED_LINEAR": states, "EXPECTED_LANES": lanes, "EXPECTED_SERIES": rows, "EXPECTED_DESIGNS": designs},
    }


def _literal(value: float) -> str:
    return "NAN" if np.isnan(value) else "INFINITY" if np.isinf(value) else f"{value:.17g}"


def header(found: dict[str, Any]) -> str:
    """Return C code that defines numbers and arrays."""
    lines = ["#include <math.h>", "#include <stdint.h>"]
    for name, value in found.items():
        if isinstance(value, np.ndarray):
            kind = "int64_t" if value.dtype == np.int64 else "double"
            lines.append(f"static const {kind} {name}[] = {{{', '.join(map(_literal, value.ravel().tolist()))}}};")
        else:
            lines.append(f"#define {name} {value!r}")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Compile and run the comparison; exit with the status of its program."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--compiler", required=True, help="of C++, with what selects the machine")
    parser.add_argument("--run", default="", help="what runs programs of that machine")
    wanted = parser.parse_args()
    folder = NATIVE.parent / "build/native/check"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cases.h").write_text(header(cases()))
    compiler, program = shlex.split(wanted.compiler), str(folder / "check")
    if compiler[0] == "zig":
        compiler[:1] = [sys.executable, "-m", "ziglang"]
    sources = [str(NATIVE / "check_machine.cpp"), *map(str, sorted(NATIVE.glob("core/*.cpp")))]
    flags = f"-std=c++20 -O2 -fno-exceptions -fno-rtti -DPRETOUCH_VARIANT=pretouch_base -I{folder} -I{NATIVE}".split()
    c = [word.replace("c++", "cc") for word in compiler]
    law = [*c, "-std=c99", "-O2", "-c", str(NATIVE / "law/pretouch_law.c"), "-o", f"{program}-law.o"]
    subprocess.run(law, check=True)
    subprocess.run([*compiler, *flags, *sources, f"{program}-law.o", "-lm", "-o", program], check=True)
    raise SystemExit(subprocess.run([*shlex.split(wanted.run), program], check=False).returncode)


if __name__ == "__main__":
    main()
