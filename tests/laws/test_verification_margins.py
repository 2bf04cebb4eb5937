"""What a verdict proposes keeps a margin to instability, and asks of a sensor the rate that gives it."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from page_rows import line, row
from pretouch.control import VirtualAdmittance
from pretouch.report import report_html
from pretouch.report.pages import page_of
from pretouch.simulation.stability import passed_distances
from pretouch.verification import VerdictStatus
from pretouch.verification.changed_loop import candidates_of
from pretouch.verification.stability import check_stability, limit_of
from verification_samples import BOUNDS, OBJECTIVE, SCENARIO, SENSOR, loop_of, velocity_limit, verdict

pytestmark = pytest.mark.usefixtures("short_rest")

LATE = loop_of(rate=30.0, delay=0.02)
APPROACH = {"quickest": 24.0, "noise": 0.0}
DISTANCE = passed_distances(SENSOR, 0.0422)


def test_the_best_gain_is_sought_among_those_with_a_margin_of_2() -> None:
    found = verdict(LATE, gain=-0.3, runs=4)
    assert found.stability is not None
    assert found.loss is not None
    assert found.loss.sought_margin == 2
    assert found.loss.curve.gain.min() >= found.stability.strongest / 2 * (1 + 1e-12)
    assert found.loss.loop_gain is not None
    assert found.stability.strongest / found.loss.loop_gain >= 2 * (1 - 1e-12)
    assert BOUNDS[0] < found.stability.strongest < 0
    assert line(str(found), "best gain with a gain margin of 2 on the simulated loop, mean of the runs").startswith(
        "-0."
    )


def test_a_gain_without_the_required_margin_holds_only_narrowly_and_the_required_margin_is_named() -> None:
    loop = loop_of(rate=250.0)
    limit = limit_of(loop, SENSOR, DISTANCE)
    assert limit is not None
    gain = limit.strongest / 2.5
    task = pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=loop, bounds=BOUNDS, gain=gain, stability_margin=4.0)
    required = pt.verify(task, changes=False)
    usual = pt.verify(task.replace(stability_margin=2.0), changes=False)
    reason = "the gain margin is only 2.5, and a margin of 4 is required (stability_margin)"
    assert reason in required.reasons
    assert required.status in {VerdictStatus.HOLDS_NARROWLY, VerdictStatus.DOES_NOT_HOLD}
    assert not any("is required" in text for text in usual.reasons)


def test_where_no_gain_within_the_bounds_has_a_margin_of_2_the_stable_ones_are_searched_and_it_is_said() -> None:
    limit = limit_of(LATE, SENSOR, DISTANCE)
    assert limit is not None
    found = verdict(LATE, gain=-0.3, runs=4, bounds=(-10.0, 0.75 * limit.strongest))
    assert found.loss is not None
    assert found.loss.sought_margin == 1
    assert found.loss.curve.gain.min() >= limit.strongest * (1 + 1e-12)
    assert found.loss.curve.gain.min() < limit.strongest / 2
    assert "best stable gain on the simulated loop (none within the bounds has a gain margin of 2)" in str(found)
    none = verdict(LATE, gain=-0.3, runs=2, bounds=(-10.0, 1.1 * limit.strongest)).loss
    assert none is not None
    assert none.loop_gain is None
    assert len(none.curve.gain) == 0
    assert repr(none.curve) == "<LoopCurve: no gain>"


def test_a_gain_that_is_better_for_lack_of_margin_is_said_to_lack_it() -> None:
    """25 readings per second, each of an instant, are enough for a better gain 9 % below the limit of stability."""
    found = verdict(loop_of(rate=25.0), gain=-0.7463, runs=2)
    assert found.loss is not None
    assert found.loss.loss is not None
    assert found.loss.loss < 0
    assert found.stability is not None
    assert 1 < found.stability.margin < 2
    assert f"a disadvantage: its gain margin is only {found.stability.margin:.3g}." in str(found)
    weaker = next(c for c in found.changes if c.name == "gain")
    assert weaker.improvement is not None
    assert weaker.improvement < 0
    assert weaker.helps  # for it holds, and not narrowly alone
    assert weaker.status is VerdictStatus.HOLDS


def test_the_rate_that_is_tried_gives_the_gain_its_margin() -> None:
    """20 readings per second are too few; twice as many would have no margin of 2."""
    slow = loop_of(rate=20.0, exposure=1 / 20)
    found = verdict(slow, gain=-0.7463, runs=5)
    assert found.stability is not None
    wanted = found.stability.lowest_rate_for_margin_2
    assert wanted > 40
    rate = math.ceil(wanted)  # to two digits, since it has two before the point
    assert wanted < 100
    change = next(c for c in found.changes if c.name == "sensor-rate")
    assert change.sentence == (
        f"Read the sensor at {rate} Hz instead of 20 Hz, with an exposure of {1e3 / rate:.4g} ms."
    )
    assert change.margin is not None
    assert 2 <= change.margin < 2.2  # one step of rounding is at most a tenth of the rate
    assert change.helps
    # beyond the controller's own rate, the controller follows
    quick = loop_of(period=0.05, rate=20.0)
    asked = candidates_of(quick, **APPROACH, wanted=123.0)[0]
    assert asked.loop.chain.rate == 130
    assert asked.loop.law.period == pytest.approx(1 / 130)
    assert "and run the controller at 130 Hz" in asked.sentence


def test_a_change_after_which_the_loop_is_unstable_never_helps() -> None:
    """Of a loop at 0.4 times the gain's need, less delay is a step, and not enough: it is not told as help."""
    found = verdict(loop_of(rate=15.0, delay=0.03), gain=-0.7463, runs=5)
    unstable = [c for c in found.changes if c.margin is not None and c.margin < 1]
    assert {"delay", "controller-rate"} <= {c.name for c in unstable}
    assert found.stability is not None
    assert any(c.margin > found.stability.margin for c in unstable if c.margin is not None)
    assert not any(c.helps for c in unstable)


