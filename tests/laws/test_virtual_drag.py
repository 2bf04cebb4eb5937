"""Laws of the virtual drag: one fraction of every speed, one excursion, and upper bounds of every encounter."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.special import lambertw

from encounters import CURVES
from pretouch._core.errors import InvalidInputError
from pretouch.config import load_scenario
from pretouch.designs import HertzImpact, SpringImpact, design_drag, design_gain
from pretouch.designs.drag import DragLimits, drag_by, drag_trade_off, predict_drag
from pretouch.motion import DRAG, Admittance, Obstacle, Scenario
from pretouch.motion.drag import slope_integral, solve_drag
from pretouch.sensors import InversePower, SensorModel, Table
from properties import examples
from refusals import refused
from sensor_samples import SAMPLES, rescaled

ADMITTANCE = Admittance(mass=1.3, damping=9.0, stiffness=20.0)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SPRING = SpringImpact(robot_mass=2.0, stiffness=4e3)
CLAIM = 1e-11
"""Of the quadrature, relative: cells are halved until what is left out of them is below 1e-12."""

TO_CONTACT = {name: curve for name, curve in CURVES.items() if curve.valid_range[0] <= 0}
curves = st.sampled_from(sorted(TO_CONTACT)).map(TO_CONTACT.__getitem__)
powers = st.sampled_from([curve for curve in TO_CONTACT.values() if isinstance(curve, InversePower)])
ratios = st.floats(0.02, 0.95)
speeds = st.floats(0.01, 5.0)
shares = st.floats(0.05, 1.0)
"""Of 55 mm, the detection distance."""


def _solve(sensor: SensorModel, distance: float, coefficient: object, velocity: object, a: object = 0.0) -> object:
    obstacle = Obstacle(position=distance, velocity=velocity, acceleration=a)
    return solve_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), sensor, coefficient, horizon=1e6)  # type: ignore[arg-type]


def _coefficient(sensor: SensorModel, distance: float, ratio: float) -> float:
    return float(ADMITTANCE.mass * math.log(1 / ratio) / slope_integral(sensor, distance))


@given(sensor=curves, ratio=ratios, share=shares, one=speeds, other=speeds)
@examples(60)
def test_the_ratio_and_the_excursion_are_the_same_at_every_speed(
    sensor: SensorModel, ratio: float, share: float, one: float, other: float
) -> None:
    distance = 0.055 * share
    contact = _solve(sensor, distance, _coefficient(sensor, distance, ratio), -np.array([one, other])).contact  # type: ignore[attr-defined]
    speed = np.array([one, other])
    tolerance = CLAIM * (1 + math.log(1 / ratio))  # ln rho is what is as good as the quadrature
    np.testing.assert_allclose(-contact.relative_velocity / speed, ratio, rtol=tolerance)
    # the excursion is a difference of paths, and so is as good as these
    np.testing.assert_allclose(contact.displacement[0], contact.displacement[1], atol=CLAIM * distance / ratio)
    np.testing.assert_allclose(contact.time * speed, distance - contact.displacement, rtol=CLAIM)
    scaled = contact.largest_acceleration / speed**2
    assert scaled[0] == pytest.approx(scaled[1], rel=1e-10)


@given(
    ratio=ratios, offset=st.floats(0.002, 0.2), share=st.floats(0.1, 8), exponents=st.tuples(*[st.floats(0.5, 8)] * 2)
)
@examples(40)
def test_the_exponent_cancels_at_a_given_ratio(
    ratio: float, offset: float, share: float, exponents: tuple[float, float]
) -> None:
    """And a drag made for n does rho to the power of (n'/n)^2 on a sensor of the exponent n'."""
    one, other = (InversePower(scale=1.0, distance_offset=offset, exponent=n) for n in exponents)
    distance = share * offset
    first, second = (drag_by(s, distance, 1.0, ratio=ratio) for s in (one, other))
    assert first.excursion == pytest.approx(second.excursion, rel=1e-10, abs=CLAIM * distance / ratio)
    assert first.peak == pytest.approx(second.peak, rel=1e-10)
    power = (exponents[1] / exponents[0]) ** 2
    assume(power * math.log(1 / ratio) < 20)
    misled = predict_drag(other, distance, 1.0, first.drag)
    assert math.log(misled.ratio) == pytest.approx(power * math.log(ratio), rel=1e-10, abs=1e-11)


@given(st.data())
@examples(60)
def test_the_scale_of_the_output_is_of_no_consequence(data: st.DataObject) -> None:
    """Reflectance and amplification: every class of curve. ln xi of a table is interpolated, so it rounds anew."""
    sensor = data.draw(SAMPLES[data.draw(st.sampled_from(sorted(SAMPLES, key=lambda c: c.__name__)))])
    low, high = sensor.valid_range
    distance = max(low, 0.0) + 0.7 * (min(high, 0.08) - max(low, 0.0))
    assume(distance > max(low, 0.0) and abs(sensor.log_slope(distance)) > 1e-3)
    grid = np.linspace(max(low, 0.0), distance, 50)
    coefficient = 2.0 / (np.mean(sensor.log_slope(grid) ** 2) * distance)
    one, other = (_solve(s, distance, coefficient, -0.3) for s in (sensor, rescaled(sensor, 1e3)))
    assert one.status == other.status  # type: ignore[attr-defined]
    for quantity in ("time", "relative_velocity", "displacement", "largest_acceleration"):
        found, expected = (getattr(result.end, quantity) for result in (one, other))  # type: ignore[attr-defined]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
    # the balance is over ln xi, whose rounding, and that of E, is some 1e-13 of the change over the path
    assert one.impulse_residual < 1e-9  # type: ignore[attr-defined]


@pytest.mark.parametrize("acceleration", [0.0, -1.0])
@pytest.mark.parametrize("name", sorted(TO_CONTACT))
def test_the_balance_contradicts_a_slope_that_is_not_that_of_the_output(
    name: str, acceleration: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both balances, of the speeds and of the ways, miss a tenth of the impulse of an output that changes more."""
    sensor, start, speed, a = TO_CONTACT[name], 0.04, -0.3, acceleration
    found = _solve(sensor, start, _coefficient(sensor, start, 0.3), speed, a)
    t, last = found.end.time, found.end.relative_velocity  # type: ignore[attr-defined]
    log_output = type(sensor).log_output
    monkeypatch.setattr(type(sensor), "log_output", lambda self, distance: 1.1 * log_output(self, distance))
    impulse = last - speed - a * t
    moment = start + speed * t + a * t**2 / 2 + impulse * t
    speeds = 0.1 * impulse / max(-speed, -a * t, 1.1 * impulse)
    ways = 0.1 * abs(impulse * t - moment) / max(start, -speed * t, -a * t**2 / 2, 1.1 * impulse * t, 1.1 * moment)
    assert found.impulse_residual == pytest.approx(max(speeds, ways), rel=1e-7)  # type: ignore[attr-defined]
    assert min(speeds, ways) > 0.01


def test_a_table_that_begins_at_next_to_nothing_is_followed_to_its_first_place() -> None:
    """From 1e-290 m on: a distance less what is left of it is zero there, where the table says nothing."""
    first = 2.2457e-290
    sensor = Table(distances=(first, 0.015625), outputs=(1.0, math.exp(-1.0)))
    found = _solve(sensor, 0.011, 1e-4, -0.3)
    assert found.end.distance == first  # type: ignore[attr-defined]
    assert not found.reached  # type: ignore[attr-defined]


@given(
    sensor=powers,
    ratio=ratios,
    speed=speeds,
    push=st.floats(-2, 0.2),
    length=st.floats(0.1, 10),
    time=st.floats(0.1, 10),
)
@examples(40)
def test_units_rescale(
    sensor: InversePower, ratio: float, speed: float, push: float, length: float, time: float
) -> None:
    """phi is a mass times a length: with other units of both, and of time, the same motion has other numbers."""
    scaled = replace(sensor, distance_offset=sensor.distance_offset * length)
    distance, a = 0.05, push * speed**2 / 0.05
    coefficient = _coefficient(sensor, distance, ratio)
    one = _solve(sensor, distance, coefficient, -speed, a)
    other = _solve(scaled, distance * length, coefficient * length, -speed * length / time, a * length / time**2)
    assert one.status == other.status  # type: ignore[attr-defined]
    units = {"time": time, "distance": length, "relative_velocity": length / time, "displacement": length}
    for quantity, unit in units.items():
        found, expected = getattr(other.end, quantity), unit * getattr(one.end, quantity)  # type: ignore[attr-defined]
        size = unit * {"time": 0.05 / speed, "relative_velocity": speed}.get(quantity, distance)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-10 * size)


