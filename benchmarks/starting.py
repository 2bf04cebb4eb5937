"""Time fresh processes: `import pretouch` compared with `import numpy`, and whole commands."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

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


def main() -> None:
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
    main()
