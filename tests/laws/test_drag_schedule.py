"""The laws of a schedule of the drag: what it keeps, what nothing goes below, and when a constant drag is best."""

from __future__ import annotations

import json
import math
import pickle
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson

from encounters import CURVES
from pretouch._core.errors import InvalidInputError
from pretouch.design.drag import DragLimits, drag_by
from pretouch.design.schedule import DragSchedule, schedule_drag
from pretouch.sensors import CustomSensor, ExponentialFirstOrder, InversePower
from properties import examples

POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
DISTANCE = 0.0422
TO_CONTACT = sorted(name for name, curve in CURVES.items() if curve.valid_range[0] <= 0)
RANGES = {"0.5-2": (0.5, 2.0), "30 %": (1 / 1.3, 1.3), "20 %": (1 / 1.2, 1.2), "10 %": (1 / 1.1, 1.1)}
WIDE = (1e-6, 40.0)
RISING = CustomSensor(
    log_output_function=lambda d: 5 * d, log_slope_function=lambda d: np.full_like(d, 5.0), maximum_distance=1.0
)


@cache
def scheduled(
    known: str = "20 %", *, monotone: bool = True, ratio: float = 0.26, rails: tuple[float, float] = (0.5, 2.0)
) -> DragSchedule:
    found = schedule_drag(POWER, DISTANCE, 1.0, ratio=ratio, reflectance=RANGES[known], monotone=monotone, rails=rails)
    assert isinstance(found, DragSchedule)
    return found


def simulated(found: DragSchedule, reflectance: float, count: int = 40_001) -> tuple[float, float, float]:
    """Ratio, excursion and peak by d ln|l'|/dl = phi(s) g^2/M on a fine grid of l, phi from the readings alone.

    Midpoints in l: phi jumps, so the error is that of the cell it jumps in, phi g^2 dl/2, and no order more.
    """
    constant = found.constant
    grid = np.linspace(constant.detection_distance, 0.0, count)
    middle, width = (grid[1:] + grid[:-1]) / 2, grid[0] / (count - 1)
    reading = constant.sensor.log_output(middle) + math.log(reflectance)
    pull = found.drag_at(reading) * constant.sensor.log_slope(middle) ** 2 / constant.mass
    growth = np.concatenate([[0.0], np.cumsum(pull) * width])
    time = cumulative_simpson(np.exp(growth), x=np.linspace(0.0, grid[0], count))[-1]
    speed = np.exp(-(growth[1:] + growth[:-1]) / 2)
    return math.exp(-growth[-1]), time - grid[0], float((pull * speed**2).max())


def error(found: DragSchedule, count: int = 40_001) -> float:
    """What `simulated` may be wrong by in Q: at each border of a step half a cell, of the difference of drags."""
    constant = found.constant
    steepest = np.abs(constant.sensor.log_slope(np.linspace(0.0, constant.detection_distance, 501))).max()
    cell = constant.detection_distance / (count - 1)
    return float(np.abs(np.diff(found.drag)).sum() / constant.mass * steepest**2 * cell / 2 + 1e-6)


@pytest.mark.parametrize("known", ["0.5-2", "30 %"])
@pytest.mark.parametrize("rails", [(0.5, 2.0), (0.25, 4.0), WIDE])
def test_a_constant_is_the_best_of_the_rising_ones_where_reflectance_is_hardly_known(
    known: str, rails: tuple[float, float]
) -> None:
    found = scheduled(known, rails=rails)
    assert 1e3 * found.constant.excursion == pytest.approx(34.23, abs=0.005)
    assert found.largest_excursion == pytest.approx(found.constant.excursion, abs=1e-5)
    assert 0 <= found.gap + 1e-12 < 1e-5
    assert found.lower_bound > found.constant.excursion - 1e-5
    assert found.verdict.startswith("a constant virtual drag with an excursion of ")
    assert (
        "Every rising drag schedule with the same steps of ln xi (xi: sensor output) needs an excursion of at least"
        in found.verdict
    )


