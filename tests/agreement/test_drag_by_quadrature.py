"""The compiled virtual drag compared with quadratures and integrations that share no code with it.

For g = c_1 and g = -n / (l + l_0), q = 2 k int g^2 dl is elementary, and mpmath integrates e^q and 1 / sqrt(w) with 20
digits. NumPy's path in tests/drag_in_numpy.py evaluates every curve itself. Derivatives are compared with central
differences of the compiled solution: their error is of fourth order in the step h, and rounding is divided by h.
"""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

import drag_in_numpy
from encounters import CURVES
from pretouch.motion import DRAG, Admittance, ContactStatus, Obstacle, Plant, Reference, Scenario
from pretouch.motion.drag import DragColumns, slope_integral, solve_drag
from pretouch.motion.scenario import scenario_with, sensor_with
from pretouch.sensors import ExponentialFirstOrder, InversePower, MittagLeffler, SensorModel, Table
from pretouch.uncertainty import make_ensemble

MASS = 1.3
ADMITTANCE = Admittance(mass=MASS, damping=10.0, stiffness=25.0)
POWER = InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32)
FLAT = ExponentialFirstOrder(scale=0.458, rate=-61.0)
CURVED = MittagLeffler(scale=1.0, rate=-40.0, order=0.8)


def _growth(sensor: SensorModel, k: float, low: object, high: object) -> object:
    """Twice k times the integral of g^2 between two distances."""
    if isinstance(sensor, ExponentialFirstOrder):
        return 2 * k * mp.mpf(sensor.rate) ** 2 * (high - low)  # type: ignore[operator]
    assert isinstance(sensor, InversePower)
    offset = mp.mpf(sensor.distance_offset)
    return 2 * k * mp.mpf(sensor.exponent) ** 2 * (1 / (low + offset) - 1 / (high + offset))  # type: ignore[operator]


def _square(sensor: SensorModel, k: float, start: tuple[float, float, float], distance: object) -> object:
    """l'^2 at a distance, for a start at l, l'^2 and with a_o."""
    l_0, w_0, a = map(mp.mpf, start)
    pushed = mp.quad(lambda l: mp.exp(_growth(sensor, k, l, l_0)), [distance, l_0]) if a else mp.mpf(0)  # noqa: E741
    return mp.exp(-_growth(sensor, k, distance, l_0)) * (w_0 - 2 * a * pushed)


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize("sensor", [POWER, FLAT], ids=["power", "exponential"])
@pytest.mark.parametrize("kind", ["uniform", "pushed", "braking", "from rest", "receding"])
def test_contact_speed_and_time_are_those_of_20_digits(sensor: SensorModel, kind: str) -> None:
    """w to 1e-12 of its start; t to 1e-11, the documented accuracy, by an integral whose variable removes w = 0."""
    rng = np.random.default_rng(5)
    for _ in range(2):
        distance, speed, k = rng.uniform(0.01, 0.08), 10 ** rng.uniform(-1.5, 0.3), 10 ** rng.uniform(-3.5, -1.7)
        scale = speed**2 / distance
        acceleration = {"uniform": 0.0, "pushed": -scale, "braking": 0.02 * scale}.get(kind, -scale)
        velocity = {"from rest": 0.0, "receding": speed}.get(kind, -speed)
        farthest = distance + (speed**2 / (2 * scale) if kind == "receding" else 0.0)
        waits = speed / scale if kind == "receding" else 0.0
        obstacle = Obstacle(position=distance, velocity=velocity, acceleration=acceleration)
        found = solve_drag(Scenario(admittance=ADMITTANCE, obstacle=obstacle), sensor, k * MASS, horizon=1e9)
        k = float(k * MASS) / MASS
        with mp.workdps(20):
            start = (farthest, 0.0 if velocity >= 0 else speed**2, acceleration)
            at_contact = _square(sensor, k, start, mp.mpf(0))
            assert at_contact > 0, "the example would end before contact"

            def pace(r: object, start: tuple[float, float, float] = start, k: float = k) -> object:
                l_0 = mp.mpf(start[0])
                return 2 * l_0 * r / mp.sqrt(_square(sensor, k, start, l_0 * (1 - r * r)))  # type: ignore[operator]

            duration = mp.quad(pace, [mp.mpf("1e-12"), 0.5, 1], maxdegree=4) if kind != "uniform" else None
        assert found.status == ContactStatus.CONTACT
        rounding = 1e-12 * max(speed**2, float(at_contact)) / float(at_contact)
        assert found.end.relative_velocity**2 == pytest.approx(float(at_contact), rel=rounding)
        if duration is not None:
            # the part of r below 1e-12 and the moderate degree of the reference's quadrature cost less than 1e-8
            assert found.end.time - waits == pytest.approx(float(duration), rel=1e-8)
        assert found.impulse_residual < 1e-11


