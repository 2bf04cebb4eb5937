"""The compiled search finds what the search that scans, halves and zooms finds, or leaves a problem to it."""

from __future__ import annotations

import numpy as np
import pytest

from pretouch.designs import Constraint, DesignStatus, ElasticImpact, HertzImpact, SpringImpact, Task, Term
from pretouch.designs.evidence import GainEvidence
from pretouch.designs.gain import design_gain
from pretouch.designs.objectives import Objective, excursion_objective, time_objective
from pretouch.designs.problem import GainProblem
from pretouch.designs.search import GainAxis
from pretouch.designs.search.compiled import INFEASIBLE, OPTIMAL, UNCERTAIN, search_compiled
from pretouch.designs.search.family import find_family
from pretouch.motion import Admittance, Obstacle, Plant, Reference, Scenario, find_contact
from pretouch.sensors import (
    CustomSensor,
    ExponentialFirstOrder,
    ExponentialSecondOrder,
    InversePower,
    MittagLeffler,
    Recessed,
    Table,
)

FIRST = ExponentialFirstOrder(scale=0.458, rate=-61.0)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
OBJECTIVES = {
    "f_1": F1,
    "f_1 following": excursion_objective(position_scale=0.5, velocity_scale="obstacle speed"),
    "f_2": time_objective(time_scale=1.0, velocity_scale=0.3),
    "acceleration": Objective(terms=(Term(quantity="acceleration", scale=2.0), *F1.terms)),
    "force": Objective(terms=(Term(quantity="virtual_force", scale=10.0), *F1.terms)),
    "own speed": Objective(terms=(Term(quantity="velocity", scale=1.0), F1.terms[1])),
    "spring": Objective(terms=(F1.terms[0], Term(quantity="impact_force", scale=20.0))),
    "hertz": Objective(terms=(F1.terms[0], Term(quantity="impact_force", scale=30.0))),
    "steeper": Objective(terms=(F1.terms[0], Term(quantity="impact_force", scale=30.0))),
    "peak": Objective(terms=(Term(quantity="largest_excursion", scale=0.5), F1.terms[1])),
}
_AT = np.linspace(0.0, 0.06, 61)
CURVES = {
    "second order": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
    "mittag-leffler": MittagLeffler(scale=0.5, rate=-60.0, order=0.9),
    "recessed": Recessed(sensor=POWER, recess=0.004),
    "custom": CustomSensor(
        log_output_function=lambda d: -40 * d - np.tanh(d / 0.03),
        log_slope_function=lambda d: -40 - 1 / 0.03 / np.cosh(d / 0.03) ** 2,
    ),
    "table": Table(distances=tuple(_AT), outputs=tuple(POWER.output(_AT))),
}
IMPACTS = {
    "spring": SpringImpact(robot_mass=2.0, stiffness=1e4),
    "hertz": HertzImpact(robot_mass=1.0, effective_modulus=1e7, radius=0.01),
    "steeper": ElasticImpact(robot_mass=1.0, stiffness=1e5, exponent=2.2),
}


def problem(scenario: Scenario, sensor: object = FIRST, objective: str = "f_1", low: float = -10.0) -> GainProblem:
    task = Task(scenario, sensor, OBJECTIVES[objective], impact=IMPACTS.get(objective), horizon=60.0)
    return GainProblem(task=task, axis=GainAxis(low=low, high=-0.01))


def letter(velocity: object, **admittance: float) -> Scenario:
    found = Admittance(**{"mass": 1.0, "damping": 10.0, "stiffness": 25.0, **admittance})
    return Scenario(admittance=found, obstacle=Obstacle(position=0.0422, velocity=velocity))


def any_encounter(rng: np.random.Generator) -> Scenario:
    mass, omega, ratio = np.exp(rng.uniform(*np.log([[0.3, 1.0, 0.6], [5.0, 12.0, 3.0]]))).tolist()
    moved, bent = rng.random() < 0.3, rng.random() < 0.2
    drift = float(rng.uniform(-0.01, 0.05)) if moved else 0.0
    return Scenario(
        admittance=Admittance(mass=mass, damping=2 * ratio * omega * mass, stiffness=mass * omega**2),
        obstacle=Obstacle(
            position=float(rng.uniform(0.02, 0.06)),
            velocity=-float(np.exp(rng.uniform(np.log(0.03), 0.0))),
            acceleration=float(rng.uniform(-0.5, 0.2)) if bent else 0.0,
        ),
        plant=Plant(position=0.0, velocity=float(rng.uniform(-0.02, 0.1)) if moved else 0.0),
        reference=Reference(velocity=drift, acceleration=6 * drift),
    )


