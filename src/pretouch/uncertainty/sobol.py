"""Draw the points of a scrambled Sobol sequence.

They are those of `scipy.stats.qmc.Sobol` with the same generator, bit by bit. SciPy takes half a second to load.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

_BITS: Final = 30  # binary digits of a point, as in SciPy

# fmt: off
_DIRECTIONS: Final = (
    (3, (1,)),
    (7, (1, 3)),
    (11, (1, 3, 1)),
    (13, (1, 1, 1)),
    (19, (1, 1, 3, 3)),
    (25, (1, 3, 5, 13)),
    (37, (1, 1, 5, 5, 17)),
    (41, (1, 1, 5, 5, 5)),
    (47, (1, 1, 7, 11, 19)),
    (55, (1, 1, 5, 1, 1)),
    (59, (1, 1, 1, 3, 11)),
    (61, (1, 3, 5, 5, 31)),
    (67, (1, 3, 3, 9, 7, 49)),
    (91, (1, 1, 1, 15, 21, 21)),
    (97, (1, 3, 1, 13, 27, 49)),
    (103, (1, 1, 1, 15, 7, 5)),
    (109, (1, 3, 1, 15, 13, 25)),
    (115, (1, 1, 5, 5, 19, 61)),
    (131, (1, 3, 7, 11, 23, 15, 103)),
    (137, (1, 3, 7, 13, 13, 15, 69)),
    (143, (1, 1, 3, 13, 7, 35, 63)),
    (145, (1, 3, 5, 9, 1, 25, 53)),
    (157, (1, 3, 1, 13, 9, 35, 107)),
    (167, (1, 3, 1, 5, 27, 61, 31)),
    (171, (1, 1, 5, 11, 19, 41, 61)),
    (185, (1, 3, 5, 3, 3, 13, 69)),
    (191, (1, 1, 7, 13, 1, 19, 1)),
    (193, (1, 3, 7, 5, 13, 19, 59)),
    (203, (1, 1, 3, 9, 25, 29, 41)),
    (211, (1, 3, 5, 13, 23, 1, 55)),
    (213, (1, 3, 7, 3, 13, 59, 17)),
    (229, (1, 3, 1, 3, 5, 53, 69)),
    (239, (1, 1, 5, 5, 23, 33, 13)),
    (241, (1, 1, 7, 7, 1, 61, 123)),
    (247, (1, 1, 7, 9, 13, 61, 49)),
    (253, (1, 3, 3, 5, 3, 55, 33)),
    (285, (1, 3, 1, 15, 31, 13, 49, 245)),
    (299, (1, 3, 5, 15, 31, 59, 63, 97)),
    (301, (1, 3, 1, 11, 11, 11, 77, 249)),
)
# fmt: on
"""Primitive polynomials over GF(2), as binary digits, and first direction numbers, from the second dimension on.

After S. Joe, F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM J. Sci. Comput. 30
(2008) 2635-2654.
"""

MOST_DIMENSIONS: Final = len(_DIRECTIONS) + 1
"""The largest number of dimensions with tabulated direction numbers."""


def scrambled_sobol(doublings: int, dimensions: int, rng: np.random.Generator) -> FloatArray:
    """Draw the first points of a scrambled Sobol sequence.

    A random linear matrix and a random shift scramble the sequence.

    Args:
        doublings: binary logarithm of the number of points, at most 30.
        dimensions: number of dimensions, at most `MOST_DIMENSIONS`.
        rng: generator of the scrambling.

    Returns:
        The points in the unit cube, shape (2 ** doublings, dimensions).

    Examples:
        >>> points = scrambled_sobol(3, 2, np.random.default_rng(0))
        >>> bool((np.sort(points[:, 0]) // 0.125 == np.arange(8)).all())  # one point in each eighth
        True
    """
    (own,) = rng.spawn(1)  # as in SciPy
    shift = own.integers(2, size=(dimensions, _BITS), dtype=np.uint32) @ 2 ** np.arange(_BITS, dtype=np.uint32)
    mixing = np.tril(own.integers(2, size=(dimensions, _BITS, _BITS), dtype=np.uint32)).astype(np.int64)
    mixing[:, np.arange(_BITS), np.arange(_BITS)] = 1
    weights = 2 ** np.arange(_BITS - 1, -1, -1)
    digits = (np.array([_directions(d) for d in range(dimensions)])[:, :, None] // weights) % 2
    directions = ((digits @ mixing.transpose(0, 2, 1)) % 2) @ weights
    points = shift.astype(np.int64)[None]
    for k in range(doublings):  # in the order of the Gray code, each half is the mirror image of the other one
        points = np.concatenate([points, points[::-1] ^ directions[:, k]])
    return np.asarray(points * 2.0**-_BITS)


def _directions(dimension: int) -> IntArray:
    """Return the Sobol direction numbers of one dimension as 30-bit integers."""
    if dimension == 0:
        numbers = [1] * _BITS
    else:
        polynomial, start = _DIRECTIONS[dimension - 1]
        degree, numbers = len(start), list(start)
        for j in range(degree, _BITS):
            new = numbers[j - degree]
            for k in range(1, degree + 1):
                if polynomial >> (degree - k) & 1:
                    new ^= numbers[j - k] << k
            numbers.append(new)
    return np.array([number << (_BITS - 1 - j) for j, number in enumerate(numbers)])
