"""Run a command as on a lesser processor: `python .ci/processor.py generic|avx2|native COMMAND...` (x86-64).

The compiled core, NumPy, OpenBLAS and the C library each choose code by what the processor can do, so results differ in
their last bits between machines. "generic" leaves them what every x86-64 has, "avx2" takes AVX-512 away, "native" changes
nothing.
"""

from __future__ import annotations

import os
import platform
import sys

AVX512 = ("AVX512F", "AVX512VL", "AVX512DQ", "AVX512BW")
VARIANT = {"generic": "base", "avx2": "avx2"}
BLAS = {"generic": "Prescott", "avx2": "Haswell"}
WITHOUT = {"generic": ("AVX", "AVX2", "FMA", "FMA4", *AVX512), "avx2": AVX512}


def environment(kind: str) -> dict[str, str]:
    """Return the variables that make the libraries see such a processor."""
    if kind == "native":
        return {}
    if kind not in VARIANT:
        raise SystemExit(f"{kind}: is no kind of processor; generic, avx2 and native are")
    if platform.machine() not in {"x86_64", "AMD64"}:
        raise SystemExit(f"{kind} is a kind of x86-64, this is {platform.machine()}")
    return {
        "PRETOUCH_VARIANT": VARIANT[kind],
        "NPY_DISABLE_CPU_FEATURES": " ".join(dispatched(kind)),
        "OPENBLAS_CORETYPE": BLAS[kind],
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=" + ",".join(f"-{feature}" for feature in WITHOUT[kind]),
    }


def dispatched(kind: str) -> list[str]:
    """List the features for which NumPy has code of its own, and this processor too, beyond what is left."""
    from numpy._core import _multiarray_umath as core

    beyond = [name for name in core.__cpu_dispatch__ if core.__cpu_features__[name]]
    return beyond if kind == "generic" else [name for name in beyond if "AVX512" in name or name == "X86_V4"]


if __name__ == "__main__":
    kind, *command = sys.argv[1:]
    print(f"as on a processor of kind {kind}: {' '.join(command)}", flush=True)
    os.environ.update(environment(kind))
    os.execvp(command[0], command)
