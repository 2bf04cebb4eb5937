"""Run the demonstration of `make demo`: fit, design, robust design, verdict and letter; reports go to demo-output/."""

import shlex
import subprocess
import sys
from html import escape
from pathlib import Path
from typing import NamedTuple

EXAMPLES = Path(__file__).resolve().parent
OUTPUT = EXAMPLES.parent / "demo-output"


class Step(NamedTuple):
    """One command of the demonstration."""

    title: str  # what it shows
    arguments: tuple[str, ...]  # of pretouch; files are those of examples/
    report: str  # name of its report
    status: int = 0  # expected exit status; 1 is a negative answer
    full: bool = False  # whether the whole answer is printed, not only its first sentences


STEPS = (
    Step("Fit a sensor curve to bench readings.", ("fit", "sensor.csv"), "sensor-fit", full=True),
    Step("Design the gain for one encounter.", ("design", "approach.toml"), "approach-design", full=True),
    Step("Design it for a fingertip, with a limited impact force.", ("design", "fingertip.toml"), "fingertip-design"),
    Step("Design it for uncertain speeds, distances and sensors.", ("robust", "robust.toml"), "robust-robust"),
    Step("Choose between soft contact and a short retreat.", ("pareto", "tradeoff.toml"), "tradeoff-pareto"),
    Step("Simulate one encounter on the sampled loop.", ("simulate", "loop.toml"), "loop-simulate"),
    Step(
        "Verify the gain in 500 runs: it misses a limit.", ("verify", "loop.toml"), "loop-verify", status=1, full=True
    ),
    Step("Verify a stronger gain.", ("verify", "loop.toml", "--gain", "-0.86 N*s"), "loop-verify-stronger"),
    Step("Reproduce the letter.", ("reproduce", "table-2", "figure-4", "figure-5"), "letter-reproduction"),
)
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>pretouch: reports of the demonstration</title>
<style>:root{{color-scheme:light dark}}body{{font:16px/1.5 system-ui,sans-serif;max-width:45em;margin:2em auto;
padding:0 1em}}li{{margin:.8em 0}}code{{font-size:.9em;overflow-wrap:anywhere}}</style></head>
<body><h1>Reports of the demonstration</h1>
<ol>
{rows}
</ol></body></html>
"""


def run(number: int, step: Step) -> str:
    """Run a step, print its answer, and return its row of the index page."""
    paths = [str(EXAMPLES / word) if (EXAMPLES / word).is_file() else word for word in step.arguments]
    command = f"pretouch {shlex.join(path.replace(f'{EXAMPLES.parent}/', '') for path in paths)}"
    blank = "\n" if number > 1 else ""
    print(f"{blank}{number}. {step.title}\n   $ {command}", flush=True)
    report = OUTPUT / f"{step.report}.html"
    arguments = [sys.executable, "-m", "pretouch", *paths, "--output", str(report)]
    ended = subprocess.run(arguments, capture_output=True, text=True, encoding="utf-8", check=False)  # noqa: S603
    if ended.returncode != step.status:
        print(ended.stdout, ended.stderr)
        sys.exit(ended.returncode or 1)
    said = [line for line in ended.stdout.rstrip().splitlines()[:-1] if not line.startswith("All numbers:")]
    answer = "\n".join(said)  # without the last line, which is the path of the report
    headline, _, _ = answer.partition("\n\n")
    print("\n".join(f"   {line}".rstrip() for line in (answer if step.full else headline).splitlines()), flush=True)
    texts = escape(step.title), escape(command), escape(" ".join(headline.split()))
    return '<li><a href="{}">{}</a><br><code>{}</code><br>{}</li>'.format(report.name, *texts)


def main() -> None:
    """Run all steps and write the index page of their reports."""
    OUTPUT.mkdir(exist_ok=True)
    rows = [run(number, step) for number, step in enumerate(STEPS, 1)]
    index = OUTPUT / "index.html"
    index.write_text(PAGE.format(rows="\n".join(rows)), encoding="utf-8")
    print(f"\nAll reports, with figures: open {OUTPUT.name}/{index.name} in a browser.")


if __name__ == "__main__":
    main()