def test_that_a_constant_is_best_follows_from_thresholds_alone() -> None:
    """The condition in the docs: no schedule that sets in at a threshold buys Q(0) cheaper than the constant."""

    def cheapest(width: float) -> float:
        """Return the price of Q(0) by a threshold, over the constant's, the least over thresholds."""
        grid = np.linspace(0.0, DISTANCE, 2001)
        integral = 3.32**2 * (1 / 0.0419 - 1 / (grid + 0.0419))  # of g^2, from contact
        k = math.log(1 / 0.26) / integral[-1]
        grown = np.exp(k * (integral[-1] - integral))
        reach = np.linspace(1e-4, 1.0, 400) * DISTANCE  # where the darkest passes the threshold
        far = np.minimum((reach + 0.0419) * math.exp(width / 3.32) - 0.0419, DISTANCE)  # and the brightest
        dark, bright = (3.32**2 * (1 / 0.0419 - 1 / (x + 0.0419)) for x in (reach, far))
        costs = np.trapezoid(grown * np.maximum(bright[:, None] - integral, 0.0), grid, axis=1)
        prices = costs / dark
        return float(prices.min() / prices[-1])

    assert cheapest(2 * math.log(2.0)) == 1.0
    assert cheapest(2 * math.log(1.3)) == 1.0
    assert cheapest(2 * math.log(1.2)) < 0.99


def test_it_is_worth_it_where_reflectance_is_known() -> None:
    saved = {known: 1 - scheduled(known).largest_excursion / 0.03423 for known in RANGES}
    assert 0.10 < saved["20 %"] < 0.15
    assert 0.25 < saved["10 %"] < 0.33
    for known in ("20 %", "10 %"):
        found = scheduled(known)
        assert found.verdict.startswith("compared with a constant drag, the drag schedule is worthwhile:")
        assert found.gap < 1e-5
    assert (
        "the excursion is 12 % smaller (30.0 mm instead of 34.2 mm). The peak acceleration is 2."
        in scheduled("20 %").verdict
    )
    assert 1e3 * scheduled("20 %", rails=WIDE).largest_excursion == pytest.approx(28.3, abs=0.1)
    assert 1e3 * scheduled("10 %", rails=WIDE).largest_excursion == pytest.approx(15.4, abs=0.1)
    assert scheduled("0.5-2", monotone=False).verdict.startswith(
        "compared with a constant drag, the drag schedule is not worthwhile:"
    )


@pytest.mark.parametrize("known", RANGES)
@pytest.mark.parametrize("rails", [(0.5, 2.0), (0.25, 4.0)])
def test_free_is_no_worse_than_monotone_and_wide_rails_than_narrow(known: str, rails: tuple[float, float]) -> None:
    one, free = scheduled(known, rails=rails), scheduled(known, monotone=False, rails=rails)
    assert free.largest_excursion <= one.largest_excursion + free.gap + 1e-12
    assert scheduled(known, rails=(0.25, 4.0)).lower_bound <= scheduled(known).largest_excursion
    assert (np.diff(one.drag) >= -1e-7 * one.constant.drag).all()  # HiGHS keeps rows to 1e-7
    assert one.reflectance[[0, -1]] == pytest.approx(RANGES[known], rel=1e-12)
    assert one.ratio.argmax() == 0 or np.ptp(one.ratio) < 1e-6
    assert one.excursion[-1] == pytest.approx(one.largest_excursion, abs=1e-8)


@given(
    known=st.sampled_from(sorted(RANGES)),
    monotone=st.booleans(),
    rails=st.sampled_from([(0.5, 2.0), (0.25, 4.0)]),
    share=st.floats(0.0, 1.0),
)
@examples(40)
def test_every_reflectance_keeps_the_ratio_and_the_rails(
    known: str, monotone: bool, rails: tuple[float, float], share: float
) -> None:
    found = scheduled(known, monotone=monotone, rails=rails)
    low, high = np.log(RANGES[known])
    theta = math.exp(low + share * (high - low))
    ratio, excursion, peak = simulated(found, theta)
    off = error(found)
    between = 1e-4 * (not monotone)  # of ln rho: between two reflectances that were looked at, by second differences
    assert math.log(ratio / 0.26) <= off + between
    assert excursion <= found.largest_excursion + (DISTANCE + found.largest_excursion) * (off + 10 * between)
    assert found.rails.ratio[0] * (1 - off) <= ratio <= found.rails.ratio[1] * (1 + off)
    assert found.rails.excursion[0] <= excursion + DISTANCE * off <= found.rails.excursion[1] + 2 * DISTANCE * off
    assert peak <= min(found.rails.peak, found.peak.max() * 1.001)
    assert (found.drag >= found.rails.weak.drag * (1 - 1e-12)).all()
    assert (found.drag <= found.rails.strong.drag * (1 + 1e-12)).all()
    assert (found.ratio <= 0.26 * (1 + 1e-12)).all()


