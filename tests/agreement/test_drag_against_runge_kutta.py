"""The quadrature of the virtual drag compared with SciPy's DOP853, for every curve and accelerated obstacles.

SciPy with rtol 1e-12 has relative errors of a few 1e-12 per step. After hundreds of steps, and since l' at contact may
be a hundredth of its initial value, the error is at most a few 1e-9. The quadrature claims 1e-11, so this test is
limited by the reference.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import expi

from encounters import CURVES
from pretouch._core.errors import OutOfRangeError
from pretouch.motion import Admittance, ContactStatus, Obstacle, Plant, Reference, Scenario
from pretouch.motion.drag import sample_drag, solve_drag
from pretouch.sensors import CustomSensor, ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel
from refusals import refused

TIGHT = 2e-8  # of the reference, see above
MASS, DAMPING, STIFFNESS = 1.7, 11.0, 30.0
ADMITTANCE = Admittance(mass=MASS, damping=DAMPING, stiffness=STIFFNESS)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)


def _reference(sensor: SensorModel, phi: float, l_0: float, v: float, a: float, end: float = 30.0) -> dict:
    """Integrate the robot itself in time, from rest at its reference: the law, and the admittance as it is held off."""
    low, high = max(sensor.valid_range[0], 0.0), sensor.valid_range[1]

    def law(t: float, y: np.ndarray) -> list[float]:
        distance = l_0 + (v + a * t / 2) * t - y[0]
        speed = v + a * t - y[1]
        pull = STIFFNESS * y[0] + DAMPING * y[1]
        slope = sensor.log_slope(min(max(distance, low), high))
        force = -phi * slope**2 * speed * abs(speed)  # a run ends where the speed changes its sign
        return [y[1], -(force + max(pull, 0.0)) / MASS]

    def contact(t: float, y: np.ndarray) -> float:
        return l_0 + (v + a * t / 2) * t - y[0] - low

    def rest(t: float, y: np.ndarray) -> float:
        return v + a * t - y[1]

    contact.terminal, contact.direction = True, -1.0  # type: ignore[attr-defined]
    rest.terminal, rest.direction = a > 0, 1.0  # type: ignore[attr-defined]
    knots = [k for k in sensor.knots if low < k < l_0]
    step = min((l_0 - low) / abs(v) / 50, 0.02) if knots else np.inf  # a corner costs the order of one step only
    run = solve_ivp(
        law, (0.0, end), [0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-15, events=[contact, rest], max_step=step
    )
    t, (x, u) = run.t[-1], run.y[:, -1]
    return {
        "touched": len(run.t_events[0]) > 0,
        "turned": len(run.t_events[1]) > 0,
        "time": t,
        "distance": l_0 + (v + a * t / 2) * t - x,
        "displacement": x,
        "velocity": u,
        "relative_velocity": v + a * t - u,
    }


def _draw(sensor: SensorModel, seed: int, count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    low, high = max(sensor.valid_range[0], 0.0), min(sensor.valid_range[1], 0.1)
    l_0 = low + (high - low) * rng.uniform(0.2, 0.95, count)
    v = -(10 ** rng.uniform(-1.3, 0.2, count))
    ratio = rng.uniform(0.05, 0.9, count)
    grid = low + (l_0 - low)[:, None] * (np.polynomial.legendre.leggauss(40)[0] + 1) / 2
    weights = np.polynomial.legendre.leggauss(40)[1]
    total = (sensor.log_slope(grid) ** 2 @ weights) * (l_0 - low) / 2
    phi = MASS * np.log(1 / ratio) / total
    a = v**2 / (l_0 - low) * rng.choice([0.0, -0.1, -1.0, -4.0, 0.05, 0.3, 1.0], count)
    return l_0, v, a, phi


@pytest.mark.slow(keep=3)
@pytest.mark.parametrize("name", CURVES)
def test_contacts_and_turns_agree_with_an_integration_in_time(name: str) -> None:
    sensor = CURVES[name]
    l_0, v, a, phi = _draw(sensor, 20261122, 21)
    scenario = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=l_0, velocity=v, acceleration=a))
    found = solve_drag(scenario, sensor, phi)
    assert (found.columns.column("quadrature_error") < 1e-11).all()
    # the balance is met to what ln xi rounds; the Mittag-Leffler function is good to 1e-13, over some 20 cells
    assert (found.impulse_residual < 1e-11).all()
    turned = 0
    tolerance = (
        2e-6 if name in {"table", "mittag-leffler"} else TIGHT
    )  # the reference at corners, and at the noise of E
    for i in range(len(l_0)):
        expected = _reference(sensor, phi[i], l_0[i], v[i], a[i])
        low = max(sensor.valid_range[0], 0.0)
        ends = ContactStatus.NEVER if expected["turned"] else ContactStatus.LEFT_RANGE if low else ContactStatus.CONTACT
        assert found.status[i] == ends
        turned += expected["turned"]
        scales = {"time": expected["time"], "distance": l_0[i], "displacement": l_0[i]}
        for quantity in ("time", "distance", "displacement", "velocity", "relative_velocity"):
            got = found.columns.column(quantity if quantity != "velocity" else "velocity")[i]
            # where it turns, l' is zero at a time that is as uncertain as l' over l''
            assert got == pytest.approx(expected[quantity], abs=tolerance * scales.get(quantity, abs(v[i]))), quantity
    assert 1 <= turned <= 15


def test_the_prototypes_numbers() -> None:
    """0.3 m/s, the letter's curve, rho = 0.15: an integration at 1e-11 by another hand gave these."""
    total = 3.32**2 * (1 / 0.0419 - 1 / 0.0841)
    phi = np.log(1 / 0.15) / total
    obstacle = Obstacle(position=0.0422, velocity=-0.3, acceleration=np.array([0.0, -0.5, -2.0]))
    scenario = Scenario(admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=obstacle)
    contact = solve_drag(scenario, POWER, phi).contact
    np.testing.assert_allclose(contact.relative_velocity, [-0.045, -0.097251145, -0.1782025], atol=5e-8)
    np.testing.assert_allclose(contact.displacement, [-0.0596185854, -0.044896, -0.036583], atol=6e-7)
    assert contact.largest_acceleration[0] == pytest.approx(2.0158, abs=5e-5)