@pytest.mark.slow
def test_where_no_change_is_enough_the_rate_that_would_be_is_named_or_what_forbids_it() -> None:
    strict = [velocity_limit(0.03, 0.9)]
    noisy = loop_of(rate=40.0, distance_noise=0.004, measures_distance=True)
    found = verdict(noisy, gain=-0.7463, runs=20, constraints=strict)
    assert found.stability is not None
    assert 1 < found.stability.margin < 2
    assert found.best_change is None or found.best_change.standing < 1
    rate = found.stability.lowest_rate_for_margin_2
    assert f"a gain margin of 2 needs a sensor rate of {rate:.3g} Hz" in str(found)
    late = verdict(loop_of(rate=250.0, delay=0.1), gain=-0.7463, runs=2, constraints=strict)
    assert late.stability is not None
    assert late.stability.lowest_rate_for_margin_2 == math.inf
    assert "no sensor rate results in a gain margin of 2: latency, filters or robot are too slow" in str(late)


def test_a_change_that_costs_margin_says_what_is_left_of_it() -> None:
    noisy = loop_of(rate=250.0, relative_noise=2e-3)
    found = verdict(noisy, gain=-0.7463, runs=5)
    assert found.stability is not None
    said = {c.name: c for c in found.changes}
    before = found.stability.margin
    for name in ("add-median", "add-low-pass"):
        margin = said[name].margin
        assert margin is not None
        assert margin < 0.8 * before
        assert said[name].sentence.endswith(f"; the gain margin falls from {before:.3g} to {margin:.3g}.")
    assert "margin" not in said["noise"].sentence
    assert said["noise"].margin == before


def test_a_gain_that_only_the_required_margin_excludes_is_refused_with_the_rate_that_gives_it_this_margin() -> None:
    """A design at the advised rate finds the gain; at half that rate it does not find the same one."""
    options: dict[str, Any] = {"constraints": [velocity_limit(0.1)], "stability_margin": 2.0}
    slow = verdict(loop_of(rate=8.0, exposure=170e-6), **options)
    assert slow.gain is None
    assert "infeasible with a required gain margin of 2 and a sensor rate of 8 Hz: the relative vel" in slow.headline
    advice = re.search(r"read the sensor at (\d+) Hz instead of 8 Hz", page_of(slow).next_step)
    assert advice is not None
    assert f"This gain has the required margin at a sensor rate of {advice[1]} Hz or more" in slow.reasons[0]
    free = verdict(loop_of(rate=8.0, exposure=170e-6), constraints=[velocity_limit(0.1)], runs=2, changes=False).gain
    for share, same in ((1.0, True), (0.5, False)):
        faster = loop_of(rate=share * float(advice[1]), exposure=170e-6)
        task = pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=faster, bounds=BOUNDS, **options)
        gain = pt.design(task).gain
        assert (gain == pytest.approx(free, rel=1e-6)) is same


def test_the_rate_is_not_advised_if_no_rate_gives_the_margin_or_if_the_limit_cannot_be_met_anyway() -> None:
    late = verdict(loop_of(delay=0.06), constraints=[velocity_limit(0.1)], stability_margin=2.0)
    assert late.needed_rate == math.inf
    assert "No sensor rate gives it this margin" in late.reasons[0]
    assert "no sensor rate results in the required gain margin" in page_of(late).next_step
    hard = verdict(loop_of(rate=8.0), constraints=[velocity_limit(1e-3)], stability_margin=2.0)
    assert hard.needed_rate is None
    assert "required gain margin" not in hard.headline + page_of(hard).next_step


def test_stability_of_a_proposal_is_that_of_its_own_loop() -> None:
    found = verdict(replace(LATE, seed=4), gain=-0.3, runs=2)
    for change in found.changes:
        if change.name in {"delay", "controller-rate"}:
            (loop,) = (c.loop for c in candidates_of(LATE, **APPROACH) if c.name == change.name)
            limit = limit_of(loop, SENSOR, np.asarray(DISTANCE))
            assert limit is not None
            assert change.margin == pytest.approx(limit.strongest / -0.3)


