"""C beside the law's header, compiled by what the core is built with."""

from __future__ import annotations

import ctypes
import importlib.util
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

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


def offsets(folder: Path, header: str, kind: str, fields: Sequence[str]) -> list[int]:
    """The size of a structure of a header in native/, and where each of its fields begins."""
    asked = "".join(f", offsetof({kind}, {field})" for field in fields)
    source = f'#include <stddef.h>\n#include "{NATIVE / header}"\nsize_t found[] = {{sizeof({kind}){asked}}};\n'
    return list((ctypes.c_size_t * (1 + len(fields))).in_dll(compile_c(folder, source), "found"))


def fields_of(kind: Any, before: str = "") -> list[tuple[str, int]]:
    """Fields of a structure that are no structures, by their path, and where each begins."""
    found = []
    for name, part in kind._fields_:
        offset = getattr(kind, name).offset
        inner = fields_of(part, f"{before}{name}.") if issubclass(part, ctypes.Structure) else [(f"{before}{name}", 0)]
        found += [(path, offset + more) for path, more in inner]
    return found
