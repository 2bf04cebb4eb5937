"""A robust gain is the best for its samples, its promises hold on others, and it goes over into the nominal gain."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import optimize, stats

from pretouch._core.errors import ResultUnavailableError
from pretouch.designs import (
    ConditionalValueAtRisk,
    Constraint,
    DesignStatus,
    Expected,
    Measure,
    Objective,
    Quantile,
    Required,
    RobustDesign,
    Task,
    WorstCase,
    design_gain,
    excursion_objective,
)
from pretouch.designs.robust import robust
from pretouch.designs.robust.problem import RobustProblem
from pretouch.designs.search import GainAxis
from pretouch.motion import Admittance, Obstacle, Scenario, find_contact, solution
from pretouch.motion.scenario import scenario_with, sensor_with
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel
from pretouch.uncertainty import CorrelatedNormal, Interval, Normal, TruncatedNormal, Uniform, sample_inputs
from refusals import refused
from robust_samples import with_robust_options

SCENARIO = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.0422, velocity=-0.3)
)
CONSTANT = ExponentialFirstOrder(scale=0.458, rate=-61.0)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
CURVED = ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)
OBJECTIVE = excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)
SPEED = {"obstacle.velocity": TruncatedNormal(location=-0.3, deviation=0.1, low=-0.6, high=-0.05)}
BOTH = {**SPEED, "sensor.rate": Normal(mean=-61.0, deviation=2.0), "admittance.mass": Uniform(low=0.8, high=1.2)}
MEASURES = (Expected(), Quantile(probability=0.9), ConditionalValueAtRisk(probability=0.9))


def design(sensor: SensorModel = CONSTANT, *, scenario: Scenario = SCENARIO, **given: object) -> RobustDesign:
    asked = {"uncertainty": SPEED, "samples": 256, "validation": 256, "bounds": BOUNDS, **given}
    return robust(Task(scenario, sensor, asked.pop("objective", OBJECTIVE), **with_robust_options(**asked)))  # type: ignore[arg-type]


def limit(name: str, size: float, probability: float = 1.0) -> Required:
    return Required(constraint=Constraint(name=name, limit=size), probability=probability)


def each_alone(found: RobustDesign, gains: np.ndarray, objective: Objective = OBJECTIVE) -> np.ndarray:
    """The objective of every sample, each solved for itself: shape (gains, samples)."""
    drawn = sample_inputs(found.uncertainty, found.samples, seed=found.seed)
    columns = []
    for i in range(found.samples):
        values = {name: float(v[i]) for name, v in drawn.items()}
        own = {n.removeprefix("sensor."): v for n, v in values.items() if n.startswith("sensor.")}
        scenario = scenario_with(found.scenario, {n: v for n, v in values.items() if not n.startswith("sensor.")})
        result = find_contact(scenario, sensor_with(found.sensor, own), gains)
        columns.append(objective.value(result.contact, abs(scenario.obstacle.velocity)))
    return np.array(columns).T


DIRECT: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "expected value": lambda f: f.mean(axis=-1),
    "90 % quantile": lambda f: np.quantile(f, 0.9, axis=-1, method="inverted_cdf"),
    "mean of the worst 10 %": lambda f: np.sort(f)[..., -20:].mean(axis=-1),  # of 200
}


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.label)
def test_the_gain_is_the_best_for_its_samples(measure: Measure) -> None:
    """Against every encounter solved for itself, over a grid of gains and with SciPy's search in its best cell."""
    found = design(uncertainty=BOTH, measure=measure, samples=200)
    direct = DIRECT[measure.label]
    assert found.gain is not None
    assert found.value is not None
    # the same contacts by another path, each good to 1e-11
    assert found.value == pytest.approx(float(direct(each_alone(found, np.array([found.gain])))[0]), rel=1e-9)
    grid = -np.geomspace(0.01, 10.0, 400)
    values = direct(each_alone(found, grid))
    best = int(np.argmin(values))
    assert found.value <= values[best] * (1 + 1e-9)
    fine = optimize.minimize_scalar(
        lambda u: float(direct(each_alone(found, np.array([-math.exp(u)])))[0]),
        bounds=(math.log(-grid[best - 1]), math.log(-grid[best + 1])),
        method="bounded",
        options={"xatol": 1e-7},
    )
    # a quantile has many small valleys, of which SciPy finds one
    assert found.value <= fine.fun * (1 + 1e-9)
    assert found.value >= fine.fun * (1 - (1e-3 if isinstance(measure, Quantile) else 1e-9))
    if isinstance(measure, Expected):  # smooth: a value that is right to 1e-12 says where the minimum is to 1e-5
        assert found.gain == pytest.approx(-math.exp(fine.x), rel=1e-5)


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.label)
@pytest.mark.parametrize(
    ("sensor", "bounds"),
    [(CONSTANT, BOUNDS), (POWER, (-3.0, -0.05)), (CONSTANT, (-8.0, 0.5))],
    ids=["constant", "power", "both signs"],
)
def test_gains_that_are_left_out_never_change_the_answer(
    monkeypatch: pytest.MonkeyPatch, measure: Measure, sensor: SensorModel, bounds: tuple[float, float]
) -> None:
    asked = {"sensor": sensor, "measure": measure, "bounds": bounds, "samples": 64, "validation": 2}
    found = design(**asked)
    monkeypatch.setattr(RobustProblem, "lowest_needed", lambda self: float(self.axis.coordinate(self.axis.low)))
    whole = design(**asked)
    assert found.strongest > bounds[0]
    assert whole.strongest == bounds[0]
    # both refine the same valley: to 1e-9 where it is smooth; a quantile is refined to one of its corners
    rough = isinstance(measure, Quantile)
    assert found.value == pytest.approx(whole.value, rel=1e-4 if rough else 1e-10)
    assert found.gain == pytest.approx(whole.gain, rel=0.02 if rough else 1e-6)


