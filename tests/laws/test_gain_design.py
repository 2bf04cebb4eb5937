"""What must hold for every design: nothing better is found by brute force, and every number follows from the others."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy

from encounters import CURVES
from pretouch.designs import (
    Constraint,
    DesignStatus,
    ElasticImpact,
    HertzImpact,
    Objective,
    SpringImpact,
    Task,
    Term,
    design_gain,
    excursion_objective,
    quantity_of,
    time_objective,
)
from pretouch.motion import Admittance, ContactStatus, Obstacle, Plant, Scenario, find_contact
from pretouch.sensors import CustomSensor, ExponentialFirstOrder, InversePower, Recessed, SensorModel
from refusals import refused

F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize(
    "objective",
    [
        F1,
        time_objective(time_scale=1.0, velocity_scale=0.1),
        Objective(terms=(Term(quantity="largest_acceleration", scale=5.0), Term(quantity="time", scale=0.3))),
    ],
    ids=["excursion", "time", "custom"],
)
def test_brute_force_finds_nothing_better(letter_encounter: Scenario, name: str, objective: Objective) -> None:
    sensor = CURVES[name]
    design = design_gain(Task(letter_encounter, sensor, objective, bounds=BOUNDS))
    gains = -np.geomspace(0.01, 10.0, 3001)
    everywhere = find_contact(letter_encounter, sensor, gains)
    values = np.where(everywhere.reached, objective.value(everywhere.end, 0.3), np.inf)
    assert design.objective <= values.min() * (1 + 1e-10)  # contacts of different kernels agree to 1e-11
    # the grid's best gain lies beside ours: one grid step in ln D is 0.0023
    assert abs(math.log(design.gain / gains[values.argmin()])) < 0.005
    assert design.certificate.at == "bound" or design.certificate.stationarity < 1e-6
    # the search takes contacts that are good to 1e-10, the result one of the guaranteed path
    assert design.objective == pytest.approx(sum(design.objective_parts.values()), rel=1e-10)


@pytest.mark.parametrize("moved", [0.95, 1.05, 1.3])
def test_the_certificate_contradicts_an_optimum_that_was_moved(
    letter_encounter: Scenario, letter_power: InversePower, moved: float
) -> None:
    """Its stationarity is df/du over f at the gain of the answer, here against differences of encounters."""
    design = design_gain(Task(letter_encounter, letter_power, F1, bounds=BOUNDS))
    assert design.certificate.stationarity < 1e-6
    gain = moved * design.gain
    around = find_contact(letter_encounter, letter_power, gain * np.exp([-1e-4, 0.0, 1e-4]))
    less, value, more = F1.value(around.end, 0.3)
    other = replace(design, settled=(DesignStatus.OPTIMAL, gain, float(value)))
    assert other.certificate.stationarity == pytest.approx(abs(more - less) / 2e-4 / value, rel=1e-4)
    assert other.certificate.stationarity > 0.005
    assert "first-order residual" in str(other)
    low, high = sorted(other.certificate.bracket)
    assert low <= design.gain <= high
    assert low <= gain <= high or abs(math.log(moved)) > 0.05, "the scan encloses the optimum by some 5 %"


def test_the_optimum_is_global_where_there_are_several(letter_encounter: Scenario) -> None:
    """An objective with a deep narrow valley far from the broad one; a local search from the middle misses it."""

    class Valleys(Objective):
        def value(self, state, obstacle_speed, impact=None):  # type: ignore[no-untyped-def]  # noqa: ARG002
            x = np.asarray(state.displacement)
            return 1.0 + (x + 0.09) ** 2 - 0.5 * np.exp(-(((x + 0.4) / 0.01) ** 2))

    objective = Valleys(terms=F1.terms)
    design = design_gain(Task(letter_encounter, CURVES["inverse-power"], objective, bounds=BOUNDS))
    assert design.result.end.displacement == pytest.approx(-0.4, abs=1e-3)
    assert len(design.certificate.local_minima) == 2


LIMITS = {
    "excursion": 0.05,
    "travel": 0.05,
    "relative_velocity": 0.07,
    "time": 0.3,
    "speed": 0.19,
    "acceleration": 4.0,
    "virtual_force": 4.0,
    "drive_force": 2.0,
    "impact_force": 7.0,
}
IMPACT = SpringImpact(robot_mass=0.5, stiffness=2e4)


@pytest.mark.parametrize("name", LIMITS)
def test_a_constraint_that_binds_is_met_exactly(letter_encounter: Scenario, name: str) -> None:
    sensor = CURVES["inverse-power"]
    free = design_gain(Task(letter_encounter, sensor, F1, bounds=BOUNDS))
    limit = Constraint(name=name, limit=LIMITS[name])
    design = design_gain(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=[limit], impact=IMPACT))
    (outcome,) = design.constraints
    assert limit.magnitude(free.result.end, IMPACT) > limit.limit, "the limit binds"
    assert design.status is DesignStatus.OPTIMAL
    assert outcome.active
    assert outcome.value <= outcome.limit
    assert outcome.margin == pytest.approx(0.0, abs=1e-9 * limit.limit)
    assert design.certificate.at == name
    # brute force: no feasible gain is better
    gains = -np.geomspace(0.01, 10.0, 3001)
    everywhere = find_contact(letter_encounter, sensor, gains)
    feasible = everywhere.reached & (limit.magnitude(everywhere.end, IMPACT) <= limit.limit)
    assert design.objective <= F1.value(everywhere.end, 0.3)[feasible].min() * (1 + 1e-9)


def test_infeasible_names_the_constraint_and_its_nearest_value(letter_encounter: Scenario) -> None:
    sensor = CURVES["inverse-power"]
    limits = [Constraint(name="relative_velocity", limit=0.02), Constraint(name="excursion", limit=0.7)]
    design = design_gain(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=limits))
    assert design.status is DesignStatus.INFEASIBLE
    assert design.gain is None
    speed, excursion = design.constraints
    assert not speed.achievable
    assert excursion.achievable
    assert speed.best_gain == -10.0
    assert speed.best_value == pytest.approx(0.0227711, rel=1e-5)


def test_constraints_that_exclude_each_other_are_reported_together(letter_encounter: Scenario) -> None:
    limits = [Constraint(name="relative_velocity", limit=0.06), Constraint(name="excursion", limit=0.06)]
    design = design_gain(Task(letter_encounter, CURVES["inverse-power"], F1, bounds=BOUNDS, constraints=limits))
    assert design.status is DesignStatus.INFEASIBLE
    assert all(o.achievable for o in design.constraints)
    assert all(o.value > o.limit for o in design.constraints)
    # at the nearest gain both are exceeded in the same proportion
    ratios = [o.value / o.limit for o in design.constraints]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-6)


def test_a_limit_that_no_gain_meets_and_those_that_it_conflicts_with_are_named_at_one_gain(
    letter_encounter: Scenario,
) -> None:
    limits = [Constraint(name=name, limit=limit) for name, limit in (("excursion", 5e-4), ("relative_velocity", 0.06))]
    limits.append(Constraint(name="time", limit=10.0))  # met, so it is no part of the conflict
    design = design_gain(Task(letter_encounter, CURVES["inverse-power"], F1, bounds=BOUNDS, constraints=limits))
    assert not design.constraints[0].achievable
    assert design.headline.count("D_p =") == 1
    gain = design.number.equals(float(design.nearest.gain))
    assert gain in design.headline
    assert all(name in design.headline for name in ("excursion", "relative velocity"))
    assert "time" not in design.headline


def test_no_contact_is_a_status(letter_first_order: ExponentialFirstOrder) -> None:
    """The plant is called back to -0.2 m, the obstacle rests at 0.03 m: never in contact."""
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.03), plant=Plant()
    )
    design = design_gain(Task(scenario, letter_first_order, F1, bounds=BOUNDS))
    assert design.status is DesignStatus.NO_CONTACT
    assert design.result is None
    assert any(text.startswith("PT307") for text in design.warnings)
    assert json.loads(json.dumps(design.to_dict(), allow_nan=False))["status"] == "no-contact"


def test_a_curve_that_starts_beyond_contact_asks_for_a_recess(letter_encounter: Scenario) -> None:
    curve = InversePower(scale=1e-4, distance_offset=0.002, exponent=2.0, minimum_distance=0.01)
    design = design_gain(Task(letter_encounter, curve, F1, bounds=BOUNDS))
    assert design.status is DesignStatus.NO_CONTACT
    assert any(text.startswith("PT307") and "recess" in text for text in design.warnings)
    sunk = design_gain(Task(letter_encounter, Recessed(sensor=curve, recess=0.01), F1, bounds=BOUNDS))
    assert sunk.status is DesignStatus.OPTIMAL


@pytest.mark.parametrize("name", ["inverse-power", "exponential-1", "recessed", "mittag-leffler"])
@pytest.mark.parametrize("limits", [(), (Constraint(name="excursion", limit=0.05),)], ids=["free", "constrained"])
def test_sensitivities_are_those_of_designing_again(
    letter_encounter: Scenario, name: str, limits: tuple[Constraint, ...]
) -> None:
    """d gain / d input against the difference of two designs, 1e-3 apart: good to its square."""
    sensor = CURVES[name]
    scenario = replace(letter_encounter, plant=Plant(position=0.001, velocity=-0.01))
    design = design_gain(Task(scenario, sensor, F1, bounds=BOUNDS, constraints=limits))
    found = {s.name: s for s in design.sensitivities}
    for part, field in (("obstacle", "velocity"), ("admittance", "damping"), ("plant", "position")):
        body = getattr(scenario, part)
        value, step = getattr(body, field), 1e-3 * max(abs(getattr(body, field)), 0.01)
        gains, values = [], []
        for sign in (1, -1):
            changed = replace(scenario, **{part: replace(body, **{field: value + sign * step})})
            again = design_gain(Task(changed, sensor, F1, bounds=BOUNDS, constraints=limits))
            gains.append(again.gain)
            values.append(again.objective)
        derivative = (gains[0] - gains[1]) / (2 * step)
        assert found[f"{part}.{field}"].gain_derivative == pytest.approx(derivative, rel=2e-4, abs=1e-6)
        change = found[f"{part}.{field}"].gain_change_per_percent  # the magnitude grows, also that of a velocity < 0
        assert change == pytest.approx(derivative * 0.01 * value, rel=2e-4, abs=1e-8)
        slope = (values[0] - values[1]) / (2 * step)
        assert found[f"{part}.{field}"].objective_derivative == pytest.approx(slope, rel=2e-4, abs=1e-6)


def test_an_admittance_without_stiffness_has_sensitivities(letter_encounter: Scenario) -> None:
    free = replace(letter_encounter, admittance=replace(letter_encounter.admittance, stiffness=0.0))
    names = {s.name for s in design_gain(Task(free, CURVES["inverse-power"], F1, bounds=BOUNDS)).sensitivities}
    assert {"obstacle.velocity", "admittance.damping"} <= names
    assert not {"admittance.stiffness", "admittance.damping_ratio"} & names


def test_the_sensor_scale_has_no_influence(letter_encounter: Scenario, letter_power: InversePower) -> None:
    design = design_gain(Task(letter_encounter, letter_power, F1, bounds=BOUNDS))
    (scale,) = (s for s in design.sensitivities if s.name == "sensor.scale")
    assert scale.gain_derivative * scale.value == pytest.approx(0.0, abs=1e-9)
    other = design_gain(Task(letter_encounter, replace(letter_power, scale=77.0), F1, bounds=BOUNDS))
    assert other.gain == pytest.approx(design.gain, rel=1e-9)


def test_what_counts_is_gain_times_slope(letter_encounter: Scenario) -> None:
    """Two sensors of constant slope: the gains differ as the slopes do, D_p g is the same."""
    designs = [
        design_gain(Task(letter_encounter, ExponentialFirstOrder(scale=1.0, rate=rate), F1, bounds=(-30.0, -0.001)))
        for rate in (-61.0, -20.0)
    ]
    assert designs[0].damping_at_contact == pytest.approx(designs[1].damping_at_contact, rel=1e-7)
    assert designs[0].gain * 61.0 == pytest.approx(designs[1].gain * 20.0, rel=1e-7)


def test_an_optimum_on_a_bound_says_so(letter_encounter: Scenario, letter_power: InversePower) -> None:
    design = design_gain(Task(letter_encounter, letter_power, F1, bounds=(-0.5, -0.01)))
    assert design.gain == -0.5
    assert design.certificate.at == "bound"
    assert design.warnings[0].startswith("PT301")


THROWN = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=Obstacle(position=0.0422),
    plant=Plant(velocity=1.2),
)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, []),
        ({"bounds": (-2.0, 0.5)}, []),
        ({"constraints": [Constraint(name="excursion", limit=0.08)]}, []),
        ({"bounds": (-0.5, -0.01)}, ["lies on its bound -0.5 N s"]),
        ({"bounds": (-10.0, -1.0)}, ["lies on its bound -1 N s"]),
        (
            {"method": "uniform-motion", "sensor": CURVES["exponential-2"]},
            ["the uniform motion L(16)-(19) does not start from the given state"],
        ),
        (
            {"scenario": THROWN, "bounds": (-2.0, -0.01)},
            [
                " scanned gains, the encounter ended without contact. The distance",
                "the lowest objective lies at the edge of contact",
            ],
        ),
        ({"scenario": THROWN, "bounds": (-0.1, -0.01)}, ["lies on its bound"]),
    ],
)
def test_a_warning_comes_where_it_must_and_nowhere_else(
    letter_encounter: Scenario, letter_power: InversePower, change: dict, said: list[str]
) -> None:
    given = {"bounds": BOUNDS, **change}
    scenario, sensor = given.pop("scenario", letter_encounter), given.pop("sensor", letter_power)
    warnings = design_gain(Task(scenario, sensor, F1, **given)).warnings
    assert len(warnings) == len(said), warnings
    for text, warning in zip(said, warnings, strict=True):
        assert text in warning


def test_a_motion_that_does_not_meet_its_balance_is_warned_of(
    letter_encounter: Scenario, letter_power: InversePower, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An output that is not that of the slope by one part in a million is, one in ten billion is no cause."""
    log_output = InversePower.log_output
    for error, warned in ((1e-10, False), (1e-6, True)):
        design = design_gain(Task(letter_encounter, letter_power, F1, bounds=BOUNDS))
        with monkeypatch.context() as other:
            other.setattr(InversePower, "log_output", lambda self, x, e=error: (1 + e) * log_output(self, x))
            said = [text for text in design.warnings if "impulse balance of the computed motion" in text]
        assert len(said) == warned
    residual = float(re.search(r"relative error of (\S+) \(usually at most", said[0]).group(1))
    assert residual == pytest.approx(1e-6, rel=1.0)  # one digit of a share of some 0.5 to 1.5 of the largest term