@pytest.mark.parametrize("ratio", [0.9, 0.5, 0.15, 0.02, 1e-4])
@pytest.mark.parametrize("distance", [0.005, 0.0422, 0.4, 5.0])
def test_closed_forms_by_the_exponential_integral(ratio: float, distance: float) -> None:
    """Contact, excursion, peak acceleration and the integral of the bound, L(3) and L(5) (docs/explanation/drag.md).

    The exponential integral is good to 1e-15 of itself; the excursion is a difference of such, l_d beside it.
    """
    n, l_0 = POWER.exponent, POWER.distance_offset
    strength = np.log(1 / ratio) * l_0 * (l_0 + distance) / distance
    u_0, u_d = strength / l_0, strength / (l_0 + distance)
    grows = expi(u_0) - expi(u_d)
    excursion = strength * np.exp(-u_d) * grows - l_0 * (1 / ratio - 1)
    u = np.clip(1.0, u_d, u_0)
    peak = u**2 / strength * np.exp(-2 * (u - u_d))
    doubled = 2 * (expi(2 * u_0) - expi(2 * u_d)) - np.exp(2 * u_0) / u_0 + np.exp(2 * u_d) / u_d
    bound = strength * np.exp(-2 * u_0) * doubled
    _check(POWER, strength / n**2, ratio, distance, (excursion, peak, bound), cancels=l_0 / ratio + strength * grows)


@pytest.mark.parametrize("ratio", [0.9, 0.5, 0.15, 0.02, 1e-4])
def test_closed_forms_of_the_exponential_curve(ratio: float) -> None:
    distance, rate = 0.0422, -61.0
    growth = np.log(1 / ratio)
    excursion = distance * ((1 / ratio - 1) / growth - 1)
    expected = (excursion, growth / distance, (1 - ratio**2) * distance / (2 * growth))
    sensor = ExponentialFirstOrder(scale=0.458, rate=rate)
    _check(sensor, growth / (rate**2 * distance), ratio, distance, expected, cancels=distance)