@pytest.mark.parametrize("name", TO_CONTACT)
@pytest.mark.parametrize("monotone", [True, False])
def test_what_is_told_of_each_reflectance_is_what_a_simulation_finds(name: str, monotone: bool) -> None:
    found = schedule_drag(CURVES[name], 0.04, 1.3, ratio=0.2, reflectance=(0.85, 1.15), monotone=monotone, steps=24)
    off = error(found)
    assert found.gap < 1e-4 * found.constant.excursion
    for i in np.linspace(0, len(found.reflectance) - 1, 5).astype(int):
        ratio, excursion, peak = simulated(found, float(found.reflectance[i]))
        assert abs(math.log(ratio / found.ratio[i])) <= off
        assert excursion == pytest.approx(found.excursion[i], abs=off * (0.04 + found.excursion[i]))
        assert peak == pytest.approx(found.peak[i], rel=2e-3)  # a midpoint is half a cell from where a step sets in


@pytest.mark.parametrize("name", TO_CONTACT)
@pytest.mark.parametrize("steps", [1, 48])
def test_between_rails_that_meet_it_is_the_constant_drag(name: str, steps: int) -> None:
    """Both quadratures of it claim 1e-11: cut at borders of s, and halved until they are smooth."""
    found = schedule_drag(CURVES[name], 0.05, 1.3, ratio=0.05, rails=(1.0, 1.0), steps=steps)
    np.testing.assert_allclose(found.ratio, 0.05, rtol=1e-10)
    np.testing.assert_allclose(found.excursion, found.constant.excursion, rtol=1e-10)
    np.testing.assert_allclose(found.peak, found.constant.peak, rtol=1e-4)  # at nodes, beside a flat top
    assert found.gap < 1e-9


@pytest.mark.parametrize(("ratio", "rails", "monotone"), [(0.26, WIDE, False), (0.7, (1e-3, 1e3), True)])
def test_a_step_that_goes_too_far_is_taken_back_halfway(
    ratio: float, rails: tuple[float, float], monotone: bool
) -> None:
    """On the way to these two some drags have excursions of 5,000 and 10^33 times that of the constant one."""
    found = schedule_drag(POWER, DISTANCE, 1.0, ratio=ratio, reflectance=(0.5, 2.0), rails=rails, monotone=monotone)
    assert (found.ratio <= ratio * (1 + 1e-9)).all()
    assert found.excursion.max() <= found.constant.excursion * (1 + 1e-9)
    assert found.gap < 1e-4


@given(seed=st.integers(0, 2**32 - 1), monotone=st.booleans(), known=st.sampled_from(["20 %", "10 %"]))
@examples(25)
def test_no_schedule_that_keeps_the_ratio_is_better_than_the_lower_bound(seed: int, monotone: bool, known: str) -> None:
    """Random steps near the best and far from it, raised until each reflectance keeps the ratio."""
    found = scheduled(known, monotone=monotone)
    rng = np.random.default_rng(seed)
    low, high = found.rails.weak.drag, found.rails.strong.drag
    drag = rng.uniform(low, high, len(found.drag))
    drag = np.sort(drag) if monotone else drag
    drag = np.clip(found.drag + rng.uniform(0.0, 1.0) ** 3 * (drag - found.drag), low, high)
    if monotone:
        drag = np.maximum.accumulate(drag)

    def tried(drag: np.ndarray) -> np.ndarray:
        given = DragSchedule(**{name: getattr(found, name) for name in DragSchedule.__slots__} | {"drag": drag})
        return np.array(
            [(*simulated(given, float(theta), 4001)[:2], error(given, 4001)) for theta in found.reflectance]
        )

    reached, most = np.log(1 / tried(drag)[:, 0]), math.log(1 / found.rails.strong.ratio)
    share = np.maximum(math.log(1 / 0.26) - reached, 0.0) / (most - reached)
    raised = tried(drag + share.max() * (high - drag))
    assert raised[:, 1].max() >= found.lower_bound - 2 * DISTANCE * raised[:, 2].max()


@pytest.mark.parametrize("steps", [1, 7])
def test_known_exactly_and_one_step(steps: int) -> None:
    found = schedule_drag(POWER, DISTANCE, 1.0, ratio=0.26, reflectance=(1.0, 1.0), steps=steps)
    assert found.reflectance.tolist() == [1.0]
    assert found.ratio[0] == pytest.approx(0.26, rel=1e-6)
    if steps == 1:
        assert found.drag == pytest.approx([found.constant.drag])
        assert found.verdict.startswith("a constant virtual drag with an excursion of ")
    else:
        assert found.drag[0] == pytest.approx(found.rails.weak.drag, rel=1e-3)  # the search halves, to the gap
        assert found.drag[-1] == pytest.approx(found.rails.strong.drag, rel=1e-3)
        assert found.verdict.startswith("compared with a constant drag, the drag schedule is worthwhile:")


