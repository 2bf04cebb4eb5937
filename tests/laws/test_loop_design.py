"""Gains that are designed on the sampled loop itself: noise, runs, brute force, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from control_samples import controller
from page_rows import line
from pretouch.motion.evaluator import NoisyEvaluator
from refusals import refused

ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SCENARIO = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)


def loop(rate: float, *, period: float = 1e-3, **chain: Any) -> pt.ClosedLoop:
    return pt.ClosedLoop(
        law=pt.control.Controller(
            period=period,
            conditioning=pt.control.Conditioning(floor=1e-3, sensor_period=1 / rate),
            law=pt.control.VirtualDamper(gain=0.0),
            admittance=pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ),
        chain=pt.SensorChain(rate=rate, **chain),
    )


NOISY = loop(250.0, exposure=170e-6, delay=120e-6, noise=1e-3, relative_noise=2e-3)
SLOW = loop(60.0, exposure=0.016, delay=0.010, noise=1e-3, relative_noise=5e-3, random_phase=True)


def many(count: int, scenario: pt.Scenario = SCENARIO) -> pt.Scenario:
    position = np.full(count, scenario.obstacle.position)
    return replace(scenario, obstacle=replace(scenario.obstacle, position=position))


@lru_cache(maxsize=1)
def slow_design() -> pt.designs.RobustDesign:
    return pt.robust(
        pt.Task(
            SCENARIO,
            SENSOR,
            OBJECTIVE,
            bounds=BOUNDS,
            uncertainty={},
            evaluate=SLOW,
            robust=pt.designs.RobustOptions(samples=128, validation=1024),
        )
    )


def test_every_gain_meets_the_noise_of_the_same_run() -> None:
    """The i-th encounter draws run i, in whatever shape encounters and gains come, and so does `run`."""
    gains = np.array([-0.5, -0.7, -0.7001])
    wide = NOISY(many(8), SENSOR, gains[:, None]).end.relative_velocity
    each = NOISY.run(SCENARIO, SENSOR, gains, runs=8).relative_velocity
    assert np.array_equal(wide, each.T)
    for i in (0, 5):
        assert np.array_equal(NOISY.after(i)(SCENARIO, SENSOR, gains).end.relative_velocity, wide[:, i])
    column = replace(SCENARIO, obstacle=pt.Obstacle(position=np.full((8, 1), 0.0422), velocity=-0.3))
    assert np.array_equal(NOISY(column, SENSOR, gains).end.relative_velocity, wide.T)
    law = NOISY.law.with_value(-0.7)
    alone = pt.simulation.simulate_loop(SCENARIO, SENSOR, law, chain=NOISY.chain, runs=8)
    assert np.array_equal(alone.relative_velocity, wide[1])


def test_common_noise_takes_the_noise_out_of_a_comparison() -> None:
    """Of two gains 0.1 % apart; with independent noise the variances add: Var a + Var b."""
    near = NOISY(many(256), SENSOR, np.array([[-0.7], [-0.7007]])).end.relative_velocity
    other = NOISY.after(256)(many(256), SENSOR, -0.7007).end.relative_velocity
    common, apart = np.var(near[1] - near[0]), np.var(other - near[0])
    assert common < 0.2 * apart


def test_a_loop_fills_the_state_at_contact_as_the_motion_does() -> None:
    """All quantities of a loop at 20 kHz without noise: errors are of the first order in T = 50 us, and the demands
    that grow from the start, where the force has not yet begun, too.
    """
    fine = loop(20_000.0, period=5e-5)
    fine = replace(fine, law=replace(fine.law, conditioning=pt.control.Conditioning(floor=1e-9)))  # type: ignore[type-var]
    gains = np.array([-0.3, -0.7, -2.0])
    found, ideal = fine(SCENARIO, SENSOR, gains), pt.find_contact(SCENARIO, SENSOR, gains)
    assert found.reached.all()
    assert found.method == "loop"
    for name in pt.motion.ContactState.names():
        got, want = np.asarray(getattr(found.end, name)), np.asarray(getattr(ideal.end, name))
        size = 1.0 if name in {"acceleration", "virtual_force"} else np.abs(want)
        assert np.all(np.abs(got - want) <= 0.01 * size + 1e-12), name
    assert np.array_equal(found.gain, gains)
    assert np.all(found.closest_distance == 0)
    assert np.isnan(found.impulse_residual).all()


def test_a_run_without_contact_ends_in_a_finite_state() -> None:
    gone = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=0.1))
    found = replace(NOISY, horizon=0.5)(gone, SENSOR, np.array([0.0, -0.7]))
    assert np.all(np.asarray(found.status) == pt.motion.ContactStatus.HORIZON)
    assert all(np.isfinite(getattr(found.end, name)).all() for name in pt.motion.ContactState.names())
    assert np.allclose(found.end.time, 0.5)
    assert np.isnan(replace(NOISY, horizon=0.5).run(gone, SENSOR, -0.7).time)


@pytest.mark.parametrize(
    "sensor", [SENSOR, pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)], ids=["inverse-power", "exponential-1"]
)
def test_the_optimum_on_the_loop_tends_to_the_ideal_one_with_the_period(sensor: pt.sensors.SensorModel) -> None:
    """Order 1: halving T halves the distance, up to a term in T^2, for which 0.1 of the order is left."""
    ideal = pt.design(pt.Task(SCENARIO, sensor, OBJECTIVE, bounds=BOUNDS)).gain
    periods = [8e-4, 4e-4, 2e-4]
    errors = []
    for period in periods:
        bare = pt.ClosedLoop(law=controller(0.0, period), chain=pt.SensorChain(rate=1 / period))
        found = pt.design(pt.Task(SCENARIO, sensor, OBJECTIVE, bounds=(-3.0, -0.2), evaluate=bare))
        errors.append(smoothed(found, 0.1) - ideal)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert abs(errors[-1]) < 0.02 * abs(ideal)
    assert orders == pytest.approx(1.0, abs=0.1)


def smoothed(design: pt.designs.GainDesign, half: float) -> float:
    """The minimum of a polynomial of degree 6 through 201 objectives: contact between two steps leaves ripples."""
    u = np.log(-design.gain) + np.linspace(-half, half, 201)
    evaluate = design.problem.task.evaluate
    result = evaluate(design.scenario, design.sensor, -np.exp(u))
    value = design.definition.value(result.end, abs(design.scenario.obstacle.velocity))
    fit = np.polynomial.Polynomial.fit(u, value, 6)
    roots = fit.deriv().roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(-np.exp(real[np.argmin(np.abs(real - np.log(-design.gain)))]))


def test_a_slow_sensor_has_another_optimum_and_the_ideal_gain_is_worse() -> None:
    """On 1024 fresh runs, pair by pair: more than three standard errors."""
    design = slow_design()
    assert design.nominal_gain == pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS)).gain
    loss = design.loss_of_nominal
    assert loss is not None
    assert loss.relative > 3 * loss.standard_error > 0
    assert abs(design.gain / design.nominal_gain - 1) > 0.02
    fresh = SLOW.after(128)(many(1024), SENSOR, np.array([[design.gain], [design.nominal_gain]]))
    value = OBJECTIVE.value(fresh.end, 0.3)
    apart = value[1] - value[0]
    assert loss.relative == pytest.approx(apart.mean() / value[0].mean(), rel=1e-12)
    assert loss.standard_error == pytest.approx(apart.std(ddof=1) / 32 / value[0].mean(), rel=1e-12)


def test_no_gain_of_a_dense_grid_is_better_than_the_robust_one() -> None:
    """By more than 1 % of the measure: jumps between the gains of the scan may hide that much."""
    gains = -np.geomspace(0.01, 3.0, 400)
    every = SLOW(many(128), SENSOR, gains[:, None])
    value = OBJECTIVE.value(every.end, 0.3).mean(axis=1)
    design = slow_design()
    assert design.value <= 1.01 * value.min()
    assert design.gain == pytest.approx(gains[np.argmin(value)], rel=0.03)


def test_the_samples_of_a_sensor_parameter_meet_the_same_runs() -> None:
    """Curves one by one, or all alike at once: where the curve is the same, so is every encounter."""
    alike = pt.uncertainty.Empirical(samples=(3.32, 3.32))
    options: dict[str, Any] = {
        "bounds": (-1.0, -0.5),
        "evaluate": NOISY,
        "robust": pt.designs.RobustOptions(samples=16, validation=16),
    }
    each = pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, uncertainty={"sensor.exponent": alike}, **options))
    once = pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, uncertainty={}, **options))
    assert np.array_equal(each.outcomes().objective, once.outcomes(each.gain).objective)
    assert each.gain == pytest.approx(once.gain, rel=1e-12)


@pytest.mark.slow
def test_noise_counts_beside_the_inputs_that_vary() -> None:
    design = pt.robust(
        pt.Task(
            SCENARIO,
            SENSOR,
            OBJECTIVE,
            bounds=(-2.0, -0.2),
            uncertainty={"obstacle.velocity": pt.uncertainty.Uniform(low=-0.35, high=-0.25)},
            constraints=[
                pt.designs.Required(constraint=pt.Constraint(name="relative_velocity", limit=0.12), probability=0.9)
            ],
            robust=pt.designs.RobustOptions(measure=pt.designs.ConditionalValueAtRisk(probability=0.8), samples=64),
            evaluate=NOISY,
        )
    )
    assert design.status is pt.designs.DesignStatus.OPTIMAL
    assert design.method == "loop"
    assert {one.name for one in design.importance} == {"obstacle.velocity", "noise"}
    assert all(one.by_gradient is None for one in design.importance)
    assert math.isfinite(design.loss_of_nominal.standard_error)
    text = str(design)
    assert "ideal design" in text
    assert "noise" in text
    assert "the sampled loop" in text
    assert "nan" not in text
    with refused("price", error=pt.errors.ResultUnavailableError):
        design.price("obstacle.velocity")


def test_a_design_on_a_loop_says_so() -> None:
    design = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=NOISY))
    assert design.method == "loop"
    assert line(str(design), "motion") == "sampled loop, simulated with every gain"
    assert "nan" not in str(design)
    assert any("only for the noise of one run" in w for w in design.warnings)
    told = design.to_dict()
    assert told["method"] == "loop"
    assert told["contact"]["impulse_residual"] is None
    assert design.certificate.at == "corner"
    assert design.sensitivities == ()
    assert math.isnan(design.gradient("sensor.scale"))
    best = design.trade_off.objective.min()
    assert design.objective <= best  # refining never loses what the scan has found


def test_a_design_on_a_loop_tells_what_the_ideal_gain_loses_there() -> None:
    still = replace(SLOW, chain=replace(SLOW.chain, noise=0.0, relative_noise=0.0))
    design = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=still))
    alone = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS))
    found = design.ideal
    assert found is not None
    assert found.gain == pytest.approx(alone.gain, rel=1e-9)
    value = OBJECTIVE.value(still(SCENARIO, SENSOR, found.gain).contact, 0.3, None)
    assert found.objective == pytest.approx(value, rel=1e-9)
    assert found.loss == pytest.approx(value / design.objective - 1, rel=1e-9)
    assert found.loss > 0.01
    assert found.feasible
    assert line(str(design), "ideal design, in continuous time").startswith("-0.7463 N s, which here is")
    assert design.to_dict()["ideal"]["loss"] == found.loss
    assert alone.ideal is None
    assert "ideal design" not in str(alone)
    slow = pt.Constraint(name="relative_velocity", limit=0.07)
    held = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=still, constraints=[slow])).ideal
    free = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, constraints=[slow])).gain
    assert held is not None
    assert held.gain == pytest.approx(free, rel=1e-6)
    ratio = abs(still(SCENARIO, SENSOR, held.gain).contact.relative_velocity) / slow.limit
    assert held.feasible == (ratio <= 1)


def test_a_scan_of_jumps_ends() -> None:
    calls = []

    def rough(scenario: pt.Scenario, sensor: pt.sensors.SensorModel, gain: Any) -> pt.motion.ContactResult:
        calls.append(np.size(gain))
        return SLOW(scenario, sensor, gain)

    design = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=rough))
    assert design.status is pt.designs.DesignStatus.OPTIMAL
    assert sum(calls) < 10_000


@pytest.mark.slow
def test_each_encounter_of_an_array_keeps_its_own_noise() -> None:
    speeds = np.array([-0.3, -0.25, -0.3])
    several = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=speeds))
    designs = pt.design(pt.Task(several, SENSOR, OBJECTIVE, bounds=(-0.8, -0.6), evaluate=NOISY))
    for i, speed in enumerate(speeds):
        one = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=float(speed)))
        alone = pt.design(pt.Task(one, SENSOR, OBJECTIVE, bounds=(-0.8, -0.6), evaluate=NOISY.after(i)))
        assert designs.gain[i] == alone.gain
    assert designs.at(2).gain == designs.gain[2]
    assert designs.gain[0] != designs.gain[2]  # the same encounter, another run


def test_a_function_of_the_users_is_an_evaluator() -> None:
    def ideal(scenario: pt.Scenario, sensor: pt.sensors.SensorModel, gain: Any) -> pt.motion.ContactResult:
        return pt.find_contact(scenario, sensor, gain)

    assert not isinstance(ideal, NoisyEvaluator)
    uncertainty = {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)}
    options: dict[str, Any] = {
        "bounds": BOUNDS,
        "uncertainty": uncertainty,
        "robust": pt.designs.RobustOptions(samples=64, validation=64),
    }
    theirs = pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, evaluate=ideal, **options))
    ours = pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, **options))
    assert theirs.gain == pytest.approx(ours.gain, rel=1e-6)
    assert theirs.strongest == BOUNDS[0]  # what is proved of L(1) is not said of what others compute
    assert [one.name for one in theirs.importance] == ["obstacle.velocity"]


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (
            lambda: pt.robust(
                pt.Task(
                    SCENARIO,
                    SENSOR,
                    OBJECTIVE,
                    bounds=BOUNDS,
                    uncertainty={"obstacle.velocity": pt.uncertainty.Interval(low=-0.4, high=-0.2)},
                    robust=pt.designs.RobustOptions(measure=pt.designs.WorstCase()),
                    evaluate=NOISY,
                )
            ),
            {"argument": "measure"},
        ),
        (
            lambda: pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, uncertainty={})),
            {"argument": "uncertainty"},
        ),
        (
            lambda: pt.robust(
                pt.Task(
                    SCENARIO,
                    SENSOR,
                    OBJECTIVE,
                    bounds=BOUNDS,
                    uncertainty={},
                    evaluate=NOISY,
                    robust=pt.designs.RobustOptions(samples=0),
                )
            ),
            {"argument": "samples", "value": 0},
        ),
        (
            lambda: pt.design(
                pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, damping_ratio=(0.7, 2.0), evaluate=NOISY)
            ),
            {"argument": "admittance.mass"},
        ),
        (
            lambda: NOISY(replace(SCENARIO, admittance=replace(ADMITTANCE, mass=2.0)), SENSOR, -0.7),
            {"argument": "admittance.mass"},
        ),
        (lambda: NOISY(many(3), SENSOR, np.zeros(2)), {"argument": "gain"}),
        (lambda: replace(NOISY, first_run=-1), {"argument": "first_run", "value": -1}),
    ],
)
def test_what_a_loop_cannot_do_is_refused_in_one_sentence(make: Any, fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()


def test_the_evidence_of_a_smooth_loop_has_its_derivatives() -> None:
    """Without noise at 1 kHz: the optimum follows its inputs as the ideal one does, to the order of T.

    The ripples of l' are 6e-6 of it: over 0.1 of u and 1 % of an input they change a derivative by a few percent.
    """
    quiet = loop(1000.0)
    quiet = replace(quiet, law=replace(quiet.law, conditioning=pt.control.Conditioning(floor=1e-9)))  # type: ignore[type-var]
    found = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=quiet))
    ideal = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS))
    assert found.certificate.at == "interior"
    assert found.gradient("obstacle.velocity") == pytest.approx(ideal.gradient("obstacle.velocity"), rel=0.1)