def _check(
    sensor: SensorModel,
    strength: float,
    ratio: float,
    distance: float,
    expected: tuple[float, float, float],
    cancels: float,
) -> None:
    excursion, peak, bound = expected
    velocity, push = (
        np.array([-1.0, 0.0]),
        np.array([0.0, -0.5]),
    )  # from rest at 1/2 m/s^2, l'^2 is the bound's integral
    scenario = Scenario(
        admittance=ADMITTANCE, obstacle=Obstacle(position=distance, velocity=velocity, acceleration=push)
    )
    found = solve_drag(scenario, sensor, strength * MASS, horizon=1e9)
    assert found.reached.all()
    assert found.end.relative_velocity[0] == pytest.approx(-ratio, rel=1e-12 * (1 + np.log(1 / ratio)))
    assert -found.end.displacement[0] == pytest.approx(excursion, rel=1e-11, abs=1e-13 * cancels)
    assert found.end.largest_acceleration[0] == pytest.approx(peak, rel=1e-11)
    assert found.end.largest_virtual_force[0] == pytest.approx(MASS * peak, rel=1e-11)
    assert found.end.relative_velocity[1] ** 2 == pytest.approx(bound, rel=1e-9)


def test_an_obstacle_that_waits_or_recedes_and_then_comes() -> None:
    """From the farthest distance on it is an obstacle that starts at rest there; until then the robot rests."""
    v, a, l_0 = np.array([0.0, 0.05, 0.2]), -0.8, 0.03
    obstacle = Obstacle(position=l_0, velocity=v, acceleration=a)
    found = solve_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), POWER, 0.02)
    farthest = l_0 + v**2 / (2 * -a)
    rested = solve_drag(
        Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=farthest, velocity=0.0, acceleration=a)), POWER, 0.02
    )
    np.testing.assert_allclose(found.contact.time, rested.contact.time + v / -a, rtol=1e-12)
    np.testing.assert_allclose(found.contact.relative_velocity, rested.contact.relative_velocity, rtol=1e-12)
    assert (found.impulse_residual < 1e-12).all()
    motion = sample_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), POWER, 0.02, samples=400)
    waits = motion.time < (v / -a)[:, None]
    assert (np.abs(motion.displacement[waits]) < 1e-15).all()


@pytest.mark.parametrize("a", [-1.0, 0.0, 1.0])
def test_samples_follow_the_equation_of_motion(a: float) -> None:
    """Central differences of l' and l over 4,000 samples: their error is (t / 4000)^2 l''' / 6, some 1e-5 of l''."""
    obstacle = Obstacle(position=0.0422, velocity=-0.3, acceleration=a)
    reference = Reference(position=0.1, velocity=0.2, acceleration=0.3)
    scenario = Scenario(
        admittance=ADMITTANCE,
        obstacle=Obstacle(position=0.1422, velocity=-0.1, acceleration=a + 0.3),
        plant=Plant(position=0.1, velocity=0.2),
        reference=reference,
    )
    motion = sample_drag(scenario, POWER, 0.015, samples=4001)
    still = sample_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), POWER, 0.015, samples=4001)
    np.testing.assert_allclose(motion.relative_velocity, still.relative_velocity, atol=1e-12)
    np.testing.assert_allclose(motion.displacement, still.displacement, atol=1e-13)
    for position, velocity in (
        ("distance", "relative_velocity"),
        ("position", "velocity"),
        ("velocity", "acceleration"),
    ):
        slope = np.gradient(getattr(motion, position), motion.time, edge_order=2)
        values = getattr(motion, velocity)
        np.testing.assert_allclose(slope, values, atol=3e-5 * np.abs(values).max())
    own = motion.virtual_force / MASS
    np.testing.assert_allclose(motion.acceleration, own + 0.3, atol=1e-13)
    end = motion.result.end
    for largest, of in (("acceleration", "acceleration"), ("speed", "velocity"), ("virtual_force", "virtual_force")):
        sampled = np.abs(getattr(motion, of)).max()
        assert getattr(end, f"largest_{largest}") == pytest.approx(sampled, rel=1e-5)
        assert getattr(end, f"largest_{largest}") >= sampled * (1 - 1e-13)
    assert end.largest_travel == pytest.approx(np.abs(motion.position - 0.1).max(), rel=1e-6)
    assert end.largest_excursion == pytest.approx(np.abs(motion.displacement).max(), rel=1e-12)


