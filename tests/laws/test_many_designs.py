"""An array of designs is what its encounters give one by one, whatever they are like."""

from __future__ import annotations

import numpy as np
import pytest

from pretouch._core.errors import ResultUnavailableError
from pretouch.designs import Constraint, DesignStatus, Task, Term, design_gain, excursion_objective, time_objective
from pretouch.designs.objectives import Objective
from pretouch.motion import Admittance, Obstacle, Plant, Scenario
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower
from refusals import refused

ADMITTANCE = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SENSORS = {
    "inverse power": InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "first order": ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "second order": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
}
OBJECTIVES = {
    "f_1": excursion_objective(position_scale=0.5, velocity_scale=0.3),
    "f_1 following": excursion_objective(position_scale=0.5, velocity_scale="obstacle speed"),
    "f_2": time_objective(time_scale=1.0, velocity_scale=0.3),
    "acceleration": Objective(
        terms=(Term(quantity="largest_acceleration", scale=5.0), Term(quantity="relative_velocity", scale=0.3))
    ),
}


def approaching(speeds: np.ndarray) -> Scenario:
    return Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.0422, velocity=-speeds))


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_each_design_of_an_array_is_the_one_of_its_encounter(sensor: str, objective: str) -> None:
    speeds = np.array([0.02, 0.05, 0.3, 0.7, 1.0])
    found = design_gain(Task(approaching(speeds), SENSORS[sensor], OBJECTIVES[objective], bounds=(-10.0, -0.01)))
    assert found.gain.shape == found.objective.shape == found.status.shape == speeds.shape
    for i in range(len(speeds)):
        one = found.at(i)
        assert one.scenario == approaching(speeds[i]), "the encounter at that place"
        assert found.status[i] == one.status
        # both polish the same flat minimum from other nodes: 1e-13 of the objective is 1e-7 of the gain at worst
        assert found.gain[i] == pytest.approx(one.gain, rel=1e-7)
        assert found.objective[i] == pytest.approx(one.objective, rel=1e-10)


def test_shapes_broadcast() -> None:
    scenario = Scenario(
        admittance=Admittance(mass=np.array([[0.5], [1.0]]), damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=np.array([-0.2, -0.3, -0.4])),
    )
    found = design_gain(Task(scenario, SENSORS["first order"], OBJECTIVES["f_1"], bounds=(-10.0, -0.01)))
    assert found.gain.shape == (2, 3)
    assert found.gain[1, 1] == pytest.approx(-0.8081335656, abs=1e-9)
    assert found.at(1, 1).gain == pytest.approx(found.gain[1, 1], rel=1e-7)
    assert repr(found) == "<GainDesign: 6 of 6 optimal>"


def test_an_array_may_hold_what_cannot_be_designed() -> None:
    """One optimum, one infeasible encounter, one without contact: each with its own status, and a run goes on."""
    scenario = Scenario(
        admittance=ADMITTANCE,
        obstacle=Obstacle(position=0.0422, velocity=np.array([-0.3, -3.0, 0.0])),
        plant=Plant(position=0.0),
    )
    found = design_gain(
        Task(
            scenario,
            SENSORS["inverse power"],
            OBJECTIVES["f_1"],
            bounds=(-2.0, -0.01),
            constraints=[Constraint(name="relative_velocity", limit=0.1)],
            horizon=5.0,
        )
    )
    assert found.status.tolist() == [DesignStatus.OPTIMAL, DesignStatus.INFEASIBLE, DesignStatus.NO_CONTACT]
    assert np.isfinite(found.gain).tolist() == [True, False, False]
    assert np.isnan(found.objective[1:]).all()


def test_a_limit_that_binds_somewhere_binds_there() -> None:
    speeds = np.linspace(0.1, 1.0, 7)
    limit = Constraint(name="excursion", limit=0.1)
    found = design_gain(
        Task(approaching(speeds), SENSORS["first order"], OBJECTIVES["f_1"], bounds=(-10.0, -0.01), constraints=[limit])
    )
    excursions = [found.at(i).result.contact.largest_excursion for i in range(len(speeds))]
    assert (np.array(excursions) <= 0.1 * (1 + 1e-9)).all()
    assert np.isclose(excursions, 0.1).any()


def test_an_array_says_how_to_get_the_evidence_of_one() -> None:
    found = design_gain(
        Task(approaching(np.array([0.2, 0.3])), SENSORS["first order"], OBJECTIVES["f_1"], bounds=(-10.0, -0.01))
    )
    with refused("trade_off", error=ResultUnavailableError):
        _ = found.trade_off
    assert set(found.to_dict()) == {"status", "gain", "objective"}
    assert found.at(1).certificate is not None
    assert "D_p" in str(found.at(1))


def test_an_empty_array_is_designed_at_once() -> None:
    found = design_gain(
        Task(approaching(np.zeros(0)), SENSORS["first order"], OBJECTIVES["f_1"], bounds=(-10.0, -0.01))
    )
    assert found.gain.shape == (0,)