@pytest.mark.slow(keep=13)
@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("sensor", [FIRST, POWER], ids=lambda s: s.name)
def test_what_is_settled_is_the_optimum(sensor: object, objective: str) -> None:
    """No gain of a dense scan by `find_contact` does better, and those next to the optimum do hardly worse."""
    rng = np.random.default_rng([len(objective), len(type(sensor).__name__)])
    settled = 0
    for _ in range(25):
        one = problem(any_encounter(rng), sensor, objective)
        found = search_compiled(one)
        assert found is not None
        if not found[2][0]:
            continue
        settled += 1
        gain, value = found[0][0], found[1][0]
        dense = -np.geomspace(10.0, 0.01, 400)
        result = find_contact(one.task.scenario, sensor, np.append(dense, gain), horizon=60.0)
        every = one.task.goal.value(result.end, abs(one.task.scenario.obstacle.velocity), one.task.impact)
        assert every[-1] == pytest.approx(value, rel=1e-9)  # contacts agree to 1e-11, terms double that
        assert (every[:-1][result.reached[:-1]] >= value * (1 - 1e-9)).all()
    assert settled >= 4, "or this says little"


@pytest.mark.parametrize("name", CURVES)
def test_every_curve_is_searched(name: str) -> None:
    sensor = CURVES[name]
    one = problem(letter(-0.3), sensor)
    found, known = search_compiled(one), GainEvidence(problem=one, settled=None)
    assert found is not None
    assert found[2][0]
    assert found[0][0] == pytest.approx(known.gain, rel=1e-7)
    assert found[1][0] == pytest.approx(known.objective, rel=1e-10)


def test_gains_that_cannot_be_the_optimum_are_not_solved() -> None:
    """At 10 kN s the motion is far too stiff for any step; the bound on what touches later leaves it out."""
    found = search_compiled(problem(letter(-0.3), POWER, low=-1e4))
    assert found is not None
    assert found[2][0]
    assert found[0][0] == pytest.approx(search_compiled(problem(letter(-0.3), POWER))[0][0], rel=1e-8)


def test_the_bound_is_not_used_where_it_is_not_proved() -> None:
    """With less than critical damping, an approach may be overtaken by the plant's own swing."""
    assert not search_compiled(problem(letter(-0.3, damping=5.0), POWER, low=-1e4))[2][0]


@pytest.mark.parametrize("sensor", [FIRST, POWER], ids=lambda s: s.name)
def test_an_optimum_at_a_bound_is_the_bound_itself(sensor: object) -> None:
    found = search_compiled(problem(letter(-0.3), sensor, low=-0.5))
    assert found is not None
    assert (found[0][0], found[2][0]) == (-0.5, OPTIMAL)
    none = Objective(terms=(Term(quantity="displacement", scale=0.5),))  # no retreat is the best
    weakest = search_compiled(problem(letter(-0.3), sensor).changed(objective=none))
    assert weakest is not None
    assert (weakest[0][0], weakest[2][0]) == (-0.01, OPTIMAL)


LIMITS = {
    "excursion": (0.003, 0.3),
    "travel": (0.003, 0.3),
    "relative_velocity": (0.02, 0.5),
    "time": (0.05, 1.0),
    "speed": (0.02, 1.0),
    "acceleration": (0.3, 30.0),
    "virtual_force": (0.3, 50.0),
    "drive_force": (1.0, 100.0),
    "impact_force": (2.0, 80.0),
}


