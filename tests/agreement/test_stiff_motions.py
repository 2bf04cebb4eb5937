"""Stiff motions, solved by long implicit steps, compared with the closed form and SciPy's Radau IIA of order 5."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pretouch as pt
from pretouch.config import load_scenario
from pretouch.motion import Admittance, ContactStatus, Obstacle, Plant, Scenario, find_contact, solve_motion
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel, Table

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
LETTER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
NEAR = InversePower(scale=1.30e-5, distance_offset=5e-6, exponent=3.32)
BENT = ExponentialSecondOrder(scale=0.48, rate=-74.0, curvature=474.0)
LINE = ExponentialFirstOrder(scale=0.458, rate=-61.0)


def encounter(mass: float = 1.0, damping: float = 10.0, stiffness: float = 25.0, velocity: float = -0.3) -> Scenario:
    return Scenario(
        admittance=Admittance(mass=mass, damping=damping, stiffness=stiffness),
        obstacle=Obstacle(position=0.0422, velocity=velocity),
    )


@pytest.mark.parametrize(
    ("scenario", "gain"),
    [
        *((encounter(), gain) for gain in (-30.0, -1e3, -1e4)),
        *((encounter(mass=mass), -1.0) for mass in (1e-3, 1e-6, 1e-9, 1e-12)),
        *((encounter(damping=damping), -1.0) for damping in (1e3, 1e6, 1e9)),
        *((encounter(damping=2 * stiffness**0.5, stiffness=stiffness), -1.0) for stiffness in (1e4, 1e8, 1e12)),
        *((encounter(velocity=velocity), -10.0) for velocity in (-1e-2, -1e-3)),
    ],
)
def test_stiff_motions_meet_the_closed_form(scenario: Scenario, gain: float) -> None:
    """Both are good to 1e-10, the closed form by its own proof, so they differ by no more than two of these."""
    exact = find_contact(scenario, LINE, gain, method="closed-form").contact
    found = find_contact(scenario, LINE, gain, method="integration")
    assert found.contact.time == pytest.approx(exact.time, rel=2e-10)
    assert found.contact.relative_velocity == pytest.approx(exact.relative_velocity, rel=2e-10)
    assert found.contact.displacement == pytest.approx(exact.displacement, rel=2e-10)
    # x~ is the path less l, which is rounded to half an eps of it; K int x~ dt is off by no more than K times that
    rounding = 1.1e-16 * scenario.distance * scenario.admittance.stiffness * exact.time
    impulse = abs(gain * (LINE.log_output(0.0) - LINE.log_output(scenario.distance)))
    assert found.impulse_residual < 1e-12 + rounding / impulse


def test_a_course_is_sampled_inside_long_steps() -> None:
    """l' of a polynomial of degree 10 is as good between its points as at them, here to rounding beside l'(0)."""
    scenario = encounter(mass=1e-3)
    exact = solve_motion(scenario, LINE, -5.0, method="closed-form")
    found = solve_motion(scenario, LINE, -5.0, method="integration")
    assert np.abs(found.distance - exact.distance).max() < 1e-12 * exact.distance[0]
    assert np.abs(found.relative_velocity - exact.relative_velocity).max() < 1e-10 * 0.3


def radau(scenario: Scenario, sensor: SensorModel, gain: float, tolerance: float) -> tuple[float, float]:
    """Time and l' at contact by an implicit method that shares nothing with ours but its family, and no polynomial."""
    m, d, k, _, _, p, v, _, _, _ = scenario.relative()

    def held(distance: float) -> float:
        return float(d + gain * sensor.log_slope(max(distance, 0.0)))

    def slope(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (d * v + k * (p + v * t - y[0]) - held(y[0]) * y[1]) / m]

    def jacobian(t: float, y: np.ndarray) -> list[list[float]]:
        step = 1e-6 * max(y[0], 1e-7)
        bend = (held(y[0] + step) - held(y[0])) / step
        return [[0.0, 1.0], [-(k + bend * y[1]) / m, -held(y[0]) / m]]

    def touch(_: float, y: np.ndarray) -> float:
        return float(y[0])

    touch.terminal = True  # type: ignore[attr-defined]
    done = solve_ivp(
        slope, (0, 600), [p, v], method="Radau", jac=jacobian, events=touch, rtol=tolerance, atol=1e-3 * tolerance * p
    )
    return float(done.t_events[0][0]), float(done.y_events[0][0][1])


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("sensor", "scenario", "gain"),
    [
        (LETTER, encounter(), -100.0),
        (LETTER, encounter(), -1e4),
        (LETTER, encounter(mass=3.9e-8), -1.0),
        (NEAR, encounter(), -1.0),
        (NEAR, encounter(), -1e3),
    ],
)
def test_stiff_motions_along_any_curve_meet_another_method(
    sensor: SensorModel, scenario: Scenario, gain: float
) -> None:
    """At a tolerance of 1e-11 per step its l' beside a very near offset still moves by 1e-6 for ten times less."""
    found = find_contact(scenario, sensor, gain)
    time, speed = radau(scenario, sensor, gain, 1e-11)
    assert found.contact.time == pytest.approx(time, rel=1e-8)
    assert found.contact.relative_velocity == pytest.approx(speed, rel=1e-5)
    assert found.impulse_residual < 1e-12


