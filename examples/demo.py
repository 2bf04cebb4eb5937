"""What `make demo` runs: a fit, two gains, a robust one, a trade-off, a part of the letter; reports in demo-output/."""

import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parent
OUTPUT = EXAMPLES.parent / "demo-output"


def pretouch(*arguments: str) -> None:
    """Run one command as a user would, and show it."""
    shown = " ".join(a.replace(f"{EXAMPLES.parent}/", "") for a in arguments)
    print(f"\n$ pretouch {shown}\n", flush=True)
    subprocess.run([sys.executable, "-m", "pretouch", *arguments], check=True)  # noqa: S603


def main() -> None:
    """Run the demonstration."""
    OUTPUT.mkdir(exist_ok=True)
    print("The first design on a machine compiles the motion solver once; that takes about 20 seconds.")
    pretouch("fit", str(EXAMPLES / "sensor.csv"), "--output", str(OUTPUT / "sensor-fit.html"))
    for name in ("approach", "fingertip"):
        report = str(OUTPUT / f"{name}-design.html")
        pretouch("design", str(EXAMPLES / f"{name}.toml"), "--output", report)
    pretouch("robust", str(EXAMPLES / "robust.toml"), "--output", str(OUTPUT / "robust-robust.html"))
    pretouch("pareto", str(EXAMPLES / "tradeoff.toml"), "--output", str(OUTPUT / "tradeoff-pareto.html"))
    pretouch("reproduce", "table-2", "figure-4", "figure-5", "--output", str(OUTPUT / "letter-reproduction.html"))
    print(f"\nReports with figures: {', '.join(sorted(p.name for p in OUTPUT.glob('*.html')))} in {OUTPUT.name}/")


if __name__ == "__main__":
    main()