@given(sensor=curves, ratio=ratios, share=shares, push=st.floats(-3, 0), stronger=st.floats(1.01, 3))
@examples(60)
def test_a_stronger_drag_touches_later_softer_and_farther_back(
    sensor: SensorModel, ratio: float, share: float, push: float, stronger: float
) -> None:
    distance = 0.055 * share
    coefficient = _coefficient(sensor, distance, ratio) * np.array([1.0, stronger])
    contact = _solve(sensor, distance, coefficient, -0.3, push * 0.09 / distance).contact  # type: ignore[attr-defined]
    assert contact.time[1] > contact.time[0]
    assert abs(contact.relative_velocity[1]) < abs(contact.relative_velocity[0])
    assert contact.displacement[1] < contact.displacement[0]


@given(sensor=curves, ratio=ratios, share=shares, nearer=st.floats(0.1, 0.99))
@examples(40)
def test_an_uncertain_detection_distance_has_its_worst_cases_at_its_ends(
    sensor: SensorModel, ratio: float, share: float, nearer: float
) -> None:
    far = 0.055 * share
    near = nearer * far
    design = drag_by(sensor, far, 1.0, ratio=ratio).seen_from(np.linspace(near, far, 7))
    assert (np.diff(design.ratio) < 0).all()
    assert (np.diff(design.excursion) > 0).all()