def test_of_an_exponential_the_known_one_is_a_switch() -> None:
    """g = c: all of Q(0) is worth the same wherever it comes from, so it comes last: phi_lo, then phi_hi."""
    sensor = ExponentialFirstOrder(scale=0.5, rate=-60.0)
    found = schedule_drag(sensor, 0.04, 1.0, ratio=0.2, reflectance=(1.0, 1.0), steps=3)
    lam = math.log(5.0)
    far, near = lam / 2, 2 * lam  # dQ/dx, x = l/l_d: half of it over 2/3 of the way, twice over the last third
    q = far * 2 / 3
    assert found.drag / found.constant.drag == pytest.approx([0.5, 0.5, 2.0], rel=1e-3)
    excursion = 0.04 * (math.expm1(q) / far + math.exp(q) * math.expm1(near / 3) / near - 1)
    assert found.lower_bound <= excursion * (1 + 1e-12)
    assert excursion * (1 - 1e-12) <= found.largest_excursion <= excursion + found.gap
    assert found.gap < 1e-4 * found.constant.excursion
    assert found.peak[0] == pytest.approx(max(far, near * math.exp(-2 * q)) / 0.04, rel=1e-3)


def test_a_schedule_is_a_value() -> None:
    found = scheduled("10 %")
    assert pickle.loads(pickle.dumps(found)) == found  # noqa: S301 - our own
    told = json.loads(json.dumps(found.to_dict()))
    assert told["verdict"] == found.verdict
    assert told["gap"] == found.gap
    assert told["rails"]["weak"]["drag"] == found.rails.weak.drag
    middle = (found.log_output[1:] + found.log_output[:-1]) / 2
    assert (found.drag_at(middle) == found.drag).all()
    assert found.drag_at(-1e3) == found.drag[0]
    assert found.drag_at(1e3) == found.drag[-1]


def test_rails_may_be_given_by_ratios() -> None:
    weak, strong = (drag_by(POWER, DISTANCE, 1.0, ratio=r) for r in (0.26**0.5, 0.26**2))
    rails = DragLimits(weak=weak, strong=strong)
    found = schedule_drag(POWER, DISTANCE, 1.0, ratio=0.26, reflectance=RANGES["10 %"], rails=rails)
    assert found.rails == rails
    assert found.largest_excursion == pytest.approx(scheduled("10 %").largest_excursion, abs=1e-5)
    for other in (drag_by(POWER, DISTANCE, 2.0, ratio=r) for r in (0.5, 0.1)):
        with pytest.raises(InvalidInputError, match="another curve, mass or detection distance"):
            schedule_drag(POWER, DISTANCE, 1.0, ratio=0.26, rails=DragLimits(weak=other, strong=other))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"ratio": 1.0}, "ratio: found 1.0, expected a single speed ratio below 1; a ratio of 1 means no virtual drag"),
        ({"ratio": 0.0}, "ratio: found 0, which must be positive"),
        ({"ratio": [0.1, 0.2]}, "ratio: found .* expected a single speed ratio"),
        (
            {"rails": (0.1, 0.9)},
            r"rails: .* approach speed is 0.26, expected a ratio between 0.87\d* .* and 0.297",
        ),
        ({"rails": (1.1, 2.0)}, "rails: .* approach speed is 0.26, expected a ratio between"),
        ({"rails": (2.0, 0.5)}, "rails: found .* two positive factors, the smaller factor first"),
        ({"rails": (1.0,)}, "rails: found .* two positive factors, the smaller factor first"),
        ({"rails": (0.0, 2.0)}, "rails: found 0, which must be positive"),
        ({"reflectance": (2.0, 0.5)}, "reflectance: found .* two positive factors, the smaller factor first"),
        ({"reflectance": (0.0, 0.5)}, "reflectance: found 0, which must be positive"),
        (
            {"reflectance": 0.5},
            "reflectance: found 0.5, expected two positive factors, the smaller factor first",
        ),
        ({"steps": 0}, "steps: found 0, expected a positive whole number of steps of ln xi"),
        ({"steps": 2.0}, "steps: found 2.0"),
        ({"distance": -1.0}, "distance: found -1 m"),
        ({"sensor": RISING}, "the slope is 5 1/m"),
        ({"sensor": InversePower(scale=1e-5, distance_offset=0.04, exponent=3.0, minimum_distance=0.01)}, "0.01 m"),
    ],
)
def test_what_makes_no_sense_is_refused(changed: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        schedule_drag(**({"sensor": POWER, "distance": DISTANCE, "mass": 1.0, "ratio": 0.26} | changed))  # type: ignore[arg-type]