def test_bounds_may_pass_through_zero(letter_encounter: Scenario, letter_power: InversePower) -> None:
    design = design_gain(Task(letter_encounter, letter_power, F1, bounds=(-10.0, 0.5)))
    assert round(design.gain, 4) == -0.7463


def test_a_users_own_evaluator_is_designed_with(letter_encounter: Scenario, letter_power: InversePower) -> None:
    """Design asks nothing of the motion but contacts: one that is twice as effective halves the gain."""

    def twice(scenario: Scenario, sensor: SensorModel, gain: object) -> object:
        return find_contact(scenario, sensor, 2 * np.asarray(gain))

    design = design_gain(Task(letter_encounter, letter_power, F1, bounds=BOUNDS, evaluate=twice))  # type: ignore[arg-type]
    assert design.gain == pytest.approx(-0.7463451 / 2, rel=1e-6)


def test_a_minimum_flatter_than_a_parabola_is_no_corner(letter_encounter: Scenario, letter_power: InversePower) -> None:
    """Beside it (l' + 0.1)^4 is below the rounding of 1e-3 within some 3e-5 m/s: the place is known no better."""
    design = design_gain(
        Task(letter_encounter, letter_power, lambda state: (state.relative_velocity + 0.1) ** 4 + 1e-3, bounds=BOUNDS)
    )
    assert design.certificate is not None
    assert design.certificate.at == "interior"
    assert design.objective == pytest.approx(1e-3, rel=1e-14)
    assert design.result is not None
    assert design.result.end.relative_velocity == pytest.approx(-0.1, abs=1e-4)