def test_an_exposure_that_comes_to_fill_the_period_changes_no_lowest_rate_suddenly() -> None:
    """Of 39.9 ms at 25 Hz it is as much a time of the sensor as of 40 ms: read more slowly, it stays.

    The delay in the loop is half an exposure: the lowest rate changes no more than tenfold as much as that does.
    """

    def lowest(exposure: float) -> tuple[float, float]:
        loop = loop_of(rate=25.0, exposure=exposure, random_phase=True)
        found = check_stability(loop, SENSOR, DISTANCE, -0.3, limit_of(loop, SENSOR, DISTANCE))
        assert found is not None
        return found.lowest_rate, found.lowest_rate_for_margin_2

    full = lowest(0.04)
    for exposure in (0.0399, 0.04 * (1 - 1e-6)):
        assert lowest(exposure) == pytest.approx(full, rel=10 * (1 - exposure / 0.04) + 1e-8)


def test_a_rate_that_is_stable_below_the_lowest_one_is_said_to_be() -> None:
    """-0.23 N s are stable with 0.5 readings per second, not with 1.5, and from 3.1 on with any number."""
    loop = loop_of(rate=3.3, random_phase=True)
    found = verdict(loop, gain=-0.23, runs=2)
    check = found.stability
    assert check is not None
    assert check.margin > 1
    assert check.lowest_rate < check.rate
    assert "at some rates" not in str(found)
    slow = loop_of(rate=0.5, random_phase=True)
    found = verdict(slow, gain=-0.23, runs=2)
    check = found.stability
    assert check is not None
    assert check.margin > 1
    assert check.lowest_rate > check.rate
    assert "at lower rates, as here, stability depends on the exact rate and phase" in " ".join(str(found).split())


@pytest.mark.parametrize("random_phase", [True, False])
def test_the_lowest_rate_does_not_contradict_the_margin(random_phase: bool) -> None:
    """100 readings and 100 steps a second, ready 0.1 ms after a step: each waits 9.9 ms, or anything up to 10 ms."""
    loop = loop_of(period=0.01, rate=100.0, delay=1e-4, random_phase=random_phase)
    for gain, stable in ((-1.3, False), (-1.0, True)):
        check = check_stability(loop, SENSOR, DISTANCE, gain, limit_of(loop, SENSOR, DISTANCE))
        assert check is not None
        assert (check.margin >= 1) == stable
        assert (check.lowest_rate <= 100.0) == stable
        assert check.has_unknown_phase == random_phase
        assert ("at the worst phase between sensor and controller" in check.text) == random_phase
    # at a phase that is given and better than the worst, the margin is its own; the lowest rate promises no phase
    lucky = loop_of(period=0.01, rate=100.0, delay=1e-4, phase=0.0099)
    check = check_stability(lucky, SENSOR, DISTANCE, -1.3, limit_of(lucky, SENSOR, DISTANCE))
    assert check is not None
    assert check.margin > 1
    assert check.lowest_rate > 100.0
    assert "at lower rates, as here, stability depends on the exact rate and phase" in check.text


def test_runs_oscillate_beyond_the_limit_and_not_before() -> None:
    """100 readings and steps a second at random phases; with half a period as the wait the limit would be -1.52 N s."""
    loop = loop_of(period=0.01, rate=100.0, exposure=170e-6, delay=120e-6, random_phase=True)
    limit = limit_of(loop, SENSOR, DISTANCE)
    assert limit is not None
    beside = replace(SCENARIO, obstacle=pt.Obstacle(position=0.002), plant=pt.Plant(velocity=1e-6))  # at rest, pushed
    loop = replace(loop, horizon=4.0)
    shares = [float((loop.run(beside, SENSOR, gain, runs=200).largest_speed > 1e-5).mean()) for gain in (-1.12, -1.45)]
    assert -1.15 < limit.strongest < -1.12  # 2 mm away the curve is less steep, which allows 4 % more
    assert shares[0] == 0
    assert shares[1] > 0.1


def test_where_no_gain_is_stable_the_verdict_says_so() -> None:
    """A spring of 8 Hz without damping, and a force that comes more than a quarter of its 126 ms late."""
    ringing = VirtualAdmittance(mass=1.0, damping=0.0, stiffness=2500.0)
    late = loop_of(delay=0.05)
    loop = replace(late, law=replace(late.law, admittance=ringing))
    scenario = replace(SCENARIO, admittance=pt.Admittance(mass=1.0, damping=0.0, stiffness=2500.0))
    found = pt.verify(
        pt.Task(
            scenario, SENSOR, OBJECTIVE, loop=loop, gain=-0.3, bounds=BOUNDS, verify=pt.designs.VerifyOptions(runs=2)
        )
    )
    assert found.stability is not None
    assert found.stability.margin == 0
    assert found.stability.lowest_rate == math.inf
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert "No gain is stable on the simulated loop, however weak" in " ".join(str(found).split())
    assert found.loss is None or found.loss.loop_gain is None
    assert found.reasons[0] == "the loop is unstable with any gain, however weak"
    assert row(report_html(found), "gain margin", "Is the sensor fast enough, and is the loop stable?") == ["0"]
