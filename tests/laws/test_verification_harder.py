"""A mitigation that makes contact harder than none does not hold, and a push that grows with it is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pretouch as pt
from pretouch.verification import Effect
from verification_samples import NOISY, QUICK, SCENARIO, SENSOR, loop_of, verdict

WILD = loop_of(rate=60.0, exposure=1 / 60, delay=0.004, distance_noise=0.008, reports_distance=True, random_phase=True)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0)


def test_contact_that_is_harder_than_without_mitigation_does_not_hold() -> None:
    """8 mm of noise, differenced 60 times a second, throws the robot about; its excursion stays within the limit."""
    limit = pt.Constraint(name="excursion", limit=0.3)
    found = verdict(WILD, gain=-0.7463, constraints=[limit], changes=False)
    assert all(check.is_met for check in found.limits)
    assert found.status is pt.VerdictStatus.DOES_NOT_HOLD
    speed = np.abs(WILD.run(SCENARIO, SENSOR, -0.7463, runs=60).relative_velocity)
    more, error = speed.mean() - 0.3, speed.std(ddof=1) / np.sqrt(60)
    assert more > 2 * error
    effect = found.effect
    assert effect is not None
    assert effect.difference == pytest.approx(more)
    assert effect.standard_error == pytest.approx(error)
    assert effect.runs == 60
    assert found.reasons[0] == (
        f"contact is harder than without mitigation: {speed.mean():.4g} m/s on average instead of 0.3 m/s "
        f"(+{more:.2g} +- {error:.1g} m/s)"
    )
    assert "harder than without mitigation" in found.headline
    assert found.to_dict()["effect"]["is_harder"] is True


def test_what_is_proposed_is_no_harder_than_no_mitigation() -> None:
    found = verdict(WILD, gain=-0.7463)
    best, loss = found.best_change, found.loss
    assert best is not None
    assert loss is not None
    assert loss.loop_gain is not None
    for gain in (best.gain, loss.loop_gain):
        speed = np.abs(WILD.run(SCENARIO, SENSOR, gain, runs=60).relative_velocity)
        assert speed.mean() <= 0.3 + 2 * speed.std(ddof=1) / np.sqrt(60)
    assert best.standing == 1
    # where contact is harder, its share of the speed without mitigation stands for how well the gain stands
    harder = loss.curve.standing < 1
    for gain, standing in zip(loss.curve.gain[harder], loss.curve.standing[harder], strict=True):
        speed = np.abs(WILD.run(SCENARIO, SENSOR, float(gain), runs=60).relative_velocity)
        assert standing == pytest.approx(0.3 / speed.mean())


@pytest.mark.parametrize(
    ("difference", "error", "harder", "softer"),
    [
        (0.021, 0.01, True, False),
        (0.019, 0.01, False, False),
        (-0.019, 0.01, False, False),
        (-0.021, 0.01, False, True),
        (1e-6, float("nan"), True, False),  # a single run
        (1e-12, 0.0, False, False),  # the same but for rounding
    ],
)
def test_a_difference_counts_from_two_standard_errors_on(
    difference: float, error: float, harder: bool, softer: bool
) -> None:
    effect = Effect(speed=0.3 + difference, unmitigated=0.3, difference=difference, standard_error=error, runs=9)
    assert (effect.is_harder, effect.is_softer) == (harder, softer)


def test_gains_that_do_not_mitigate_are_not_called_harder() -> None:
    assert verdict(QUICK, gain=0.3, runs=1, changes=False).effect is None
    soft = verdict(QUICK, gain=-0.7463, runs=1, changes=False).effect
    assert soft is not None
    assert not soft.is_harder
    assert soft.difference == pytest.approx(0.0791 - 0.3, abs=1e-3)


def test_a_push_after_the_impact_that_grows_with_mitigation_is_named() -> None:
    """The robot that has given way is carried on by the driven obstacle, against the drive that wants it back.

    2 kg behind 4,000 N/m on a soft contact; followed until the push is over, it is largest where the robot has gone
    farthest; with an obstacle of 1.5 kg on a stiff contact the impact is all there is.
    """
    pushed = replace(NOISY, plant=ROBOT, contact=pt.simulation.HuntCrossley(stiffness=1e6, dissipation=0.5), follow=0.3)
    found = verdict(pushed, gain=-0.7463, runs=20, changes=False)
    result, free = found.mitigated, found.unmitigated
    assert result is not None
    assert free is not None
    said = [text for text in found.warnings if text.startswith("The largest force of the whole contact is larger")]
    difference = np.asarray(result.peak_force - free.peak_force)
    grows = difference.mean() > 2 * difference.std(ddof=1) / np.sqrt(20)
    assert grows == bool(said)
    assert grows
    for values in (result.peak_force, free.peak_force, result.impact_force, free.impact_force):
        assert f"{values.mean():.4g} N" in said[0]
    assert "driven on, and the robot's drive push on" in said[0]
    light = replace(NOISY, plant=ROBOT, contact=pt.simulation.HuntCrossley(stiffness=1e7, obstacle_mass=0.2))
    other = verdict(light, gain=-0.7463, runs=20, changes=False)
    assert not any(text.startswith("The largest force") for text in other.warnings)


def test_a_run_with_a_sensor_curve_of_its_own_meets_the_noise_of_its_number() -> None:
    """So verdicts of neighboring seeds share no noise, and a run is the same whether its curve differs or not."""
    known = {"sensor.exponent": pt.robust.Uniform(low=3.3199999, high=3.3200001)}
    own = verdict(NOISY, gain=-0.7463, runs=4, changes=False, uncertainty=known)
    same = NOISY.run(SCENARIO, SENSOR, -0.7463, runs=4)
    assert own.mitigated is not None
    assert own.mitigated.time == pytest.approx(same.time, rel=1e-6)
    assert np.ptp(same.time) > 1e-3 * same.time.mean()  # noise and phase alone make far more than that
