"""A new distribution is one class in one place, of one input or of several: it goes wherever distributions go."""

from __future__ import annotations

import json
import math
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from page_checks import as_written
from pretouch.report import write_report
from pretouch.uncertainty import Distribution, JointDistribution, Normal, make_ensemble
from refusals import refused
from robust_samples import with_robust_options
from verification_samples import BOUNDS, NOISY, OBJECTIVE, SCENARIO, SENSOR, verdict

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Triangular(Distribution):
    """Likeliest in the middle between two values."""

    low: float
    high: float

    @property
    def support(self) -> tuple[float, float]:
        return self.low, self.high

    def _quantile(self, probability: np.ndarray) -> np.ndarray:
        half = np.sqrt(np.minimum(probability, 1 - probability) / 2)
        return self.low + (self.high - self.low) * np.where(probability < 0.5, half, 1 - half)


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed(JointDistribution):
    """A speed, and a start that follows it: the faster, the farther."""

    speed: Distribution
    slope: float

    def inputs(self, name: str) -> tuple[str, ...]:  # noqa: ARG002
        return "obstacle.velocity", "obstacle.position"

    def means(self) -> tuple[float, ...]:
        return self.speed.mean, self.slope * self.speed.mean

    def draw(self, points: np.ndarray) -> np.ndarray:
        return self.speed.quantile(points[:, :1]) * [1.0, self.slope]

    def variance_along(self, slopes: np.ndarray) -> float:
        return float((slopes[0] + self.slope * slopes[1]) ** 2 * self.speed.variance)

    def alone(self, index: int) -> Distribution:
        return self.speed if index == 0 else Triangular(low=0.035, high=0.05)

    def others(self, index: int, values: np.ndarray) -> np.ndarray:
        return np.array([values, self.slope * values] if index == 0 else [values / self.slope, values])


SPEED = Triangular(low=-0.35, high=-0.25)
ONE = {"obstacle.velocity": SPEED}
TWO = {"approach": Followed(speed=SPEED, slope=-0.14)}
KNOWN = {"one input": ONE, "several": TWO}


def designed(known: Any, **options: Any) -> pt.designs.RobustDesign:
    given = {"bounds": BOUNDS, "uncertainty": known, "samples": 128, "validation": 128} | options
    return pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, **with_robust_options(**given)))


@pytest.mark.parametrize("sampling", ["sobol", "latin-hypercube", "random"])
def test_it_is_sampled(sampling: str) -> None:
    drawn = pt.uncertainty.sample_inputs(ONE, 4096, sampling=sampling)["obstacle.velocity"]
    # the mean of 4096 independent samples is within five of its standard errors; the width is 0.1, its variance / 24
    assert SPEED.variance == pytest.approx(0.01 / 24, rel=1e-4)  # 200 nodes on a quantile with a root at both ends
    assert abs(drawn.mean() - SPEED.mean) < 5 * math.sqrt(SPEED.variance / 4096)
    both = pt.uncertainty.sample_inputs(TWO, 4096, sampling=sampling)
    assert list(both) == ["obstacle.velocity", "obstacle.position"]
    np.testing.assert_array_equal(both["obstacle.position"], -0.14 * both["obstacle.velocity"])


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("name", KNOWN)
def test_a_robust_gain_is_designed_for_it_and_pages_name_it(name: str, tmp_path: Path) -> None:
    found = designed(KNOWN[name], measure=pt.designs.Quantile(probability=0.9))
    assert found.gain is not None
    (one,) = found.importance  # all of the variance is its own, to both ways of telling
    assert one.total == pytest.approx(1.0, abs=6 * one.total_error + 1e-9)
    assert one.by_gradient == 1.0
    price = found.price("obstacle.velocity", count=5)
    assert (price.low, price.high) == SPEED.support
    assert (price.loss > -1e-9).all()  # both objectives are right to 1e-10
    path = tmp_path / "page.html"
    write_report(found, path)
    together = ", jointly with the other inputs of approach" if name == "several" else ""
    expected = f"Triangular, -0.35 m/s to -0.25 m/s{together}"
    assert expected in as_written(path.read_text(encoding="utf-8"))
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))["uncertainty"]
    assert told[next(iter(KNOWN[name]))]["kind"] == type(next(iter(KNOWN[name].values()))).__name__
    assert pickle.loads(pickle.dumps(KNOWN[name])) == KNOWN[name]  # noqa: S301


def test_what_goes_together_is_priced_together() -> None:
    price = designed(TWO).price("obstacle.position", count=5)
    assert (price.low, price.high) == (0.035, 0.05)
    values = {"obstacle.position": price.value, "obstacle.velocity": price.value / -0.14}
    several = make_ensemble(SCENARIO, SENSOR, values)
    result = several.contacts(designed(TWO).gain)
    np.testing.assert_array_equal(price.robust, OBJECTIVE.value(result.end, several.speed, None))


def test_its_bounds_are_those_of_a_worst_case() -> None:
    planted = designed(ONE, measure=pt.designs.WorstCase())
    interval = {"obstacle.velocity": pt.uncertainty.Interval(low=-0.35, high=-0.25)}
    assert planted.gain == designed(interval, measure=pt.designs.WorstCase()).gain
    with refused("uncertainty approach"):
        designed(TWO, measure=pt.designs.WorstCase())


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_encounters_on_a_loop_differ_by_it(name: str, tmp_path: Path) -> None:
    found = verdict(NOISY, uncertainty=KNOWN[name], runs=16, changes=False)
    write_report(found, tmp_path / "page.html")
    page = as_written((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert "Triangular, -0.35 m/s to -0.25 m/s" in page


class Scipys:
    """What has quantiles, but is no distribution of ours."""

    def quantile(self, probability: Any) -> Any:
        return probability


def test_what_is_none_is_told_what_it_lacks() -> None:
    with refused("uncertainty obstacle.velocity"):
        designed({"obstacle.velocity": Scipys()})

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Half(Distribution):
        @property
        def support(self) -> tuple[float, float]:
            return 0.0, 1.0

    with pytest.raises(TypeError, match=r"abstract class Half .*_quantile"):
        Half()

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Narrow(Followed):
        def draw(self, points: np.ndarray) -> np.ndarray:
            return self.speed.quantile(points[:, 0])

    narrow = Narrow(speed=Normal(mean=-0.3, deviation=0.01), slope=-0.14)
    with refused("uncertainty approach"):
        designed({"approach": narrow})


def test_a_file_says_which_ways_it_knows(tmp_path: Path) -> None:
    """A file gives numbers in the unit of the input, so the ways to say them are its own."""
    path = tmp_path / "loop.toml"
    text = (ROOT / "examples" / "loop.toml").read_text(encoding="utf-8")
    path.write_text(text.replace("{ normal = [", "{ triangular = [", 1), encoding="utf-8")
    with refused("uncertainty.obstacle.velocity.triangular", error=pt.errors.ScenarioFileError):
        pt.load_scenario(path)
