"""Limits of speed, acceleration and excursion hold together for any requested motion, without windup.

The tests use the plain Python law; the C law equals it bit for bit (tests/faults/test_control_samples.py).
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control_samples import controller
from plain_law.motion import limit_motion
from pretouch.control import Limits, Sample
from pretouch.control.components import NO_LIMIT, stopping_distance
from pretouch.control.structures import MotionLimits
from properties import examples
from refusals import refused

limits = st.builds(
    MotionLimits,
    period=st.floats(1e-4, 0.02),
    speed=st.one_of(st.just(NO_LIMIT), st.floats(0.01, 5)),
    acceleration=st.one_of(st.just(NO_LIMIT), st.floats(0.1, 500)),
    excursion=st.one_of(st.just(NO_LIMIT), st.floats(1e-3, 1)),
)
wishes = st.lists(st.tuples(st.floats(-2, 2), st.floats(-10, 10)), min_size=1, max_size=80)
ROUNDING = 1e-12  # some sums of numbers that are each good to 2e-16


@examples(300)
@given(held=limits, wanted=wishes)
def test_limits_hold_together_whatever_is_wanted(held: MotionLimits, wanted: list[tuple[float, float]]) -> None:
    position = velocity = 0.0
    for x, v in wanted:
        before, start = velocity, position
        position, velocity, limited = limit_motion(held, position, velocity, x, v)
        assert abs(position - start) <= held.speed * held.period * (1 + ROUNDING) + ROUNDING
        assert abs(position) <= held.excursion
        assert abs(velocity) <= held.speed * (1 + ROUNDING)
        assert abs(velocity - before) <= held.acceleration * held.period * (1 + ROUNDING) + ROUNDING
        assert limited or (position, velocity) == (x, v)
        ahead = position if velocity >= 0 else -position
        assert ahead + stopping_distance(held, abs(velocity)) <= held.excursion * (1 + ROUNDING) + ROUNDING


@examples(200)
@given(held=limits, speed=st.floats(0, 3))
def test_the_way_to_rest_is_that_of_braking_period_by_period(held: MotionLimits, speed: float) -> None:
    step = held.acceleration * held.period
    if speed / step > 1e4:
        return
    left, way = speed, 0.0
    while left > 0:
        after = max(left - step, 0.0)
        way += held.period * (left + after) / 2
        left = after
    assert stopping_distance(held, speed) == pytest.approx(way, rel=1e-9, abs=1e-15)  # 1e4 sums
    assert way >= speed**2 / (2 * held.acceleration) * (1 - 1e-9)  # never shorter than by braking without pause


def test_full_speed_ahead_ends_at_the_excursion_as_late_as_can_be() -> None:
    """Nothing is given away: the wall is reached, at rest, and the largest deceleration is used."""
    held = MotionLimits(period=1e-3, speed=0.4, acceleration=10.0, excursion=0.1)
    position = velocity = hardest = 0.0
    for _ in range(2000):
        before = velocity
        position, velocity, _ = limit_motion(held, position, velocity, 10.0, 10.0)
        hardest = max(hardest, (before - velocity) / held.period)
    assert position == pytest.approx(0.1, abs=1e-12)
    assert velocity == pytest.approx(0.0, abs=1e-9)
    assert hardest == pytest.approx(10.0, rel=1e-9)


def test_nothing_winds_up_behind_a_limit() -> None:
    """A push that is far too strong and long, then none: the plant leaves the limit at once, as from that position."""
    made = controller(limits=Limits(excursion=0.05, acceleration=200.0), contact_gain=1.0)
    parameters, state = made.parameters(), made.start()
    for _ in range(5000):
        state, output = made.step(parameters, state, Sample(reading=0.0, contact_force=-500.0))
    assert output.position == pytest.approx(-0.05, abs=1e-9)
    state, first = made.step(parameters, state, Sample(reading=0.0))
    free = controller()
    state, second = free.step(free.parameters(), free.start(position=output.position), Sample(reading=0.0))
    assert first.position == pytest.approx(second.position, abs=1e-12)
    assert first.velocity == pytest.approx(second.velocity, abs=1e-9)
    assert first.velocity > 0


@pytest.mark.parametrize("name", ["force", "speed", "acceleration", "excursion"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, 2 * NO_LIMIT])
def test_a_limit_that_is_none_is_refused(name: str, value: float) -> None:
    with refused(f"largest {name}"):
        Limits(**{name: value})


def test_a_start_from_which_limits_cannot_be_held_is_refused() -> None:
    made = controller(limits=Limits(excursion=0.1, speed=1.0, acceleration=5.0))
    made.start(position=0.09, velocity=0.3)  # 9 mm to rest
    for position, velocity in ((0.2, 0.0), (0.0, 1.5), (0.09, 0.4)):
        with refused("start"):
            made.start(position=position, velocity=velocity)
