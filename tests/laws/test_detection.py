"""The law acts from where the floor detects the object: this distance, its warning, both cures, runs from beyond it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from pretouch.control import Conditioning
from pretouch.simulation import ClosedLoop, SensorChain
from pretouch.simulation.detection import detection_distance, moved_on, time_at
from refusals import refused

ROOT = Path(__file__).parents[2]
LOOP = (ROOT / "examples/loop.toml").read_text(encoding="utf-8")
FLOOR, START = 'floor = "1900 counts"', 'position = "42.2 mm"'
CURVE = pt.InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)


def task_of(folder: Path, *changes: tuple[str, str]) -> pt.Task:
    text = LOOP.replace("runs = 500", "runs = 60")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "loop.toml").write_text(text, encoding="utf-8")
    return pt.load_scenario(folder / "loop.toml")


def warned(task: pt.Task, gain: float | None = -0.8) -> bool:
    return any(text.startswith("PT421") for text in task.start_warnings(gain))


def cured(folder: Path, task: pt.Task, changes: tuple[tuple[str, str], ...]) -> list[pt.Task]:
    """Follow both cures of the warning literally, each in a new file."""
    (text,) = task.start_warnings(-0.8)
    start, floor = re.search(r'set (position = "[^"]+") in', text), re.search(r"set (floor = \S+) in", text)
    assert start is not None
    assert floor is not None
    where = dict(changes)
    first = {**where, START: start[1]}
    second = {**where, FLOOR: floor[1]}
    return [task_of(folder, *cure.items()) for cure in (first, second)]


@pytest.mark.parametrize(
    ("resolution", "crosstalk", "offset", "signal"),
    [(0.0, 150.0, 150.0, 1.0), (1.0, 150.0, 150.0, 2.0), (8.0, 30.0, 0.0, 1.0)],
)
def test_the_detection_distance_is_where_half_of_the_readings_exceed_the_floor(
    resolution: float, crosstalk: float, offset: float, signal: float
) -> None:
    chain = SensorChain(rate=250.0, noise=20.0, crosstalk=crosstalk, resolution=resolution)
    found = detection_distance(CURVE, chain, Conditioning(floor=100.0, offset=offset), signal=signal)
    readings = signal * CURVE.output(found) + crosstalk + 20.0 * np.random.default_rng(1).standard_normal(40_000)
    if resolution:
        readings = resolution * np.round(readings / resolution)
    # of 40,000 readings, 2 standard deviations are 0.5 %; a step of 8 counts has 4 of them at most next to the floor
    assert np.mean(readings - offset > 100.0) == pytest.approx(0.5, abs=0.006)


def test_a_controller_that_always_or_never_detects_has_no_distance() -> None:
    chain = SensorChain(rate=250.0, crosstalk=150.0, highest=65535.0)
    assert detection_distance(CURVE, chain, Conditioning(floor=100.0)) == np.inf
    assert detection_distance(CURVE, chain, Conditioning(floor=30_000.0)) == 0.0
    ends = replace(CURVE, maximum_distance=0.09)
    assert detection_distance(ends, replace(chain, crosstalk=0.0), Conditioning(floor=100.0)) == 0.09


@pytest.mark.parametrize("floor", ["100 counts", "700 counts", "4000 counts", "9000 counts"])
def test_another_detection_distance_is_warned_of_and_both_cures_work(floor: str, tmp_path: Path) -> None:
    changes = ((FLOOR, f'floor = "{floor}"'),)
    task = task_of(tmp_path, *changes)
    assert warned(task)
    assert warned(task, None)
    for verb in (pt.design, pt.simulate):
        assert any(text.startswith("PT421") for text in verb(task.replace(stability_margin=None)).warnings)
    for agreeing in cured(tmp_path, task, changes):
        assert not warned(agreeing)
        assert not warned(agreeing, None)


def test_a_floor_that_detects_a_little_earlier_is_not_warned_of(tmp_path: Path) -> None:
    assert not warned(task_of(tmp_path))
    assert not warned(task_of(tmp_path, (FLOOR, 'floor = "1850 counts"')), None)


@pytest.mark.slow
def test_a_gain_that_misses_a_limit_from_the_detection_distance_does_not_hold(tmp_path: Path) -> None:
    """An independent run of encounters that really start farther away agrees with the share of missed limits."""
    task = task_of(tmp_path, (FLOOR, 'floor = "100 counts"')).replace(gain=-0.86)
    task = task.replace(verify=pt.designs.VerifyOptions(runs=200))
    verdict = pt.verify(task, changes=False)
    assert verdict.status.value == "does-not-hold"
    assert all(check.is_met for check in verdict.limits)
    assert verdict.approach is not None
    assert {check.name for check in verdict.approach.missed} == {"relative_velocity", "excursion"}
    assert verdict.approach.distance == pytest.approx(0.1645, abs=1e-4)
    assert verdict.reasons[0].startswith("from 164.5 mm, where the floor detects the object: ")
    farther = task.replace(
        scenario=replace(task.scenario, obstacle=replace(task.scenario.obstacle, position=0.2)),
        loop=replace(task.loop, horizon=9.0, seed=5),
    )
    other = pt.verify(farther, changes=False)
    for mine, theirs in zip(verdict.approach.limits, other.limits, strict=True):
        assert mine.held == pytest.approx(theirs.held, abs=0.12)  # 2.5 standard errors of two shares of 200 runs
    assert pt.verify(task_of(tmp_path).replace(gain=-0.86), changes=False).approach is None


def test_runs_that_begin_farther_away_are_those_of_a_farther_start(tmp_path: Path) -> None:
    """Only the times differ, by that of the way; the noise of every reading is the same."""
    task = task_of(tmp_path)
    loop: ClosedLoop = task.loop
    far = replace(task.scenario, obstacle=replace(task.scenario.obstacle, position=0.3))
    begun, farther = replace(loop, start_distance=0.3), replace(loop, horizon=6.0)
    mine, theirs = (one.run(s, task.sensor, -0.8) for one, s in ((begun, task.scenario), (farther, far)))
    way = (0.3 - 0.0422) / 0.3
    for name in ("relative_velocity", "largest_excursion", "peak_force", "contacts"):
        assert getattr(mine, name) == pytest.approx(getattr(theirs, name), rel=1e-9)
    for name in ("time", "detection_time", "end_time"):
        assert getattr(mine, name) == pytest.approx(getattr(theirs, name) - way, abs=1e-9)
    assert mine.trace().time[0] == pytest.approx(-way)
    assert mine.trace().contacts[0, 0] == pytest.approx(mine.time)
    assert not warned(task.replace(loop=begun))
    nearer = replace(loop, start_distance=0.02).run(task.scenario, task.sensor, -0.8)
    assert nearer.time == loop.run(task.scenario, task.sensor, -0.8).time


@pytest.mark.slow
def test_the_key_start_distance_lets_runs_begin_beyond_the_range(tmp_path: Path) -> None:
    task = task_of(tmp_path, ("[loop]\n", '[loop]\nstart_distance = "200 mm"\n')).replace(gain=-0.86)
    verdict = pt.verify(task, changes=False)
    near = pt.verify(task_of(tmp_path).replace(gain=-0.86), changes=False)
    assert verdict.mitigated.detection_time.min() < 0 < near.mitigated.detection_time.min()
    speeds = [v.comparison("relative_velocity") for v in (verdict, near)]
    assert speeds[0].predicted == speeds[1].predicted
    assert speeds[0].simulated.mean == pytest.approx(speeds[1].simulated.mean, rel=0.05)
    encounter = pt.simulate(task)
    assert encounter.comparison("time").relative_difference == pytest.approx(0.0, abs=0.05)


def test_uncertain_positions_beyond_the_range_are_predicted_from_the_detection_distance(tmp_path: Path) -> None:
    uncertain = "[uncertainty]\n"
    changes = (
        (uncertain, uncertain + 'obstacle.position = { uniform = ["40 mm", "120 mm"] }\n'),
        (START, 'position = "43 mm"'),
    )
    verdict = pt.verify(task_of(tmp_path, *changes).replace(gain=-0.86), changes=False)
    assert verdict.effect is not None
    assert abs(verdict.effect.excess) < 0.1  # the prediction acts from 43.2 mm, as the loop does
    assert min(verdict.mitigated.trace(i).time[0] for i in range(5)) < -0.05


def test_a_falling_object_is_met_where_it_was_released_at_most() -> None:
    drop = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.08, velocity=-0.8, acceleration=-9.81),
    )
    released = 0.08 + 0.8**2 / (2 * 9.81)
    for distance in (0.1, 0.3):
        before = moved_on(drop, float(time_at(drop, distance)))
        assert before.distance == pytest.approx(min(distance, released))
        energy = before.obstacle.velocity**2 / 2 + 9.81 * before.distance
        assert energy == pytest.approx(0.8**2 / 2 + 9.81 * 0.08)
    later = moved_on(drop, float(time_at(drop, 0.03)))
    assert later.distance == pytest.approx(0.03)
    assert later.obstacle.velocity == pytest.approx(-np.sqrt(0.8**2 + 2 * 9.81 * 0.05))
    receding = replace(drop, obstacle=replace(drop.obstacle, velocity=0.1, acceleration=0.0))
    assert np.isnan(time_at(receding, 0.03))


def test_a_course_is_continued_from_a_later_start() -> None:
    task = pt.load_scenario(ROOT / "examples/course.toml")
    later = moved_on(task.scenario, 0.07)
    for time in (0.0, 0.01, 0.1, 0.3, 0.5):
        assert later.obstacle.position_at(time) == pytest.approx(task.scenario.obstacle.position_at(0.07 + time))


@pytest.mark.parametrize("file", sorted(path.name for path in (ROOT / "examples").glob("*.toml")))
def test_every_shipped_scenario_starts_where_its_floor_detects(file: str) -> None:
    task = pt.load_scenario(ROOT / "examples" / file)
    assert not warned(task, None)
    if task.loop is not None:
        found = task.loop.detection(task.scenario, task.sensor)
        assert found.distance == pytest.approx(task.scenario.distance, rel=0.05)


def test_starts_beyond_a_curve_that_ends_before_the_detection_distance_are_refused(tmp_path: Path) -> None:
    known = 'obstacle.position = { uniform = ["40 mm", "46 mm"] }\nobstacle.velocity ='
    cut = ("exponent = 3.32", 'exponent = 3.32\nmaximum_distance = "43 mm"')
    task = task_of(tmp_path, cut, (FLOOR, 'floor = "1000 counts"'), ("obstacle.velocity =", known))
    with refused("obstacle.position", limit=(0.0, 0.043)):
        pt.verify(task.replace(gain=-0.8), changes=False)


def test_a_robust_design_promises_what_the_loop_can_do_for_starts_beyond_the_range(tmp_path: Path) -> None:
    uncertain = "[uncertainty]\n"
    beyond = (uncertain, uncertain + 'obstacle.position = { uniform = ["40 mm", "120 mm"] }\n')
    task = task_of(tmp_path, beyond, (START, 'position = "43 mm"'))
    task = task.replace(robust=replace(task.robust, samples=128, validation=512))
    design = pt.robust(task)
    verdict = pt.verify(task.replace(gain=design.gain), changes=False)
    for promised, simulated in zip(design.validation.limits, verdict.limits, strict=True):
        assert promised.held == pytest.approx(simulated.held, abs=0.06)  # 60 runs
    # without the loop, the law would act from 120 mm on, with less force near contact
    alone = pt.robust(task.replace(loop=None, stability_margin=None))
    assert alone.status is not design.status


def test_the_worst_start_is_where_the_object_is_detected(tmp_path: Path) -> None:
    task = task_of(tmp_path).replace(constraints=())
    far = replace(task.scenario, obstacle=replace(task.scenario.obstacle, position=0.08))
    for low in (0.04, 0.05):
        inputs = {
            "obstacle.position": pt.uncertainty.Interval(low=low, high=0.12),
            "obstacle.velocity": pt.uncertainty.Interval(low=-0.4, high=-0.2),
        }
        robust = replace(task.robust, measure=pt.designs.WorstCase())
        design = pt.robust(task.replace(scenario=far, uncertainty=inputs, robust=robust))
        assert design.worst.inputs["obstacle.position"] == pytest.approx(task.farthest_start, rel=1e-4)
        assert design.worst.bound == pytest.approx(design.worst.value, rel=1e-6)
