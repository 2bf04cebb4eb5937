"""Measures are what textbooks say, and their intervals hold as often as they claim."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize, stats

from pretouch._core.vocabulary import QUANTITIES
from pretouch.designs import ConditionalValueAtRisk, Constraint, Expected, Measure, Quantile, Required, WorstCase
from pretouch.designs.robust.required import least_probability
from pretouch.designs.robust.validation import LimitOutcome, Validation
from properties import examples
from refusals import refused

VALUES = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40)
SHARES = st.floats(0.01, 0.99)
EVERY = (Expected(), Quantile(probability=0.8), ConditionalValueAtRisk(probability=0.8), WorstCase())


@examples(200)
@given(values=VALUES, p=SHARES)
def test_measures_are_those_of_numpy_and_of_rockafellar_and_uryasev(values: list[float], p: float) -> None:
    f = np.array(values)
    size = np.abs(f).max() + 1.0
    assert Expected().of(f) == pytest.approx(f.mean(), abs=1e-12 * size)
    assert WorstCase().of(f) == f.max()
    if abs(p * len(f) - round(p * len(f))) > 1e-6:  # on a step, rounding decides which neighbor is meant
        assert Quantile(probability=p).of(f) == np.quantile(f, p, method="inverted_cdf")
    # their theorem: the mean of the tail is the minimum of t + mean(max(f - t, 0)) / (1 - p), a convex function of t
    # that is linear between samples: its minimum is at one of them
    least = min(t + np.maximum(f - t, 0).mean() / (1 - p) for t in f)
    assert ConditionalValueAtRisk(probability=p).of(f) == pytest.approx(least, abs=1e-9 * size / (1 - p))


def test_the_mean_of_the_tail_is_that_of_known_distributions() -> None:
    """Normal: phi(z) / (1 - p); of 2^16 equally likely quantiles, whose sums are off by some 1e-3 in the last cell."""
    p = 0.9
    grid = stats.norm.ppf((np.arange(1 << 16) + 0.5) / (1 << 16))
    known = stats.norm.pdf(stats.norm.ppf(p)) / (1 - p)
    assert ConditionalValueAtRisk(probability=p).of(grid) == pytest.approx(known, rel=1e-4)
    direct = optimize.minimize_scalar(lambda t: t + np.maximum(grid - t, 0).mean() / (1 - p), bounds=(0, 3))
    assert ConditionalValueAtRisk(probability=p).of(grid) == pytest.approx(direct.fun, rel=1e-6)


@examples(100)
@given(values=VALUES, rises=st.data())
def test_no_measure_falls_where_no_value_does(values: list[float], rises: st.DataObject) -> None:
    f = np.array(values)
    up = f + np.array([rises.draw(st.floats(0, 10)) for _ in values])
    for measure in EVERY:
        assert measure.of(up) >= measure.of(f) - 1e-9 * (np.abs(f).max() + 10)


@pytest.mark.parametrize("measure", EVERY, ids=lambda m: m.label)
def test_measures_work_along_the_last_axis(measure: Measure) -> None:
    f = np.random.default_rng(3).exponential(size=(4, 3, 50))
    found = measure.of(f)
    assert found.shape == (4, 3)
    assert found[2, 1] == pytest.approx(measure.of(f[2, 1]), rel=1e-14)


def test_an_encounter_without_contact_counts_where_it_lies_in_what_is_measured() -> None:
    f = np.array([1.0, 2.0, 3.0, 4.0, math.inf])
    assert Quantile(probability=0.8).of(f) == 4.0
    for measure in (Expected(), WorstCase(), ConditionalValueAtRisk(probability=0.5), Quantile(probability=0.9)):
        assert measure.of(f) == math.inf
    for measure in (Expected(), ConditionalValueAtRisk(probability=0.9), Quantile(probability=0.9)):
        value, low, high = measure.estimate(f, 0.95)
        assert value == math.inf
        assert low < high


def test_intervals_are_those_of_scipy() -> None:
    f = np.random.default_rng(0).gamma(2.0, size=300)
    value, low, high = Expected().estimate(f, 0.9)
    known = stats.t.interval(0.9, 299, loc=f.mean(), scale=stats.sem(f))
    assert (value, low, high) == pytest.approx((f.mean(), *known), rel=1e-12)
    _, low, high = Quantile(probability=0.7).estimate(f, 0.95)
    ends = stats.quantile_test(f, q=f.mean(), p=0.7).confidence_interval(0.95)
    assert (low, high) == pytest.approx((ends.low, ends.high), rel=1e-12)


@examples(100)
@given(count=st.integers(1, 5000), share=st.floats(0, 1), confidence=st.floats(0.5, 0.999))
def test_the_lower_bound_of_a_probability_is_that_of_clopper_and_pearson(
    count: int, share: float, confidence: float
) -> None:
    held = round(share * count)
    known = stats.binomtest(held, count, alternative="greater").proportion_ci(confidence, method="exact").low
    assert least_probability(held, count, confidence) == pytest.approx(known, rel=1e-9, abs=1e-12)


# (measure, samples of one repetition, draw, the true value, the coverage that is claimed)
COVERED = {
    "mean": (Expected(), 100, "uniform", 0.5, 0.95),  # t on the mean of 100 uniform numbers is off by less than 1e-3
    "quantile": (Quantile(probability=0.9), 200, "exponential", math.log(10), 0.95),  # holds for every distribution
    # asymptotic: the mean of the worst fifth of 1,000 rests on 200 numbers and on an estimated quantile
    "tail": (ConditionalValueAtRisk(probability=0.8), 1000, "exponential", math.log(5) + 1, 0.94),
}


@pytest.mark.parametrize("name", COVERED)
def test_intervals_cover_as_often_as_they_claim(name: str) -> None:
    measure, count, draw, true, claimed = COVERED[name]
    repeats, rng = 2000, np.random.default_rng(11)
    covered = wrong = 0
    for _ in range(repeats):
        _, low, high = measure.estimate(getattr(rng, draw)(size=count), 0.95)
        covered += low <= true <= high
        wrong += low <= 1.5 * true <= high
    # half as much again is four standard errors or more of each: few intervals may hold it
    assert wrong < 0.1 * repeats
    # a correct interval covers fewer times than this once in 10,000 runs of this test
    assert covered >= stats.binom.ppf(1e-4, repeats, claimed)
    if name == "mean":  # and one that is far too wide would cover always
        assert covered <= stats.binom.ppf(1 - 1e-4, repeats, 0.955)


@pytest.mark.parametrize("p", [0.5, 0.95])
def test_what_fresh_samples_say_of_a_limit_is_what_their_number_of_hits_allows(p: float) -> None:
    """Against the binomial distribution: shown where so many hits are rare below p, missed where so few are above."""
    n, said = 200, []
    required = Required(constraint=Constraint(name="time", limit=1.0), probability=p)
    for hits in range(n + 1):
        low = least_probability(hits, n, 0.95)
        outcome = LimitOutcome(required=required, limited=QUANTITIES["time"], held=hits / n, low=low, magnitude=1.0)
        nothing = {"value": 1.0, "low": 1.0, "high": 1.0, "nominal": None, "loss": None, "nominal_breaks": ()}
        fresh = Validation(samples=n, confidence=0.95, limits=(outcome,), reached=1.0, **nothing)
        said.append(fresh.state_of(outcome))
        many, few = stats.binom.sf(hits - 1, n, p), stats.binom.cdf(hits, n, p)
        if hits / n >= p:
            assert said[-1] == (
                "demonstrated" if many <= 0.05 else "met in every sample" if hits == n else "met, not demonstrated"
            )
        else:
            assert said[-1] == ("missed" if few < 0.05 else "missed, within chance")
    assert {"missed", "missed, within chance", "met, not demonstrated", "demonstrated"} <= set(said)


def test_the_lower_bound_of_a_probability_holds_as_often_as_it_claims() -> None:
    """Exact for every probability: it fails in at most 5 %, and in no fewer than discreteness makes of that."""
    rng, repeats = np.random.default_rng(5), 2000
    for p in (0.5, 0.9, 0.99):
        held = rng.binomial(400, p, size=repeats)
        fine = sum(least_probability(int(k), 400, 0.95) <= p for k in held)
        assert fine >= stats.binom.ppf(1e-4, repeats, 0.95)
        assert fine < repeats


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: Quantile(probability=1.0), {"argument": "probability", "value": 1.0, "limit": (0.0, 1.0)}),
        (
            lambda: ConditionalValueAtRisk(probability=0.0),
            {"argument": "probability", "value": 0.0, "limit": (0.0, 1.0)},
        ),
        (
            lambda: Required(constraint=Constraint(name="time", limit=1.0), probability=1.5),
            {"argument": "probability", "value": 1.5, "limit": (0.0, 1.0)},
        ),
    ],
)
def test_probabilities_that_are_none_are_refused(make: object, fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()
