"""Gain and admittance together: brute force finds nothing better, and the conditions of an optimum hold."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from encounters import CURVES
from pretouch._core.errors import ResultUnavailableError
from pretouch.designs import (
    Constraint,
    DesignStatus,
    Objective,
    SpringImpact,
    Task,
    Term,
    design_admittance,
    design_gain,
    excursion_objective,
    time_objective,
)
from pretouch.designs.problem import GainProblem, magnitude, merit
from pretouch.designs.search import GainAxis
from pretouch.designs.search.circles import follow_kinks
from pretouch.designs.search.freedom import make_freedom
from pretouch.designs.search.local import kkt_residual
from pretouch.designs.search.trials import Trials
from pretouch.motion import Admittance, Obstacle, Scenario, find_contact
from pretouch.sensors import InversePower
from refusals import refused

BOUNDS = (-10.0, -0.01)
F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
FREE = {"natural_frequency": (2.0, 12.0), "damping_ratio": (0.5, 2.0)}
IMPACT = SpringImpact(robot_mass=0.5, stiffness=2e4)
CASES = {
    "bounds": (F1, ()),
    "time": (time_objective(time_scale=0.5, velocity_scale=0.1), ()),
    "acceleration": (F1, (Constraint(name="acceleration", limit=1.2),)),
    "time and excursion": (F1, (Constraint(name="time", limit=0.3), Constraint(name="excursion", limit=0.05))),
    "forces": (
        Objective(terms=(Term(quantity="impact_force", scale=10.0), Term(quantity="displacement", scale=0.1))),
        (Constraint(name="virtual_force", limit=2.0),),
    ),
}


def brute(scenario: Scenario, objective: Objective, limits: tuple[Constraint, ...], sensor: object) -> float:
    """The least objective on a grid of 25 x 19 x 161."""
    frequency, ratio, gain = np.meshgrid(
        np.geomspace(2, 12, 25), np.linspace(0.5, 2, 19), -np.geomspace(0.01, 10, 161), indexing="ij"
    )
    admittance = Admittance.from_natural_frequency(mass=1.0, natural_frequency=frequency, damping_ratio=ratio)
    result = find_contact(replace(scenario, admittance=admittance), sensor, gain)  # type: ignore[arg-type]
    value = np.where(result.reached, objective.value(result.end, 0.3, IMPACT), np.inf)
    for limit in limits:
        value = np.where(limit.magnitude(result.end, IMPACT) <= limit.limit, value, np.inf)
    return float(value.min())


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("curve", ["inverse-power", "exponential-1"])
def test_brute_force_finds_nothing_better(letter_encounter: Scenario, case: str, curve: str) -> None:
    objective, limits = CASES[case]
    sensor = CURVES[curve]
    design = design_admittance(
        Task(letter_encounter, sensor, objective, bounds=BOUNDS, constraints=limits, impact=IMPACT, **FREE)
    )
    assert design.status is DesignStatus.OPTIMAL
    assert design.objective <= brute(letter_encounter, objective, limits, sensor) * (1 + 1e-9)
    # differences of order 4 are good to some 1e-9 of the objective per range, SLSQP ends when a step gains 1e-14
    assert design.certificate.residual < 1e-5
    assert all(multiplier >= 0 for _, multiplier in design.certificate.active)
    assert all(o.value <= o.limit for o in design.gain_design.constraints)


@pytest.mark.parametrize("limits", [(), (Constraint(name="acceleration", limit=1.2),)], ids=["free", "limited"])
def test_the_conditions_of_an_optimum_contradict_one_that_was_moved(
    letter_encounter: Scenario, limits: tuple[Constraint, ...]
) -> None:
    """Where nothing holds it, what remains of the gradient by ln of the gain is that of differences of encounters."""
    sensor = CURVES["inverse-power"]
    design = design_admittance(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=limits, **FREE))
    trials = Trials(
        freedom=make_freedom(letter_encounter, BOUNDS, FREE["natural_frequency"], FREE["damping_ratio"]),
        encounters=design.problem,
        measures=(merit(F1, 0.3, None),),
    )
    best = design.certificate.local_minima[0].at
    assert kkt_residual(trials, best, np.ones(1))[0] == pytest.approx(design.certificate.residual, abs=1e-9)
    moved: list[bool] = []
    for shift in (-0.02, 0.02):  # of the range of the gain, 15 % of it
        point = best + np.array([shift, 0.0, 0.0])
        residual, _, _ = kkt_residual(trials, point, np.ones(1))
        kept = bool(trials.feasible(trials.rows(point[None])[0])[0])
        assert kept or limits, "a limit contradicts what was moved beyond it, the residual all else"
        assert residual > max(0.02, 1e3 * design.certificate.residual) or not kept
        moved.append(kept)
        if not limits:
            beside = trials.rows(point + np.array([[-1e-5, 0.0, 0.0], [1e-5, 0.0, 0.0]]))[0][:, 0]
            assert residual >= abs(beside[1] - beside[0]) / 2e-5 / float(trials.rows(point[None])[0][0, 0]) * (1 - 1e-4)
    assert any(moved)


def test_an_optimum_at_a_kink_of_a_limit_is_found(letter_encounter: Scenario) -> None:
    """The largest acceleration is that of the start, or a later one: its derivatives jump where both are equal.

    Brute force: its gains are 1e-4 apart, ln f changes by 1.4e-4 over one.
    """
    sensor = CURVES["inverse-power"]
    limit = Constraint(name="acceleration", limit=0.3)
    own = Admittance.from_natural_frequency(mass=1.0, natural_frequency=5.0, damping_ratio=0.7)
    scenario = replace(letter_encounter, admittance=own)
    design = design_admittance(
        Task(scenario, sensor, F1, bounds=BOUNDS, constraints=[limit], natural_frequency=(3.0, 10.0))
    )
    frequency, gain = np.meshgrid(np.linspace(3.0, 3.2, 81), -0.0253 * np.exp(np.arange(-200, 200) * 1e-4))
    admittance = Admittance.from_natural_frequency(mass=1.0, natural_frequency=frequency, damping_ratio=0.7)
    end = find_contact(replace(letter_encounter, admittance=admittance), sensor, gain).end
    least = np.where(limit.magnitude(end) <= limit.limit, F1.value(end, 0.3), np.inf).min()
    assert least * (1 - 2e-4) <= design.objective <= least
    assert all(o.value <= o.limit for o in design.gain_design.constraints)


@pytest.mark.parametrize("slope", [-2.0, 0.37, 1.0])
@pytest.mark.parametrize("valley", [0.0, 3.0, 100.0])
def test_kinks_are_followed_in_any_direction(slope: float, valley: float) -> None:
    """Values fall along a line of admittances across which they have a kink; the best gain follows it."""

    def values(at: np.ndarray) -> np.ndarray:
        gain, first, second = at.T
        across = np.abs(second - 0.5 - slope * (first - 0.5))
        return (1 + first + valley * across + 4 * np.abs(gain - 0.3 - 0.5 * first))[:, None]

    trials = SimpleNamespace(
        values=values, freedom=SimpleNamespace(size=3), encounters=SimpleNamespace(is_continuous=True)
    )
    end = max(0.0, 0.5 - 0.5 / abs(slope)) if valley > abs(1 / slope) else 0.0  # where the line leaves the square
    start = np.array([0.55, 0.5, 0.5])
    at, value = follow_kinks(trials, start, float(values(start[None])[0, 0]))  # type: ignore[arg-type]
    assert value == pytest.approx(1 + end, abs=1e-5)
    assert at[0] == pytest.approx(0.3 + 0.5 * end, abs=1e-5)


def test_the_answer_is_an_encounter_that_leads_to_the_objective(letter_encounter: Scenario) -> None:
    sensor = CURVES["inverse-power"]
    design = design_admittance(Task(letter_encounter, sensor, F1, bounds=BOUNDS, **FREE))
    again = find_contact(replace(letter_encounter, admittance=design.admittance), sensor, design.gain)
    assert float(F1.value(again.end, 0.3)) == pytest.approx(design.objective, rel=1e-9)
    assert design.admittance.natural_frequency == pytest.approx(design.natural_frequency, rel=1e-12)
    assert design.admittance.damping_ratio == pytest.approx(design.damping_ratio, rel=1e-12)
    assert design.admittance.mass == letter_encounter.admittance.mass
    assert design.objective < design.unchanged.objective


def test_an_optimum_that_is_known_inside_the_bounds_is_found(letter_encounter: Scenario) -> None:
    """The objective is how far three quantities are from those of a given gain and admittance."""
    sensor = CURVES["inverse-power"]
    there = Admittance.from_natural_frequency(mass=1.0, natural_frequency=4.2, damping_ratio=0.83)
    wanted = find_contact(replace(letter_encounter, admittance=there), sensor, -0.37).contact

    class Distance(Objective):
        def value(self, state, obstacle_speed, impact=None):  # type: ignore[no-untyped-def]  # noqa: ARG002
            names = (("displacement", 0.05), ("relative_velocity", 0.1), ("acceleration", 1.0))
            return 1 + sum(((np.asarray(getattr(state, n)) - getattr(wanted, n)) / s) ** 2 for n, s in names)

    design = design_admittance(Task(letter_encounter, sensor, Distance(terms=F1.terms), bounds=BOUNDS, **FREE))
    # an objective that is flat to 1e-14 fixes the place to 1e-7 of the quantities, which follow it a hundred times less
    assert design.objective == pytest.approx(1.0, abs=1e-10)
    assert design.natural_frequency == pytest.approx(4.2, rel=1e-3)
    assert design.damping_ratio == pytest.approx(0.83, rel=1e-3)
    assert design.gain == pytest.approx(-0.37, rel=1e-3)
    assert design.certificate.active == ()


def test_the_better_of_two_local_minima_is_chosen(letter_encounter: Scenario) -> None:
    """At 3.9 rad/s the objective is least at either end of the damping ratios, and higher between."""
    sensor = CURVES["inverse-power"]
    own = Admittance.from_natural_frequency(mass=1.0, natural_frequency=3.9)
    scenario = replace(letter_encounter, admittance=own)
    design = design_admittance(Task(scenario, sensor, F1, bounds=BOUNDS, damping_ratio=(0.3, 2.0)))
    minima = design.certificate.local_minima
    assert [m.damping_ratio for m in minima] == [0.3, 2.0]
    assert minima[0].objective < minima[1].objective
    assert design.damping_ratio == 0.3
    # in the neighborhood of the other one alone, that one is the answer
    other = design_admittance(Task(scenario, sensor, F1, bounds=BOUNDS, damping_ratio=(1.5, 2.0)))
    assert other.damping_ratio == 2.0
    assert other.objective == pytest.approx(minima[1].objective, rel=1e-9)


@pytest.mark.parametrize(("name", "limit"), [("acceleration", 1.2), ("time", 0.3), ("excursion", 0.04)])
def test_a_multiplier_says_what_relaxing_its_limit_gains(letter_encounter: Scenario, name: str, limit: float) -> None:
    """d ln f / d ln limit, from two designs whose limits differ by 2 h = 2e-3 of themselves: good to h^2."""
    sensor = CURVES["inverse-power"]

    def designed(value: float) -> object:
        constraint = Constraint(name=name, limit=value)
        return design_admittance(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=[constraint], **FREE))

    design = designed(limit)
    multipliers = dict(design.certificate.active)  # type: ignore[attr-defined]
    higher, lower = designed(limit * 1.001).objective, designed(limit * 0.999).objective  # type: ignore[attr-defined]
    assert multipliers[name] == pytest.approx((lower - higher) / 2e-3 / design.objective, rel=1e-4)  # type: ignore[attr-defined]


def limited_in_time(encounter: Scenario) -> GainProblem:
    limit = Constraint(name="time", limit=0.5)
    task = Task(encounter, CURVES["inverse-power"], constraints=[limit], impact=IMPACT)
    return GainProblem(task=task, axis=GainAxis.between(BOUNDS))


@pytest.mark.parametrize("free", [{}, {"natural_frequency": (2.0, 12.0)}, FREE])
@pytest.mark.parametrize("at", [(0.4, 0.3, 0.6), (0.0, 0.0, 1.0), (0.9995, 0.5, 0.001)])
def test_derivatives_are_those_of_the_encounters(letter_encounter: Scenario, free: dict, at: tuple[float, ...]) -> None:
    """Against one-sided differences of order 2 inside the bounds, h = 2e-5 of the range: a largest speed that is known
    to 1e-8 then gives a derivative to 1e-3."""
    freedom = make_freedom(letter_encounter, BOUNDS, free.get("natural_frequency"), free.get("damping_ratio"))
    trials = Trials(
        freedom=freedom,
        encounters=limited_in_time(letter_encounter),
        measures=(merit(F1, 0.3, IMPACT), magnitude("impact_force", IMPACT), magnitude("largest_speed", None)),
    )
    point = np.array(at[: freedom.size])
    rows, slopes = trials.differentiate(point)
    assert slopes.shape == (4, freedom.size)
    for j in range(freedom.size):
        step = -2e-5 if point[j] > 0.5 else 2e-5
        beside = np.stack([point, point])
        beside[:, j] += [step, 2 * step]
        first, second = trials.rows(beside)[0]
        found = (4 * first - 3 * rows - second) / (2 * step)
        assert (np.abs(slopes[:, j] - found) <= 1e-3 * np.abs(found) + 5e-3 * np.abs(rows)).all()


def test_infeasible_and_no_contact_are_statuses(letter_encounter: Scenario) -> None:
    sensor = CURVES["inverse-power"]
    limits = [Constraint(name="excursion", limit=0.01), Constraint(name="relative_velocity", limit=0.05)]
    design = design_admittance(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=limits, **FREE))
    assert design.status is DesignStatus.INFEASIBLE
    assert design.gain is None
    assert design.best_ratio > 1
    assert "Infeasible: within the bounds, no gain and admittance" in str(design)
    with refused("admittance", error=ResultUnavailableError):
        _ = design.admittance
    assert json.loads(json.dumps(design.to_dict(), allow_nan=False))["status"] == "infeasible"
    still = replace(letter_encounter, obstacle=Obstacle(position=0.03))
    design = design_admittance(Task(still, sensor, F1, bounds=BOUNDS, **FREE))
    assert design.status is DesignStatus.NO_CONTACT
    assert "end in contact" in repr(design)


def test_feasibility_that_the_grid_misses_is_found(letter_encounter: Scenario) -> None:
    """Limits so narrow that no encounter of the grid keeps them: what one encounter needs, widened by 1e-4."""
    sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    there = Admittance.from_natural_frequency(mass=1.0, natural_frequency=2.0, damping_ratio=0.5)
    end = find_contact(replace(letter_encounter, admittance=there), sensor, -0.123).contact
    limits = [
        Constraint(name="excursion", limit=end.largest_excursion * (1 + 1e-4)),
        Constraint(name="relative_velocity", limit=-end.relative_velocity * (1 + 1e-4)),
    ]
    design = design_admittance(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=limits, **FREE))
    assert design.status is DesignStatus.OPTIMAL
    assert design.gain == pytest.approx(-0.123, rel=1e-2)
    assert design.map.objective.min() == np.inf


def test_the_object_and_the_text_say_the_same(letter_encounter: Scenario) -> None:
    design = design_admittance(Task(letter_encounter, CURVES["exponential-1"], F1, bounds=BOUNDS, **FREE))
    found = json.loads(json.dumps(design.to_dict(), allow_nan=False))
    assert found["gain"] == design.gain
    together = found["admittance"]
    assert together["natural_frequency"] == design.natural_frequency
    assert together["unchanged"]["objective"] == design.unchanged.objective
    assert together["certificate"]["residual"] == design.certificate.residual
    assert len(together["map"]["objective"]) == design.map.objective.size
    text = str(design)
    assert text.startswith("The optimal admittance has a natural frequency of 2 rad/s")
    assert "Compared with the admittance of the task, the objective changes by -" in text
    assert "At this admittance: Optimal gain" in text
    assert "<table" in design._repr_html_()
    assert repr(design.map) == f"<AdmittanceMap: {design.map.objective.size} admittances>"


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({}, {"argument": "natural_frequency"}),
        ({"damping_ratio": (2.0, 1.0)}, {"argument": "damping_ratio", "value": (2.0, 1.0)}),
        ({"damping_ratio": (0.5, 1.0), "bounds": (0.0, -1.0)}, {"argument": "bounds", "value": (0.0, -1.0)}),
    ],
)
def test_a_request_that_makes_no_sense_is_refused(
    letter_encounter: Scenario, change: dict, fields: dict[str, Any]
) -> None:
    with refused(**fields):
        design_admittance(Task(letter_encounter, CURVES["exponential-1"], F1, **{"bounds": BOUNDS, **change}))


@pytest.mark.parametrize("at", [(0.4, 0.3, 0.6), (0.0, 0.0, 1.0), (1.0, 0.5, 0.0)])
def test_exact_derivatives_are_those_of_differences(letter_encounter: Scenario, at: tuple[float, ...]) -> None:
    """Two ways that share no code; differences of order 4 over 2e-4 of the range are good to 1e-12 / 2e-4."""
    trials = Trials(
        freedom=make_freedom(letter_encounter, BOUNDS, FREE["natural_frequency"], FREE["damping_ratio"]),
        encounters=limited_in_time(letter_encounter),
        measures=(merit(F1, 0.3, IMPACT), magnitude("impact_force", IMPACT), magnitude("acceleration", None)),
    )
    point = np.array(at)
    exact = trials._exact(trials.run(point[None]), point)
    scale = np.abs(exact).max(axis=1, keepdims=True)
    assert np.abs(exact - trials._differences(point)[1]) / scale == pytest.approx(np.zeros((4, 3)), abs=1e-7)


def test_the_map_shows_what_designing_each_gain_would_find(letter_encounter: Scenario) -> None:
    """Also under a limit, between the gains of the grid: to 1/64 of the axis, three times divided by 8.

    That is 2.1e-4 of ln |D_p|. By differences, ln f changes by 0, 0.87 and 0.49 of that at the three optima.
    """
    sensor = CURVES["inverse-power"]
    limits = [Constraint(name="acceleration", limit=3.0)]
    design = design_admittance(
        Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=limits, natural_frequency=(2.0, 12.0))
    )
    for i in (0, 8, 16):
        own = Admittance.from_natural_frequency(mass=1.0, natural_frequency=design.map.natural_frequency[i])
        alone = design_gain(
            Task(replace(letter_encounter, admittance=own), sensor, F1, bounds=BOUNDS, constraints=limits)
        )
        assert alone.objective * (1 - 1e-9) <= design.map.objective[i] <= alone.objective * (1 + 2e-4)