MOTION_LIMITS = {
    "inactive": [limit("excursion", 0.2, 0.9)],
    "excursion": [limit("excursion", 0.09, 0.9)],
    "beside one at contact": [limit("excursion", 0.09), limit("relative_velocity", 0.2, 0.9)],
    "acceleration": [limit("acceleration", 3.0, 0.9)],
    "two": [limit("virtual_force", 8.0, 0.9), limit("travel", 0.12, 0.9)],
    "none can be held": [limit("speed", 0.001, 0.9)],
    "they exclude each other": [limit("virtual_force", 12.0, 0.9), limit("relative_velocity", 0.06, 0.9)],
}


@pytest.mark.parametrize("name", MOTION_LIMITS)
def test_limits_of_the_whole_motion_hold_at_the_gain(name: str) -> None:
    found = design(constraints=MOTION_LIMITS[name], samples=64, validation=64)
    assert (found.gain is None) == (name in {"none can be held", "they exclude each other"})
    if found.gain is not None:
        free = design(samples=64, validation=64)
        assert free.gain is not None
        assert (found.gain > free.gain + 0.01) == (name != "inactive")
        _, ratios = found.problem.values(found.gain)
        assert all(r.share(ratio) <= 1 for r, ratio in zip(found.limits, ratios, strict=True))


# --- constraints


def test_a_chance_constraint_is_active_and_fresh_samples_hold_it() -> None:
    p, count = 0.95, 2048
    required = limit("relative_velocity", 0.08, p)
    free = design(samples=count, validation=count)
    found = design(constraints=[required], samples=count, validation=count)
    assert found.status is DesignStatus.OPTIMAL
    assert found.gain is not None
    assert free.gain is not None
    assert found.gain < free.gain  # slower contacts need a stronger gain
    assert found.validation is not None
    (outcome,) = found.validation.limits
    # in the samples of the design: active, and held as often as it must be
    _, ratios = found.problem.values(found.gain)
    assert required.share(ratios[0]) == pytest.approx(1.0, abs=1e-8)
    assert np.mean(ratios[0] <= 1) >= p
    # two shares of `count` samples each differ by five of their standard errors once in a million
    assert abs(outcome.held - p) < 5 * math.sqrt(2 * p * (1 - p) / count)
    assert outcome.low < outcome.held
    assert outcome.magnitude == pytest.approx(0.08, rel=0.05)


def test_asking_for_a_little_more_shows_what_is_wanted() -> None:
    found = design(constraints=[limit("relative_velocity", 0.08, 0.97)], samples=2048, validation=2048)
    assert found.validation is not None
    # 0.97 held, less five standard errors of both shares and less 1.645 for the bound, is above 0.94
    assert found.validation.limits[0].low > 0.94


def test_a_constraint_that_must_always_hold_holds_in_every_sample() -> None:
    found = design(constraints=[Constraint(name="relative_velocity", limit=0.1)])
    assert found.gain is not None
    _, ratios = found.problem.values(found.gain)
    assert ratios.max() <= 1
    assert ratios.max() == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("size", [1e-6, 0.01])