@given(sensor=curves, ratio=ratios, share=shares)
@examples(15)
def test_the_designs_by_limits_are_the_strongest_that_keep_them(
    sensor: SensorModel, ratio: float, share: float
) -> None:
    """The limits are what a known drag comes to. For the acceleration, stronger ones may keep it as well; the one that
    is found keeps it, is no weaker than this, and none of the stronger ones keeps it. A limit that some peak just
    touches may be refused: one is found then for a limit that is a little less."""
    distance = 0.055 * share
    assume(abs(sensor.log_slope(distance)) > 1.0)
    drag = drag_by(sensor, distance, 1.3, ratio=ratio)
    by_excursion = drag_by(sensor, distance, 1.3, excursion=drag.excursion)
    assert by_excursion.excursion <= drag.excursion * (1 + 1e-11)
    assert by_excursion.drag == pytest.approx(drag.drag, rel=1e-8)
    speed = 0.7
    limit = drag.peak * speed**2
    try:
        found = drag_by(sensor, distance, 1.3, acceleration=limit, largest_speed=speed)
        assert found.drag >= drag.drag * (1 - 1e-9)
    except InvalidInputError as refused:
        assert "change the limit slightly" in str(refused)  # noqa: PT017
        limit *= 0.99
        found = drag_by(sensor, distance, 1.3, acceleration=limit, largest_speed=speed)
    assert found.acceleration(speed) <= limit * (1 + 1e-9)
    most = max(20 / math.log(1 / found.ratio), 1.1)
    beyond = predict_drag(sensor, distance, 1.3, found.drag * np.geomspace(1 + 1e-6, most, 100))
    assert (beyond.acceleration(speed) > limit).all()


@pytest.mark.parametrize("limit", [2.0, 2.5, 3.2, 4.0, 5.5, 6.0, 40.0])
def test_the_limit_on_acceleration_has_three_branches(limit: float) -> None:
    """L(3), l_d = 5 l_0: the peak lies at detection, inside, or at contact; each by Lambert's W, or in closed form."""
    l_0, l_d, n = 0.04, 0.2, 3.0
    beta = l_0 + l_d
    roots = [limit * beta**2] if limit * beta**2 >= beta else []
    inside = -2 / (limit * math.e**2 * beta)
    if inside >= -1 / math.e:
        roots += [c for k in (-1, 0) if l_0 <= (c := -lambertw(inside, k).real / 2 * beta) <= beta]
    falls = -2 * l_d / (l_0 * beta)
    if falls * limit * l_0**2 >= -1 / math.e:
        roots += [c for k in (-1, 0) if (c := lambertw(falls * limit * l_0**2, k).real / falls) <= l_0]
    assert roots
    sensor = InversePower(scale=1.0, distance_offset=l_0, exponent=n)
    if l_d / (l_0 * beta) * max(roots) > math.log(1e9):
        with refused("acceleration"):
            drag_by(sensor, l_d, 1.0, acceleration=limit, largest_speed=1.0)
        return
    found = drag_by(sensor, l_d, 1.0, acceleration=limit, largest_speed=1.0)
    assert found.drag * n**2 == pytest.approx(max(roots), rel=1e-9)


