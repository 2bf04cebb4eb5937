"""C beside the law's header, compiled by what the core is built with."""

from __future__ import annotations

import ctypes
import importlib.util
import subprocess
from pathlib import Path

import pytest

NATIVE = Path(__file__).parents[1] / "native"


def compile_c(folder: Path, source: str, *flags: str) -> ctypes.CDLL:
    """Make a library of a source and load it; a test is skipped where the machine has no compiler."""
    spec = importlib.util.spec_from_file_location("pretouch_native", NATIVE / "build.py")
    assert spec is not None
    assert spec.loader is not None
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    found = build.compilers()
    if found is None:
        pytest.skip("no compiler of the system's")
    (folder / "source.c").write_text(source)
    made = folder / "source.so"
    strict = [*build.LAW.split(), "-shared", "-fPIC", f"-I{NATIVE / 'law'}", *flags]
    subprocess.run([*found[0], *strict, str(folder / "source.c"), "-o", str(made), "-lm"], check=True)
    return ctypes.CDLL(str(made))