def test_what_no_gain_holds_is_infeasible(size: float) -> None:
    found = design(constraints=[limit("relative_velocity", size, 0.9), limit("excursion", 0.1, 0.9)])
    assert (found.status, found.gain, found.value, found.validation) == (DesignStatus.INFEASIBLE, None, None, None)
    assert str(found).startswith("Infeasible: the relative velocity at contact cannot be limited to ")
    told = found.to_dict()
    assert told["status"] == "infeasible"
    least = next(entry for entry in told["reachable"] if entry["name"] == "relative_velocity")
    # the slowest contact of all gains: no other gain of a grid keeps 90 % below less
    _, ratios = found.problem.values(least["gain"])
    assert np.quantile(ratios[0], 0.9, method="inverted_cdf") * size == pytest.approx(least["magnitude"], rel=1e-9)
    for gain in -np.geomspace(0.01, 10, 30):
        _, ratios = found.problem.values(gain)
        assert np.quantile(ratios[0], 0.9, method="inverted_cdf") * size >= least["magnitude"] * (1 - 1e-9)
    if size < 1e-3:  # else the excursion has a say in what exceeds the limits least
        assert found.nearest_gain == least["gain"]
    with refused("price", error=ResultUnavailableError):
        found.price("obstacle.velocity")
    with refused("outcomes", error=ResultUnavailableError):
        found.outcomes()
    assert found.outcomes(-1.0).reached.all()


def test_no_contact_is_a_status_and_a_quantile_leaves_some_out() -> None:
    away = {"obstacle.velocity": Uniform(low=-0.4, high=0.1)}  # one fifth never comes
    for measure in (Expected(), ConditionalValueAtRisk(probability=0.5), Quantile(probability=0.9)):
        found = design(uncertainty=away, measure=measure)
        assert found.status is DesignStatus.NO_CONTACT
        assert "contact" in str(found)
    found = design(uncertainty=away, measure=Quantile(probability=0.7))
    assert found.status is DesignStatus.OPTIMAL
    assert found.validation is not None
    # 256 samples: 0.8 within five standard errors
    assert abs(found.validation.reached - 0.8) < 5 * math.sqrt(0.16 / 256)
    leaving = scenario_with(SCENARIO, {"obstacle.velocity": 0.15})
    never = design(
        scenario=leaving,
        uncertainty={"obstacle.velocity": Uniform(low=0.1, high=0.2)},
        measure=Quantile(probability=0.5),
    )
    assert never.status is DesignStatus.NO_CONTACT
    assert not any(never.outcomes(gain).reached.any() for gain in (BOUNDS[0], -1.0, BOUNDS[1]))  # solved, not proved


# --- what is promised


def test_intervals_hold_the_measure_of_all_encounters() -> None:
    """24 designs from few samples; what is true of each gain comes from 65,536 encounters."""
    for measure in MEASURES:
        covered = 0
        for seed in range(24):
            found = design(measure=measure, samples=64, validation=400, seed=2 * seed)  # seed + 1 draws the fresh ones
            assert found.validation is not None
            assert found.gain is not None
            true = _measured(found, measure, found.gain)
            covered += found.validation.low <= true <= found.validation.high
        # 93 % where the interval is asymptotic; a correct one misses more often once in 10,000 runs
        assert covered >= stats.binom.ppf(1e-4, 24, 0.93), measure.label


def _measured(found: RobustDesign, measure: Measure, gain: float) -> float:
    drawn = sample_inputs(found.uncertainty, 1 << 16, seed=77)
    several = scenario_with(found.scenario, drawn)
    state = find_contact(several, found.sensor, gain).contact
    return float(measure.of(OBJECTIVE.value(state, np.abs(several.obstacle.velocity))))


def test_the_same_seed_gives_the_same_design_and_another_another() -> None:
    one, again, other = (design(uncertainty=BOTH, seed=seed) for seed in (3, 3, 4))
    assert one.to_dict() == again.to_dict()
    assert str(one) == str(again)
    assert one.gain != other.gain
    assert one.validation is not None
    assert other.validation is not None
    assert one.validation.value != other.validation.value


