"""What data do not support of an encounter: shares of the impulse, and contact where the sensor tells nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.sensors.recessed import recess_in_words
from pretouch.uncertainty import reservations_of

pytestmark = pytest.mark.usefixtures("short_rest")

TRUTH = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)


@dataclass(frozen=True)
class Answer:
    scenario: pt.Scenario
    sensor: pt.sensors.SensorModel
    gain: Any = None


@cache
def report(first: float, last: float) -> pt.calibration.CalibrationReport:
    distances = np.linspace(first, last, 21)
    return pt.fit(
        pt.Calibration(distances=distances, outputs=TRUTH.output(distances), unit="V"),
        models=("inverse-power",),
        offset="zero",
    )


def encounter(start: float = 0.04, **given: Any) -> pt.Scenario:
    bodies = {"obstacle": pt.Obstacle(position=start, velocity=-0.3), **given}
    return pt.Scenario(admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0), **bodies)


def answer(first: float, last: float, *, recess: float = 0.0, gain: Any = -0.75, **given: Any) -> Any:
    fitted = replace(report(first, last).best.sensor, minimum_distance=0.0, maximum_distance=0.2)
    sensor = pt.Recessed(sensor=fitted, recess=recess) if recess else fitted
    return reservations_of(report(first, last), Answer(encounter(**given), sensor, gain))


def silent_nearer(sensor: pt.sensors.SensorModel, near: float) -> pt.CustomSensor:
    """The curve with an output that stays the same nearer than a distance."""
    return pt.CustomSensor(
        log_output_function=lambda distance: np.asarray(sensor.log_output(np.maximum(distance, near))),
        log_slope_function=lambda distance: np.where(
            distance > near, sensor.log_slope(np.maximum(distance, near)), 0.0
        ),
        corners=(near,),
        maximum_distance=sensor.valid_range[1],
    )


def test_data_from_contact_to_the_start_leave_nothing_to_say() -> None:
    found = answer(0.0, 0.05)
    assert (found.headline, found.share_nearer, found.share_beyond, found.leaves_range) == (None, 0.0, 0.0, False)
    assert found.supported == (0.0, 0.05)


def test_a_recess_as_deep_as_the_window_starts_makes_contact_supported() -> None:
    """l_min - recess rounds to within 1e-18 m of zero; whatever the numbers are, that is no distance."""
    for near in np.random.default_rng(5).uniform(0.001, 0.02, 50):
        found = reservations_of(
            replace(report(0.0, 0.06), window=replace(report(0.0, 0.06).window, distances=(near, 0.06))),
            Answer(encounter(), pt.Recessed(sensor=report(0.0, 0.06).best.sensor, recess=float(near))),
        )
        assert found.is_contact_supported
        assert found.headline is None


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("first", "last"), [(0.006, 0.05), (0.0, 0.02), (0.01, 0.03)])
@pytest.mark.parametrize("recess", [0.0, 0.004])
def test_shares_are_those_of_the_impulse_along_the_motion(first: float, last: float, recess: float) -> None:
    found = answer(first, last, recess=recess)
    sensor = Answer(encounter(), report(first, last).best.sensor).sensor
    sensor = replace(sensor, minimum_distance=0.0, maximum_distance=0.2)
    sensor = pt.Recessed(sensor=sensor, recess=recess) if recess else sensor
    motion = pt.solve_motion(encounter(), sensor, -0.75, samples=4001)
    near, far = found.supported
    # the trapezoidal rule over 4000 steps, a step astride either limit: 1/4000 of the whole each
    force, time, distance = motion.virtual_force, motion.time, motion.distance
    pushes = np.diff(time) * (force[1:] + force[:-1]) / 2
    middle = (distance[1:] + distance[:-1]) / 2
    whole = pushes.sum()
    assert found.share_nearer == pytest.approx(pushes[middle < near].sum() / whole, abs=2e-3)
    assert found.share_beyond == pytest.approx(pushes[middle > far].sum() / whole, abs=2e-3)


@pytest.mark.parametrize("gain", [-0.2, -0.75, -3.0])
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"reference": pt.Reference(velocity=0.05, acceleration=-0.1)},
        {
            "obstacle": pt.Obstacle(position=0.05, velocity=-0.2, acceleration=-0.5),
            "plant": pt.Plant(velocity=0.1),
        },
    ],
)
def test_without_force_nearer_than_the_data_contact_is_that_of_a_silent_sensor(gain: float, given: Any) -> None:
    found = answer(0.008, 0.06, gain=gain, **given)
    sensor = replace(report(0.008, 0.06).best.sensor, minimum_distance=0.0, maximum_distance=0.2)
    silent = pt.find_contact(encounter(**given), silent_nearer(sensor, found.supported[0]), gain)
    # two motions joined at a located distance against one over a corner: both good to about 1e-10
    assert found.speed_without_force == pytest.approx(-silent.contact.relative_velocity, rel=1e-8)
    whole = pt.find_contact(encounter(**given), sensor, gain)
    assert found.speed == pytest.approx(-whole.contact.relative_velocity, rel=1e-12)
    assert found.speed_without_force > found.speed


def test_the_headline_has_both_speeds_and_what_to_measure() -> None:
    found = answer(0.008, 0.06)
    for text in (
        "from 8 mm (first measured distance) to contact",
        'recess = "8 mm"',
        "If no virtual force acted at distances below",
    ):
        assert text in found.headline
    assert answer(0.008, 0.06, gain=None).speed is None
    assert "If no virtual force" not in answer(0.008, 0.06, gain=None).headline
    assert answer(0.008, 0.06, gain=np.array([-0.5, -1.0])).speed is None


@pytest.mark.parametrize(("start", "said"), [(0.0506, False), (0.06, True)])
def test_beyond_the_data_a_twentieth_of_the_impulse_is_decisive(start: float, said: bool) -> None:
    found = answer(0.0, 0.05, start=start)
    slope = 3.32  # ln xi = -n ln(l + l_0) + const
    shares = slope * np.log((start + 0.0419) / (0.05 + 0.0419)) / (slope * np.log((start + 0.0419) / 0.0419))
    assert found.share_beyond == pytest.approx(shares, rel=1e-3)  # the fit is good to that
    assert (found.share_beyond > 0.05) is said
    assert (found.headline is not None) is said


def test_a_motion_that_leaves_the_curve_is_said_to() -> None:
    sensor = report(0.008, 0.06).best.sensor
    found = reservations_of(report(0.008, 0.06), Answer(encounter(), sensor))
    assert found.leaves_range
    assert not found.recedes
    assert found.headline.startswith(
        "PT202: Not supported by data: the motion leaves the calibrated distances before contact. "
    )
    assert "recedes" not in found.headline


@pytest.mark.slow(keep=4)
@pytest.mark.parametrize("gain", [None, -0.75, np.array([-0.5, -1.0])], ids=["none", "one", "several"])
@pytest.mark.parametrize("velocity", [0.1, np.array([0.1, 0.2])], ids=["one", "array"])
@pytest.mark.parametrize("near", [0.0, 0.008])
def test_an_object_that_recedes_is_named_before_anything_else(gain: Any, velocity: Any, near: float) -> None:
    """Whatever else is wrong with the answer, and in headlines of arrays, too: no contact comes without an approach."""
    sensor = replace(report(near, 0.03).best.sensor, minimum_distance=0.0)
    scene = encounter(obstacle=pt.Obstacle(position=0.04, velocity=velocity))
    found = reservations_of(report(near, 0.03), Answer(scene, replace(sensor, maximum_distance=0.2), gain))
    assert found.recedes
    assert found.headline.startswith("PT203: The object recedes at the start. ")
    assert "Not supported by data: " in found.headline


def test_a_receding_object_asks_for_an_approach() -> None:
    sensor = report(0.008, 0.06).best.sensor
    scene = encounter(obstacle=pt.Obstacle(position=0.04, velocity=0.1))
    headline = reservations_of(report(0.008, 0.06), Answer(scene, sensor, -0.75)).headline
    start = "PT203: The object recedes at the start. For an approach, give the obstacle a negative velocity. "
    assert headline.startswith(f"{start}PT202: Not supported by data: ")


def test_a_contact_harder_than_without_mitigation_is_compared_with_it() -> None:
    """A drawn-back admittance springs forward where the force ends: softer at first, and then harder than without."""
    found = answer(0.008, 0.06)
    assert found.speed_without_force < found.speed_without_mitigation
    assert "harder than without mitigation" not in found.headline.partition("Not supported by the readings")[0]
    harder = replace(found, speed_without_force=1.01 * found.speed_without_mitigation)
    assert f"instead of {pt_speed(found.speed)}. Contact at this speed is harder" in harder.headline
    assert "0.3 m/s." in harder.headline


def pt_speed(speed: float) -> str:
    return f"{speed:.4g} m/s"


def test_distances_count_from_the_contact_surface_and_those_in_brackets_from_the_zero_of_the_sensor() -> None:
    found = answer(0.008, 0.06, recess=0.005)
    zero = "the zero of the sensor's distance scale, which is 5 mm behind the contact surface"
    assert "from 3 mm (first measured distance) to contact at 0 mm. Distances in brackets count from" in found.headline
    assert f"Distances in brackets count from {zero}." in found.headline
    assert 'mount the sensor 8 mm (now 5 mm) behind the contact surface, and set recess = "8 mm" (' in found.headline
    assert any(zero in line and "all other distances count from the contact surface" in line for line in found.lines)
    bare = answer(0.008, 0.06)
    assert zero not in str(bare)
    assert "Distances in brackets" not in bare.headline
    assert "(now " not in bare.headline


def test_an_offset_with_a_wide_interval_has_no_standard_error() -> None:
    found = answer(0.008, 0.06)
    offset = pt.calibration.OffsetEstimate(value=180.0, standard_error=1.2, low=140.0, high=220.0, kind="fitted")
    wide = replace(found, report=replace(found.report, offset=offset))
    assert "the fitted offset from each reading: 180 V (95 % interval: 140 to 220)" in str(wide)
    narrow = replace(wide, report=replace(found.report, offset=replace(offset, low=177.6, high=182.4)))
    assert "the fitted offset from each reading: 180 ± 1.2 V (95 % interval: 177.6 to 182.4)" in str(narrow)


@pytest.mark.parametrize("near", np.random.default_rng(6).uniform(1e-4, 0.3, 20))
def test_the_recess_that_is_advised_reaches_contact_and_is_no_more_than_a_micrometer_too_deep(near: float) -> None:
    """The readings of dense sweeps are gathered, so that a window starts anywhere."""
    curve = pt.ExponentialFirstOrder(scale=1.0, rate=-60.0, minimum_distance=float(near))
    recess = float(recess_in_words(curve.minimum_distance).removesuffix(" mm")) / 1e3
    assert pt.Recessed(sensor=curve, recess=recess).valid_range[0] <= 0.0
    assert recess < near + 1.001e-6


def test_a_recess_as_deep_as_a_curve_starts_reaches_contact_whatever_the_rounding() -> None:
    for near in (np.nextafter(0.0075, 0.0), 0.0075, np.nextafter(0.0075, 1.0)):
        curve = pt.ExponentialFirstOrder(scale=1.0, rate=-60.0, minimum_distance=float(near))
        assert pt.Recessed(sensor=curve, recess=0.0075).valid_range[0] == 0.0
        assert recess_in_words(float(near)) == "7.5 mm"


@pytest.mark.slow
def test_what_a_drag_does_where_no_data_are_is_its_share_of_the_logarithm_of_the_speeds() -> None:
    """ln rho is -(phi/M) int g^2 dl, so that shares of it are those of the integral, by its closed form here."""
    sensor = replace(report(0.008, 0.06).best.sensor, minimum_distance=0.0, maximum_distance=0.2)
    task = pt.Task(encounter(), sensor, law="virtual-drag", gain=0.0144)
    found = reservations_of(report(0.008, 0.06), task)
    nearer, whole = (d / (sensor.distance_offset * (sensor.distance_offset + d)) for d in (0.008, 0.04))
    assert found.share_nearer == pytest.approx(nearer / whole, rel=1e-6)
    assert found.share_beyond == 0.0
    contact = pt.find_contact(task.scenario, sensor, 0.0144, law="virtual-drag").contact
    assert found.speed == pytest.approx(-contact.relative_velocity, rel=1e-12)
    assert found.speed_without_force > found.speed
    assert "at distances nearer than 8 mm, the sensor curve is extrapolated" in str(found)
    assert "% of the effect of the drag, ln(1/\u03c1)\n" in str(found)
    design = pt.design(task.replace(drag_effect=pt.DragEffect(ratio=0.15)))
    assert reservations_of(report(0.008, 0.06), design).speed == pytest.approx(0.15 * 0.3, rel=1e-9)
