"""A calibration is checked with a recording of today: right verdicts, and none if the recording cannot decide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.errors import InvalidInputError
from pretouch.recording import Recheck, Recording, recheck, replay
from pretouch.recording.curve_today import _shifted, curves_of, explanations_of, signals_of
from pretouch.recording.known_distances import KnownDistance, read_known_distances
from pretouch.recording.recheck_page import recheck_page
from pretouch.sensors import ExponentialFirstOrder, InversePower

ROOT = Path(__file__).parents[2]
OFFSET = 150.0
HELD = (np.inf, 0.005, 0.02, 0.04)


@cache
def task() -> pt.Task:
    return pt.load_scenario(ROOT / "examples/loop.toml").replace(gain=-0.86)


def today(
    held: Sequence[float] = HELD,
    *,
    offset: float = OFFSET,
    factor: float = 1.0,
    shift: float = 0.0,
    sign: float = 1.0,
    noise: float = 20.0,
    count: int = 300,
    highest: float = 65535.0,
    slips: tuple[float, ...] = (),
    seed: int = 7,
) -> tuple[Recording, Recording]:
    """Return readings of a drifted sensor and the distances; each one is held for `count` readings of 4 ms."""
    rng = np.random.default_rng(seed)
    places = np.repeat(held, count)
    true = np.repeat(np.asarray(held) + np.asarray(slips or [0.0] * len(held)), count)
    signal = np.where(
        np.isinf(true), 0.0, factor * 0.533 * (np.where(np.isinf(true), 1.0, true) + 0.0419 + shift) ** -3.32
    )
    values = np.minimum(np.round(offset + sign * signal + noise * rng.standard_normal(len(places))), highest)
    stamps = np.arange(len(places), dtype=np.int64) * 4_000_000
    columns: dict[str, Any] = {"source": "today", "message_type": "column", "clock": "column", "stamps": stamps}
    return (
        Recording(topic="output", values=values, **columns),
        Recording(topic="distance", kind="distance", values=places, **columns),
    )


def check(recording: Recording, distances: Recording | None, **options: float) -> Recheck:
    return recheck(task(), replay(task(), recording), distances=distances, **options)


def test_a_sensor_without_drift_is_fine() -> None:
    answer = check(*today(), elapsed=30 * 86400.0)
    assert answer.decision == "fine"
    assert answer.offset == pytest.approx(OFFSET, abs=4 * 20 / 300**0.5)
    assert abs(answer.slope - answer.slope_then) < 3 * answer.slope_error
    assert answer.contact.low < answer.contact_then < answer.contact.high
    assert 0 < answer.interval <= 30 * 86400.0  # never longer than the only interval that was seen


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize("seed", range(12))
def test_chance_does_not_decide(seed: int) -> None:
    """With distances wrong by 1.5 mm, the signal at 5 mm is uncertain by 11 %: no range can be within 15 %."""
    recording, distances = today(seed=seed)
    answer = check(recording, distances, distance_error=1.5e-3)
    assert answer.decision == "not-decided"
    assert answer.contact.low < 0.85 * answer.contact_then
    fewer = replace(distances, values=np.where(distances.values == HELD[1 + seed % 3], np.nan, distances.values))
    assert check(recording, fewer, distance_error=1.5e-3).decision != "fine"


def test_every_explanation_that_fits_is_moved_within_its_errors() -> None:
    """Two distances fit all three explanations, and noise does not decide which one counts."""
    sensor = InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
    found = signals(sensor, 1.0, 0.0, (0.005, 0.04))
    wide = found._replace(covariance=np.diag([0.05**2, 0.05**2]))
    explanations = explanations_of(wide, sensor)
    assert len(explanations) == 3
    for each in explanations:
        best, *moved = (np.log(curve.output(0.001)) for curve in curves_of(each, 0.0))
        assert len(moved) == 4
        assert max(moved) - best > 2 * 0.05
        assert best - min(moved) > 2 * 0.05
    for ratios in np.random.default_rng(5).normal(0, 0.05, (8, 2)):
        first = explanations_of(wide._replace(ratios=ratios), sensor)[0]
        assert isinstance(first.curve(first.ends), InversePower)


def test_an_offset_above_the_floor_is_updated() -> None:
    answer = check(*today(offset=OFFSET + 2500), elapsed=86400.0)
    assert answer.decision == "update-offset"
    lines = recheck_page(answer).next_lines
    assert lines[0] == "[chain]"
    assert float(lines[1].removeprefix("offset = ")) == pytest.approx(OFFSET + 2500, abs=5)
    assert answer.interval < 86400.0


def speed_on(sensor: Any) -> float:
    """Return the contact speed on the loop without noise."""
    chain = replace(task().loop.chain, noise=0.0, relative_noise=0.0)
    run = replace(task().loop, chain=chain, contact=None).run(task().scenario, sensor, -0.86, runs=8)
    return float(np.abs(run.relative_velocity).mean())


def test_another_slope_is_recalibrated() -> None:
    answer = check(*today((np.inf, 0.001, 0.01, 0.04), shift=0.02, factor=3.5), distance_error=2e-4)
    assert answer.decision == "recalibrate"
    truth = replace(task().sensor, distance_offset=0.0619, scale=3.5 * 0.533)
    design = pt.design(task().replace(sensor=truth, gain=None, stability_margin=None))
    assert answer.optimal_gain == pytest.approx(design.gain, rel=0.1)
    assert answer.optimal_gain_then == pytest.approx(-0.7463, abs=1e-4)
    speed = speed_on(truth)
    assert speed > 1.15 * answer.contact_then
    assert answer.contact_updated.low < speed < answer.contact_updated.high


def test_another_distance_that_later_detection_makes_up_for_is_no_reason_to_recalibrate() -> None:
    """The slope is a third flatter, but the floor is reached at 18 mm instead of 43 mm."""
    answer = check(*today((np.inf, 0.001, 0.01, 0.04), shift=0.025), distance_error=1e-4)
    assert answer.decision == "fine"
    assert speed_on(replace(task().sensor, distance_offset=0.0669)) == pytest.approx(answer.contact.value, rel=0.03)


def test_a_sensor_that_saturates_where_the_calibration_does_not_is_recalibrated() -> None:
    answer = check(*today((np.inf, 0.012, 0.03), factor=9.0))
    assert answer.decision == "recalibrate"


def test_a_limit_that_holds_narrowly_is_named() -> None:
    limit = pt.Constraint(name="relative_velocity", limit=0.0738)
    narrow = task().replace(constraints=[limit])
    recording, distances = today()
    answer = recheck(narrow, replay(narrow, recording), distances=distances)
    assert (answer.decision, answer.limits) == ("fine", ("relative_velocity",))
    assert check(recording, distances).limits == ()


def test_noise_above_the_floor_is_no_fine_sensor() -> None:
    assert check(*today(noise=900.0, count=600)).decision in {"recalibrate", "not-decided"}


@pytest.mark.parametrize(
    ("held", "drift"),
    [
        ((np.inf, 0.005), {}),  # one distance
        ((np.inf,), {}),
        ((0.005, 0.04), {}),  # no empty scene
        ((np.inf, 0.03, 0.035), {}),  # most of the force acts nearer
        (HELD, {"count": 5}),
        (HELD, {"sign": -1.0}),
        (HELD, {"factor": 0.0}),  # the sensor sees nothing
        (HELD, {"factor": 0.0, "noise": 0.0}),  # and repeats one number
        ((np.inf, 0.0, 0.04), {"highest": 20000.0}),
        (HELD, {"slips": (0.0, 0.0, 0.004, 0.0)}),  # a wrong distance
        ((np.inf, 0.005, 0.04), {"slips": (0.0, 0.0, -0.0385)}),  # the signal does not fall
    ],
)
def test_a_recording_that_cannot_decide_does_not(held: tuple[float, ...], drift: dict[str, Any]) -> None:
    answer = check(*today(held, **drift))
    assert answer.decision == "not-decided"
    assert answer.reasons
    assert not answer.is_good
    assert answer.interval is None


@pytest.mark.parametrize(
    ("held", "drift", "action"),
    [
        (HELD, {"factor": 0.0, "noise": 0.0}, "cable"),
        (HELD, {"factor": 0.0}, "cable"),
        (HELD, {"sign": -1.0}, "named distances"),
        ((np.inf, 0.005, 0.04), {"slips": (0.0, 0.035, -0.035)}, "correct the named distances"),
        (HELD, {"slips": (0.0, 0.0, 0.004, 0.0)}, "object is that of the calibration"),
        ((np.inf, 0.0, 0.04), {"highest": 20000.0}, "farther away"),
        ((np.inf, 0.03, 0.035), {}, "close to"),
        ((0.005, 0.04), {}, "as none"),
        (HELD, {"count": 5}, "longer parts"),
    ],
)
def test_the_next_step_follows_from_the_reason(held: tuple[float, ...], drift: dict[str, Any], action: str) -> None:
    answer = check(*today(held, **drift))
    assert len(answer.actions) == 1
    assert action in answer.actions[0]
    assert recheck_page(answer).next_step == answer.actions[0]


def test_a_changed_offset_is_updated_even_if_the_curve_is_not_decided() -> None:
    for offset, updates in ((OFFSET + 100, False), (OFFSET + 2500, True)):
        answer = check(*today(offset=offset), distance_error=1.5e-3)
        assert (answer.decision, answer.updates_offset) == ("not-decided", updates)
        assert bool(recheck_page(answer).next_lines) is updates
        assert (f"offset to {answer.offset:.5g}" in answer.reasons[0]) is updates


def test_noise_is_that_of_the_named_empty_scene_if_the_offset_is_taken_for_an_object() -> None:
    answer = check(*today(offset=OFFSET + 2500, noise=40.0))
    assert answer.replay.noise.noise == pytest.approx(40, rel=0.15)
    assert any("PT607" in text for text in recheck_page(answer).warnings)


def test_the_needed_exactness_of_the_distances_decides() -> None:
    answer = check(*today(), distance_error=1.5e-3)
    needed = answer.actions[0].partition('--distance-error "')[2].partition(" mm")[0]
    assert 0.5 < float(needed) < 1.5
    assert check(*today(), distance_error=1e-3 * float(needed)).decision == "fine"


def test_equal_readings_have_the_error_of_their_rounding() -> None:
    recording, distances = today()
    recording = replace(recording, values=np.where(np.isinf(distances.values), OFFSET, recording.values))
    answer = check(recording, distances)
    assert answer.offset_error == pytest.approx(1 / 12**0.5)


def test_without_distances_nothing_is_decided() -> None:
    answer = check(today()[0], None)
    assert answer.decision == "not-decided"
    assert answer.contact is None


def test_an_object_that_moves_while_it_is_held_decides_nothing() -> None:
    recording, distances = today()
    moved = recording.values.copy()
    moved[300:450] = moved[600:750]  # at the second distance during half of the first hold
    assert check(replace(recording, values=moved), distances).decision == "not-decided"


def test_an_offset_that_still_drifts_decides_nothing() -> None:
    recording, distances = today()
    warm = recording.values + np.where(np.isinf(distances.values), np.linspace(0, 1600, len(distances.values)), 0)
    assert check(replace(recording, values=warm), distances).decision == "not-decided"


def test_a_slow_approach_decides_like_held_distances() -> None:
    recording, _ = today()
    time = np.arange(4000) * 4e-3
    distance = np.where(time < 2, np.inf, np.maximum(0.05 - 0.0035 * (time - 2), 0.002))
    for shift, factor, decision in ((0.0, 1.0, "fine"), (0.02, 3.5, "recalibrate")):
        signal = factor * 0.533 * (np.where(np.isinf(distance), 1.0, distance) + 0.0419 + shift) ** -3.32
        noise = 20 * np.random.default_rng(3).standard_normal(len(time))
        values = np.round(OFFSET + np.where(np.isinf(distance), 0.0, signal) + noise)
        moving = replace(recording, stamps=(time * 1e9).round().astype(np.int64), values=values)
        known = read_known_distances("0-1.996 s: none, 2-15.7 s: 50 to 2 mm", moving)
        assert check(moving, known).decision == decision


def test_a_sensor_of_distances_is_refused() -> None:
    recording, distances = today()
    with pytest.raises(InvalidInputError):
        check(replace(distances, topic="range", values=np.full(len(distances.values), 0.1)), recording)


def signals(sensor: Any, factor: float, shift: float, places: Sequence[float]) -> Any:
    measured = tuple(
        KnownDistance(
            distance=place,
            signal=float(sensor.output(place)),
            reading=factor * float(sensor.output(place + shift)),
            error=1e-9,
            count=10,
            change=0.0,
            change_error=1.0,
            clipped=False,
        )
        for place in places
    )
    found, doubts = signals_of(measured, (0.0, 0.0), sensor, 1e-9, 0.0)
    assert not doubts
    return found


@pytest.mark.parametrize("factor", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("shift", [-0.004, 0.0, 0.015])
def test_two_distances_determine_factor_and_shift_of_an_inverse_power(factor: float, shift: float) -> None:
    sensor = InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
    for places in ((0.005, 0.04), (0.005, 0.02, 0.04)):
        found = signals(sensor, factor, shift, places)
        curve = min(
            (e.curve(e.ends) for e in explanations_of(found, sensor)), key=lambda c: not isinstance(c, InversePower)
        )
        assert curve.distance_offset == pytest.approx(0.0419 + shift, rel=1e-6)
        assert curve.scale == pytest.approx(0.533 * factor, rel=1e-5)


@pytest.mark.parametrize(("factor", "shift"), [(0.5, 0.0), (1.0, 0.01), (2.0, -0.003)])
def test_factor_and_shift_of_an_exponential_are_one_number_and_leave_the_slope(factor: float, shift: float) -> None:
    sensor = ExponentialFirstOrder(scale=20000.0, rate=-60.0)
    ends = explanations_of(signals(sensor, factor, shift, (0.005, 0.02, 0.04)), sensor)[0].ends
    assert ends[0] == pytest.approx(np.log(factor) - 60 * shift, abs=1e-9)
    assert ends[1] == pytest.approx(ends[0], abs=1e-9)


def test_equal_signals_have_no_shift() -> None:
    sensor = InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
    change = float(np.diff(np.asarray(sensor.log_output(np.array([0.04, 0.005]))))[0])
    assert _shifted(sensor, 0.005, 0.04, np.array([0.0, change])) is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0-1 s: none, 1.5-2 s: 5 mm", {0.5: np.inf, 1.2: np.nan, 1.75: 0.005}),
        ("0 s to 500 ms: 2 cm; 1 s - 3 s: 40 to 20 mm", {0.25: 0.02, 0.75: np.nan, 2.0: 0.03}),
        ("0-1: no object, 2-3: 10-10 mm", {0.5: np.inf, 2.5: 0.01}),
    ],
)
def test_known_distances_are_read(text: str, expected: dict[float, float]) -> None:
    recording, _ = today()
    known = read_known_distances(text, recording)
    for time, distance in expected.items():
        assert known.values[round(time / 4e-3)] == pytest.approx(distance, nan_ok=True)


@pytest.mark.parametrize(
    "text",
    ["5 mm", "0-5 s 5 mm", "900-950 s: none", "2-1 s: none", "0-1 s: -5 mm", "0-1 s: 5 kg", "0-1 s: 5", "0-1 s: 40-5"],
)
def test_unclear_distances_are_refused(text: str) -> None:
    with pytest.raises(pt.errors.PretouchError):
        read_known_distances(text, today()[0])
