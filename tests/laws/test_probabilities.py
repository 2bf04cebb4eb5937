"""Probabilities and quantiles agree with those of SciPy."""

import numpy as np
import pytest
from scipy import special, stats

from pretouch._core.probabilities import (
    beta_probability,
    beta_quantile,
    binomial_quantile,
    gamma_probability,
    gamma_quantile,
    normal_probability,
    normal_quantile,
    student_probability,
    student_quantile,
)

FORWARD = 1e-8  # relative: the rounding errors of ln Gamma, about 1e-16 of values up to 1e7
COUNTS = (1, 2, 3, 20, 59, 500, 4096, 100_000)


def test_normal_quantiles_have_nearly_full_precision():
    rng = np.random.default_rng(1)
    p = np.concatenate([rng.random(1000), 10.0 ** -rng.uniform(0, 300, 300), 1 - 10.0 ** -rng.uniform(1, 15, 300)])
    np.testing.assert_allclose(normal_quantile(p), special.ndtri(p), rtol=1e-13, atol=1e-15)
    assert normal_quantile(np.array(0.25)).shape == ()
    for z in rng.uniform(-37, 9, 50):
        assert normal_probability(z) == pytest.approx(special.ndtr(z), rel=1e-12)


@pytest.mark.parametrize("count", COUNTS)
def test_bounds_of_probabilities_agree(count):
    for held in {1, (count + 1) // 2, max(count - 3, 1), count}:
        for p in (1e-3, 0.05, 0.5, 0.95):
            x = beta_quantile(held, count - held + 1, p)
            assert x == pytest.approx(special.betaincinv(held, count - held + 1, p), rel=1e-10)
            assert beta_probability(held, count - held + 1, x) == pytest.approx(p, rel=FORWARD)


@pytest.mark.parametrize("count", COUNTS[:-1])
def test_binomial_quantiles_agree(count):
    for share in (0.001, 0.3, 0.5, 0.9, 0.999):
        for p in (0.005, 0.05, 0.5, 0.975):
            assert binomial_quantile(count, share, p) == int(stats.binom.ppf(p, count, share))


@pytest.mark.parametrize("freedom", [1.0, 1.5, 2.0, 3.0, 10.0, 55.3, 4095.0, 1e5])
def test_student_quantiles_agree(freedom):
    for p in (1e-4, 0.025, 0.5, 0.6, 0.95, 0.975, 0.9995, 1 - 1e-6):
        t = student_quantile(freedom, p)
        assert t == pytest.approx(special.stdtrit(freedom, p), rel=FORWARD, abs=1e-12)
        assert student_probability(freedom, t) == pytest.approx(p, rel=FORWARD)


@pytest.mark.parametrize("a", [0.5, 1.0, 1.5, 7.0, 40.5, 2000.0])
def test_gamma_quantiles_agree(a):
    for p in (1e-3, 0.05, 0.5, 0.95, 0.9999):
        x = gamma_quantile(a, p)
        assert x == pytest.approx(special.gammaincinv(a, p), rel=1e-10)
        assert gamma_probability(a, x) == pytest.approx(p, rel=FORWARD)


def test_ends_and_nan():
    assert beta_probability(2.0, 3.0, 0.0) == 0.0
    assert beta_probability(2.0, 3.0, 1.0) == 1.0
    assert np.isnan(beta_probability(2.0, 3.0, np.nan))
    assert (beta_quantile(2.0, 3.0, 0.0), beta_quantile(2.0, 3.0, 1.0)) == (0.0, 1.0)
    assert gamma_probability(2.0, -1.0) == 0.0
