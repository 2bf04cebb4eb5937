"""Distributions are values whose quantiles say everything; samples of them are the same for the same seed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pretouch.uncertainty import (
    CorrelatedNormal,
    Distribution,
    Empirical,
    Interval,
    Normal,
    TruncatedNormal,
    Uniform,
    sample_inputs,
)
from pretouch.uncertainty.sobol import MOST_DIMENSIONS, scrambled_sobol
from properties import examples
from refusals import refused

KNOWN: dict[str, tuple[Distribution, object]] = {
    "uniform": (Uniform(low=-0.5, high=-0.1), stats.uniform(-0.5, 0.4)),
    "normal": (Normal(mean=3.3, deviation=0.2), stats.norm(3.3, 0.2)),
    "truncated": (
        TruncatedNormal(location=-0.3, deviation=0.1, low=-0.5, high=-0.05),
        stats.truncnorm(-2, 2.5, loc=-0.3, scale=0.1),
    ),
    "one-sided": (
        TruncatedNormal(location=1.0, deviation=2.0, low=0.0),
        stats.truncnorm(-0.5, math.inf, loc=1.0, scale=2.0),
    ),
    "upper tail": (TruncatedNormal(location=0.0, deviation=1.0, low=8.0, high=9.0), stats.truncnorm(8, 9)),
}


@pytest.mark.parametrize("name", KNOWN)
def test_quantiles_and_means_are_those_of_scipy(name: str) -> None:
    ours, theirs = KNOWN[name]
    p = np.array([1e-6, 0.01, 0.3, 0.5, 0.9, 0.999, 1 - 1e-9])
    np.testing.assert_allclose(ours.quantile(p), theirs.ppf(p), rtol=1e-9)
    assert ours.mean == pytest.approx(theirs.mean(), rel=1e-12)
    # quadrature: some 1e-7 in a tail that is cut, 1e-4 in one that is not
    assert ours.variance == pytest.approx(theirs.var(), rel=1e-3 if math.isinf(ours.support[1]) else 1e-6)
    assert (ours.quantile(0.0), ours.quantile(1.0)) == ours.support


@pytest.mark.parametrize("where", [-20.0, -1.2, 0.0, 1.0, 8.0])
@pytest.mark.parametrize("width", [1e-13, 1e-9, 1e-6, 4e-5, 2e-4, 1e-2])
def test_a_narrow_cut_of_a_normal_distribution_keeps_its_digits(where: float, width: float) -> None:
    cut = TruncatedNormal(location=0.0, deviation=1.0, low=where, high=where + width)
    low, high = cut.support
    p, place, width = np.array([0.0, 0.1, 0.5, 0.8, 1.0]), np.linspace(0.0, 1.0, 4001), high - low
    density = np.exp(-width * place * (low + width * place / 2))  # over that at the lower end
    weight = (density[1:] + density[:-1]) / 2
    inside = np.interp(p, np.concatenate([[0.0], np.cumsum(weight)]) / weight.sum(), place)
    middle = weight @ (place[1:] + place[:-1]) / 2 / weight.sum()
    # of the width: the square of 1e-4 that is left out, and beyond that the digits of differences of Phi
    near = (1e-8 if width < 1e-4 else 4e-14 / width**2 + 1e-8) * width
    np.testing.assert_allclose(cut.quantile(p), low + width * inside, rtol=1e-15, atol=near)
    assert cut.mean == pytest.approx(low + width * middle, rel=1e-15, abs=near)


@pytest.mark.parametrize(("location", "deviation"), [(-0.3, 1e16), (0.0, 1e300)])
def test_a_deviation_that_says_nothing_leaves_both_ends(location: float, deviation: float) -> None:
    cut = TruncatedNormal(location=location, deviation=deviation, low=-0.6, high=-0.05)
    assert cut.mean == pytest.approx(-0.325, rel=1e-12)
    assert cut.quantile([0.0, 0.25, 1.0]) == pytest.approx([-0.6, -0.4625, -0.05], rel=1e-12)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        (Interval(low=0.038, high=0.046), "anywhere, 38 mm to 46 mm"),
        (Uniform(low=0.038, high=0.046), "uniform, 38 mm to 46 mm"),
        (Normal(mean=0.04, deviation=0.002), "normal, 40 mm with a standard deviation of 2 mm"),
        (
            TruncatedNormal(location=0.04, deviation=0.002, low=0.038, high=0.046),
            "normal, 40 mm with a standard deviation of 2 mm, truncated to 38 mm to 46 mm",
        ),
        (Empirical(samples=(0.046, 0.038, 0.04)), "3 measured values, 38 mm to 46 mm"),
    ],
)
def test_a_distribution_says_what_it_is(known: Distribution, words: str) -> None:
    assert known.described("m") == words
    assert list(known.rows("obstacle.position", {"obstacle.position": "m"})) == [("obstacle.position", words)]
    told = known.to_dict()
    assert told.pop("kind") == type(known).__name__
    assert type(known)(**told) == known


def test_inputs_that_go_together_are_told_one_by_one() -> None:
    known = CorrelatedNormal(names=("sensor.exponent", "b"), mean=(3.3, 0.04), covariance=((0.04, 0.0), (0.0, 0.0)))
    assert list(known.rows("calibration", {"b": "m"})) == [
        (
            "sensor.exponent",
            "normal, 3.3 with a standard deviation of 0.2, jointly with the other inputs of calibration",
        ),
        ("b", "normal, 40 mm with a standard deviation of 0 mm, jointly with the other inputs of calibration"),
    ]
    assert known.to_dict()["kind"] == "CorrelatedNormal"


@examples(50)
@given(samples=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=30), p=st.floats(0, 1))
def test_an_empirical_quantile_is_one_of_the_values(samples: list[float], p: float) -> None:
    known = Empirical(samples=tuple(samples))
    value = known.quantile(p)
    assert value in samples
    assert np.mean(np.asarray(samples) <= value) >= p - 1e-12
    assert known.mean == pytest.approx(np.mean(samples), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("sampling", ["sobol", "latin-hypercube", "random"])
def test_samples_follow_the_seed_and_nothing_else(sampling: str) -> None:
    known = {"obstacle.velocity": Uniform(low=-0.5, high=-0.1), "admittance.mass": Normal(mean=1.0, deviation=0.1)}
    one = sample_inputs(known, 300, seed=7, sampling=sampling)
    again = sample_inputs(known, 300, seed=7, sampling=sampling)
    other = sample_inputs(known, 300, seed=8, sampling=sampling)
    for name, value in known.items():
        assert one[name].shape == (300,)
        np.testing.assert_array_equal(one[name], again[name])
        assert not np.array_equal(one[name], other[name])
        # the mean of 300 independent samples is within five of its standard errors
        deviation = float(np.diff(value.quantile([0.16, 0.84]))[0]) / 2
        assert abs(one[name].mean() - value.mean) < 5 * deviation / math.sqrt(300)


def test_correlated_inputs_have_the_covariance_that_was_given() -> None:
    names, mean = ("sensor.exponent", "sensor.distance_offset"), (3.3, 0.04)
    covariance = ((1e-2, 1.8e-4), (1.8e-4, 4e-6))
    known = CorrelatedNormal(names=names, mean=mean, covariance=covariance)
    drawn = sample_inputs({"sensor": known}, 1 << 14, seed=1)
    table = np.array([drawn[n] for n in names])
    np.testing.assert_allclose(table.mean(axis=1), mean, rtol=1e-3)
    np.testing.assert_allclose(np.cov(table), covariance, rtol=0.02)  # Sobol points of 16,384 are better than 1 %
    np.testing.assert_allclose(known.root @ known.root.T, covariance, rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: Interval(low=1.0, high=1.0), {"argument": "low"}),
        (lambda: Uniform(low=2.0, high=math.nan), {"argument": "high"}),
        (lambda: Normal(mean=0.0, deviation=0.0), {"argument": "deviation", "value": 0.0}),
        (lambda: TruncatedNormal(location=0.0, deviation=1.0, low=40.0, high=41.0), {"argument": "low"}),
        (lambda: Empirical(samples=(1.0,)), {"argument": "samples"}),
        (
            lambda: CorrelatedNormal(names=("a", "b"), mean=(0.0, 0.0), covariance=((1.0, 2.0), (2.0, 1.0))),
            {"argument": "covariance"},
        ),
        (
            lambda: CorrelatedNormal(names=("a", "b"), mean=(0.0, 0.0), covariance=((1.0, 0.5), (0.1, 1.0))),
            {"argument": "covariance"},
        ),
        (lambda: CorrelatedNormal(names=("a",), mean=(0.0, 0.0), covariance=((1.0,),)), {"argument": "covariance"}),
        (lambda: sample_inputs({}, 10), {"argument": "uncertainty"}),
        (lambda: sample_inputs({"a": Normal(mean=0, deviation=1)}, 0), {"argument": "samples", "value": 0}),
        (
            lambda: sample_inputs({"a": Normal(mean=0, deviation=1)}, 9, sampling="grid"),
            {"argument": "sampling", "value": "grid"},
        ),
        (
            lambda: sample_inputs(
                {"a": Normal(mean=0, deviation=1), "b": CorrelatedNormal(names=("a",), mean=(0,), covariance=((1,),))},
                9,
            ),
            {"argument": "uncertainty"},
        ),
    ],
)
def test_what_makes_no_sense_is_refused(make: object, fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()


@pytest.mark.parametrize(("doublings", "dimensions"), [(0, 1), (1, 2), (10, 7), (12, MOST_DIMENSIONS)])
def test_points_of_the_sobol_sequence_are_those_of_scipy(doublings: int, dimensions: int) -> None:
    """Bit by bit: sums of powers of two are exact."""
    own = scrambled_sobol(doublings, dimensions, np.random.default_rng(doublings))
    scipy = stats.qmc.Sobol(dimensions, rng=np.random.default_rng(doublings)).random_base2(doublings)
    assert np.array_equal(own, scipy)


def test_more_inputs_than_tabulated_dimensions_are_sampled_by_scipy() -> None:
    names = [f"obstacle.{k}" for k in range(MOST_DIMENSIONS + 1)]
    drawn = sample_inputs({name: Uniform(low=0.0, high=1.0) for name in names}, 8, seed=3)
    scipy = stats.qmc.Sobol(len(names), rng=np.random.default_rng(3)).random_base2(3)
    assert np.allclose(np.column_stack([drawn[name] for name in names]), scipy, rtol=0, atol=1e-15)