def test_the_designs_by_contact_speed_and_force_are_the_weakest_that_keep_them() -> None:
    sensor, speed = POWER, 0.5
    spring = SpringImpact(robot_mass=2.0, stiffness=4e3)
    by_speed = drag_by(sensor, 0.0422, 1.0, contact_speed=0.05, largest_speed=speed)
    assert by_speed.contact_speed(speed) == pytest.approx(0.05, rel=1e-12)
    by_force = drag_by(sensor, 0.0422, 1.0, impact_force=spring.peak_force(0.05), impact=spring, largest_speed=speed)
    assert by_force.ratio == pytest.approx(0.1, rel=1e-11)
    hertz = HertzImpact(robot_mass=1.0, effective_modulus=1e7, radius=0.01)
    none = drag_by(sensor, 0.0422, 1.0, impact_force=1e5, impact=hertz, largest_speed=speed)
    assert (none.drag, none.ratio, none.excursion) == (0.0, pytest.approx(1.0), pytest.approx(0.0, abs=1e-15))


@pytest.mark.parametrize(
    ("effect", "values", "reached"),
    [
        ("ratio", (0.05, 0.9), lambda design: design.ratio),
        ("excursion", (0.005, 0.1), lambda design: design.excursion),
        ("contact_speed", (0.02, 0.2), lambda design: design.ratio * 0.5),
        ("impact_force", (2.0, 15.0), lambda design: SPRING.peak_force(design.ratio * 0.5)),
        ("acceleration", (2.0, 6.0), lambda design: design.peak * 0.5**2),
    ],
)
def test_drags_of_an_array_are_those_of_one_each(effect: str, values: tuple[float, float], reached: Any) -> None:
    limits = np.random.default_rng(3).uniform(*values, (2, 3))
    distances = np.array([0.03, 0.0422, 0.05])
    options = {} if effect in {"ratio", "excursion"} else {"largest_speed": 0.5}
    many = drag_by(POWER, distances, 1.3, impact=SPRING, **{effect: limits}, **options)
    assert many.drag.shape == (2, 3)
    assert reached(many) == pytest.approx(limits, rel=1e-9)
    for at in np.ndindex(2, 3):
        one = drag_by(POWER, float(distances[at[1]]), 1.3, impact=SPRING, **{effect: float(limits[at])}, **options)
        assert many.drag[at] == pytest.approx(one.drag, rel=1e-11)


def test_a_limit_of_an_array_that_no_drag_reaches_is_named() -> None:
    with refused("excursion"):
        drag_by(POWER, 0.0422, 1.0, excursion=[0.05, 1e9, 0.06])
    with refused("acceleration"):
        drag_by(POWER, 0.0422, 1.0, acceleration=[2.0, 1e9], largest_speed=1.0)


@pytest.mark.parametrize(
    ("given", "fields"),
    [
        ({}, {"argument": "drag"}),
        ({"ratio": 0.1, "excursion": 0.1}, {"argument": "drag"}),
        ({"ratio": 1.2}, {"argument": "ratio"}),
        ({"acceleration": 2.0}, {"argument": "largest_speed"}),
        ({"impact_force": 2.0, "largest_speed": 1.0}, {"argument": "impact"}),
        ({"excursion": 1e9}, {"argument": "excursion"}),
    ],
)
def test_a_design_without_a_meaning_is_refused(given: dict[str, float], fields: dict[str, Any]) -> None:
    with refused(**fields):
        drag_by(POWER, 0.0422, 1.0, **given)


def test_a_curve_that_does_not_reach_contact_has_no_design() -> None:
    table = Table(distances=(0.01, 0.02, 0.04), outputs=(4.0, 2.0, 1.0))
    with refused("sensor"):
        drag_by(table, 0.035, 1.0, ratio=0.2)


