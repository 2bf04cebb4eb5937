"""Time fresh processes: `import pretouch` compared with `import numpy`, and whole commands.

    python -m benchmarks.starting --packages

prints the size of each package that the program and its extras need, and the processor time of imports.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
ROUNDS = 5
VERBS = {
    "fit": "sensor.csv",
    "design": "approach.toml",
    "simulate": "loop.toml",
    "robust": "robust.toml",
    "pareto": "tradeoff.toml",
    "verify": "loop.toml",
}
"""And what each is given of the examples."""


def seconds(*arguments: str, folder: str) -> float:
    """Time one fresh interpreter."""
    start = time.perf_counter()
    done = subprocess.run([sys.executable, *arguments], cwd=folder, stdout=subprocess.DEVNULL, check=False)
    if done.returncode not in {0, 1}:  # 1: the verdict on the example is that its gain does not hold
        raise SystemExit(f"{' '.join(arguments)}: ended with {done.returncode}")
    return time.perf_counter() - start


IMPORTS = {
    "Python itself": "pass",
    "NumPy": "import numpy",
    "SciPy: scipy.special": "import scipy.special",
    "SciPy: scipy.optimize": "import scipy.optimize",
    "Matplotlib: a figure": "import matplotlib.figure, matplotlib.backends.backend_svg",
    "Typer": "import typer",
    "Typer with an option (pydantic)": "import typer, pydantic",
    "pretouch": "import pretouch",
}
_LARGE = 1.0  # MB: smaller packages are summed up


def _name(text: str) -> str:
    return re.sub(r"[-_.]+", "-", text).lower()


def needed(requirements: Iterable[str], extras: dict[str, list[str]]) -> set[str]:
    """Return the names of installed packages that requirements need, directly or not."""
    found: set[str] = set()
    open_ones = [Requirement(text) for text in requirements]
    while open_ones:
        one = open_ones.pop()
        if one.name == "pretouch":
            open_ones += [Requirement(text) for extra in one.extras for text in extras[extra]]
            continue
        if _name(one.name) in found:
            continue
        try:
            metadata = importlib.metadata.distribution(one.name)
        except importlib.metadata.PackageNotFoundError:  # for another system, or not installed
            continue
        found.add(_name(one.name))
        wanted = [Requirement(text) for text in metadata.requires or []]
        chosen = one.extras or {""}
        open_ones += [r for r in wanted if r.marker is None or any(r.marker.evaluate({"extra": e}) for e in chosen)]
    return found


def megabytes(name: str) -> float:
    """Return the size of an installed package without bytecode [MB]."""
    files = importlib.metadata.distribution(name).files or []
    paths = [Path(str(file.locate())) for file in files if "__pycache__" not in file.parts]
    return sum(path.stat().st_size for path in paths if path.exists()) / 1e6


def packages() -> None:
    """Print sizes of packages and processor times of imports."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    own = needed(project["dependencies"], extras)
    parts = {"program": own} | {name: needed([f"pretouch[{name}]"], extras) - own for name in extras}
    print("\npackages (installed ones; of an extra: those that the program does not need)")
    for part, names in parts.items():
        sizes = sorted(((megabytes(name), name) for name in names), reverse=True)
        large = ", ".join(f"{name} {size:.1f}" for size, name in sizes if size >= _LARGE)
        print(f"{part:12s} {sum(size for size, _ in sizes):6.0f} MB in {len(names):2d} packages: {large}")
    print(f"\nprocessor time of a fresh process, shortest of {ROUNDS}")
    for name, code in IMPORTS.items():
        times = [_processor_seconds("-c", code) for _ in range(ROUNDS)]
        print(f"{name:32s} {min(times):6.3f} s")


def _processor_seconds(*arguments: str) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(arguments: list[str] | None = None) -> None:
    """Run the benchmark, without arguments by default."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.starting", description="Time fresh processes.")
    parser.add_argument("--packages", action="store_true", help="sizes of packages and times of imports instead")
    if parser.parse_args(arguments or []).packages:
        packages()
    else:
        commands()


def commands() -> None:
    """Measure in turn, so that a drift of the machine affects all equally."""
    cases = {
        "import numpy": ("-c", "import numpy"),
        "import pretouch": ("-c", "import pretouch"),
        "every public name": ("-c", "from pretouch import *"),
        "pretouch --help": ("-m", "pretouch", "--help"),
    }
    for verb, name in VERBS.items():
        command = ("-m", "pretouch", verb, str(ROOT / "examples" / name))
        cases |= {f"pretouch {verb}": (*command, "--no-report")}
        cases |= {f"pretouch {verb}, with report": (*command, "--output", "report.html", "--force")}
    with tempfile.TemporaryDirectory() as folder:
        for arguments in cases.values():  # warm the caches of the file system
            seconds(*arguments, folder=folder)
        times: dict[str, list[float]] = {name: [] for name in cases}
        for _ in range(ROUNDS):
            for name, arguments in cases.items():
                times[name].append(seconds(*arguments, folder=folder))
    base = statistics.median(times["import numpy"])
    print(f"\nfresh processes, {ROUNDS} rounds in turn        min   median      max   over numpy")
    for name, values in times.items():
        median = statistics.median(values)
        print(f"{name:32s} {min(values):6.3f} s {median:6.3f} s {max(values):6.3f} s   {median / base:8.1f}")


if __name__ == "__main__":
    main(sys.argv[1:])
