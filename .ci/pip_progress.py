"""Run pip with the given arguments and show its progress in a single line; print its whole output if it fails."""

import subprocess
import sys
import time

EVERY = 10.0  # seconds between two lines if the output is not a terminal


def main() -> int:
    """Return the exit status of pip."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *sys.argv[1:]]
    output, start, shown = [], time.monotonic(), 0.0
    print("Setting up .venv (1 to 5 minutes) ...", flush=True)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as pip:
        for line in pip.stdout:
            output.append(line)
            word, _, rest = line.strip().partition(" ")
            if word not in {"Collecting", "Downloading", "Building", "Installing"}:
                continue
            text, passed = f"  {word} {rest}"[:90], time.monotonic() - start
            if sys.stdout.isatty():
                print(f"\r{text:<90}", end="", flush=True)
            elif passed - shown > EVERY:
                shown = passed
                print(text, flush=True)
    if sys.stdout.isatty():
        print(f"\r{'':<90}\r", end="")
    print("".join(output) if pip.returncode else f"Set up in {time.monotonic() - start:.0f} s.", flush=True)
    return pip.returncode


if __name__ == "__main__":
    sys.exit(main())
