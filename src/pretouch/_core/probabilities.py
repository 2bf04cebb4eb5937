"""Probabilities and quantiles of the normal, beta, binomial, Student's t and gamma distributions.

They agree with those of `scipy.special`, whose import takes longer than many designs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from .numbers import FloatArray

_ROUNDING: Final = 2.0**-52
_TIE: Final = 1e-12  # probabilities that differ by less are equal, such as 1/2 and that of half of the trials
_TINY: Final = 1e-300  # replaces a zero in a continued fraction
_MOST_TERMS: Final = 100_000
_MOST_STEPS: Final = 200  # so many bisections separate any two numbers of practical size
_CENTER: Final = 0.425  # |p - 1/2| up to which the first rational function of `normal_quantile` is used
_FAR: Final = 5.0  # sqrt(-ln p) from which the last one is used

# Numerator and denominator of M. J. Wichura's algorithm AS 241, Applied Statistics 37 (1988) 477, highest power first.
_MIDDLE: Final = (
    (
        2509.0809287301227,
        33430.57558358813,
        67265.7709270087,
        45921.95393154987,
        13731.69376550946,
        1971.5909503065513,
        133.14166789178438,
        3.3871328727963665,
    ),
    (
        5226.495278852854,
        28729.085735721943,
        39307.89580009271,
        21213.794301586597,
        5394.196021424751,
        687.1870074920579,
        42.31333070160091,
        1.0,
    ),
)
_TAIL: Final = (
    (
        0.0007745450142783414,
        0.022723844989269184,
        0.2417807251774506,
        1.2704582524523684,
        3.6478483247632045,
        5.769497221460691,
        4.630337846156546,
        1.4234371107496835,
    ),
    (
        1.0507500716444169e-09,
        0.0005475938084995345,
        0.015198666563616457,
        0.14810397642748008,
        0.6897673349851,
        1.6763848301838038,
        2.053191626637759,
        1.0,
    ),
)
_FAR_TAIL: Final = (
    (
        2.0103343992922881e-07,
        2.7115555687434876e-05,
        0.0012426609473880784,
        0.026532189526576124,
        0.29656057182850487,
        1.7848265399172913,
        5.463784911164114,
        6.657904643501103,
    ),
    (
        2.0442631033899397e-15,
        1.421511758316446e-07,
        1.8463183175100548e-05,
        0.0007868691311456133,
        0.014875361290850615,
        0.1369298809227358,
        0.599832206555888,
        1.0,
    ),
)


def normal_probability(z: float) -> float:
    """Return the probability that a standard normal variable is at most z.

    Examples:
        >>> normal_probability(0.0)
        0.5
    """
    return 0.5 * math.erfc(-z / math.sqrt(2))


def normal_quantile(probability: FloatArray) -> FloatArray:
    """Return the quantiles of the standard normal distribution (Wichura's algorithm AS 241).

    Args:
        probability: probabilities in (0, 1).

    Examples:
        >>> normal_quantile(np.array([0.025, 0.5])).round(6).tolist()
        [-1.959964, 0.0]
    """
    p = np.atleast_1d(np.asarray(probability, dtype=np.float64))
    q = p - 0.5
    z = q * _ratio(_MIDDLE, _CENTER**2 - q * q)
    outside = np.abs(q) > _CENTER
    if outside.any():
        r = np.sqrt(-np.log(np.where(q[outside] < 0, p[outside], 1 - p[outside])))
        far = np.where(r > _FAR, _ratio(_FAR_TAIL, r - _FAR), _ratio(_TAIL, r - 1.6))
        z[outside] = np.copysign(far, q[outside])
    return z.reshape(np.shape(probability))


def _ratio(coefficients: tuple[tuple[float, ...], tuple[float, ...]], r: FloatArray) -> FloatArray:
    above, below = (np.polyval(row, r) for row in coefficients)
    return np.asarray(above / below)


def beta_probability(a: float, b: float, x: float) -> float:
    """Return the regularized incomplete beta function I_x(a, b).

    Its continued fraction is evaluated on that side of the mean on which it converges fast.

    Examples:
        >>> round(beta_probability(2.0, 3.0, 0.5), 12)
        0.6875
    """
    if not 0 < x < 1:
        return math.nan if math.isnan(x) else float(x >= 1)
    if x > (a + 1) / (a + b + 2):
        return 1 - _beta_from_below(b, a, 1 - x, x)
    return _beta_from_below(a, b, x, 1 - x)


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)


def _beta_from_below(a: float, b: float, x: float, rest: float) -> float:
    """Return I_x(a, b) by its continued fraction, with Lentz's method; `rest` is 1 - x."""
    front = math.exp(a * math.log(x) + b * math.log(rest) - _log_beta(a, b)) / a
    c, d = 1.0, 1 / ((1 - (a + b) * x / (a + 1)) or _TINY)
    value = d
    for m in range(1, _MOST_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        d, c = 1 / ((1 + even * d) or _TINY), (1 + even / c) or _TINY
        value *= c * d
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        d, c = 1 / ((1 + odd * d) or _TINY), (1 + odd / c) or _TINY
        value *= c * d
        if abs(c * d - 1) <= _ROUNDING:
            break
    return front * value


def beta_quantile(a: float, b: float, probability: float) -> float:
    """Return the x at which I_x(a, b) is a probability.

    Examples:
        >>> round(beta_quantile(2.0, 3.0, 0.6875), 12)
        0.5
    """
    if probability <= 0 or probability >= 1:
        return float(probability >= 1)
    scale = _log_beta(a, b)
    if a < 1:  # the density is infinite at 0, where I_x is about x^a / (a B)
        start = math.exp(min((math.log(probability * a) + scale) / a, math.log(0.5)))
    else:
        start = min(max((a - 1) / max(a + b - 2, _ROUNDING), 1e-3 / (a + b)), 1 - 1e-3 / (a + b))

    def density(x: float) -> float:
        return math.exp((a - 1) * math.log(x) + (b - 1) * math.log1p(-x) - scale)

    return _inverse(lambda x: beta_probability(a, b, x), density, probability, start, 1.0)


def _inverse(
    function: Callable[[float], float],
    derivative: Callable[[float], float],
    value: float,
    start: float,
    high: float,
) -> float:
    """Return where a rising function has a value, by Newton's method between bounds that narrow."""
    low, x = 0.0, start
    for _ in range(_MOST_STEPS):
        error = function(x) - value
        low, high = (x, high) if error < 0 else (low, x)
        slope = derivative(x)
        following = x - error / slope if slope > _TINY else math.nan
        if not low < following < high:
            following = 0.5 * (low + high) if math.isfinite(high) else 2 * x
        if abs(following - x) <= 2 * _ROUNDING * x or error == 0:
            return following if error else x
        x = following
    return x


def binomial_quantile(count: int, share: float, probability: float) -> int:
    """Return the smallest k such that at most k of `count` trials succeed with a probability.

    Args:
        count: number of trials.
        share: probability of success of each trial, in (0, 1).
        probability: in (0, 1).

    Examples:
        >>> binomial_quantile(100, 0.5, 0.975)
        60
    """
    low, high = -1, count
    while high - low > 1:
        middle = (low + high) // 2
        at_most = 1 - beta_probability(middle + 1, count - middle, share)
        low, high = (low, middle) if at_most >= probability - _TIE else (middle, high)
    return high


def student_probability(freedom: float, t: float) -> float:
    """Return the probability that a variable with Student's t distribution is at most t.

    Examples:
        >>> round(student_probability(1.0, 1.0), 12)
        0.75
    """
    tail = 0.5 * beta_probability(0.5 * freedom, 0.5, freedom / (freedom + t * t))
    return tail if t < 0 else 1 - tail


def student_quantile(freedom: float, probability: float) -> float:
    """Return a quantile of Student's t distribution.

    Examples:
        >>> round(student_quantile(10.0, 0.975), 6)
        2.228139
    """
    share = beta_quantile(0.5, 0.5 * freedom, abs(2 * probability - 1))  # t^2 / (freedom + t^2)
    rest = 1 - share
    if share > 0.5:  # the smaller one is computed, because it has more digits
        rest = beta_quantile(0.5 * freedom, 0.5, 2 * min(probability, 1 - probability))
        share = 1 - rest
    return math.copysign(math.sqrt(freedom * share / rest) if rest > 0 else math.inf, probability - 0.5)


def gamma_probability(a: float, x: float) -> float:
    """Return the regularized lower incomplete gamma function P(a, x).

    Examples:
        >>> round(gamma_probability(1.0, 1.0), 12)
        0.632120558829
    """
    if x <= 0:
        return 0.0
    front = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x > a + 1:
        return 1 - front * _gamma_fraction(a, x)
    total = term = 1 / a
    n = 1
    while term > _ROUNDING * total and n < _MOST_TERMS:
        term *= x / (a + n)
        total += term
        n += 1
    return front * total


def _gamma_fraction(a: float, x: float) -> float:
    """Return the continued fraction of the upper incomplete gamma function, with Lentz's method."""
    below = x + 1 - a
    c, d = math.inf, 1 / below
    value = d
    for n in range(1, _MOST_TERMS):
        above = -n * (n - a)
        below += 2
        d, c = 1 / ((below + above * d) or _TINY), (below + above / c) or _TINY
        value *= c * d
        if abs(c * d - 1) <= _ROUNDING:
            break
    return value


def gamma_quantile(a: float, probability: float) -> float:
    """Return the x at which P(a, x) is a probability; twice this x is a quantile of chi squared with 2 a degrees.

    Examples:
        >>> round(2 * gamma_quantile(1.0, 0.95), 6)
        5.991465
    """
    start = math.exp((math.log(probability * a) + math.lgamma(a)) / a) if a < 1 else max(a - 1, 0.1)

    def density(x: float) -> float:
        return math.exp((a - 1) * math.log(x) - x - math.lgamma(a))

    return _inverse(lambda x: gamma_probability(a, x), density, probability, start, math.inf)