def _encounters(count: int, low: float, high: float) -> tuple[Scenario, np.ndarray]:
    rng = np.random.default_rng(11)
    distance = low + (high - low) * rng.uniform(0.05, 1, count)
    velocity = rng.choice([-1, 1, 0], count, p=[0.8, 0.15, 0.05]) * 10 ** rng.uniform(-2, 0.5, count)
    acceleration = rng.choice([-1, 1, 0], count, p=[0.4, 0.4, 0.2]) * 10 ** rng.uniform(-3, 1.5, count)
    obstacle = Obstacle(position=distance, velocity=velocity, acceleration=acceleration)
    return Scenario(admittance=ADMITTANCE, obstacle=obstacle), 10 ** rng.uniform(-5, -1.5, count)


@pytest.mark.parametrize("name", CURVES)
def test_the_kernel_agrees_with_the_same_method_on_the_curve_itself(name: str) -> None:
    """Ends and peaks of random encounters, receding and braking ones included.

    The polynomials of the kernel have g within 1e-13 of its largest value, over q up to some hundred; a distance at
    rest is as uncertain as w over w'.
    """
    sensor = CURVES[name]
    scenario, drag = _encounters(300, max(sensor.valid_range[0], 0.0), min(sensor.valid_range[1], 0.2))
    found = columns_of(scenario, sensor, drag)
    known = drag_in_numpy.solved(found)
    assert (found.path.status == known.status).all()
    assert len(set(found.path.status)) >= 2
    for quantity in ("time", "distance", "square"):
        value = getattr(known, quantity)
        scale = np.maximum(np.abs(value), 1e-3 * np.abs(value).max())
        np.testing.assert_allclose(found.path.rows[quantity] / scale, value / scale, atol=1e-10)
    rates = drag_in_numpy.largest_rates(known)
    np.testing.assert_allclose(found.path.peaks["largest_rate"], rates, rtol=1e-10, atol=1e-13 * rates.max())


def columns_of(scenario: Scenario, sensor: SensorModel, drag: np.ndarray) -> DragColumns:
    """The columns of a solution, with its path."""
    columns = solve_drag(scenario, sensor, drag).columns
    assert isinstance(columns, DragColumns)
    return columns


STARTED = Scenario(
    admittance=ADMITTANCE,
    obstacle=Obstacle(position=0.05, velocity=-0.2, acceleration=0.1),
    plant=Plant(position=0.009, velocity=0.03),
    reference=Reference(position=0.01, velocity=0.04, acceleration=-0.1),
)
TABLE = Table(distances=tuple(np.linspace(0.0, 0.08, 9)), outputs=tuple(POWER.output(np.linspace(0.0, 0.08, 9))))


