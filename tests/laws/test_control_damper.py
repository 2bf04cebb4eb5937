"""Laws of the sampled virtual damper, for any rate of the loop and of the sensor."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control_samples import controller, rows_of, run_rows
from pretouch.control import (
    Conditioning,
    Controller,
    Output,
    Parts,
    Push,
    Sample,
    Status,
    VirtualAdmittance,
    drive,
    observe,
)
from properties import examples

FORCE, LEVEL, STATUS = 3, 4, 5
levels = st.lists(st.floats(-6, 0), min_size=2, max_size=40)
periods = st.floats(1e-4, 0.05)


@examples(150)
@given(logs=levels, period=periods, gain=st.floats(-5, 5).map(lambda g: round(g, 6)))
def test_the_impulse_is_the_gain_times_the_change_of_ln_xi(logs: list[float], period: float, gain: float) -> None:
    """L(2), integrated: exact at any sample time, whatever the steps are."""
    found = run_rows(controller(gain, period), rows_of(np.exp(logs)))
    forces = gain * np.diff(logs) / period
    assert found[0, FORCE] == 0.0
    # each logarithm is that of exp(log), within 2e-16 of its size up to 7
    np.testing.assert_allclose(found[1:, FORCE], forces, rtol=1e-12, atol=abs(gain) * 5e-15 / period)


@examples(100)
@given(logs=levels, ratio=st.floats(1.0, 8.0), gain=st.floats(-5, -0.1))
def test_a_slow_sensor_gives_the_same_impulse(logs: list[float], ratio: float, gain: float) -> None:
    """One reading in several periods, also where that is no whole number of them.

    A reading that comes before the impulse of the last one is through finds at most half of it left, and takes it over.
    """
    period, sensor_period = 1e-3, ratio * 1e-3
    logs = logs + 40 * logs[-1:]  # 0.5^40 = 1e-12 is left of the last change
    steps = np.ceil(np.arange(len(logs) + 1) * ratio - 1e-9).astype(int)
    readings, fresh = np.zeros(steps[-1]), np.zeros(steps[-1])
    readings[steps[:-1]], fresh[steps[:-1]] = np.exp(logs), 1.0
    found = run_rows(controller(gain, period, sensor_period=sensor_period), rows_of(readings, fresh=fresh))
    impulse = found[:, FORCE].sum() * period
    assert impulse == pytest.approx(gain * (logs[-1] - logs[0]), rel=1e-9, abs=abs(gain) * 1e-10)
    assert not (found[:, STATUS].astype(int) & Status.STALE).any()


def test_what_is_given_ahead_of_a_late_reading_is_taken_off_it() -> None:
    """A steady approach of which readings fail to come: the force goes on and fades, the sum stays that of ln xi."""
    period, rate = 1e-3, 6.0
    logs = np.log(0.1) + rate * period * np.arange(400)
    come = np.random.default_rng(7).random(400) < 0.5
    come[[0, -1]] = True
    made = controller(-0.7, period, fade_time=8e-3, timeout=0.05)
    found = run_rows(made, rows_of(np.exp(logs), fresh=come))
    assert found[:, FORCE].sum() * period == pytest.approx(-0.7 * (logs[-1] - logs[0]), rel=1e-9)
    assert found[1:, FORCE].max() <= 0.0, "what was given ahead never pulls"
    hard = run_rows(controller(-0.7, period, fade_time=0.0, timeout=0.05), rows_of(np.exp(logs), fresh=come))
    assert hard[:, FORCE].sum() * period == pytest.approx(-0.7 * (logs[-1] - logs[0]), rel=1e-9)
    assert np.std(found[5:, FORCE]) < 0.5 * np.std(hard[5:, FORCE]), "and it is far smoother than stop and go"


@examples(60)
@given(logs=levels, factor=st.integers(-20, 20).map(lambda e: 2.0**e), offset=st.floats(-1, 1))
def test_scale_and_offset_of_the_readings_change_nothing(logs: list[float], factor: float, offset: float) -> None:
    """Reflectance cancels in xi'/xi; an offset does not, and is therefore subtracted."""
    xi = np.exp(logs)
    one = run_rows(controller(), rows_of(xi))
    scaled = run_rows(controller(floor=1e-3 * factor), rows_of(xi * factor))
    shifted = run_rows(controller(offset=offset), rows_of(xi + offset))
    # xi + offset is rounded at 2e-16 of up to 2, xi is at least exp(-6): ln xi to 1e-13, over 1 ms
    np.testing.assert_allclose(scaled[:, :STATUS], one[:, :STATUS], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(shifted[:, :STATUS], one[:, :STATUS], rtol=1e-9, atol=1e-9)


@examples(100)
@given(logs=levels, ratio=st.integers(1, 4), drop=st.sets(st.integers(0, 39)))
def test_damping_approaches_alone_never_pulls(logs: list[float], ratio: int, drop: set[int]) -> None:
    rows = np.repeat(rows_of(np.exp(logs)), ratio, axis=0)
    rows[:, 1] = [i % ratio == 0 and i // ratio not in drop for i in range(len(rows))]
    found = run_rows(controller(-0.7, sensor_period=ratio * 1e-3, approach_only=True, release=0.1), rows)
    assert (found[:, FORCE] <= 0.0).all()


def test_noise_within_the_release_is_no_approach() -> None:
    """Without release, each rise of the noise would count and none of its falls."""
    noise = np.random.default_rng(3).uniform(-0.01, 0.01, 2000)
    rows = rows_of(np.exp(-1.0 + noise))
    kept = run_rows(controller(-1.0, approach_only=True, release=0.02), rows)
    rectified = run_rows(controller(-1.0, approach_only=True, release=0.0), rows)
    assert -kept[:, FORCE].sum() * 1e-3 <= 0.02
    assert -rectified[:, FORCE].sum() * 1e-3 > 100 * 0.02


def test_a_recession_wider_than_the_release_lets_the_next_approach_count() -> None:
    logs = np.concatenate([np.linspace(-3, -1, 50), np.linspace(-1, -2, 50), np.linspace(-2, -1, 50)])
    found = run_rows(controller(-1.0, approach_only=True, release=0.25), rows_of(np.exp(logs)))
    assert -found[:, FORCE].sum() * 1e-3 == pytest.approx(2.0 + 0.75, rel=1e-9)


def test_the_start_is_bumpless() -> None:
    """Neither a first reading in mid-range nor the way through the floor makes a jump of the force."""
    middle = run_rows(controller(median_window=5, low_pass_order=2, cutoff=100.0), rows_of(np.full(50, 0.3)))
    assert np.abs(middle[:, FORCE]).max() < 1e-9  # the settled filter is good to rounding
    xi = 1e-3 * np.exp(np.linspace(-3, 3, 601))
    found = run_rows(controller(-1.0, floor=1e-3), rows_of(xi))
    detecting = found[:, STATUS].astype(int) & Status.DETECTING > 0
    assert not detecting[:300].any()
    assert detecting[302:].all()
    assert (found[:300, FORCE] == 0.0).all()
    assert np.abs(found[:, FORCE]).max() <= 10.0 * (1 + 1e-9)  # 0.01 per period of 1 ms, nothing saved up before


def test_the_gain_rises_along_its_ramp() -> None:
    logs = np.log(1e-3) + 0.01 * np.arange(-20, 200) - 1e-12  # one of them just below the floor, which is no object
    found = run_rows(controller(-1.0, ramp_time=0.1), rows_of(np.exp(logs)))
    force = -found[21:, FORCE] / 10.0
    np.testing.assert_allclose(force[:99], np.arange(1, 100) * 0.01, rtol=1e-9)
    np.testing.assert_allclose(force[100:], 1.0, rtol=1e-9)


def test_nothing_is_switched_at_contact() -> None:
    """The threshold reports a contact and changes nothing else; a share of the contact force acts all the time."""
    xi, force = np.linspace(0.1, 0.5, 300), np.r_[np.zeros(200), -np.linspace(0, 30, 100)]
    one = run_rows(controller(contact_gain=1.0, contact_threshold=1.0), rows_of(xi, force=force))
    other = run_rows(controller(contact_gain=1.0, contact_threshold=20.0), rows_of(xi, force=force))
    np.testing.assert_array_equal(one[:, :STATUS], other[:, :STATUS])
    contact = one[:, STATUS].astype(int) & Status.IN_CONTACT > 0
    np.testing.assert_array_equal(contact, np.abs(force) >= 1.0)
    without = run_rows(controller(contact_gain=0.0), rows_of(xi, force=force))
    np.testing.assert_array_equal(without[:200, :STATUS], one[:200, :STATUS])
    assert one[-1, 0] < without[-1, 0]
    # forces grow by 0.3 N per step, and so do the accelerations: no jump at any of them
    assert np.abs(np.diff(one[201:, 2] - without[201:, 2])).max() < 0.31


def test_a_contact_force_acts_as_in_an_admittance() -> None:
    """K x~ = F in the end."""
    found = run_rows(controller(contact_gain=1.0), rows_of(np.zeros(6000), force=-2.0))
    assert found[-1, 0] == pytest.approx(-2.0 / 25.0, rel=1e-9)  # exp(-5 x 6) of it is left


def test_the_reference_is_followed_exactly_where_it_accelerates_uniformly() -> None:
    made = controller(period=0.01)
    parameters, state = made.parameters(), made.start()
    for k in range(100):
        t = 0.01 * k
        sample = Sample(0.0, True, 0.0, 0.0, 0.1 + 0.2 * t - 0.15 * t * t, 0.2 - 0.3 * t, -0.3)
        state, output = made.step(parameters, state, sample)
    assert output.position == pytest.approx(0.1 + 0.2 - 0.15, abs=1e-12)
    assert output.velocity == pytest.approx(-0.1, abs=1e-12)
    assert output.acceleration == pytest.approx(-0.3, abs=1e-12)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cushion:
    """Another law: a force that grows with ln xi and with the robot's own speed."""

    hardness: float

    @property
    def step(self) -> Callable[..., Any]:
        return _step_cushion

    def numbers(self, controller: Controller) -> tuple[float, ...]:  # noqa: ARG002
        return (self.hardness,)

    def start(self) -> tuple[float, ...]:
        return (0.0,)


def _cushion(hardness: float, level: float, velocity: float) -> float:
    return -hardness * level - 0.5 * velocity


def _step_cushion(parameters: Any, state: Any, sample: Any) -> tuple[Any, Output]:
    sensing, seen = observe(parameters.sensing, state.sensing, sample)
    force = _cushion(parameters.law[0], seen.log_level, state.drive.motion.velocity)
    driven, output = drive(parameters.drive, state.drive, seen, Push(0.0, force), sample)
    return Parts(sensing, driven, state.law), output


def test_another_law_runs_in_the_same_controller_and_loop() -> None:
    made = Controller(
        period=1e-3,
        conditioning=Conditioning(floor=0.1),
        law=_Cushion(hardness=2.0),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )
    rows = rows_of(np.full(8000, 0.1 * math.e))
    found = run_rows(made, rows)
    assert found[-1, 0] == pytest.approx(-2.0 / 25.0, rel=1e-9)
    parameters, state = made.parameters(), made.start()
    for row in found[:100]:
        state, output = made.step(parameters, state, Sample(0.1 * math.e))
        assert output == tuple(row)