def test_a_touch_is_a_contact_and_what_turns_before_is_none() -> None:
    """a_o such that l' comes to zero just at l = 0: found by bisection between a contact and a turn."""
    low, high = 0.0, 5.0

    def ended(a: float) -> ContactStatus:
        scenario = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.04, velocity=-0.3, acceleration=a))
        result = solve_drag(scenario, POWER, 0.01)
        return ContactStatus(result.status)

    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if ended(middle) == ContactStatus.CONTACT else (low, middle)
    scenario = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.04, velocity=-0.3, acceleration=low))
    touch = solve_drag(scenario, POWER, 0.01)
    assert touch.contact.distance == 0.0
    assert touch.contact.relative_velocity == 0.0
    assert touch.impulse_residual < 1e-11
    above = solve_drag(
        Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.04, velocity=-0.3, acceleration=low * 1.001)),
        POWER,
        0.01,
    )
    assert above.status == ContactStatus.NEVER
    assert 0 < above.closest_distance < 1e-4
    assert above.closest_distance == above.end.distance
    assert above.settling_distance == np.inf


def test_a_run_ends_at_the_horizon_where_the_samples_say() -> None:
    scenario = Scenario(
        admittance=ADMITTANCE,
        obstacle=Obstacle(position=0.0422, velocity=-0.3, acceleration=np.array([0.0, -1.0, 0.9])),
    )
    whole = sample_drag(scenario, POWER, 0.02, samples=5)
    for index in range(3):
        one = Scenario(
            admittance=ADMITTANCE,
            obstacle=Obstacle(position=0.0422, velocity=-0.3, acceleration=scenario.obstacle.acceleration[index]),
        )
        horizon = float(whole.time[index, 3])
        part = solve_drag(one, POWER, 0.02, horizon=horizon)
        assert part.status == ContactStatus.HORIZON
        assert part.end.time == horizon
        assert part.end.distance == pytest.approx(whole.distance[index, 3], rel=1e-11)
        assert part.end.relative_velocity == pytest.approx(whole.relative_velocity[index, 3], rel=1e-11)
        assert part.impulse_residual < 1e-12


def test_a_law_too_strong_for_its_horizon_and_a_very_strong_one() -> None:
    """At lambda = 400 a uniform obstacle all but stops; an accelerated one comes at sqrt(|a_o| M / phi) / |g|."""
    phi = 400 * MASS / (POWER.exponent**2 * (1 / 0.0419 - 1 / 0.0841))
    obstacle = Obstacle(position=0.0422, velocity=-0.3, acceleration=np.array([0.0, -1.0]))
    found = solve_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), POWER, phi, horizon=10.0)
    assert list(found.status) == [ContactStatus.HORIZON, ContactStatus.CONTACT]
    terminal = np.sqrt(MASS / (phi * POWER.log_slope(0.0) ** 2))
    # w lags its terminal value by the relative change of that over one length of decay: some M / (phi g^2 l_0)
    assert -found.end.relative_velocity[1] == pytest.approx(terminal, rel=2 / 400)
    assert (found.impulse_residual < 1e-11).all()


def test_what_is_not_known_is_refused() -> None:
    approach = Obstacle(position=0.04, velocity=-0.3)

    def solve(sensor: SensorModel = POWER, **bodies: object) -> None:
        solve_drag(Scenario(**{"admittance": ADMITTANCE, "obstacle": approach, **bodies}), sensor, 0.01)  # type: ignore[arg-type]

    with refused("plant position"):
        solve(plant=Plant(position=0.01))
    with refused("plant velocity"):
        solve(plant=Plant(velocity=0.01))
    with refused("obstacle velocity"):
        solve(plant=Plant(position=-0.01), obstacle=Obstacle(position=0.04, velocity=0.1, acceleration=-1.0))
    with refused("drag", value=-0.01):
        solve_drag(Scenario(admittance=ADMITTANCE, obstacle=approach), POWER, -0.01)
    turning = ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)
    with refused("obstacle position", error=OutOfRangeError, value=0.08, limit=(0.0, 0.0780591)):
        solve(turning, obstacle=Obstacle(position=0.08, velocity=-0.3))
    rising = CustomSensor(
        log_output_function=lambda d: -((d - 0.02) ** 2) * 100, log_slope_function=lambda d: -200 * (d - 0.02)
    )
    with refused("sensor"):
        solve(rising)
    solve(plant=Plant(position=-0.01, velocity=-0.02))  # behind it, and giving way: the pull is held off