@pytest.mark.parametrize("sensor", [POWER, FLAT, CURVED, CURVES["recessed"], CURVES["exponential-2"]], ids=repr)
def test_gradients_are_those_of_central_differences(sensor: SensorModel) -> None:
    """Of every quantity by every input and every parameter, by a formula of fourth order with h = 1e-3 of the input."""
    gain = MASS * math.log(1 / 0.7) / slope_integral(sensor, 0.041)  # without the acceleration, a ratio of 0.7

    def solved(by: str, change: float) -> dict[str, float]:
        scenario, curve, drag = STARTED, sensor, gain
        if by == "gain":
            drag += change
        elif by.startswith("sensor."):
            name = by.removeprefix("sensor.")
            curve = sensor_with(sensor, {name: sensor.parameters[name] + change})
        else:
            part, _, name = by.partition(".")
            scenario = scenario_with(scenario, {by: getattr(getattr(scenario, part), name) + change})
        end = solve_drag(scenario, curve, drag).contact
        return {q: float(getattr(end, q)) for q in gradients.quantities}

    result = solve_drag(STARTED, sensor, gain)
    gradients = result.gradients
    for by in gradients.inputs:
        part, _, name = by.partition(".")
        if part == "sensor":
            value = sensor.parameters[name]
        else:
            value = gain if by == "gain" else getattr(getattr(STARTED, part), name)
        step = 1e-3 * abs(value) or 1e-3
        samples = {i: solved(by, i * step) for i in (-2, -1, 1, 2)}
        for quantity in gradients.quantities:
            f = {i: sample[quantity] for i, sample in samples.items()}
            expected = (f[-2] - 8 * f[-1] + 8 * f[1] - f[2]) / (12 * step)
            size = abs(float(getattr(result.end, quantity))) / step
            assert gradients.of(quantity, by) == pytest.approx(expected, rel=1e-6, abs=1e-10 * size), (quantity, by)


def test_encounters_with_a_curve_each_are_solved_together_as_each_alone() -> None:
    """Curves that are not alike, in one call: contacts, gradients and residuals are those of single solutions."""
    orders = np.linspace(0.6, 0.95, 5)
    several = make_ensemble(
        replace(STARTED, plant=Plant(), reference=Reference()), CURVED, {"sensor.order": orders}, law=DRAG
    )
    assert several.many is not None
    together = several.contacts(np.array([[0.002], [0.004]]))
    assert together.end.time.shape == (2, 5)
    assert (together.impulse_residual < 1e-10).all()
    slope = together.gradients.of("relative_velocity", "sensor.order")
    for i in range(5):
        scenario, sensor = several.at(i)
        for row, drag in enumerate((0.002, 0.004)):
            alone = solve_drag(scenario, sensor, drag)
            for quantity, value in alone.end.as_dict().items():
                assert getattr(together.end, quantity)[row, i] == pytest.approx(value, rel=1e-10, abs=1e-13), quantity
            expected = alone.gradients.of("relative_velocity", "sensor.order")
            assert slope[row, i] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("mass", "position", "velocity", "acceleration", "drag"),
    [
        (1e-200, 0.05, -0.3, 0.0, 0.01),
        (1e-200, 0.05, -0.3, -1.0, 0.01),
        (1e200, 0.05, -0.3, 1e-200, 0.01),
        (1.0, 1e50, -0.3, 0.0, 0.01),
        (1.0, 0.05, -1e50, -1e50, 0.01),
        (1.0, 0.05, 1e50, -1e-50, 0.01),
        (1.0, 0.05, -1e-90, 1e50, 0.01),
        (1.0, 0.05, -0.3, -1.0, 1e3),
        (1.0, 0.05, -0.3, 0.0, 1e3),
        (1.0, 0.05, -0.3, -1.0, 1e60),
    ],
)
def test_extreme_numbers_end_with_a_status(
    mass: float, position: float, velocity: float, acceleration: float, drag: float
) -> None:
    """A thousand of each: a solver that followed them all would need hours, which no test would survive."""
    scenario = Scenario(
        admittance=Admittance(mass=mass, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=np.full(1000, position), velocity=velocity, acceleration=acceleration),
    )
    for sensor in (POWER, TABLE if position < 0.08 else FLAT):
        found = solve_drag(scenario, sensor, drag)
        assert set(np.unique(found.status)) <= {int(status) for status in ContactStatus}
        assert np.isfinite(found.end.time).all()
        assert np.isfinite(found.end.distance).all()
