"""Compute normal, beta and Student probabilities and their quantiles without SciPy, which takes 0.15 s to load."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from .numbers import FloatArray

# Wichura (1988), Algorithm AS 241, Applied Statistics 37, 477: numerators and denominators of three rational
# approximations with relative errors of about 1e-16, ascending powers.
_CENTRAL: Final = (
    (
        *(3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4),
        *(4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3),
    ),
    (
        *(1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3),
        *(2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3),
    ),
)
_OUTER: Final = (
    (
        *(1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0, 3.64784832476320460504e0),
        *(1.27045825245236838258e0, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4),
    ),
    (
        *(1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1),
        *(1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9),
    ),
)
_FAR: Final = (
    (
        *(6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0, 2.96560571828504891230e-1),
        *(2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7),
    ),
    (
        *(1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2),
        *(7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15),
    ),
)
_TINY: Final = 1e-300  # replaces a denominator of 0 in a continued fraction
_ROUNDING: Final = 2.0**-52
_MOST: Final = 100_000  # terms of the continued fraction, which needs about the root of the larger parameter


def normal_share(z: float) -> float:
    """Return the probability that a standard normal variable is at most z."""
    return 0.5 * math.erfc(-z / math.sqrt(2))


def normal_quantile(probability: ArrayLike) -> FloatArray:
    """Return the values that a standard normal variable does not exceed with given probabilities from 0 to 1.

    They are infinite for 0 and 1.
    """
    p = np.asarray(probability, dtype=np.float64)
    q = p - 0.5
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.sqrt(-np.log(np.minimum(p, 1 - p)))
        far = np.where(r <= 5, _ratio(_OUTER, r - 1.6), _ratio(_FAR, np.minimum(r, 1e3) - 5))
    outer = np.copysign(np.where(np.isinf(r), np.inf, far), q)
    return np.asarray(np.where(np.abs(q) <= 0.425, q * _ratio(_CENTRAL, 0.180625 - q * q), outer))


def _ratio(coefficients: tuple[tuple[float, ...], tuple[float, ...]], x: FloatArray) -> FloatArray:
    above, below = (np.full_like(x, ascending[-1]) for ascending in coefficients)
    for k in range(len(coefficients[0]) - 2, -1, -1):
        above, below = above * x + coefficients[0][k], below * x + coefficients[1][k]
    return np.asarray(above / below)


def beta_share(a: float, b: float, x: float) -> float:
    """Return the probability that a beta variable with parameters a, b > 0 is at most x.

    For whole numbers k and n it is the probability of at least k successes in n trials of probability x, with a = k and
    b = n - k + 1.
    """
    if not 0 < x < 1:
        return float(x >= 1)
    if x > (a + 1) / (a + b + 2):  # the continued fraction converges fast below the mean
        return 1 - beta_share(b, a, 1 - x)
    return _beta_density(a, b, x) * x * (1 - x) / a * _continued_fraction(a, b, x)


def beta_quantile(a: float, b: float, probability: float) -> float:
    """Return the value that a beta variable with parameters a, b > 0 does not exceed with a probability from 0 to 1."""
    low, high, x = 0.0, 1.0, a / (a + b)
    for _ in range(200):  # Newton's method, and bisection where a step leaves the bracket
        excess, slope = beta_share(a, b, x) - probability, _beta_density(a, b, x)
        low, high = (low, x) if excess > 0 else (x, high)
        nearer = x - excess / slope if slope > 0 else math.nan
        nearer = nearer if low < nearer < high else (low + high) / 2
        if abs(nearer - x) <= 2 * _ROUNDING * x:
            return nearer
        x = nearer
    return x


def student_limit(freedom: float, probability: float) -> float:
    """Return the limit that the magnitude of a Student t variable does not exceed with a probability below 1."""
    share = beta_quantile(0.5, freedom / 2, probability)  # of t^2 in t^2 + degrees of freedom
    return math.sqrt(freedom * share / (1 - share))


def _beta_density(a: float, b: float, x: float) -> float:
    scale = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)
    return math.exp(scale + (a - 1) * math.log(x) + (b - 1) * math.log1p(-x)) if 0 < x < 1 else 0.0


def _continued_fraction(a: float, b: float, x: float) -> float:
    """Return the continued fraction of the incomplete beta function, by Lentz's method (DLMF 8.17.22)."""
    c = 1.0
    value = d = 1 / ((1 - (a + b) * x / (a + 1)) or _TINY)
    for m in range(1, _MOST):
        before = value
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            d = 1 / ((1 + term * d) or _TINY)
            c = (1 + term / c) or _TINY
            value *= c * d
        if abs(value - before) <= _ROUNDING * abs(value):
            break
    return value