def test_a_design_tells_of_itself() -> None:
    curve = drag_trade_off(POWER, 0.0422, 1.0)
    assert curve.ratio.shape == curve.excursion.shape == (99,)
    assert (np.diff(curve.ratio) < 0).all()
    assert (np.diff(curve.excursion) > 0).all()
    one = drag_by(POWER, 0.0422, 1.0, ratio=0.15)
    assert one == drag_by(POWER, 0.0422, 1.0, ratio=0.15)
    told = one.to_dict()
    assert told["ratio"] == one.ratio
    assert told["largest_speed"] is None
    assert len(told["premises"]) == len(one.premises)
    assert one.time(0.3) == pytest.approx((0.0422 + 0.0596185854) / 0.3, rel=1e-9)
    assert one.peak_distance == pytest.approx(0.0422, rel=1e-9)
    assert one.slope_integral == pytest.approx(POWER.exponent**2 * (1 / 0.0419 - 1 / 0.0841), rel=1e-12)


# --- what no encounter exceeds: 10^5 of them, by a method of our own that knows none of the formulas ---

COUNT, PIECES, STEPS = 30_000, 8, 700


class _Drawn:
    """Random curves, rails and speeds: inverse powers and exponentials, one formula for both."""

    def __init__(self, seed: int, count: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.l_0 = 10 ** rng.uniform(-2.3, -0.9, count)
        self.l_d = self.l_0 * 10 ** rng.uniform(-0.7, 0.5, count)
        self.flat = rng.random(count) < 0.3
        self.v = 10 ** rng.uniform(-1.5, 0.5, count)
        self.total = np.where(self.flat, self.l_d / self.l_0**2, 1 / self.l_0 - 1 / (self.l_0 + self.l_d))  # of g^2
        low = rng.uniform(0.1, 0.9, count)
        self.ratio = (low, low ** rng.uniform(1, 2.5, count))
        self.strength = tuple(np.log(1 / r) / self.total for r in self.ratio)

    def square(self, l: np.ndarray) -> np.ndarray:  # noqa: E741
        return np.where(self.flat, 1 / self.l_0, 1 / (np.maximum(l, 0.0) + self.l_0)) ** 2

    def growth(self, k: np.ndarray, l: np.ndarray) -> np.ndarray:  # noqa: E741
        power = 1 / (np.maximum(l, 0.0) + self.l_0) - 1 / (self.l_0 + self.l_d)
        return k * np.where(self.flat, (self.l_d - l) / self.l_0**2, power)

    def bound(self, k: np.ndarray, push: np.ndarray) -> np.ndarray:
        """rho^2 v^2 + 2 A int exp(-2 (Q_0 - Q)) dl, by 40 Gauss points that crowd at contact."""
        x, weights = np.polynomial.legendre.leggauss(40)
        at_contact, total = self.growth(k, np.zeros_like(self.v)), np.zeros_like(self.v)
        for node, weight in zip((x + 1) / 2, weights, strict=True):
            total += weight * node * self.l_d * np.exp(-2 * (at_contact - self.growth(k, self.l_d * node**2)))
        return np.sqrt(np.exp(-2 * at_contact) * self.v**2 + 2 * push * total)


def _integrate(drawn: _Drawn, strength: object, push: object, duration: np.ndarray) -> tuple[np.ndarray, ...]:
    """Follow all encounters in time, by Runge and Kutta's method of order 4, to contact, out of sight, or the end.

    Returns:
        |l'| at contact and its time, NaN where there is none, the plant's largest acceleration until then, and which
        obstacles turned back on their way.
    """
    step = duration / STEPS
    l, u = drawn.l_d.copy(), -drawn.v  # noqa: E741
    speed, time, largest = np.full_like(l, np.nan), np.full_like(l, np.nan), np.zeros_like(l)
    open_, turned = np.ones(len(l), dtype=bool), np.zeros(len(l), dtype=bool)
    for i in range(STEPS):
        piece = i * PIECES // STEPS
        k, a = strength(piece), push(piece)  # type: ignore[operator]

        def rate(l: np.ndarray, u: np.ndarray, k: np.ndarray = k, a: np.ndarray = a) -> np.ndarray:  # noqa: E741
            return a + k * drawn.square(l) * np.minimum(u, 0.0) ** 2

        f1 = rate(l, u)
        largest = np.where(open_, np.maximum(largest, f1 - a), largest)
        u2 = u + step / 2 * f1
        f2 = rate(l + step / 2 * u, u2)
        u3 = u + step / 2 * f2
        f3 = rate(l + step / 2 * u2, u3)
        u4 = u + step * f3
        f4 = rate(l + step * u3, u4)
        l_next, u_next = l + step / 6 * (u + 2 * u2 + 2 * u3 + u4), u + step / 6 * (f1 + 2 * f2 + 2 * f3 + f4)
        hit = open_ & (l_next <= 0)
        share = l / np.where(hit, l - l_next, 1.0)
        speed = np.where(hit, -(u + share * (u_next - u)), speed)
        time = np.where(hit, (i + share) * step, time)
        turned |= open_ & (u_next > 0)
        open_ &= ~hit & (l_next <= drawn.l_d)
        l, u = np.where(open_, l_next, l), np.where(open_, u_next, u)  # noqa: E741
        if not open_.any():
            break
    return speed, time, largest, turned


@pytest.mark.slow
def test_no_obstacle_exceeds_the_bound_and_a_steady_push_meets_it() -> None:
    """Piecewise accelerations of both signs, at most A toward the plant; many turn back and come again.

    A step lasts a 700th of what the encounter may take: of order 4, and contact by a line within it, this is good to
    1e-3.
    """
    drawn = _Drawn(20261122, COUNT)
    push = drawn.v**2 / drawn.l_d * 10 ** drawn.rng.uniform(-1.5, 0.5, COUNT)
    course = drawn.rng.uniform(-1, 1, (PIECES, COUNT)) * push
    course = np.where(drawn.rng.random((PIECES, COUNT)) < 0.3, -push, course)
    switch = drawn.rng.uniform(0, 1, (PIECES, COUNT))
    weak, strong = drawn.strength
    bound, duration = drawn.bound(weak, push), 3 * drawn.l_d / drawn.v / np.sqrt(drawn.ratio[1])
    scheduled, _, _, turned = _integrate(
        drawn, lambda i: weak + (strong - weak) * switch[i], lambda i: course[i], duration
    )
    reached = np.isfinite(scheduled)
    assert reached.sum() > 0.5 * COUNT
    assert (reached & turned).sum() > 0.01 * COUNT
    assert np.nanmax(scheduled / bound) < 1 + 2e-3
    some = slice(0, 6_000)
    few = _Drawn.__new__(_Drawn)
    few.__dict__ = {n: v[some] for n, v in vars(drawn).items() if isinstance(v, np.ndarray)}
    steady, _, _, _ = _integrate(few, lambda _: weak[some], lambda _: -push[some], duration[some] / 2)
    met = steady / bound[some]
    assert np.isfinite(met).sum() > 5_700
    assert np.nanmax(np.abs(met - 1)) < 2e-2  # the fastest ones last fewest steps
    assert np.nanmedian(np.abs(met - 1)) < 1e-4


@pytest.mark.slow
def test_a_schedule_between_rails_keeps_what_they_keep() -> None:
    """Contact speed, time (so excursion) and acceleration of a uniform approach; the method's error as above."""
    drawn = _Drawn(7, 20_000)
    weak, strong = drawn.strength
    switch = drawn.rng.integers(0, 2, (PIECES, len(weak))) * drawn.rng.uniform(0, 1, (PIECES, len(weak)))
    duration = 1.5 * drawn.l_d / drawn.v / drawn.ratio[1]
    zero = np.zeros_like(weak)
    runs = [
        _integrate(drawn, k, lambda _: zero, duration)
        for k in (lambda _: weak, lambda i: weak + (strong - weak) * switch[i], lambda _: strong)
    ]
    known = np.all([np.isfinite(speed) for speed, *_ in runs], axis=0)
    assert known.sum() > 15_000
    (low, first, peak, _), (speed, time, largest, _), (high, last, _, _) = ((x[known] for x in run) for run in runs)
    assert (speed <= low * 1.002).all()
    assert (speed >= high * 0.998).all()
    assert (time >= first * 0.998).all()
    assert (time <= last * 1.002).all()
    assert (largest <= (strong / weak)[known] * peak * 1.01).all()  # sampled at steps, each of a 700th


@given(sensor=curves, ratio=ratios, share=shares, speed=speeds, push=st.floats(0.0, 10.0))
@example(sensor=POWER, ratio=0.15, share=0.767, speed=0.3, push=0.5)
@examples(40)
def test_the_bound_of_a_design_is_the_formula(
    sensor: SensorModel, ratio: float, share: float, speed: float, push: float
) -> None:
    """l'_c^2 = rho^2 v^2 + 2 A I, with I as the square of the contact speed of what starts at rest at 1/2 m/s^2."""
    distance = 0.055 * share
    drag = drag_by(sensor, distance, 1.0, ratio=ratio)
    bound = drag.contact_speed_bound(speed, push)
    lag = drag.contact_speed_bound(0.0, 0.5) ** 2
    assert bound**2 == pytest.approx((ratio * speed) ** 2 + 2 * push * lag, rel=1e-9)


def test_rails_speak_of_two_designs_of_one_encounter() -> None:
    weak, strong = (drag_by(POWER, 0.0422, 1.0, ratio=r) for r in (0.3, 0.1))
    rails = DragLimits(weak=weak, strong=strong)
    assert rails.ratio == pytest.approx((0.1, 0.3))
    assert rails.excursion == (weak.excursion, strong.excursion)
    grid = np.linspace(0, 0.0422, 2001)
    growth = weak.drag * 3.32**2 * (1 / (grid + 0.0419) - 1 / 0.0841)
    reached = strong.drag * POWER.log_slope(grid) ** 2 * np.exp(-2 * growth)
    assert rails.peak == pytest.approx(reached.max(), rel=1e-6)
    assert rails.peak >= max(weak.peak, strong.peak) * (1 - 1e-12)
    assert rails.contact_speed_bound(0.3, 1.0) == weak.contact_speed_bound(0.3, 1.0)
    with refused("rails"):
        DragLimits(weak=strong, strong=weak)
    with refused("rails"):
        DragLimits(weak=weak, strong=strong.seen_from(0.05))


def test_the_equation_and_its_integrals_symbolically() -> None:
    """dw/dl = 2 (a_o + k g^2 w) is solved by w of the docs for any g; and the closed forms differentiate to their
    integrands."""
    import sympy as sp

    l, l_0, n, k, a, w_0, u, u_d, c = sp.symbols("l l_0 n k a w_0 u u_d c", positive=True)  # noqa: E741
    growth, inner = sp.Function("Q")(l), sp.Function("J")(l)
    slope = sp.Function("g")(l)
    w = sp.exp(-2 * growth) * (w_0 - 2 * a * inner)
    rate = sp.diff(w, l).subs({growth.diff(l): -k * slope**2, inner.diff(l): -sp.exp(2 * growth)})
    assert sp.simplify(rate - 2 * (a + k * slope**2 * w)) == 0
    assert sp.simplify(sp.diff(k * n**2 / (l + l_0), l) + k * (-n / (l + l_0)) ** 2) == 0
    excursion = c * sp.exp(-u_d) * (sp.Ei(u) - sp.exp(u) / u)  # dl = -c du / u^2
    assert sp.simplify(sp.diff(excursion, u) - c * sp.exp(u - u_d) / u**2) == 0
    lag = c * (2 * sp.Ei(2 * u) - sp.exp(2 * u) / u)
    assert sp.simplify(sp.diff(lag, u) - c * sp.exp(2 * u) / u**2) == 0


@pytest.mark.parametrize(("position", "velocity"), [(1e200, -0.3), (1e300, -1e200), (1e6, -1e200)])
def test_a_drag_on_numbers_without_a_square_is_refused(position: float, velocity: float) -> None:
    """They overflowed on the way, with a warning of NumPy."""
    task = load_scenario(Path(__file__).parents[2] / "examples/drag.toml")
    far = replace(task.scenario, obstacle=replace(task.scenario.obstacle, position=position, velocity=velocity))
    verbs = [lambda: DRAG.contact(far, task.sensor, 0.0144), lambda: design_gain(task.replace(scenario=far))]
    if position > 1e6:  # the drag of a ratio follows from the distance alone
        verbs.append(lambda: design_drag(task.replace(scenario=far)))
    for verb in verbs:
        with pytest.raises(InvalidInputError, match=r"found -?1e\+[23]00.*, expected .*at most \d"):
            verb()
