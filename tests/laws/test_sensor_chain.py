"""Each effect of the sensor chain on a reading, tested separately at a constant distance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

import pretouch as pt
from loop_samples import BareLaw
from pretouch.simulation import PARTS, Disturbance
from refusals import refused

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
ADMITTANCE = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
STILL = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.02))
PASSING = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.04, velocity=-0.3))
XI = SENSOR.output(0.02)


def readings(horizon: float = 2.0, scenario: pt.Scenario = STILL, seed: int = 0, **chain: Any) -> np.ndarray:
    law = BareLaw(-1e-12, 1e-3)
    run = pt.simulation.simulate_loop(
        scenario, SENSOR, law, chain=pt.SensorChain(**{"rate": 1000.0} | chain), horizon=horizon, seed=seed
    )
    return run.trace().reading


def test_without_anything_a_reading_is_xi() -> None:
    assert readings() == pytest.approx(np.full(2000, XI), rel=1e-11)


def test_noise_has_both_of_its_parts() -> None:
    """A standard deviation from 8000 draws is known to 0.8 %: four of these."""
    found = readings(8.0, noise=1e-3, relative_noise=0.01) - XI
    assert found.std() == pytest.approx(np.hypot(1e-3, 0.01 * XI), rel=0.032)
    assert abs(found.mean()) < 4 * found.std() / np.sqrt(8000)
    assert abs(np.mean((found / found.std()) ** 4) - 3) < 4 * np.sqrt(24 / 8000)  # as a normal distribution has it
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 4 / np.sqrt(8000)


def test_readings_are_whole_steps_between_their_ends() -> None:
    found = readings(noise=0.05, resolution=0.01, lowest=0.1, highest=0.2)
    assert np.allclose(found / 0.01, np.round(found / 0.01), atol=1e-9)
    assert found.min() == pytest.approx(0.1)
    assert found.max() == pytest.approx(0.2)


def test_a_pedestal_adds_and_drifts() -> None:
    found = readings(offset=0.1, crosstalk=0.02, drift=0.05)
    assert found[[0, -1]] == pytest.approx([XI + 0.12, XI + 0.12 + 0.05 * 1.999])


def test_dropouts_leave_the_reading_before() -> None:
    found = readings(8.0, noise=1e-3, dropout=0.3)
    kept = np.mean(np.diff(found) == 0)
    assert kept == pytest.approx(0.3, abs=4 * np.sqrt(0.3 * 0.7 / 8000))


def test_a_delayed_reading_is_that_of_before() -> None:
    """Where the plant stands still, the distance is known at any time."""
    prompt, late = readings(0.1, PASSING), readings(0.1, PASSING, delay=0.0072)
    assert late[8:] == pytest.approx(prompt[:-8])  # 7.2 ms wait for the step at 8 ms
    shifted = readings(0.1, PASSING, phase=0.0004)
    time = np.arange(100) * 1e-3
    assert shifted[1:] == pytest.approx(SENSOR.output(0.04 - 0.3 * (time[1:] - 0.0006)))


def test_an_exposure_averages() -> None:
    found = readings(0.1, PASSING, exposure=0.001)
    time = np.linspace(0, 0.001, 20_001) + 0.049
    exact = SENSOR.output(0.04 - 0.3 * time).mean()  # the exposure from 49 ms to 50 ms is had at 50 ms
    assert found[50] == pytest.approx(exact, rel=1e-8)
    assert found[50] > SENSOR.output(0.04 - 0.3 * 0.0495)  # xi is convex


def test_jitter_shifts_the_instants() -> None:
    found = readings(0.1, PASSING, jitter=5e-5, delay=0.0005)
    distance = (SENSOR.scale / found[5:]) ** (1 / SENSOR.exponent) - SENSOR.distance_offset
    instants = (0.04 - distance) / 0.3
    shift = instants - 1e-3 * np.round(instants / 1e-3)
    assert shift.std() == pytest.approx(5e-5, rel=4 / np.sqrt(2 * 95))


def test_a_part_that_reports_distances_steps_and_scatters_in_them() -> None:
    stepped = readings(measures_distance=True, distance_resolution=0.003)
    assert stepped == pytest.approx(np.full(2000, SENSOR.output(0.021)))
    noisy = readings(8.0, measures_distance=True, distance_noise=0.001)
    distance = (SENSOR.scale / noisy) ** (1 / SENSOR.exponent) - SENSOR.distance_offset
    assert distance.std() == pytest.approx(0.001, rel=0.032)
    assert distance.mean() == pytest.approx(0.02, abs=4 * 0.001 / np.sqrt(8000))


def test_a_slower_sensor_keeps_its_reading_between() -> None:
    found = readings(0.1, PASSING, rate=250.0)
    assert (np.diff(found) != 0).mean() == pytest.approx(0.25, abs=0.02)


def test_nothing_is_seen_beyond_the_range() -> None:
    near = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32, maximum_distance=0.03)
    law = BareLaw(-1e-12, 1e-3)
    trace = pt.simulation.simulate_loop(PASSING, near, law, chain=pt.SensorChain(rate=1000.0, offset=0.01)).trace()
    seen = trace.distance <= 0.03
    assert seen.any()
    assert not seen.all()
    assert trace.reading[~seen] == pytest.approx(np.full((~seen).sum(), 0.01))


def test_runs_of_one_seed_meet_the_same_noise_whatever_else_is_changed() -> None:
    one, two = readings(noise=1e-3, seed=5), readings(4.0, noise=2e-3, seed=5)
    assert 2 * (one - XI) == pytest.approx((two - XI)[:2000], abs=1e-9)
    other = readings(noise=1e-3, seed=6)
    assert abs(np.corrcoef(one, other)[0, 1]) < 4 / np.sqrt(2000)
    law = BareLaw(-1e-12, 1e-3)
    chain = pt.SensorChain(rate=1000.0, noise=1e-3)
    many = pt.simulation.simulate_loop(STILL, SENSOR, law, chain=chain, runs=3, horizon=0.1, seed=5)
    first, second = many.trace(0).reading, many.trace(1).reading
    assert np.array_equal(first, one[:100])
    assert not np.array_equal(first, second)


def curve_errors(runs: int, **chain: Any) -> tuple[np.ndarray, np.ndarray]:
    """The distances that an object passes, and ln of reading / xi at them in each run."""
    law = BareLaw(-1e-12, 1e-3)
    made = pt.SensorChain(**{"rate": 1000.0, "misfit": 0.03, "misfit_length": 0.008} | chain)
    several = pt.simulation.simulate_loop(PASSING, SENSOR, law, chain=made, runs=runs, horizon=0.1)
    distance = 0.04 - 0.3 * np.arange(100) * 1e-3
    found = np.array([several.trace(i).reading for i in range(runs)])
    return distance, np.log(found / SENSOR.output(distance))


def test_a_misfit_has_its_size_and_its_length_over_runs() -> None:
    """Its covariance is misfit^2 exp(-d^2 / (2 misfit_length^2)), whatever the number of cosines.

    From N independent runs a covariance rho misfit^2 is known to misfit^2 sqrt((1 + rho^2) / N), with few cosines to
    less; a mean to misfit / sqrt(N). Four of these, at distances 1.2, 6 and 24 mm apart.
    """
    distance, error = curve_errors(400)
    for apart in (0, 4, 20, 80):
        d = distance[10] - distance[10 + apart]
        alike = np.exp(-(d**2) / (2 * 0.008**2))
        covariance = np.mean(error[:, 10] * error[:, 10 + apart]) / 0.03**2
        assert covariance == pytest.approx(alike, abs=4 * np.sqrt((1 + alike**2) / 400))
    assert abs(error[:, 50].mean()) < 4 * 0.03 / np.sqrt(400)
    assert np.abs(np.diff(error)).max() < 0.03 * 4 * 5 * 0.0003 / 0.008  # |h'| <= 4 misfit max |w|, 5 / length at most


def test_a_misfit_is_one_function_of_distance_in_a_run_and_another_in_the_next() -> None:
    misfit: dict[str, Any] = {"misfit": 0.03, "misfit_length": 0.008}
    distance, error = curve_errors(2)
    still = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=float(distance[50])))
    found = readings(0.5, still, **misfit)
    assert np.ptp(found) < 1e-12 * found[0]  # no noise: the same in every reading
    assert np.log(found[0] / SENSOR.output(distance[50])) == pytest.approx(error[0, 50], abs=1e-9)
    slower = pt.Scenario(admittance=ADMITTANCE, obstacle=pt.Obstacle(position=0.04, velocity=-0.15))
    assert np.log(readings(0.1, slower, **misfit) / XI)[20] != 0
    assert np.log(readings(0.1, slower, **misfit)[::2] / SENSOR.output(distance[:50])) == pytest.approx(
        error[0, :50], abs=1e-9
    )
    assert np.abs(error[0] - error[1]).max() > 0.003
    distances = readings(0.5, still, measures_distance=True, **misfit)  # at the distance that the part reports
    assert distances == pytest.approx(found, rel=1e-9)


def test_a_misfit_moves_the_contact_of_a_run_and_no_noise_does_that_for_it() -> None:
    """As noise of the same size it would average out over some hundred readings; as misfit it stays."""
    law = BareLaw(-0.7, 1e-3)

    def spread(**chain: Any) -> float:
        run = pt.simulation.simulate_loop(PASSING, SENSOR, law, chain=pt.SensorChain(rate=1000.0, **chain), runs=200)
        return float(np.std(run.relative_velocity))

    none = spread()
    assert none < 1e-15  # the rounding of a mean of equal numbers
    assert spread(misfit_length=0.01) == none
    small, large = spread(misfit=0.005, misfit_length=0.01), spread(misfit=0.02, misfit_length=0.01)
    assert small > 0
    assert large == pytest.approx(4 * small, rel=0.2)  # the same 200 draws, in first order four times as far


def test_a_misfit_asks_for_its_length() -> None:
    with refused("misfit_length"):
        pt.SensorChain(rate=20.0, misfit=0.02)


@pytest.mark.parametrize("name", PARTS)
def test_a_part_names_its_source_and_what_is_assumed(name: str) -> None:
    part = pt.simulation.sensor_part(name)
    assert part.name == name
    assert part.source
    assert part.facts
    assert any("noise" in a for a in part.assumptions)
    assert part.range[0] < part.range[1]


def test_the_chain_of_a_calibration_has_its_noise_offset_and_steps() -> None:
    rng = np.random.default_rng(3)
    distance = np.repeat(np.linspace(0.002, 0.04, 20), 10)
    outputs = SENSOR.output(distance) + 0.05 + 1e-3 * rng.standard_normal(200)
    fit = pt.calibration.fit_sensor(pt.Calibration(distances=distance, outputs=outputs), "inverse-power")
    chain = pt.simulation.chain_of_fit(fit, rate=100.0, delay=0.002)
    assert chain.noise == fit.noise.output
    assert chain.relative_noise == fit.noise.relative
    assert (chain.misfit, chain.misfit_length) == (fit.noise.misfit, fit.noise.misfit_length)
    assert chain.offset == fit.offset.value
    assert chain.latency == 0.002
    assert chain.noise == pytest.approx(1e-3, rel=0.5)


def test_a_random_phase_is_another_in_each_run_and_uniform() -> None:
    """The law sees the object at its first step after the first reading, so phases come out rounded up to 1 ms."""
    chain = pt.SensorChain(rate=20.0, random_phase=True)
    law = BareLaw(-1e-12, 1e-3, hold=0.05)
    start = [
        pt.simulation.simulate_loop(STILL, SENSOR, law, chain=chain, horizon=0.06, seed=seed).trace().reading
        for seed in range(3)
    ]
    assert len({int(np.argmax(reading > 0)) for reading in start}) == 3  # another with each seed
    several = pt.simulation.simulate_loop(STILL, SENSOR, law, chain=chain, horizon=0.06, runs=400)
    first = np.array([np.argmax(several.trace(i).reading > 0) for i in range(400)]) * 1e-3
    assert first.max() <= 0.051
    assert stats.kstest(first, "uniform", args=(0.0005, 0.05)).pvalue > 1e-3


def test_a_phase_is_given_or_random() -> None:
    with refused("phase"):
        pt.SensorChain(rate=20.0, phase=0.01, random_phase=True)


def test_a_reading_within_the_step_that_ends_at_a_touch_is_that_of_its_instant() -> None:
    """A mass that nothing pulls touches at 33.3 ms, a third into a step, and is looked at 0.23 ms before: at 70 um."""
    curve = pt.ExponentialFirstOrder(scale=1.0, rate=-1.0)
    free = pt.simulation.ImpedancePlant(mass=1.7, stiffness=1e-9, damping=0.0, feedforward=False)
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=0.0, stiffness=0.0),
        obstacle=pt.Obstacle(position=0.01),
        plant=pt.Plant(velocity=0.3),
    )
    law = BareLaw(-1e-12, 1e-3, damping=0.0, stiffness=0.0)
    chain = pt.SensorChain(rate=1000.0, phase=1e-4)
    contact = pt.simulation.SpringDamper(stiffness=1e4)
    run = pt.simulation.simulate_loop(scenario, curve, law, chain=chain, plant=free, contact=contact, follow_time=0.01)
    trace = run.trace()
    assert run.time == pytest.approx(0.01 / 0.3, abs=1e-9)
    read = trace.reading[np.searchsorted(trace.time, 0.034 - 1e-9)]
    # ln xi is tabulated to 1e-12, and the servo's 1e-9 N/m move the mass by less
    assert -np.log(read) == pytest.approx(0.01 - 0.3 * 0.0331, abs=1e-11)


def disturbed(kind: str, scenario: pt.Scenario = STILL, **chain: Any) -> np.ndarray:
    """Readings for 2 s with a disturbance of 0.5 s from 1 s on."""
    own = {name: chain.pop(name) for name in ("factor", "distance", "time") if name in chain}
    at = {} if "distance" in own else {"time": 1.0}
    event = Disturbance(kind=kind, duration=0.5, **at | own)
    return readings(scenario=scenario, offset=0.1, noise=1e-3, highest=5.0, disturbances=[event], **chain)


@pytest.mark.parametrize(
    ("kind", "own", "expected"),
    [
        ("cable", {}, lambda plain: 0.0 * plain),
        ("full-scale", {}, lambda plain: 5.0 + 0.0 * plain),
        ("reflectance", {"factor": 2.0}, lambda plain: plain + XI),
        ("object-leaves", {}, lambda plain: plain - XI),
        ("stuck", {}, lambda plain: plain[0] + 0.0 * plain),
    ],
)
def test_a_disturbance_changes_the_readings_while_it_lasts(kind: str, own: dict[str, float], expected: Any) -> None:
    plain, found = readings(offset=0.1, noise=1e-3, highest=5.0), disturbed(kind, **own)
    assert (found[:1000] == plain[:1000]).all()
    assert found[1500:] == pytest.approx(plain[1500:], rel=1e-9)  # the law moves the robot by some picometers
    at = slice(999, 1500) if kind == "stuck" else slice(1000, 1500)
    assert found[at] == pytest.approx(expected(plain[at]), rel=1e-9, abs=1e-12)


def test_a_disturbance_begins_at_its_distance() -> None:
    law = BareLaw(-1e-12, 1e-3)
    chain = pt.SensorChain(rate=1000.0, disturbances=[Disturbance(kind="cable", distance=0.02)])
    run = pt.simulation.simulate_loop(PASSING, SENSOR, law, chain=chain, horizon=2.0)
    trace = run.trace()
    assert ((trace.reading == 0.0) == (trace.distance <= 0.02)).all()


def test_disturbances_act_together() -> None:
    two = [Disturbance(kind="reflectance", time=0.5, factor=3.0), Disturbance(kind="cable", time=1.0, duration=0.2)]
    found = readings(disturbances=two)
    assert found[[0, 499]] == pytest.approx(XI)
    assert found[[500, 999, 1200, -1]] == pytest.approx(3 * XI)
    assert (found[1000:1200] == 0.0).all()