@pytest.mark.slow(keep=4)
@pytest.mark.parametrize("sensor", [FIRST, POWER], ids=lambda s: s.name)
@pytest.mark.parametrize("name", LIMITS)
def test_designs_with_limits_are_those_of_the_adaptive_scan(sensor: object, name: str) -> None:
    """One limit by its name and up to two others, of random size: met, binding, conflicting, impossible."""
    rng = np.random.default_rng([len(name), ord(name[0]), len(type(sensor).__name__)])
    outcomes = []
    for _ in range(12):
        others = rng.choice([n for n in LIMITS if n != name], size=rng.integers(0, 3), replace=False).tolist()
        limits = [Constraint(name=n, limit=float(np.exp(rng.uniform(*np.log(LIMITS[n]))))) for n in (name, *others)]
        task = Task(any_encounter(rng), sensor, F1, impact=IMPACTS["hertz"], constraints=limits, horizon=60.0)
        one = GainProblem(task=task, axis=GainAxis(low=-10.0, high=-0.01))
        found, known = search_compiled(one), GainEvidence(problem=one, settled=None)
        assert found is not None
        outcomes.append(found[2][0])
        if found[2][0] == INFEASIBLE:
            assert known.status is DesignStatus.INFEASIBLE
        if found[2][0] == OPTIMAL:
            assert known.status is DesignStatus.OPTIMAL
            assert found[1][0] == pytest.approx(known.objective, rel=1e-9)
            assert found[0][0] == pytest.approx(known.gain, rel=1e-6)  # flat minima determine no more of the gain
            assert one.landscape(one.axis.coordinate(found[0])).worst_ratio[0] <= 1 + 1e-10
    assert sum(outcome != UNCERTAIN for outcome in outcomes) >= 9, "or this says little"


def test_a_limit_that_is_only_touched_is_not_passed_over() -> None:
    """The peak of a ratio between two gains: with a limit just above it all gains are allowed, just below it not."""
    task = Task(letter(-0.3), FIRST, OBJECTIVES["f_2"], horizon=60.0)
    one = GainProblem(task=task, axis=GainAxis(low=-10.0, high=-0.01))
    u = np.linspace(*one.axis.span, 20001)
    limited = one.changed(constraints=[Constraint(name="virtual_force", limit=1.0)]).landscape(u).ratios[0]
    inner = np.flatnonzero((limited[1:-1] > limited[:-2]) & (limited[1:-1] > limited[2:])) + 1
    for limit in (*(limited[inner] * (1 + 1e-7)), *(limited[inner] * (1 - 1e-7)), float(limited.min()) * (1 - 1e-7)):
        close = one.changed(constraints=[Constraint(name="virtual_force", limit=float(limit))])
        found, known = search_compiled(close), GainEvidence(problem=close, settled=None)
        assert found is not None
        if found[2][0] == OPTIMAL:
            assert found[1][0] == pytest.approx(known.objective, rel=1e-9)
        assert found[2][0] != INFEASIBLE or known.status is DesignStatus.INFEASIBLE


def test_arrays_with_limits_hold_infeasible_designs() -> None:
    speeds = -np.linspace(0.05, 1.0, 40)
    task = Task(letter(speeds), POWER, F1, bounds=(-10.0, -0.01), constraints=[Constraint(name="excursion", limit=0.1)])
    whole = design_gain(task)
    alone = [design_gain(task.replace(scenario=letter(float(v)))) for v in speeds]
    assert [str(s) for s in whole.status] == [str(one.status.value) for one in alone]
    gains = np.array([np.nan if one.gain is None else one.gain for one in alone])
    np.testing.assert_allclose(whole.gain, gains, rtol=1e-7)
    strict = design_gain(task.replace(constraints=[Constraint(name="excursion", limit=1e-4)]))
    assert set(strict.status.tolist()) == {"infeasible"}
    assert np.isnan(strict.gain).all()


def test_what_the_search_does_not_know_is_declined() -> None:
    class Own(Objective):
        pass

    one = problem(letter(-0.3))
    assert search_compiled(one.changed(law="virtual-drag")) is None
    assert search_compiled(one.changed(objective=Own(terms=F1.terms))) is None
    assert search_compiled(one.changed(method="uniform-motion")) is None
    assert search_compiled(one.changed(evaluate=find_contact)) is None


FIELDS = {
    "obstacle velocity": lambda x: letter(-0.05 - 0.95 * x),
    "obstacle position": lambda x: Scenario(
        admittance=letter(-0.3).admittance, obstacle=Obstacle(position=0.02 + 0.04 * x, velocity=-0.3)
    ),
    "damping": lambda x: letter(-0.3, damping=10.0 + 20.0 * x),
    "mass": lambda x: letter(-0.3, mass=0.2 + 0.8 * x),
}


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("sensor", [FIRST, POWER], ids=lambda s: s.name)
def test_a_family_is_what_its_encounters_give_one_by_one(sensor: object, field: str) -> None:
    x = np.random.default_rng(3).random(600)
    found = find_family(problem(FIELDS[field](x), sensor))
    assert found is not None
    assert found[2].all()
    for i in range(0, 600, 40):
        alone = search_compiled(problem(FIELDS[field](float(x[i])), sensor))
        # interpolated to 1e-9; each alone is polished to some 1e-10
        assert found[0][i] == pytest.approx(alone[0][0], rel=5e-9)
        assert found[1][i] == pytest.approx(alone[1][0], rel=1e-9)


