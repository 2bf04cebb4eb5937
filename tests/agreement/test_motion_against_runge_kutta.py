"""12,000 random encounters with all curves, 800 of them with a table, compared with an integration of order 8.

The claim is a relative error of 1e-9 in time. The error of the reference is measured by taking 1.5 to 2 times as many
steps, which makes it 25 to 256 times smaller: an encounter counts as checked if this changes the time of contact by
less than 1e-10. Shorter steps are taken for the others. The few that still remain are stiff and are checked with an
implicit method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from encounters import CURVES, KINDS, Encounters, random_encounters, together
from pretouch._core.fields import declared
from pretouch.motion import Admittance, ContactStatus, Obstacle, Plant, Reference, Scenario, find_contact, solution
from pretouch.sensors import ExponentialFirstOrder, SensorModel
from reference_integrator import integrate, integrate_over_distance

PER_CASE = 200
CLAIM = 1e-9
REFERENCE = 1e-10
HORIZON = 30.0


def _part(scenario: Scenario, index: np.ndarray) -> Scenario:
    """The encounters of a batch with the given index."""

    def pick(body: object) -> object:
        names = [f.name for f in declared(type(body)) if np.ndim(getattr(body, f.name))]
        return replace(body, **{n: getattr(body, n)[index] for n in names})  # type: ignore[type-var]

    parts = ("admittance", "obstacle", "plant", "reference")
    return Scenario(**{name: pick(getattr(scenario, name)) for name in parts})  # type: ignore[arg-type]


def _all_kinds(kinds: Sequence[str]) -> Encounters:
    """200 of each kind, in one batch: NumPy takes as long for one step of 200 as of 1,600."""
    return together(random_encounters(kind, PER_CASE, seed=20261121) for kind in kinds)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in CURVES if n != "table"])
def test_contact_agrees_with_an_independent_integration(name: str) -> None:
    sensor, batch = CURVES[name], _all_kinds(KINDS)
    found = find_contact(batch.scenario, sensor, batch.gain, horizon=HORIZON)
    assert np.isin(found.status, [0, 1, 2, 3]).all(), "every encounter is followed to an end"
    for field, value in found.end.as_dict().items():
        assert np.isfinite(value).all(), field
    todo = np.flatnonzero(found.reached)
    for steps, more in ((150, 300), (2400, 3600)):
        part, gain = _part(batch.scenario, todo), batch.gain[todo]
        end, speed = found.end.time[todo], found.end.relative_velocity[todo]
        coarse = integrate(part, sensor, gain, end, steps)
        fine = integrate(part, sensor, gain, end, more)
        with np.errstate(invalid="ignore"):
            trusted = np.abs(fine["distance"] - coarse["distance"]) < REFERENCE * np.abs(speed) * end
        error = np.abs(fine["distance"] / speed / end)[trusted]
        assert (error < CLAIM).all(), f"time off by up to {error.max():.1e}"
        drift = np.abs(fine["relative_velocity"] / speed - 1)[trusted]
        assert (drift < 1e-7).all(), f"l' off by up to {drift.max():.1e}"  # l' changes by l''/l' t times the error in t
        assert (fine["smallest"][trusted] > 0).all(), "an earlier contact was missed"
        for field in ("excursion", "speed"):
            least = fine[field][trusted] * (1 - CLAIM) - 1e-13
            assert (getattr(found.end, f"largest_{field}")[todo][trusted] >= least).all(), field
        todo = todo[~trusted]
        if not len(todo):
            break
    reached, left = (
        np.histogram(i, len(KINDS), (0, len(found.reached)))[0] for i in (np.flatnonzero(found.reached), todo)
    )
    assert (left <= 0.07 * reached).all(), f"of {reached} contacts per kind, {left} could not be checked"
    for i in dict(zip(todo // PER_CASE, todo, strict=True)).values():
        _check_stiff(_part(batch.scenario, np.array([i])), sensor, float(batch.gain[i]), found.end.time[i])


def _check_stiff(scenario: Scenario, sensor: SensorModel, gain: float, end: float) -> None:
    """Compare one stiff encounter with the implicit Radau method in (x~, w = M x~' + D x~ - D_p ln xi).

    In these variables no velocity of the stiff part is differenced; SciPy's own error at rtol 1e-12 is a few 1e-10.
    """
    m, d, k, x0, u0, p, v, a, _, _ = scenario.relative()[0]
    low, high = sensor.valid_range

    def ln_xi(x: float, t: float) -> float:
        distance = p + (v + a * t / 2) * t - x
        inside = min(max(distance, low), high)
        return sensor.log_output(inside) + sensor.log_slope(inside) * (distance - inside)

    def slope(t: float, y: np.ndarray) -> list[float]:
        return [(y[1] - d * y[0] + gain * ln_xi(y[0], t)) / m, -k * y[0]]

    start = [x0, m * u0 + d * x0 - gain * ln_xi(x0, 0.0)]
    solution = solve_ivp(slope, (0.0, end), start, method="Radau", rtol=1e-12, atol=1e-14)
    x = solution.y[0, -1]
    relative_velocity = v + a * end - slope(end, solution.y[:, -1])[0]
    assert abs((p + (v + a * end / 2) * end - x) / relative_velocity / end) < CLAIM


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["letter", "over-damped", "near-critical", "free"])
def test_contact_of_a_table_agrees_from_knot_to_knot(kind: str) -> None:
    sensor, batch = CURVES["table"], random_encounters(kind, PER_CASE, seed=20261121)
    found = find_contact(batch.scenario, sensor, batch.gain, horizon=HORIZON)
    coarse = integrate_over_distance(batch.scenario, sensor, batch.gain, 200)
    fine = integrate_over_distance(batch.scenario, sensor, batch.gain, 400)
    trusted = fine["monotone"] & (np.abs(fine["time"] / coarse["time"] - 1) < REFERENCE)
    assert trusted.sum() > 0.7 * PER_CASE
    assert found.reached[trusted].all()
    assert (np.abs(found.end.time / fine["time"] - 1)[trusted] < CLAIM).all()
    assert (np.abs(found.end.relative_velocity / fine["relative_velocity"] - 1)[trusted] < 1e-7).all()


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("name", CURVES)
def test_no_contact_is_reported_only_where_there_is_none(name: str) -> None:
    kinds = ("accelerated", "tracking", "everything")
    sensor, batch = CURVES[name], _all_kinds(kinds)
    found = find_contact(batch.scenario, sensor, batch.gain, horizon=HORIZON)
    without = np.flatnonzero(~found.reached)
    assert set(without // PER_CASE) == set(range(len(kinds))), "each kind must hold encounters without contact"
    part, gain = _part(batch.scenario, without), batch.gain[without]
    coarse, fine = (integrate(part, sensor, gain, found.end.time[without], n) for n in (1000, 1500))
    scale = np.abs(found.end.distance[without])
    with np.errstate(invalid="ignore"):
        trusted = np.abs(fine["distance"] - coarse["distance"]) < 1e-7 * scale
    assert (fine["smallest"][trusted] > 0).all()
    # where the motion left the curve's range it stopped, and the reference reaches the same place at that time
    assert (np.abs(fine["distance"] - found.end.distance[without])[trusted] < 1e-6 * scale[trusted]).all()
    # nearest approach: the reference only looks at its steps, which can miss the bottom but never undercut it
    assert (fine["smallest"][trusted] >= found.closest_distance[without][trusted] * (1 - 1e-6)).all()
    never = found.status[without] == ContactStatus.NEVER
    assert not never.any() or (found.closest_distance[without][never] > 0).all()


def test_closed_form_and_integration_are_one(letter_first_order: object, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of our own guaranteed ways that share no formula: L(10) by divided differences, and the Taylor series."""
    monkeypatch.setattr(solution, "_LANES", 1 << 40)
    for kind in KINDS:
        batch = random_encounters(kind, PER_CASE, seed=7)
        closed = find_contact(batch.scenario, letter_first_order, batch.gain, horizon=HORIZON)  # type: ignore[arg-type]
        series = find_contact(
            batch.scenario,
            letter_first_order,  # type: ignore[arg-type]
            batch.gain,
            horizon=HORIZON,
            method="integration",
        )
        assert (closed.reached == series.reached).all()
        both = closed.reached
        # a quantity that is small beside the largest of its kind met on the way is a difference of such, and rounded so
        largest = {
            "position": closed.end.largest_travel + closed.end.largest_speed * closed.end.time,
            "displacement": closed.end.largest_travel + closed.end.largest_speed * closed.end.time,
            "velocity": closed.end.largest_speed,
            "acceleration": closed.end.largest_acceleration,
            "virtual_force": closed.end.largest_virtual_force,
        }
        for field, value in closed.end.as_dict().items():
            other = getattr(series.end, field)
            least = 0.0 if field == "time" else 1e-2  # where nothing moves
            scale = np.maximum(np.maximum(np.abs(value), largest.get(field, 0.0)), least)
            # each derivative of a series that ends at 1e-16 of l loses a factor of order / step: two of them for x''
            tolerance = 1e-10 if "acceleration" in field or "force" in field else 1e-12
            assert (np.abs(value - other)[both] <= tolerance * scale[both]).all(), (kind, field)


def test_the_two_ways_agree_in_every_corner() -> None:
    """All combinations of rest, edge of range, no stiffness, no damping and amplifying gains that a user can write.

    Where a positive gain makes the damping negative, rounding grows exponentially, and a run that is all rounding must
    say that it is unresolved.
    """
    rng = np.random.default_rng(20261121)
    compared = 0
    for _ in range(1500):
        mass, stiffness = 10 ** rng.uniform(-1, 1), rng.choice([0.0, 1e-9, 1.0, 25.0, 400.0])
        critical = 2 * np.sqrt(mass * stiffness)
        gain = rng.choice([0.0, -0.01, -0.5, -2.0, 0.05, 0.3])
        scenario = Scenario(
            admittance=Admittance(
                mass=mass, damping=rng.choice([0.0, critical, rng.uniform(0, 40)]), stiffness=stiffness
            ),
            obstacle=Obstacle(
                position=rng.choice([0.01, 0.05]),
                velocity=rng.choice([0.0, -0.3, 0.2, rng.normal()]),
                acceleration=rng.choice([0.0, 0.0, -9.81, 1.0, rng.normal()]),
            ),
            plant=Plant(velocity=rng.choice([0.0, 0.3, -0.2])),
            reference=Reference(position=rng.choice([0.0, 0.02, -0.03, 0.2]), velocity=rng.choice([0.0, 0.1])),
        )
        sensor = ExponentialFirstOrder(
            scale=1.0,
            rate=-60.0,
            maximum_distance=rng.choice([0.05, 0.08, np.inf]),
            minimum_distance=rng.choice([0.0, 0.0, 0.002]),
        )
        closed = find_contact(scenario, sensor, gain, method="closed-form", horizon=20.0)
        series = find_contact(scenario, sensor, gain, method="integration", horizon=20.0)
        if ContactStatus.UNRESOLVED in {closed.status, series.status}:
            assert 60 * gain > scenario.admittance.damping, "only a negative damping leaves a run unresolved here"
            continue
        compared += 1
        assert closed.closest_distance >= 0
        if {closed.status, series.status} == {ContactStatus.NEVER, ContactStatus.HORIZON}:
            continue  # the closed form proves more
        rests = scenario.distance == sensor.maximum_distance and scenario.relative_velocity == 0
        if rests and ContactStatus.LEFT_RANGE in {closed.status, series.status}:
            continue  # the two are 2.5e-11 m apart on where the range ends, which a slow start takes its time for
        assert closed.status == series.status
        if closed.status != ContactStatus.NEVER:  # which each way proves at a time of its own
            assert closed.end.time == pytest.approx(series.end.time, rel=1e-9)
        assert closed.closest_distance == pytest.approx(series.closest_distance, rel=1e-7, abs=1e-9)
    assert compared > 1000