def test_impact_forces_follow_energy_balance() -> None:
    """Both peak forces against the deflection at which the contact has taken up the kinetic energy."""
    spring = SpringImpact(robot_mass=2.0, obstacle_mass=3.0, stiffness=5e4)
    assert spring.reduced_mass == pytest.approx(1.2)
    deflection = 0.1 * math.sqrt(1.2 / 5e4)
    assert spring.peak_force(-0.1) == pytest.approx(5e4 * deflection, rel=1e-14)
    hertz = HertzImpact(robot_mass=2.0, effective_modulus=3e7, radius=0.008)
    k = 4 / 3 * 3e7 * math.sqrt(0.008)
    deflection = (5 / 4 * 2.0 * 0.2**2 / k) ** 0.4
    assert hertz.peak_force(0.2) == pytest.approx(k * deflection**1.5, rel=1e-13)


def test_the_peak_force_of_an_elastic_impact_has_one_formula() -> None:
    """Solved for the depth at which 1/2 mu v^2 = k d^(n+1) / (n+1), symbolically; spring and sphere are instances."""
    k, mu, v, d, n = sympy.symbols("k mu v d n", positive=True)
    energy = sympy.integrate(k * d**n, (d, 0, d), conds="none")
    depth = sympy.solve(sympy.Eq(energy, mu * v**2 / 2), d)[0]
    formula = k ** (1 / (n + 1)) * ((n + 1) / 2 * mu * v**2) ** (n / (n + 1))
    assert sympy.simplify(sympy.expand_log(sympy.log(k * depth**n / formula), force=True)) == 0
    speed = np.array([-0.05, 0.3])
    spring = SpringImpact(robot_mass=2.0, obstacle_mass=3.0, stiffness=1e4)
    sphere = HertzImpact(robot_mass=2.0, effective_modulus=1e7, radius=0.01)
    soft = ElasticImpact(robot_mass=2.0, stiffness=1e5, exponent=2.2)
    for impact, stiffness, exponent in ((spring, 1e4, 1.0), (sphere, 4 / 3 * 1e7 * 0.1, 1.5), (soft, 1e5, 2.2)):
        known = {k: stiffness, n: exponent, mu: impact.reduced_mass}
        forces = [float(formula.subs({**known, v: abs(at)})) for at in speed]
        slopes = [float(np.sign(at) * sympy.diff(formula, v).subs({**known, v: abs(at)})) for at in speed]
        assert impact.peak_force(speed) == pytest.approx(forces, rel=1e-13)
        assert impact.peak_force_slope(speed) == pytest.approx(slopes, rel=1e-13)
        same = ElasticImpact(robot_mass=2.0, obstacle_mass=impact.obstacle_mass, stiffness=stiffness, exponent=exponent)
        assert (same.peak_force(speed) == impact.peak_force(speed)).all()