def test_the_samples_of_the_validation_are_not_those_of_the_design() -> None:
    found = design(sampling="random")
    drawn = found.problem.ensemble.values["obstacle.velocity"]
    fresh = found.fresh.ensemble.values["obstacle.velocity"]
    assert not np.isin(drawn, fresh).any()


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.label)
def test_the_nominal_gain_is_what_is_left_as_uncertainty_goes(measure: Measure) -> None:
    nominal = design_gain(Task(SCENARIO, CONSTANT, OBJECTIVE, bounds=BOUNDS))
    slope = next(s.gain_derivative for s in nominal.sensitivities if s.name == "obstacle.velocity")
    for width in (1e-3, 1e-5):
        found = design(
            uncertainty={"obstacle.velocity": Normal(mean=-0.3, deviation=width)}, measure=measure, samples=256
        )
        assert found.nominal_gain == nominal.gain
        # every measure is the objective of an encounter within four deviations, so its optimum is that of one
        assert abs(found.gain - nominal.gain) <= 4 * abs(slope) * width
        assert found.value == pytest.approx(nominal.objective, rel=20 * width)


# --- the price


@pytest.mark.parametrize("name", [*BOTH, "sensor.exponent", "sensor.distance_offset"])
def test_knowing_more_never_costs(name: str) -> None:
    if name in BOTH:
        found = design(uncertainty=BOTH)
    else:
        known = CorrelatedNormal(
            names=("sensor.exponent", "sensor.distance_offset"),
            mean=(3.32, 0.0419),
            covariance=((1e-2, 1.8e-4), (1.8e-4, 4e-6)),
        )
        found = design(POWER, uncertainty={**SPEED, "calibration": known})
    price = found.price(name, count=21)
    assert price.value.shape == price.loss.shape == (21,)
    # both objectives are right to 1e-10
    assert (price.loss >= -1e-9).all()
    assert price.loss.max() > 1e-4
    i = int(np.argmin(np.abs(price.best_gain - found.gain)))
    slope = np.gradient(price.best_gain, price.value)[i]
    near = abs(price.best_gain[i] - found.gain) <= abs(slope) * (price.value[1] - price.value[0])
    assert near == (price.loss[i] < price.loss.max() / 20)  # where the best gain is the robust one, nothing is lost
    other = found.price(name, count=21, gain=1.1 * found.gain)
    assert found.price_of(1.1 * found.gain, price) == other
    with refused("price", value="plant.velocity"):
        found.price("plant.velocity")


def test_the_price_of_inputs_that_go_together_follows_them() -> None:
    """Exponent and offset of a fit move together, so that one alone says less about the gain than by itself."""
    mean, error, rho = (3.32, 0.0419), (0.1, 0.002), 0.99
    cross = rho * error[0] * error[1]
    known = CorrelatedNormal(
        names=("sensor.exponent", "sensor.distance_offset"),
        mean=mean,
        covariance=((error[0] ** 2, cross), (cross, error[1] ** 2)),
    )
    together = design(POWER, uncertainty={"calibration": known}).price("sensor.exponent", count=5)
    alone = design(POWER, uncertainty={"sensor.exponent": Normal(mean=mean[0], deviation=error[0])})
    apart = alone.price("sensor.exponent", count=5)
    assert np.ptp(together.best_gain) < np.ptp(apart.best_gain)
    moved = sensor_with(
        POWER,
        {
            "exponent": float(together.value[0]),
            "distance_offset": mean[1] + rho * error[1] / error[0] * (float(together.value[0]) - mean[0]),
        },
    )
    direct = design_gain(Task(SCENARIO, moved, OBJECTIVE, bounds=BOUNDS))
    assert together.best_gain[0] == pytest.approx(direct.gain, rel=1e-9)


# --- evidence


def test_what_is_shown_is_what_was_designed() -> None:
    found = design(uncertainty=BOTH)
    assert found.gain is not None
    assert found.validation is not None
    own = found.outcomes()
    assert own.gain == found.gain
    assert float(np.mean(own.objective)) == pytest.approx(found.validation.value, rel=1e-12)
    assert set(own.inputs) == set(BOTH)
    assert (own.magnitude("relative_velocity") > 0).all()
    curve = found.trade_off
    assert (np.diff(curve.gain) > 0).all()
    assert curve.feasible.all()
    assert float(np.interp(found.gain, curve.gain, curve.value)) == pytest.approx(found.value, rel=1e-3)
    assert curve.value.min() >= found.value * (1 - 1e-12)
    for shown, words in ((own, "<RobustOutcomes: 256 "), (curve, "<RobustTradeOff: "), (found, "<RobustDesign: D_p")):
        assert repr(shown).startswith(words)
        assert "\n" not in repr(shown)


# --- what makes no sense