def test_the_encounters_that_never_touch() -> None:
    obstacle = Obstacle(
        position=0.04, velocity=np.array([0.0, 0.2, 0.1, 3.0]), acceleration=np.array([0.0, 0.0, 1.0, -1.0])
    )
    near = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32, maximum_distance=0.5)
    found = solve_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), near, 0.01)
    assert list(found.status) == [*[ContactStatus.NEVER] * 3, ContactStatus.LEFT_RANGE]
    np.testing.assert_array_equal(found.settling_distance, [0.04, np.inf, np.inf, np.inf])
    np.testing.assert_array_equal(found.closest_distance, 0.04)
    assert found.end.distance[3] == pytest.approx(0.5, rel=1e-14)
    assert np.isnan(found.gradients.of("time", "gain")).all()


@pytest.mark.parametrize("name", ["inverse-power", "exponential-2", "custom", "recessed"])
@pytest.mark.parametrize("a", [0.0, -1.5, 0.3])
def test_derivatives_are_those_of_differences(name: str, a: float) -> None:
    """Central differences of step 1e-4 of each input: their own error is 1e-8 of the third derivative, some 1e-7."""
    x, weights = np.polynomial.legendre.leggauss(40)
    total = float((CURVES[name].log_slope(0.02 * (x + 1)) ** 2 @ weights) * 0.02)
    coefficient = 1.7 * np.log(2.5) / total
    inputs = {"gain": coefficient, "admittance.mass": 1.7, "obstacle.position": 0.04}
    inputs |= {"obstacle.velocity": -0.6, "obstacle.acceleration": a}

    def solve(values: dict[str, float]) -> object:
        scenario = Scenario(
            admittance=Admittance(mass=values["admittance.mass"], damping=1.0, stiffness=2.0),
            obstacle=Obstacle(**{n.split(".")[1]: v for n, v in values.items() if n.startswith("obstacle")}),
        )
        return solve_drag(scenario, CURVES[name], values["gain"])

    result = solve(inputs)
    assert result.reached  # type: ignore[attr-defined]
    for by, value in inputs.items():
        step = 1e-4 * (abs(value) or 1.0)
        up, down = (solve({**inputs, by: value + s}).end for s in (step, -step))  # type: ignore[attr-defined]
        for quantity in ("time", "relative_velocity", "displacement"):
            difference = (getattr(up, quantity) - getattr(down, quantity)) / (2 * step)
            found = result.gradients.of(quantity, by)  # type: ignore[attr-defined]
            assert found == pytest.approx(difference, rel=1e-6, abs=1e-9), (quantity, by)


@pytest.mark.parametrize("name", CURVES)
def test_every_encounter_is_followed_to_its_end_and_certified(name: str) -> None:
    """Speeds, accelerations and strengths over seven decades each, some of them zero, most of them absurd.

    The balance is met to 1e-12, but for what ln xi rounds where an object goes far away: 1e-16 of its magnitude there.
    """
    rng, count, sensor = np.random.default_rng(3), 400, CURVES[name]
    low, high = max(sensor.valid_range[0], 0.0), min(sensor.valid_range[1], 0.3)
    distance = low + (high - low) * rng.uniform(0.001, 1, count)
    velocity = rng.choice([-1, 1], count, p=[0.8, 0.2]) * 10 ** rng.uniform(-6, 1, count)
    acceleration = rng.choice([-1, 1], count) * 10 ** rng.uniform(-6, 2, count)
    coefficient = 10 ** rng.uniform(-7, -1, count)
    for values, share in ((velocity, 0.05), (acceleration, 0.2), (coefficient, 0.05)):
        values[rng.random(count) < share] = 0.0
    obstacle = Obstacle(position=distance, velocity=velocity, acceleration=acceleration)
    found = solve_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), sensor, coefficient)
    assert (found.status != ContactStatus.UNRESOLVED).mean() > 0.995  # lambda of ten thousand is possible here
    for quantity, values in found.end.as_dict().items():
        assert np.isfinite(values).all(), quantity
    assert found.impulse_residual[found.status != ContactStatus.UNRESOLVED].max() < 1e-9
    assert found.columns.column("quadrature_error").max() < 1e-11
    assert (found.closest_distance >= 0).all()
