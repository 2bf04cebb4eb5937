"""Run the demonstration of `make demo`: fit, design, robust design, verdict and letter; reports go to demo-output/."""

import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parent
OUTPUT = EXAMPLES.parent / "demo-output"


def pretouch(*arguments: str, expected: int = 0) -> None:
    """Print and run one command; stop if its exit status is not the expected one."""
    shown = " ".join(a.replace(f"{EXAMPLES.parent}/", "") for a in arguments)
    print(f"\n$ pretouch {shown}\n", flush=True)
    ended = subprocess.run([sys.executable, "-m", "pretouch", *arguments], check=False).returncode  # noqa: S603
    if ended != expected:
        sys.exit(ended or 1)


def main() -> None:
    """Run the demonstration."""
    OUTPUT.mkdir(exist_ok=True)
    pretouch("fit", str(EXAMPLES / "sensor.csv"), "--output", str(OUTPUT / "sensor-fit.html"))
    for name in ("approach", "fingertip"):
        report = str(OUTPUT / f"{name}-design.html")
        pretouch("design", str(EXAMPLES / f"{name}.toml"), "--output", report)
    pretouch("robust", str(EXAMPLES / "robust.toml"), "--output", str(OUTPUT / "robust-robust.html"))
    pretouch("pareto", str(EXAMPLES / "tradeoff.toml"), "--output", str(OUTPUT / "tradeoff-pareto.html"))
    loop = str(EXAMPLES / "loop.toml")
    pretouch("simulate", loop, "--output", str(OUTPUT / "loop-simulate.html"))
    pretouch(
        "verify", loop, "--output", str(OUTPUT / "loop-verify.html"), expected=1
    )  # the verdict: it does not hold; change the gain
    better = str(OUTPUT / "loop-verify-stronger.html")
    pretouch("verify", loop, "--gain", "-0.86 N*s", "--output", better)  # the changed gain holds
    pretouch("reproduce", "table-2", "figure-4", "figure-5", "--output", str(OUTPUT / "letter-reproduction.html"))
    print(f"\nReports with figures: {', '.join(sorted(p.name for p in OUTPUT.glob('*.html')))} in {OUTPUT.name}/")


if __name__ == "__main__":
    main()
