"""Normal, beta and Student probabilities and quantiles, compared with those of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from pretouch._core.probability import beta_quantile, beta_share, normal_quantile, normal_share, student_limit

ROUNDING = 2.0**-52
PROBABILITIES = np.concatenate(
    [np.logspace(-307, -1, 4000), np.linspace(0.1, 0.9, 2001), 1 - np.logspace(-16, -1, 400)]
)


def test_normal_quantiles_agree_to_rounding_with_those_of_scipy() -> None:
    # Each of both has a relative error of a few roundings; near 0.5 the error is absolute, as that of the probability.
    assert np.allclose(normal_quantile(PROBABILITIES), special.ndtri(PROBABILITIES), rtol=8 * ROUNDING, atol=ROUNDING)


def test_normal_quantiles_of_impossible_and_of_certain_are_infinite() -> None:
    assert normal_quantile([0.0, 1.0]).tolist() == [-np.inf, np.inf]


@pytest.mark.parametrize("z", [-30.0, -8.0, -1.0, 0.0, 0.3, 6.0])
def test_normal_shares_agree_with_those_of_scipy(z: float) -> None:
    # erfc amplifies the rounding of its argument by z^2
    assert normal_share(z) == pytest.approx(float(special.ndtr(z)), rel=4 * ROUNDING * (1 + z * z))


@pytest.mark.parametrize("runs", [1, 7, 59, 500, 4096, 100_000])
@pytest.mark.parametrize("share", [0.01, 0.5, 0.95, 1.0])
@pytest.mark.parametrize("probability", [1e-3, 0.05, 0.5, 0.95])
def test_beta_quantiles_agree_with_those_of_scipy(runs: int, share: float, probability: float) -> None:
    k = max(round(share * runs), 1)
    # The logarithm of the gamma function has an absolute error of a few roundings of its value, n ln n.
    allowed = 20 * ROUNDING * (1 + runs * np.log1p(runs))
    quantile = beta_quantile(k, runs - k + 1, probability)
    assert quantile == pytest.approx(float(special.betaincinv(k, runs - k + 1, probability)), rel=allowed)
    assert beta_share(k, runs - k + 1, quantile) == pytest.approx(probability, rel=100 * allowed)


@pytest.mark.parametrize("x", [-1.0, 0.0, 1.0, 2.0])
def test_beta_shares_outside_of_the_range_are_zero_and_one(x: float) -> None:
    assert beta_share(2.0, 3.0, x) == (x >= 1)


@pytest.mark.parametrize("freedom", [1, 2, 15, 4095])
@pytest.mark.parametrize("probability", [0.5, 0.9, 0.95, 0.999])
def test_limits_of_student_agree_with_those_of_scipy(freedom: int, probability: float) -> None:
    expected = float(special.stdtrit(freedom, 0.5 + 0.5 * probability))
    # t is computed from s = t^2 / (t^2 + freedom); an error of s changes ln t by half of it over s (1 - s).
    allowed = (
        20 * ROUNDING * (1 + freedom * np.log1p(freedom)) * (1 + expected**2 / freedom) * (1 + freedom / expected**2)
    )
    assert student_limit(freedom, probability) == pytest.approx(expected, rel=allowed)