def test_forces_need_the_physical_mass(letter_encounter: Scenario, letter_power: InversePower) -> None:
    contact = find_contact(letter_encounter, letter_power, -1.0).contact
    with refused("impact_force"):
        quantity_of("impact_force", contact)


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"bounds": (-0.1, -1.0)}, {"argument": "bounds", "value": (-0.1, -1.0)}),
        ({"bounds": (-1.0, math.nan)}, {"argument": "bounds"}),
        (
            {"constraints": [Constraint(name="time", limit=1.0), Constraint(name="time", limit=2.0)]},
            {"argument": "constraint time"},
        ),
        ({"method": "magic"}, {"argument": "method", "value": "magic"}),
        ({"horizon": -1.0}, {"argument": "horizon", "value": -1.0}),
    ],
)
def test_a_request_that_makes_no_sense_is_refused(
    letter_encounter: Scenario, letter_power: InversePower, change: dict, fields: dict[str, Any]
) -> None:
    with refused(**fields):
        design_gain(Task(letter_encounter, letter_power, F1, **{"bounds": BOUNDS, **change}))


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: Term(quantity="speeed", scale=1.0), {"argument": "quantity", "value": "speeed"}),
        (lambda: Term(quantity="time", scale=0.0), {"argument": "scale"}),
        (lambda: Term(quantity="time", scale="obstacle speed"), {"argument": "scale"}),
        (lambda: Term(quantity="time", scale=1.0, weight=-1.0), {"argument": "weight", "value": -1.0}),
        (lambda: Objective(terms=()), {"argument": "terms"}),
        (lambda: Constraint(name="excursion", limit=0.0), {"argument": "constraint excursion", "value": 0.0}),
        (lambda: Constraint(name="height", limit=1.0), {"argument": "constraint", "value": "height"}),
        (lambda: SpringImpact(robot_mass=0.0, stiffness=1.0), {"argument": "robot_mass", "value": 0.0}),
        (lambda: ElasticImpact(robot_mass=1.0, stiffness=1.0, exponent=0.5), {"argument": "exponent", "value": 0.5}),
    ],
)
def test_a_definition_that_makes_no_sense_is_refused(make: object, fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()  # type: ignore[operator]


def test_an_obstacle_at_rest_has_no_speed_to_scale_with(letter_first_order: ExponentialFirstOrder) -> None:
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=-0.035),
        plant=Plant(position=-0.1),
    )
    objective = time_objective(time_scale=1.0, velocity_scale="obstacle speed")
    with refused("scale", value="obstacle speed"):
        design_gain(Task(scenario, letter_first_order, objective, bounds=BOUNDS))