def test_a_family_may_have_its_optimum_at_a_bound() -> None:
    speeds = np.linspace(0.05, 1.0, 2000)
    found = find_family(problem(letter(-speeds), low=-0.8))
    assert found is not None
    # at 0.29 m/s the optimum reaches -0.8 N s; faster obstacles would need more, and close to it no scan is certain
    assert found[2][(speeds < 0.15) | (speeds > 0.5)].all()
    assert (found[0][speeds > 0.5] == -0.8).all()
    assert (found[0] >= -0.8).all()


@pytest.mark.parametrize("limits", [(), (Constraint(name="excursion", limit=0.09),)], ids=["free", "limited"])
@pytest.mark.parametrize("sensor", [FIRST, POWER], ids=lambda s: s.name)
def test_a_grid_is_what_its_encounters_give_one_by_one(sensor: object, limits: tuple[Constraint, ...]) -> None:
    """The excursion is limited by 0.09 m in a part of the grid only."""
    rng = np.random.default_rng(3)
    speeds, damping = 0.05 + 0.5 * rng.random((120, 1)), 10.0 + 10.0 * rng.random((1, 110))
    grid = problem(letter(-speeds, damping=damping), sensor).changed(constraints=limits)
    found = find_family(grid)
    assert found is not None
    assert found[2].mean() > 0.8  # fewest where the curve on which the limit becomes active crosses the grid
    gains, objectives, certain = (row.reshape(grid.task.scenario.shape) for row in found)
    for index in zip(*(rng.integers(0, n, 40) for n in gains.shape), strict=True):
        alone = search_compiled(grid.at(index))
        assert alone is not None
        if certain[index]:
            # at a limit, grids use 1 - 1e-8 of it
            assert gains[index] == pytest.approx(alone[0][0], rel=1e-7 if limits else 5e-9)
            assert objectives[index] == pytest.approx(alone[1][0], rel=1e-7 if limits else 1e-9)


def test_encounters_without_an_axis_of_their_own_are_no_family() -> None:
    x = np.random.default_rng(4).random(600)
    assert find_family(problem(letter(-0.05 - x, damping=10.0 + x))) is None
    assert find_family(problem(letter(-0.05 - x[:100]))) is None, "too few"
    assert find_family(problem(letter(-0.05 - x[:30, None], damping=10.0 + x[:30]))) is None, "too few along each axis"


@pytest.mark.parametrize("limits", [(), (Constraint(name="excursion", limit=0.09),)], ids=["free", "limited"])
@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_of_equal_values_repeats_the_family_of_the_others(axis: int, limits: tuple[Constraint, ...]) -> None:
    speeds, equal = np.linspace(0.05, 0.4, 500), np.full(60, 10.0)
    velocity = np.expand_dims(-speeds, 1 - axis)
    grid = problem(letter(velocity, damping=np.expand_dims(equal, axis))).changed(constraints=limits)
    found, alone = find_family(grid), find_family(problem(letter(-speeds, damping=10.0)).changed(constraints=limits))
    assert found is not None
    assert alone is not None
    for row, one in zip(found, alone, strict=True):
        repeated = row.reshape(grid.task.scenario.shape).swapaxes(0, axis)
        assert np.array_equal(repeated, np.broadcast_to(one[:, None], repeated.shape))
    assert find_family(problem(letter(np.full(600, -0.3)))) is None, "equal encounters"


def test_a_short_axis_of_a_grid_is_not_interpolated() -> None:
    x = np.random.default_rng(4).random(500)
    every = problem(letter(-0.05 - x, damping=np.array([[10.0], [20.0]])))
    found = find_family(every)
    assert found is not None
    assert found[2].all()
    for k, damping in enumerate((10.0, 20.0)):
        alone = find_family(problem(letter(-0.05 - x, damping=damping)))
        assert alone is not None
        assert np.array_equal(found[0].reshape(2, -1)[k], alone[0])