@pytest.mark.parametrize("sensor", [LETTER, LINE, BENT])
@pytest.mark.parametrize("mass", [1.0, 2.4e-8])
def test_many_at_once_are_those_of_each_alone(sensor: SensorModel, mass: float) -> None:
    """Lanes give stiff motions up, however slowly these turn; both ways are good to 1e-9."""
    gain = -np.geomspace(0.01, 10.0, 65)
    several = find_contact(encounter(mass=mass), sensor, gain, method="integration")
    alone = [find_contact(encounter(mass=mass), sensor, float(g), method="integration").contact.time for g in gain]
    assert several.contact.time == pytest.approx(np.array(alone), rel=2e-9)


@pytest.mark.parametrize("gain", [-1e6, -1e8, -1e12])
def test_what_comes_too_late_is_said_so(gain: float) -> None:
    assert find_contact(encounter(), LETTER, gain).status is ContactStatus.HORIZON


def test_a_lasting_fast_swing_is_given_up() -> None:
    """A swing at 1e6 rad/s for 0.14 s: 4,000 steps of about two radians end long before."""
    swing = replace(encounter(stiffness=1e12, damping=0.0), plant=Plant(velocity=0.1))
    assert find_contact(swing, LETTER, -1e-3).status is ContactStatus.UNRESOLVED


@pytest.mark.parametrize(
    ("damping", "stiffness", "velocity", "gain"), [(100.0, 685.0, -0.0124, -5900.0), (3.06, 0.517, -0.288, -1190.0)]
)
def test_a_slope_that_rounds_holds_no_long_step_up(
    damping: float, stiffness: float, velocity: float, gain: float
) -> None:
    """Where a table falls steeply within 1 mm, a rounding of l turns g by 1e-12 of itself, and l' with it.

    No step can be resolved to less, which must not be taken for a fast part of the motion.
    """
    edge = Table(
        distances=(0.005, 0.0151, 0.03075, 0.03181, 0.0505, 0.05476, 0.0638),
        outputs=(1.0, 0.9985, 0.9724, 0.9213, 0.9133, 0.4749, 0.4716),
    )
    scenario = Scenario(
        admittance=Admittance(mass=0.758, damping=damping, stiffness=stiffness),
        obstacle=Obstacle(position=0.03706, velocity=velocity),
    )
    found = find_contact(scenario, edge, gain, horizon=30.0)
    assert found.status is not ContactStatus.UNRESOLVED
    assert found.impulse_residual < 1e-12


@pytest.mark.parametrize(
    ("old", "new"),
    [('"-10 N*s"', '"-10e3 N*s"'), ('[constraints]\nexcursion = "0.2 m"\n', ""), ('"-0.3 m/s"', '"-1e-50 m/s"')],
)
def test_designs_with_stiff_motions_resolve_every_gain(tmp_path, old: str, new: str) -> None:
    """The optimum of the letter is the same whatever stronger gains are asked about, and all of them are answered."""
    text = (EXAMPLES / "approach.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "approach.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    design = pt.design(load_scenario(path))
    assert "unresolved" not in str(design)
    if "1e-50" in new:
        assert design.status.value == "no-contact"
    else:
        assert design.gain == pytest.approx(-0.746345196323, rel=1e-9)
