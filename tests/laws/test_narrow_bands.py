"""A search finds feasible gains also if all of them lie between two scanned ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pretouch as pt
from pretouch._core.numbers import FloatArray
from pretouch.designs import Constraint, Expected, HertzImpact, Measure, Quantile, WorstCase
from pretouch.designs.robust import robust
from pretouch.designs.search import RUNS, SAMPLED, Effort, Landscape, search_axis
from pretouch.designs.search.scan import EXACT
from pretouch.uncertainty import TruncatedNormal


@pytest.mark.slow
@given(at=st.floats(-4.5, 4.5), slopes=st.tuples(st.floats(0.1, 30), st.floats(0.1, 30)), width=st.floats(1e-5, 0.05))
@pytest.mark.parametrize("effort", [EXACT, SAMPLED, RUNS])
def test_a_band_between_scanned_coordinates_is_found(
    effort: Effort, at: float, slopes: tuple[float, float], width: float
) -> None:
    """Two limits leave a band of any width: its two ends are the only edges, and the objective falls to one of them."""
    if effort is not EXACT:
        width = max(width, 5e-3)  # these searches resolve a thousandth

    def evaluate(u: FloatArray) -> Landscape:
        ratios = np.stack([1 - slopes[0] * (u - at), 1 + slopes[1] * (u - at - width)])
        return Landscape(objective=2 + np.tanh(u), ratios=ratios)

    scanned, minima = search_axis(evaluate, -5.0, 5.0, effort)
    assert scanned.landscape.feasible.any()
    assert minima[0].coordinate == pytest.approx(at, abs=1e-8 if effort is EXACT else 2e-3)


@given(places=st.lists(st.floats(-4.5, 4.5), min_size=2, max_size=3, unique=True), width=st.floats(1e-3, 0.02))
def test_every_band_is_searched(places: list[float], width: float) -> None:
    """Of several bands, the one with the lowest objective has the answer."""
    near = np.sort(places)
    if np.diff(near).min() < 0.5:
        return

    def evaluate(u: FloatArray) -> Landscape:
        apart = np.abs(np.asarray(u)[..., None] - near).min(axis=-1)
        return Landscape(objective=2 - np.tanh(u), ratios=(1 + apart - width)[None])

    _, minima = search_axis(evaluate, -5.0, 5.0)
    assert minima[0].coordinate == pytest.approx(near[-1] + width, abs=1e-8)


@pytest.mark.parametrize("reach", [1e-2, 1e-4])
def test_a_band_at_the_edge_of_contact_is_found(reach: float) -> None:
    """A contact speed that falls to 0 at the edge of contact meets its limit only close to this edge."""

    def evaluate(u: FloatArray) -> Landscape:
        inside = np.maximum(u - 0.123, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            objective = np.where(u > 0.123, 1 + u**2, np.inf)
            return Landscape(objective=objective, ratios=np.where(u > 0.123, np.sqrt(inside / reach), np.inf)[None])

    _, minima = search_axis(evaluate, -5.0, 5.0)
    assert 0.123 < minima[0].coordinate <= 0.123 + reach


def test_without_a_feasible_coordinate_the_scan_contains_the_least_violation() -> None:
    """Two ratios cross at 1.0001: nothing is feasible, and the crossing belongs to the scan."""

    def evaluate(u: FloatArray) -> Landscape:
        return Landscape(objective=2 + np.tanh(u), ratios=1.0001 + np.stack([1.5 - u, 2 * (u - 1.5)]))

    scanned, minima = search_axis(evaluate, -5.0, 5.0)
    assert not minima
    assert scanned.least_violation == pytest.approx(1.5, abs=1e-9)
    assert scanned.landscape.worst_ratio.min() == pytest.approx(1.0001, abs=1e-9)


TASK = pt.Task(
    pt.Scenario(
        admittance=pt.Admittance.from_natural_frequency(mass=1.0, natural_frequency=5.0),
        obstacle=pt.Obstacle(position=0.098, velocity=-0.25),
    ),
    pt.InversePower(scale=4.8, distance_offset=0.01101, exponent=2.101),
    pt.excursion_objective(position_scale=0.06, velocity_scale=0.25),
    bounds=(-10.0, -0.001),
    constraints=(Constraint(name="excursion", limit=0.06), Constraint(name="impact_force", limit=15.0)),
    impact=HertzImpact(robot_mass=0.4, effective_modulus=1e7, radius=0.01),
    uncertainty={"obstacle.velocity": TruncatedNormal(location=-0.25, deviation=0.05, low=-0.4, high=-0.1)},
)


@pytest.mark.parametrize("measure", [Expected(), Quantile(probability=0.9), WorstCase()])
def test_a_robust_gain_does_not_depend_on_bounds_that_contain_it(measure: Measure) -> None:
    """The feasible band is 3 % wide, and two neighboring gains of the first scan differ by 15 %."""
    task = TASK.replace(robust=replace(TASK.robust, measure=measure, samples=128, validation=128))
    gains = [
        robust(task.replace(bounds=bounds)).gain
        for bounds in [(-10.0, -0.001), (-2.0, -0.1), (-0.5, -0.05), (-0.3, -0.15)]
    ]
    assert gains[0] is not None
    np.testing.assert_allclose(gains, gains[0], rtol=1e-6)
