"""A mitigation that makes contact harder than none does not hold, and a push that grows with it is named."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.control import Limits
from pretouch.motion import DAMPER
from pretouch.report.pages import page_of
from pretouch.simulation.stability import passage
from pretouch.verification import Effect
from pretouch.verification.effect import SensorSpeed, chase_in_words, higher_in_words
from pretouch.verification.stability import limit_of
from refusals import refused
from verification_samples import BOUNDS, NOISY, OBJECTIVE, QUICK, SCENARIO, SENSOR, loop_of, verdict

pytestmark = pytest.mark.usefixtures("short_rest")

WILD = loop_of(rate=60.0, exposure=1 / 60, delay=0.004, distance_noise=0.008, measures_distance=True, random_phase=True)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0)


def test_contact_that_is_harder_than_without_mitigation_does_not_hold() -> None:
    """8 mm of noise, differenced 60 times a second, throws the robot about; its excursion stays within the limit."""
    limit = pt.Constraint(name="excursion", limit=0.3)
    found = verdict(WILD, gain=-0.7463, constraints=[limit], changes=False)
    assert all(check.is_met for check in found.limits)
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
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
    harder = loss.curve.standing < 0.99  # a gain without effect stands at 0.99
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


def test_contact_that_is_harder_in_more_runs_than_half_is_harder_whatever_its_mean() -> None:
    """Of runs on which a gain does nothing half are harder by chance, within two deviations of sqrt(n) / 2."""
    known = {"speed": 0.29, "unmitigated": 0.3, "difference": -0.01, "standard_error": 0.02}
    assert Effect(**known, runs=100, harder_count=61).is_harder
    assert not Effect(**known, runs=100, harder_count=60).is_harder
    assert not Effect(**known, runs=4, harder_count=4).is_harder


@pytest.mark.parametrize("gain", [0.3, 0.01])
def test_a_gain_of_the_wrong_sign_does_not_hold_whatever_the_limits(gain: float) -> None:
    found = verdict(QUICK, gain=gain, runs=1, changes=False)
    assert not found.limits
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.reasons[0] == f"D_p = {gain:g} N s makes the robot chase the object: mitigating gains are negative"
    assert found.reasons[1].startswith("contact is harder than without mitigation: ")
    assert found.reasons[2].startswith(
        "contact is predicted to be harder than without mitigation: the predicted contact speed is "
    )
    assert "chase the object" in found.headline
    soft = verdict(QUICK, gain=-0.7463, runs=1, changes=False).effect
    assert soft is not None
    assert not soft.is_harder
    assert soft.difference == pytest.approx(0.0791 - 0.3, abs=1e-3)


def test_contact_that_comes_with_the_gain_alone_is_harder() -> None:
    """The object turns 2 mm before the robot; a gain of the wrong sign follows it there."""
    turning = pt.Obstacle(position=0.0422, velocity=-0.3, acceleration=0.3**2 / (2 * 0.0402))
    scenario = replace(SCENARIO, obstacle=turning)
    loop = replace(QUICK, horizon=1.0)
    task = pt.Task(
        scenario,
        SENSOR,
        OBJECTIVE,
        loop=loop,
        gain=1.0,
        bounds=(-10.0, 2.0),
        verify=pt.designs.VerifyOptions(runs=2),
        horizon=1.0,
    )
    found = pt.verify(task, changes=False)
    assert found.effect is not None
    assert found.effect.unmitigated == 0
    assert found.effect.is_harder
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.reasons[-2].endswith("instead of no contact")


def test_a_law_of_the_other_sign_has_its_sign_explained() -> None:
    number = pt.motion.LawNumber("drag", "phi", "N*s^2", 1)
    assert list(chase_in_words(number, -0.01)) == [
        "phi = -0.01 N s\u00b2 makes the robot chase the object: mitigating drags are positive"
    ]
    assert not list(chase_in_words(number, 0.01))


BOTH = {"natural_frequency": (2.0, 12.0)}


@pytest.mark.parametrize(
    "verb",
    [
        pt.design,
        pt.pareto,
        pt.robust,
        pt.verify,
        lambda task: pt.pareto(task.replace(**BOTH)),
        lambda task: pt.design(task.replace(**BOTH)),
        lambda task: pt.design(task.replace(stability_margin=2.0)),
    ],
)
def test_bounds_without_a_gain_that_mitigates_are_refused_with_the_sign(verb: Any) -> None:
    task = pt.Task(
        SCENARIO, SENSOR, OBJECTIVE, loop=QUICK, bounds=(0.01, 10.0), verify=pt.designs.VerifyOptions(runs=2)
    )
    with refused("bounds", value=(0.01, 10.0), limit=(-10.0, -0.01)):
        verb(task)
    with refused("bounds", value=(0.0, 10.0), limit=(-10.0, 0.0)):
        verb(task.replace(bounds=(0.0, 10.0)))


def test_bounds_of_a_drag_are_positive_and_those_with_both_signs_are_searched() -> None:
    drag = pt.Task(SCENARIO, SENSOR, OBJECTIVE, law="virtual-drag", bounds=(-0.1, -1e-3))
    with refused("bounds", value=(-0.1, -0.001), limit=(0.001, 0.1)):
        pt.design(drag)
    both = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=(-10.0, 0.5)))
    assert both.gain == pytest.approx(-0.7463, abs=1e-4)


def test_a_design_that_makes_contact_harder_does_not_call_that_less() -> None:
    """Without mitigation contact comes after 141 ms; only gains that chase the object make it sooner."""
    late = [pt.Constraint(name="time", limit=0.12)]
    found = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=(-1.0, 1.0), constraints=late))
    assert found.gain is not None
    assert found.gain > 0
    assert ", harder than the 0.3 m/s without mitigation." in found.headline


def test_a_loop_without_effect_does_not_hold() -> None:
    """The object comes within 84 ms, of which an 8 Hz sensor has no two readings."""
    fast = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=-0.5))
    task = pt.Task(
        fast,
        SENSOR,
        OBJECTIVE,
        loop=loop_of(rate=8.0, random_phase=True),
        gain=-0.2,
        bounds=BOUNDS,
        verify=pt.designs.VerifyOptions(runs=20),
    )
    found = pt.verify(task, changes=False)
    assert found.mitigated is not None
    assert np.all(found.mitigated.largest_excursion == 0)
    assert found.stability is not None
    assert found.stability.margin > 1
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.reasons[0].startswith("the gain has no effect: the average contact speed is 0.5 m/s with the gain, ")
    assert found.sensor_speed is not None
    assert "The sensor is too slow" in found.sensor_speed.text
    assert "The sensor is too slow" in " ".join(str(found).split())
    assert verdict(QUICK, gain=0.0, runs=1, changes=False).status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    one = pt.simulate(task)
    assert one.warnings[-1].startswith(
        "PT415: The gain has no effect in this run: the contact speed is 0.5 m/s with this gain and "
    )


def test_a_loop_that_loses_most_of_the_mitigation_does_not_hold() -> None:
    """Half of the predicted fall of the speed is the border: 12 Hz lose more, 15 Hz less."""
    free, predicted = 0.3, abs(float(pt.find_contact(SCENARIO, SENSOR, -0.4).contact.relative_velocity))
    for rate, lost in ((12.0, True), (15.0, False)):
        loop = loop_of(rate=rate, random_phase=True)
        found = verdict(loop, gain=-0.4, changes=False)
        mean = float(np.abs(loop.run(SCENARIO, SENSOR, -0.4, runs=60).relative_velocity).mean())
        assert found.effect is not None
        assert found.effect.lost == pytest.approx((mean - predicted) / (free - predicted))
        assert (found.effect.lost > 0.5) == lost
        assert (found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD) == lost
        said = (
            "most of the predicted mitigation is lost on the simulated loop: the mean contact speed is "
            f"{mean:.3g} m/s (predicted speed: {predicted:.3g} m/s; without mitigation: 0.3 m/s)"
        )
        assert (found.reasons[0] == said) == lost


def test_contact_that_is_harder_than_predicted_is_said_first_and_is_no_fast_sensor() -> None:
    slow = loop_of(rate=15.0, random_phase=True)
    found = verdict(slow, gain=-0.4, changes=False)
    assert found.stability is not None
    assert found.stability.margin > 1
    speed = np.abs(slow.run(SCENARIO, SENSOR, -0.4, runs=60).relative_velocity)
    predicted = abs(float(pt.find_contact(SCENARIO, SENSOR, -0.4).contact.relative_velocity))
    excess = speed.mean() / predicted - 1
    assert excess > 0.1
    assert found.status is pt.verification.VerdictStatus.HOLDS_NARROWLY
    assert found.reasons[0].startswith(f"the contact speed is {100 * excess:.2g} % higher than predicted, ")
    assert found.reasons[0] in found.headline
    assert found.reasons[1].startswith("the sensor is too slow: in 95 % of the runs, the contact speed is up to ")
    # with a reading of each step, of that instant, the same controller gives what is compared with
    quick = loop_of(rate=1000.0)
    ideal = abs(float(quick.run(SCENARIO, SENSOR, -0.4).relative_velocity))
    check = found.sensor_speed
    assert check is not None
    assert check.fast == pytest.approx(ideal)
    assert check.excess == pytest.approx(float(np.quantile(speed / ideal, 0.95)) - 1)
    assert not check.is_fast_enough
    lenient = verdict(slow, gain=-0.4, changes=False, speed_tolerance=1.5 * max(check.excess, excess))
    assert lenient.sensor_speed is not None
    assert lenient.sensor_speed.is_fast_enough
    assert not any("faster" in reason or "too slow" in reason for reason in lenient.reasons)
    with refused("speed_tolerance", value=-0.1):
        verdict(slow, gain=-0.4, speed_tolerance=-0.1)


def test_simulate_warns_first_of_a_gain_that_makes_contact_harder() -> None:
    found = pt.simulate(pt.Task(SCENARIO, SENSOR, loop=QUICK, gain=0.3))
    assert found.warnings[0] == "PT403: D_p = 0.3 N s makes the robot chase the object: mitigating gains are negative."
    assert found.warnings[1].startswith(
        "PT403: With this gain, contact is harder than without mitigation: the contact speed is 0.81"
    )
    shown = str(found).split("\n\n")
    assert "makes the robot chase the object" in shown[1]
    assert found.headline.startswith(
        "Contact is harder than without mitigation: the contact speed on the simulated loop is 0.81"
    )
    assert not pt.simulate(pt.Task(SCENARIO, SENSOR, loop=QUICK, gain=-0.7463)).warnings


def test_simulate_warns_of_a_loop_that_is_unstable_or_nearly_and_of_a_force_far_above_the_predicted_one() -> None:
    slow = loop_of(period=0.01, rate=100.0)
    limit = limit_of(slow, SENSOR, passage(DAMPER, SCENARIO, SENSOR, -1.0, 0.0422))
    assert limit is not None

    def warnings(gain: float) -> str:
        return " ".join(pt.simulate(pt.Task(SCENARIO, SENSOR, loop=slow, gain=gain)).warnings)

    strongest = f"{limit.strongest:.3g} N s"
    assert f": the strongest stable gain there is {strongest}" in warnings(1.05 * limit.strongest)
    assert "The gain margin of the sampled loop is only 1.05 at" in warnings(limit.strongest / 1.05)
    assert "gain margin" not in warnings(limit.strongest / 2.1)
    wild = pt.simulate(pt.Task(SCENARIO, SENSOR, loop=loop_of(relative_noise=0.1), gain=-0.7463))
    force = wild.comparison("largest_virtual_force")
    assert abs(force.loop) > 1.5 * abs(force.predicted)
    assert any(
        text.startswith(f"PT414: The virtual force reaches {force.loop:.3g} N on the simulated loop")
        for text in wild.warnings
    )


@pytest.mark.slow
def test_a_push_after_the_impact_that_grows_with_mitigation_is_named() -> None:
    """The robot that has given way is carried on by the driven obstacle, against the drive that wants it back.

    2 kg behind 4,000 N/m on a soft contact; followed until the push is over, it is largest where the robot has gone
    farthest; with an obstacle of 1.5 kg on a stiff contact the impact is all there is.
    """
    pushed = replace(
        NOISY, plant=ROBOT, contact=pt.simulation.HuntCrossley(stiffness=1e6, dissipation=0.5), follow_time=0.3
    )
    found = verdict(pushed, gain=-0.7463, runs=20, changes=False)
    result, free = found.mitigated, found.unmitigated
    assert result is not None
    assert free is not None
    said = [text for text in found.warnings if text.startswith("PT407: After the impact, ")]
    difference = np.asarray(result.peak_force - free.peak_force)
    grows = difference.mean() > 2 * difference.std(ddof=1) / np.sqrt(20)
    assert grows == bool(said)
    assert grows
    for values in (result.peak_force, free.peak_force, result.impact_force, free.impact_force):
        assert f"{values.mean():.4g} N" in said[0]
    assert "the robot's drive and the driven obstacle push with a mean peak force of " in said[0]
    light = replace(NOISY, plant=ROBOT, contact=pt.simulation.HuntCrossley(stiffness=1e7, obstacle_mass=0.2))
    other = verdict(light, gain=-0.7463, runs=20, changes=False)
    assert not any(text.startswith("PT407: After the impact") for text in other.warnings)


def test_a_run_with_a_sensor_curve_of_its_own_meets_the_noise_of_its_number() -> None:
    """So verdicts of neighboring seeds share no noise, and a run is the same whether its curve differs or not."""
    known = {"sensor.exponent": pt.uncertainty.Uniform(low=3.3199999, high=3.3200001)}
    own = verdict(NOISY, gain=-0.7463, runs=4, changes=False, uncertainty=known)
    same = NOISY.run(SCENARIO, SENSOR, -0.7463, runs=4)
    assert own.mitigated is not None
    assert own.mitigated.time == pytest.approx(same.time, rel=1e-6)
    assert np.ptp(same.time) > 1e-3 * same.time.mean()  # noise and phase alone make far more than that


@pytest.mark.parametrize(
    ("excess", "words"),
    [
        (0.041, "4.1 % higher than predicted"),
        (0.97, "97 % higher than predicted"),
        (1.0, "2 times as high as predicted"),
        (5.39, "6.4 times as high as predicted"),
        (539.0, "540 times as high as predicted"),
        (-0.22, "22 % lower than predicted"),
    ],
)
def test_a_speed_is_compared_in_percent_or_as_a_factor(excess: float, words: str) -> None:
    assert higher_in_words(excess, "predicted") == words


@pytest.mark.parametrize(
    ("excess", "words"), [(0.0, "no higher than"), (0.2, "up to 20 % higher than"), (5.39, "6.4 times")]
)
def test_the_speed_of_a_sensor_is_compared_in_words(excess: float, words: str) -> None:
    speed = SensorSpeed(rate=8.0, speed=0.3, fast=0.08, excess=excess, tolerance=0.1)
    assert f"In 95 % of the runs, the contact speed is {'up to ' * (excess > 1)}{words}" in speed.text
    assert "with an infinitely fast sensor; an increase of up to 10 % is allowed." in speed.text


@pytest.mark.parametrize(
    ("gain", "step"), [(0.3, "use a negative gain, such as D_p = -0.3 N s"), (-0.7463, "run `pretouch")]
)
def test_the_next_step_for_a_gain_of_the_wrong_sign_is_the_sign(gain: float, step: str) -> None:
    """The prediction is harder than without mitigation, too, so a comparison with it would reassure."""
    found = pt.simulate(pt.Task(SCENARIO, SENSOR, loop=QUICK, gain=gain))
    assert page_of(found).next_step.startswith(step)
    assert found.is_mitigated is page_of(found).good is (gain < 0)
    assert ("predicted 0.8" in found.headline) is (gain > 0)
    assert ("(" in found.headline) is (gain < 0)


def test_a_gain_without_effect_is_explained_by_an_excursion_that_is_used_up() -> None:
    """The robot retreats by 2 mm, and then stands still at its limit until contact."""
    law: Any = NOISY.law
    short = replace(NOISY, law=replace(law, limits=Limits(excursion=2e-3)))
    found = verdict(short, gain=-0.7463, runs=20, changes=False)
    assert found.status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert found.reasons[0].startswith("the allowed excursion of 2 mm is used up before contact in 100 % of 20 runs")
    free = verdict(NOISY, gain=-0.7463, runs=20, changes=False)
    assert not any("used up" in reason for reason in free.reasons)