def test_a_users_own_curve_is_designed_with_like_any_other(letter_encounter: Scenario) -> None:
    power = CURVES["inverse-power"]
    own = CustomSensor(
        log_output_function=lambda d: -3.32 * np.log(d + 0.0419), log_slope_function=lambda d: -3.32 / (d + 0.0419)
    )
    ours = design_gain(Task(letter_encounter, power, F1, bounds=BOUNDS))
    theirs = design_gain(Task(letter_encounter, own, F1, bounds=BOUNDS))
    assert theirs.gain == pytest.approx(ours.gain, rel=1e-8)


def test_the_report_and_the_object_say_the_same(letter_encounter: Scenario, letter_power: InversePower) -> None:
    design = design_gain(
        Task(letter_encounter, letter_power, F1, bounds=BOUNDS, constraints=[Constraint(name="excursion", limit=0.2)])
    )
    found = json.loads(json.dumps(design.to_dict(), allow_nan=False))
    assert found["status"] == "optimal"
    assert found["gain"] == design.gain
    assert found["contact"]["time"] == design.result.contact.time
    assert found["contact"]["relative_velocity"] == design.result.contact.relative_velocity
    assert found["no_mitigation"]["relative_velocity"] == pytest.approx(-0.3)
    assert found["constraints"][0]["margin"] == pytest.approx(0.2 - 0.0969, abs=1e-4)
    curve = found["trade_off"]
    assert len({len(column) for column in curve.values()}) == 1
    assert min(o for o, ok in zip(curve["objective"], curve["feasible"], strict=True) if ok) >= found["objective"]
    assert "D_p = -0.7463 N s" in str(design)
    assert "\u22120.7463" in design._repr_html_()
    assert ContactStatus(design.result.status).label == "contact"


@pytest.mark.parametrize("spare", [1e-3, 1e-6, 1e-9])
def test_limits_may_leave_less_than_lies_between_two_gains_of_the_scan(
    letter_encounter: Scenario, spare: float
) -> None:
    """A stronger gain needs more excursion, a weaker one touches faster: both limits leave a little about -0.9 N s."""
    sensor = CURVES["inverse-power"]
    there = find_contact(letter_encounter, sensor, -0.9).contact
    limits = [
        Constraint(name="excursion", limit=there.largest_excursion * (1 + spare)),
        Constraint(name="relative_velocity", limit=abs(there.relative_velocity) * (1 + spare)),
    ]
    design = design_gain(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=limits))
    assert design.status is DesignStatus.OPTIMAL
    # both quantities change by about as much as the gain does, in proportion
    assert design.gain == pytest.approx(-0.9, rel=20 * spare)
    assert all(outcome.margin >= 0 for outcome in design.constraints)
    more = [Constraint(name=limit.name, limit=limit.limit * (1 - 3 * spare)) for limit in limits]
    none = design_gain(Task(letter_encounter, sensor, F1, bounds=BOUNDS, constraints=more))
    assert none.status is DesignStatus.INFEASIBLE
