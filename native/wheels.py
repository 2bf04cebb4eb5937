"""Build the wheels of a release with zig, one for each kind of machine.

    python native/wheels.py --output dist                  every kind of machine
    python native/wheels.py --output dist linux-aarch64    only this kind

Each wheel serves every Python version, because the library does not use Python's C interface. If auditwheel is
installed, it checks the Linux wheels. The wheels for macOS and Windows are built, but have not been run.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from build import NATIVE, TARGETS

LARGEST = 3 * 2**20  # largest size of a wheel [bytes]; a wheel with three processor variants and the page has 1.7e6


def build_wheel(target: str, output: Path) -> Path:
    """Build the wheel of one kind of machine, and return its path."""
    before = set(output.glob("*.whl"))
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(output), "."]
    subprocess.run(command, cwd=NATIVE.parent, env=os.environ | {"PRETOUCH_TARGET": target}, check=True)
    (made,) = set(output.glob("*.whl")) - before
    return made


def check(wheel: Path, target: str) -> str:
    """Return a report on the sizes of a wheel; exit if it is too large, or without library or page core."""
    with zipfile.ZipFile(wheel) as archive:
        files = archive.infolist()
    own = [i for i in files if Path(i.filename).name.startswith("libpretouch")]
    libraries = [i for i in own if not i.filename.endswith(".json")]
    if len(libraries) != 1 or len(own) != 2 or wheel.stat().st_size > LARGEST:
        raise SystemExit(f"{wheel.name}: {wheel.stat().st_size} bytes, library and record {[i.filename for i in own]}")
    if not any(Path(i.filename).name == "core.wasm" for i in files):
        raise SystemExit(f"{wheel.name}: without the core of the page; build it with `make page` or install ziglang")
    size, compressed = wheel.stat().st_size / 1e3, libraries[0].compress_size / 1e3
    found = f"{wheel.name}: {size:.0f} kB, of which the library {compressed:.0f}"
    if target.startswith("linux") and (auditwheel := shutil.which("auditwheel")):
        shown = subprocess.run([auditwheel, "show", str(wheel)], check=True, capture_output=True, text=True).stdout
        found += "\n    auditwheel: " + " ".join(shown.split())
    return found


def main() -> None:
    """Build and check the wheels that the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("targets", nargs="*", default=sorted(TARGETS), help=", ".join(sorted(TARGETS)))
    parser.add_argument("--output", type=Path, default=Path("dist"), help="folder of the wheels")
    wanted = parser.parse_args()
    output = wanted.output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    for target in wanted.targets:
        print(check(build_wheel(target, output), target), flush=True)


if __name__ == "__main__":
    main()