@pytest.mark.parametrize(
    ("asked", "fields"),
    [
        (
            {"uncertainty": {"obstacle.velocity": Interval(low=-0.4, high=-0.2)}},
            {"argument": "uncertainty obstacle.velocity"},
        ),
        ({"uncertainty": {}}, {"argument": "uncertainty"}),
        (
            {"uncertainty": {"obstacle.speed": Uniform(low=0.1, high=0.2)}},
            {"argument": "uncertainty", "value": "obstacle.speed", "remedy": "obstacle.velocity"},
        ),
        (
            {"uncertainty": {"admittance.mass": Normal(mean=1.0, deviation=0.7)}},
            {"argument": "uncertainty", "value": -0.0954395},
        ),
        (
            {"uncertainty": {"sensor.rate": Normal(mean=-61.0, deviation=50.0)}},
            {"argument": "uncertainty", "value": 4.41453},
        ),
        (
            {
                "uncertainty": {
                    "obstacle.velocity": TruncatedNormal(location=-0.45, deviation=0.06, low=-0.6, high=-0.1)
                }
            },
            {"argument": "uncertainty obstacle.velocity"},
        ),
        ({"bounds": (-1.0, -2.0)}, {"argument": "bounds", "value": (-1.0, -2.0)}),
        ({"confidence": 1.0}, {"argument": "confidence", "value": 1.0, "limit": (0.0, 1.0)}),
        ({"samples": 0}, {"argument": "samples", "value": 0}),
        ({"seed": -1}, {"argument": "seed", "value": -1}),
        ({"constraints": [limit("time", 1.0), limit("time", 2.0)]}, {"argument": "constraint time"}),
    ],
)
def test_what_makes_no_sense_is_refused(asked: dict[str, object], fields: dict[str, Any]) -> None:
    with refused(**fields):
        design(**asked)


def test_a_worst_case_takes_intervals() -> None:
    found = design(uncertainty={"obstacle.velocity": Interval(low=-0.4, high=-0.2)}, measure=WorstCase())
    assert found.status is DesignStatus.OPTIMAL
    gains, speeds = np.append(np.geomspace(0.5, 2.0, 60) * found.gain, found.gain), np.linspace(-0.4, -0.2, 21)
    scenario = scenario_with(SCENARIO, {"obstacle.velocity": speeds[:, None]})
    worst = OBJECTIVE.value(find_contact(scenario, CONSTANT, gains).end, np.abs(speeds)[:, None]).max(axis=0)
    assert found.value == pytest.approx(worst[-1], rel=1e-9)  # at an end of the interval, which is on the grid
    assert worst[-1] <= worst.min() * (1 + 1e-9)
    assert worst[:-1].min() < 1.01 * worst[-1], "the grid of gains reaches the optimum's neighborhood"
    assert worst[0] > worst[-1] * (1 + 1e-3)
    assert worst[-2] > worst[-1] * (1 + 1e-3), "and a moved optimum is told from it"


def test_curves_that_have_no_likeness_are_solved_one_by_one() -> None:
    found = design(
        CURVED, uncertainty={"sensor.curvature": Normal(mean=474.0, deviation=20.0)}, samples=16, validation=4
    )
    assert found.strongest > BOUNDS[0]
    assert found.gain == pytest.approx(found.nominal_gain, rel=0.05)


@pytest.mark.parametrize("sensor", [CONSTANT, POWER, CURVED], ids=lambda s: s.name)
def test_contacts_and_peaks_of_a_problem_are_computed_in_one_pass(
    sensor: SensorModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    solved, solve = [], solution.contact_times

    def count(*args: Any, **options: Any) -> None:
        solved.append(len(args[4]))
        solve(*args, **options)

    limits = (limit("excursion", 0.2, 0.9), limit("relative_velocity", 0.1, 0.9))
    task = Task(SCENARIO, sensor, OBJECTIVE, bounds=BOUNDS, uncertainty=SPEED, constraints=limits)
    values = sample_inputs(SPEED, 64, seed=1)
    several = RobustProblem.over(task, GainAxis(low=-10.0, high=-0.01), values)
    monkeypatch.setattr(solution, "contact_times", count)
    objective, ratios = several.values(-0.8)
    assert sum(solved) == (0 if sensor is CONSTANT else 64)  # a constant slope has a closed form
    lazy = several.ensemble.contacts(-0.8)
    assert objective == pytest.approx(np.ravel(OBJECTIVE.value(lazy.end, several.ensemble.speed)), rel=1e-12)
    assert ratios[0] == pytest.approx(np.ravel(lazy.end.largest_excursion) / 0.2, rel=1e-12)
