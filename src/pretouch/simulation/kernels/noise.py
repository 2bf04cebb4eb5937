"""Random numbers by their index: the k-th draw of a run is the same whatever was drawn before, on any thread.

So two runs with one seed meet the same noise, reading by reading, even where one of them ends earlier: common random
numbers. The mixing is that of SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

__all__ = ["mix", "normal", "uniform"]

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_ONE = np.uint64(1)


def mix(key: Any, index: Any) -> Any:
    """Return 64 random bits for an index, both of them unsigned."""
    z = key + (index + _ONE) * _GOLDEN
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


def uniform(key: Any, index: int) -> float:
    """Return a number in (0, 1)."""
    return (float(mix(key, np.uint64(index)) >> _11) + 0.5) * 1.1102230246251565e-16


def normal(key: Any, index: int) -> float:
    """Return a number of the standard normal distribution, from the draws of an index and the next (Box, Muller)."""
    radius = math.sqrt(-2.0 * math.log(uniform(key, index)))
    return radius * math.cos(2.0 * math.pi * uniform(key, index + 1))
