"""What must hold for every front: nothing that brute force tries beats it, and each of its points is an encounter."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import brentq

from encounters import CURVES
from pretouch.designs import (
    Constraint,
    FrontStatus,
    ParetoOptions,
    SpringImpact,
    Task,
    design_gain,
    excursion_objective,
    pareto,
    quantity_of,
)
from pretouch.designs.front.curve_front import trace_front
from pretouch.designs.front.dominance import non_dominated, shortfall
from pretouch.designs.search import Landscape
from pretouch.motion import Admittance, Obstacle, Plant, Scenario, find_contact
from pretouch.sensors import ExponentialFirstOrder
from refusals import refused

BOUNDS = (-10.0, -0.01)
F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
PAIR = ("displacement", "relative_velocity")
TRIPLE = ("time", "relative_velocity", "largest_acceleration")
FREE = {"natural_frequency": (2.0, 12.0), "damping_ratio": (0.5, 2.0)}


def unlimited(*quantities: np.ndarray) -> Landscape:
    return Landscape(objective=np.stack(quantities), ratios=np.empty((0, len(quantities[0]))))


def magnitudes(result: object, quantities: tuple[str, ...]) -> np.ndarray:
    return np.stack([np.abs(quantity_of(q, result.end)) for q in quantities], axis=-1)  # type: ignore[attr-defined]


def extent_of(front: object) -> np.ndarray:
    return np.ptp(front.values, axis=0)  # type: ignore[attr-defined]


# --- domination


@pytest.mark.parametrize("k", [2, 3])
@given(data=st.data())
def test_domination_is_what_comparing_all_pairs_finds(k: int, data: st.DataObject) -> None:
    """With small integers, so that there are many ties; and some points that are infinite."""
    points = data.draw(arrays(np.float64, st.tuples(st.integers(1, 40), st.just(k)), elements=st.integers(0, 5)))
    points[data.draw(st.lists(st.integers(0, len(points) - 1), max_size=3))] = np.inf
    expected = []
    for i, p in enumerate(points):
        others = np.delete(points, i, axis=0)
        dominated = ((others <= p).all(axis=1) & (others < p).any(axis=1)).any()
        repeated = (points[:i] == p).all(axis=1).any()
        expected.append(bool(np.isfinite(p).all() and not dominated and not repeated))
    assert non_dominated(points).tolist() == expected


def test_the_shortfall_is_the_shift_that_makes_a_front_dominate() -> None:
    front = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert shortfall(np.array([[0.4, 0.4]]), front)[0] == pytest.approx(0.6)
    assert shortfall(np.array([[1.5, 1.5]]), front)[0] == pytest.approx(-0.5)
    assert shortfall(np.array([[np.inf, 0.0]]), front)[0] == -np.inf


# --- the front of a curve


def test_the_front_of_a_curve_ends_where_a_quantity_is_least() -> None:
    """Two parabolas over u, with their minima at 0.3 and at 0.7: what lies between is the front."""
    found = trace_front(lambda u: unlimited((u - 0.3) ** 2, (u - 0.7) ** 2))
    assert found.at[[0, -1], 0] == pytest.approx([0.3, 0.7], abs=1e-7)  # a minimum is found to the root of rounding
    assert (found.piece == found.piece[0]).all()


def test_a_curve_that_doubles_back_has_a_front_in_pieces_whose_ends_are_found() -> None:
    """(u, 1 - u - 0.2 sin 6 pi u): a piece ends at each minimum of the second quantity, the next begins where that is
    undercut."""

    def second(u: np.ndarray) -> np.ndarray:
        return 1 - u - 0.2 * np.sin(6 * np.pi * u)

    found = trace_front(lambda u: unlimited(u, second(u)))
    # where the slope -1 - 1.2 pi cos 6 pi u is 0 and the sine positive
    least = [(math.acos(-1 / (1.2 * math.pi)) + 2 * math.pi * k) / (6 * math.pi) for k in range(3)]
    starts = [0.0]
    for u in least[:-1]:
        level = second(u)
        grid = np.linspace(u + 1e-3, 1, 4001)
        under = grid[np.argmax(second(grid) < level)]
        starts.append(brentq(lambda v, level=level: second(v) - level, under - 1e-3, under, xtol=1e-14))
    for number, (start, end) in enumerate(zip(starts, least, strict=True)):
        piece = found.at[found.piece == number, 0]
        assert piece[0] == pytest.approx(start, abs=1e-9)
        assert piece[-1] == pytest.approx(end, abs=1e-7)


def test_an_edge_of_what_is_feasible_is_found_to_rounding() -> None:
    edge = 1 / math.sqrt(7)

    def evaluate(u: np.ndarray) -> Landscape:
        return Landscape(objective=np.where(u < edge, np.stack([u, 1 - u]), np.inf), ratios=np.empty((0, len(u))))

    assert trace_front(evaluate).at[-1, 0] == pytest.approx(edge, abs=1e-12)


def test_a_front_within_a_narrow_band_is_found() -> None:
    """Two limits leave a band between two scanned coordinates."""

    def evaluate(u: np.ndarray) -> Landscape:
        return Landscape(objective=np.stack([u, 1 - u]), ratios=1 + np.stack([0.401 - u, u - 0.402]))

    found = trace_front(evaluate)
    np.testing.assert_allclose(found.at[[0, -1], 0], [0.401, 0.402], atol=1e-10)


# --- the front of the gain


@pytest.mark.slow(keep=2)
@pytest.mark.parametrize("name", CURVES)
def test_brute_force_over_the_gain_finds_nothing_better(letter_encounter: Scenario, name: str) -> None:
    front = pareto(Task(letter_encounter, CURVES[name], bounds=BOUNDS))
    assert front.status is FrontStatus.FOUND
    everywhere = find_contact(letter_encounter, CURVES[name], -np.geomspace(0.01, 10.0, 2001))
    brute = magnitudes(everywhere, PAIR)[everywhere.reached]
    # neighbors of the front lie 0.01 of its extent apart in the quantity that changes most: no gap is wider
    assert shortfall(brute / extent_of(front), front.values / extent_of(front)).max() < 0.01
    # and no encounter of brute force dominates a point of the front, to the accuracy of contacts
    better = [(brute <= p * (1 - 1e-8)).all(axis=1).any() for p in front.values]
    assert not any(better)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(
    ("name", "quantities"), [*((name, PAIR) for name in CURVES), *((name, TRIPLE) for name in list(CURVES)[::3])]
)
def test_what_the_front_misses_is_what_dense_sampling_finds(
    letter_encounter: Scenario, name: str, quantities: tuple[str, ...]
) -> None:
    """Between its points, too: they are looked at to 1/128 of an interval, so to 2 % of the largest shift."""
    front = pareto(Task(letter_encounter, CURVES[name], bounds=BOUNDS, pareto=ParetoOptions(quantities=quantities)))
    everywhere = find_contact(letter_encounter, CURVES[name], -np.geomspace(0.01, 10.0, 20_001))
    dense = shortfall(
        magnitudes(everywhere, quantities)[everywhere.reached] / extent_of(front), front.values / extent_of(front)
    ).max()
    assert 1e-3 < dense < 1.02 * front.approximation_error
    assert front.approximation_error < 1.02 * dense + 1e-4


@pytest.mark.parametrize(
    "quantities", [PAIR, ("largest_excursion", "time"), TRIPLE, ("position", "largest_virtual_force")]
)
def test_each_point_is_the_encounter_of_its_gain(letter_encounter: Scenario, quantities: tuple[str, ...]) -> None:
    front = pareto(
        Task(letter_encounter, CURVES["inverse-power"], pareto=ParetoOptions(quantities=quantities), bounds=BOUNDS)
    )
    again = find_contact(letter_encounter, CURVES["inverse-power"], front.gain)
    assert front.values == pytest.approx(magnitudes(again, quantities), rel=1e-9)
    assert non_dominated(front.values).all()
    for name in quantities:
        assert front.of(name).min() == pytest.approx(front.ends[quantities.index(name)].values[name], rel=1e-9)


def test_limits_end_the_front_exactly(letter_encounter: Scenario) -> None:
    limits = [Constraint(name="excursion", limit=0.05), Constraint(name="relative_velocity", limit=0.2)]
    front = pareto(Task(letter_encounter, CURVES["inverse-power"], bounds=BOUNDS, constraints=limits))
    assert front.of("displacement").max() == pytest.approx(0.05, rel=1e-9)
    assert front.of("relative_velocity").max() == pytest.approx(0.2, rel=1e-9)
    assert front.meets(displacement=0.05, relative_velocity=0.2).all()
    assert not front.meets(displacement=0.02).all()


def test_quantities_that_do_not_conflict_leave_one_point(letter_encounter: Scenario) -> None:
    """Without mitigation the obstacle arrives first, and finds the plant where it was: the weakest gain is best."""
    front = pareto(
        Task(
            letter_encounter,
            CURVES["inverse-power"],
            pareto=ParetoOptions(quantities=("time", "displacement")),
            bounds=BOUNDS,
        )
    )
    assert front.gain.tolist() == [-0.01]
    assert front.knee is None
    headline = "Time of contact and deviation from the reference do not conflict: D_p = -0.01 N s is best in both."
    assert str(front).startswith(headline)


def test_the_optimum_of_any_weights_lies_on_the_front(letter_encounter: Scenario) -> None:
    sensor = CURVES["inverse-power"]
    for weight in (0.1, 1.0, 10.0):
        objective = excursion_objective(position_scale=0.5, velocity_scale=0.3, velocity_weight=weight)
        design = design_gain(Task(letter_encounter, sensor, objective, bounds=BOUNDS))
        front = pareto(Task(letter_encounter, sensor, bounds=BOUNDS, pareto=ParetoOptions(choice=design)))
        assert front.choice.gain == design.gain
        # the front's points on both sides of it are 0.01 of the extent apart
        assert abs(front.choice.distance_to_front) < 0.01
        assert front.choice.distance_to_front <= 1e-9


def test_the_knee_is_deepest_below_the_chord(letter_encounter: Scenario) -> None:
    sensor = CURVES["inverse-power"]
    front = pareto(Task(letter_encounter, sensor, bounds=BOUNDS))
    ends = front.values[[0, -1]]
    everywhere = magnitudes(find_contact(letter_encounter, sensor, -np.geomspace(0.01, 10.0, 4001)), PAIR)
    share = (everywhere - ends.min(axis=0)) / np.ptp(ends, axis=0)
    depth = (1 - share.sum(axis=1)) / math.sqrt(2)  # distance from the line p1 + p2 = 1
    assert front.knee.depth == pytest.approx(depth.max(), rel=1e-6)
    assert front.knee.gain == pytest.approx(-np.geomspace(0.01, 10.0, 4001)[depth.argmax()], rel=5e-3)
    assert front.knee.distance_to_front == pytest.approx(0.0, abs=0.01)


# --- the front of gain and admittance


@pytest.fixture(scope="module")
def wide() -> object:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.0422, velocity=-0.3)
    )
    return scenario, pareto(
        Task(scenario, CURVES["inverse-power"], bounds=BOUNDS, pareto=ParetoOptions(choice=-0.7463451), **FREE)
    )


@pytest.mark.slow
def test_brute_force_over_gain_and_admittance_finds_nothing_better(wide: object) -> None:
    scenario, front = wide  # type: ignore[misc]
    frequency, ratio, gain = np.meshgrid(
        np.geomspace(2, 12, 23), np.linspace(0.5, 2, 17), -np.geomspace(0.01, 10, 97), indexing="ij"
    )
    admittance = Admittance.from_natural_frequency(mass=1.0, natural_frequency=frequency, damping_ratio=ratio)
    everywhere = find_contact(replace(scenario, admittance=admittance), CURVES["inverse-power"], gain)
    brute = magnitudes(everywhere, PAIR)[everywhere.reached]
    # neighbors of the front lie 0.03 of its extent apart; being convex, it falls less than half of that between them
    assert shortfall(brute / extent_of(front), front.values / extent_of(front)).max() < 0.01
    assert front.approximation_error < 0.01  # of which at most 0.015 lie between neighbors, less what is convex
    # a dominated point would be one that the search left too early: by more than 1e-4 of its quantities there is none
    assert not any((brute <= p * (1 - 1e-4)).all(axis=1).any() for p in front.values)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize(("quantities", "above"), [(PAIR, 1.0), (TRIPLE, 1.05)])
def test_what_a_front_of_gain_and_admittance_misses_is_no_less_than_dense_sampling_finds(
    wide: object, quantities: tuple[str, ...], above: float
) -> None:
    scenario, front = wide  # type: ignore[misc]
    if quantities != PAIR:
        front = pareto(
            Task(scenario, CURVES["inverse-power"], bounds=BOUNDS, pareto=ParetoOptions(quantities=quantities), **FREE)
        )
    rng, count = np.random.default_rng(5), 60_000
    frequency, gain = np.geomspace(2, 12, count), -np.exp(rng.uniform(np.log(0.01), np.log(10), count))
    admittance = Admittance.from_natural_frequency(
        mass=1.0, natural_frequency=frequency, damping_ratio=rng.uniform(0.5, 2, count)
    )
    everywhere = find_contact(replace(scenario, admittance=admittance), CURVES["inverse-power"], gain)
    dense = magnitudes(everywhere, quantities)[everywhere.reached]
    assert (
        0
        < shortfall(dense / extent_of(front), front.values / extent_of(front)).max()
        <= above * front.approximation_error
    )


def test_what_is_chosen_along_the_front_leads_there(wide: object) -> None:
    scenario, front = wide  # type: ignore[misc]
    admittance = Admittance.from_natural_frequency(
        mass=1.0, natural_frequency=front.natural_frequency, damping_ratio=front.damping_ratio
    )
    again = find_contact(replace(scenario, admittance=admittance), CURVES["inverse-power"], front.gain)
    assert front.values == pytest.approx(magnitudes(again, PAIR), rel=1e-9)
    assert ((front.natural_frequency >= 2) & (front.natural_frequency <= 12)).all()
    assert ((front.damping_ratio >= 0.5) & (front.damping_ratio <= 2)).all()


def test_freedom_of_the_admittance_moves_the_front_and_leaves_the_choice_behind(wide: object) -> None:
    scenario, front = wide  # type: ignore[misc]
    assert front.free == ("gain", "natural_frequency", "damping_ratio")
    assert front.choice.distance_to_front > 0.01
    narrow = pareto(Task(scenario, CURVES["inverse-power"], bounds=BOUNDS))
    for speed in (0.05, 0.1, 0.2):
        shorter = front.of("displacement")[front.of("relative_velocity") <= speed].min()
        assert shorter < narrow.of("displacement")[narrow.of("relative_velocity") <= speed].min()


def test_three_quantities_over_gain_and_frequency_are_not_beaten_by_brute_force(letter_encounter: Scenario) -> None:
    sensor = ExponentialFirstOrder(scale=0.458, rate=-61.0)
    quantities = ("time", "relative_velocity", "virtual_force")
    front = pareto(
        Task(
            letter_encounter,
            sensor,
            pareto=ParetoOptions(quantities=quantities),
            bounds=BOUNDS,
            natural_frequency=(2.0, 12.0),
        )
    )
    frequency, gain = np.meshgrid(np.geomspace(2, 12, 61), -np.geomspace(0.01, 10, 401))
    admittance = Admittance.from_natural_frequency(mass=1.0, natural_frequency=frequency)
    everywhere = find_contact(replace(letter_encounter, admittance=admittance), sensor, gain)
    brute = magnitudes(everywhere, quantities)[everywhere.reached]
    assert not any((brute <= p * (1 - 1e-4)).all(axis=1).any() for p in front.values)
    # 90 points over a surface lie about a tenth of its extent apart
    assert shortfall(brute / extent_of(front), front.values / extent_of(front)).max() < 0.05
    assert front.knee is not None


# --- the rest


def test_infeasible_and_no_contact_are_statuses(letter_encounter: Scenario) -> None:
    sensor = CURVES["inverse-power"]
    limits = [Constraint(name="excursion", limit=1e-4), Constraint(name="relative_velocity", limit=0.01)]
    for free in ({}, FREE):
        front = pareto(
            Task(letter_encounter, sensor, bounds=BOUNDS, constraints=limits, pareto=ParetoOptions(choice=-0.7), **free)
        )
        assert front.status is FrontStatus.INFEASIBLE
        assert len(front.gain) == 0
        assert not front.choice.feasible
        assert json.loads(json.dumps(front.to_dict(), allow_nan=False))["knee"] is None
        assert str(front).startswith("Infeasible")
    still = replace(letter_encounter, obstacle=Obstacle(position=0.03))
    front = pareto(Task(still, sensor, bounds=BOUNDS, pareto=ParetoOptions(choice=-0.7)))
    assert front.status is FrontStatus.NO_CONTACT
    assert front.choice is None
    assert front.no_bound.startswith("found an obstacle that does not approach")


def test_a_plant_in_motion_has_a_front_but_no_bound(letter_encounter: Scenario) -> None:
    moving = replace(letter_encounter, plant=Plant(velocity=0.05))
    front = pareto(Task(moving, CURVES["inverse-power"], bounds=BOUNDS))
    assert front.comparison is None
    assert "is not at rest at its reference" in str(front)


def test_forces_are_traded_with_the_physical_mass(letter_encounter: Scenario) -> None:
    impact = SpringImpact(robot_mass=0.5, stiffness=2e4)
    front = pareto(
        Task(
            letter_encounter,
            CURVES["inverse-power"],
            pareto=ParetoOptions(quantities=("displacement", "impact_force")),
            bounds=BOUNDS,
            impact=impact,
        )
    )
    speed = np.abs(front.result.end.relative_velocity)
    assert front.of("impact_force") == pytest.approx(speed * math.sqrt(0.5 * 2e4), rel=1e-12)
    with refused("impact_force"):
        pareto(
            Task(
                letter_encounter,
                CURVES["inverse-power"],
                pareto=ParetoOptions(quantities=("displacement", "impact_force")),
                bounds=BOUNDS,
            )
        )


def test_a_users_own_evaluator_is_traded_with(letter_encounter: Scenario) -> None:
    sensor = CURVES["inverse-power"]
    front = pareto(
        Task(letter_encounter, sensor, bounds=BOUNDS, evaluate=lambda e, s, g: find_contact(e, s, 2 * np.asarray(g)))
    )
    plain = pareto(Task(letter_encounter, sensor, bounds=(-20.0, -0.02)))
    assert front.knee.gain == pytest.approx(plain.knee.gain / 2, rel=1e-5)
    assert front.comparison is None
    assert "motions in continuous time, L(1), that start from the given state" in front.no_bound


def test_the_object_and_the_text_say_the_same(letter_encounter: Scenario) -> None:
    limits = [Constraint(name="acceleration", limit=5.0), Constraint(name="speed", limit=0.5)]
    front = pareto(
        Task(
            letter_encounter,
            CURVES["inverse-power"],
            bounds=BOUNDS,
            constraints=limits,
            pareto=ParetoOptions(choice=-0.2),
        )
    )
    found = json.loads(json.dumps(front.to_dict(), allow_nan=False))
    assert found["status"] == "found"
    assert found["knee"]["gain"] == front.knee.gain
    assert found["front"]["displacement"] == front.of("displacement").tolist()
    assert len({len(column) for column in found["front"].values()}) == 1
    assert found["physical_bound"]["acceleration_limit"] == 5.0
    assert found["physical_bound"]["speed_limit"] == 0.5
    assert found["physical_bound"]["excursion_at_least_contact_speed"] == pytest.approx(0.3**2 / 10)
    text = str(front)
    assert "knee" in text
    assert "The choice lies on the Pareto front." in text
    assert "9 mm" in text
    assert "<table>" in front._repr_html_()
    assert found["knee"]["least_excursion"] == front.knee.bound.least_excursion
    assert found["knee"]["relative_velocity"] == front.knee.values["relative_velocity"]
    assert repr(front).startswith("<ParetoFront: The knee of the Pareto front of deviation from the")
    assert repr(front.knee).startswith("<FrontPoint knee")


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"bounds": (-0.1, -1.0)}, {"argument": "bounds", "value": (-0.1, -1.0)}),
        ({"natural_frequency": (5.0, 5.0)}, {"argument": "natural_frequency", "value": (5.0, 5.0)}),
        ({"damping_ratio": (-1.0, 1.0)}, {"argument": "damping_ratio", "value": -1.0}),
        ({"damping_ratio": (0.5, 1.0, 2.0)}, {"argument": "damping_ratio", "value": (0.5, 1.0, 2.0)}),
        ({"method": "magic"}, {"argument": "method", "value": "magic"}),
    ],
)
def test_a_request_that_makes_no_sense_is_refused(
    letter_encounter: Scenario, change: dict, fields: dict[str, Any]
) -> None:
    with refused(**fields):
        pareto(Task(letter_encounter, CURVES["exponential-1"], **{"bounds": BOUNDS, **change}))


@pytest.mark.parametrize(
    ("options", "fields"),
    [
        ({"quantities": ("time",)}, {"argument": "quantities"}),
        ({"quantities": ("time", "time")}, {"argument": "quantities"}),
        ({"quantities": "time"}, {"argument": "quantities", "value": "time"}),
        ({"quantities": ("time", "speed")}, {"argument": "quantities", "value": "speed"}),
        ({"choice": math.nan}, {"argument": "choice"}),
    ],
)
def test_options_that_make_no_sense_are_refused(
    letter_encounter: Scenario, options: dict, fields: dict[str, Any]
) -> None:
    with refused(**fields):
        pareto(Task(letter_encounter, CURVES["exponential-1"], bounds=BOUNDS, pareto=ParetoOptions(**options)))


def test_arrays_and_admittances_without_a_ratio_are_refused(letter_encounter: Scenario) -> None:
    sensor = CURVES["exponential-1"]
    many = replace(letter_encounter, obstacle=Obstacle(position=0.04, velocity=[-0.1, -0.2]))
    with refused("scenario"):
        pareto(Task(many, sensor, bounds=BOUNDS))
    free = replace(letter_encounter, admittance=Admittance(mass=1.0, damping=1.0, stiffness=0.0))
    assert pareto(Task(free, sensor, bounds=BOUNDS)).status is FrontStatus.FOUND
    with refused("natural_frequency"):
        pareto(Task(free, sensor, bounds=BOUNDS, natural_frequency=(1.0, 2.0)))
    with refused("damping_ratio"):
        pareto(Task(free, sensor, bounds=BOUNDS, damping_ratio=(1.0, 2.0)))
    designs = design_gain(Task(many, sensor, F1, bounds=BOUNDS))
    with refused("choice"):
        pareto(Task(letter_encounter, sensor, bounds=BOUNDS, pareto=ParetoOptions(choice=designs)))
