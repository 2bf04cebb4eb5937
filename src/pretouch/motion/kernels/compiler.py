"""How kernels are compiled and where their machine code is kept.

Numba keeps machine code beside the source or in the home folder and raises where it can write to neither. Here it
goes to the first place that can be written: the folder that NUMBA_CACHE_DIR names, the user's cache folder, a
private folder among the temporary files; where there is none, kernels are compiled anew in each process. The folder
is named after a digest of all kernel sources: Numba watches only the file of the function that is called, not those
of the functions that it calls.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from pretouch._core.machine_code import writable_folder

__all__ = ["block_kernel", "block_part", "cache_folder", "kernel"]

config: Any = numba.core.config
F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a function on its first call, without the GIL, with NumPy's rules for division by zero."""
    return _compiled(function)


def block_kernel(function: F) -> F:
    """Compile a function that runs over blocks of encounters side by side: products and sums may be fused."""
    return _compiled(function, fastmath={"contract", "nsz"})


def block_part(function: F) -> F:
    """Compile a function that becomes part of each block kernel that calls it: a call would keep a loop scalar."""
    return _compiled(function, fastmath={"contract", "nsz"}, forceinline=True)


def _compiled(function: F, **options: Any) -> F:
    folder = cache_folder()
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder) if folder else before
    try:
        compiled = numba.njit(cache=folder is not None, error_model="numpy", nogil=True, **options)(function)
    finally:
        config.CACHE_DIR = before
    return cast("F", compiled)


@lru_cache(maxsize=1)
def cache_folder() -> Path | None:
    """Find the folder for machine code.

    Returns:
        The first candidate that can be written, or None where there is none.
    """
    package = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(package.glob("*/kernels/*.py")):
        digest.update(path.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    return writable_folder(name)
