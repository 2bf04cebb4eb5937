"""The over-damped closed form in NumPy against the guaranteed path: what it calls solved is the first contact."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from pretouch.design import design_gain, excursion_objective
from pretouch.motion import Admittance, Obstacle, Plant, Reference, Scenario
from pretouch.motion.contact import ContactStatus
from pretouch.motion.kernels.layout import COLUMNS
from pretouch.motion.over_damped import STATES, solve_over_damped
from pretouch.motion.request import Request, make_request
from pretouch.motion.solution import _guaranteed
from pretouch.sensors import ExponentialFirstOrder

SENSOR = ExponentialFirstOrder(scale=0.458, rate=-61.0)


def letter_like(n: int) -> Request:
    rng = np.random.default_rng(1)
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-rng.uniform(0.05, 1.0, n)),
    )
    return make_request(scenario, SENSOR, -rng.uniform(0.05, 2.0, n), "auto", 600.0)


def wide(n: int) -> Request:
    """Every kind of encounter: swinging, critical, receding, accelerated, amplified, moving plants and references."""
    rng = np.random.default_rng(2)

    def sometimes(values: np.ndarray, share: float) -> np.ndarray:
        return np.where(rng.uniform(size=n) < share, values, 0.0)

    mass, stiffness = 10 ** rng.uniform(-1, 1, n), sometimes(10 ** rng.uniform(-1, 3, n), 0.9)
    critical = 2 * np.sqrt(mass * stiffness)
    damping = np.where(rng.uniform(size=n) < 0.2, critical, 10 ** rng.uniform(-1, 2, n))
    scenario = Scenario(
        admittance=Admittance(mass=mass, damping=damping, stiffness=stiffness),
        obstacle=Obstacle(
            position=0.05, velocity=rng.normal(-0.3, 0.4, n), acceleration=sometimes(rng.normal(0, 3, n), 0.2)
        ),
        plant=Plant(position=rng.uniform(-0.1, 0.045, n), velocity=sometimes(rng.normal(0, 0.3, n), 0.5)),
        reference=Reference(
            position=sometimes(rng.normal(0, 0.05, n), 0.3), velocity=sometimes(rng.normal(0, 0.2, n), 0.3)
        ),
    )
    gain = rng.choice([-1.0, 1.0], n, p=[0.85, 0.15]) * 10 ** rng.uniform(-5, 1, n)
    return make_request(scenario, SENSOR, gain, "auto", 30.0)


@pytest.mark.parametrize(("make", "least"), [(letter_like, 1.0), (wide, 0.15)])
def test_what_is_solved_is_the_first_contact_and_its_state(make, least: float) -> None:
    request = make(20_000)
    found, proved = solve_over_damped(request.columns, -61.0, request.horizon)
    rows, status = _guaranteed(request)
    assert proved.mean() >= least
    assert (status[proved] == ContactStatus.CONTACT).all()
    start = (request.column(5) - request.column(3))[proved]
    time = rows[proved, 0]
    assert tuple(found) == STATES
    for name in STATES:
        values = found[name][proved]
        guaranteed = rows[proved, COLUMNS.index(name)]
        # up to a thousand units of rounding are lost where terms cancel; each quantity beside its natural size
        natural = {"time": time, "displacement_integral": start * time, "displacement": start}.get(
            name, np.abs(guaranteed) + start / time
        )
        if name == "displacement_acceleration":
            d = (request.column(1) - 61.0 * request.column(10))[proved]
            natural = natural + np.abs(d / request.column(0)[proved] * rows[proved, COLUMNS.index("relative_velocity")])
        assert (np.abs(values - guaranteed) <= 2e-11 * (natural + np.abs(guaranteed))).all(), name


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("which", range(11))
def test_nothing_is_solved_from_numbers_that_are_none(bad: float, which: int) -> None:
    columns = [np.array([c]) for c in (1.0, 10.0, 25.0, 0.0, 0.0, 0.0422, -0.3, 0.0, 0.0, 0.0, -0.8)]
    assert solve_over_damped(tuple(columns), -61.0, 600.0)[1].all()
    columns[which] = np.array([bad])
    states, proved = solve_over_damped(tuple(columns), -61.0, 600.0)
    assert not proved.any() or which in {8, 9}, "the reference's own motion does not matter to the contact"
    assert all(np.isfinite(values[proved]).all() for values in states.values())


def test_a_closed_form_design_loads_no_compiled_core() -> None:
    code = """
import sys, pretouch as pt
admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
scenario = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
sensor = pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)
f_1 = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
design = pt.design_gain(scenario, sensor, f_1, bounds=(-10.0, -0.01))
print(design.gain, design.objective)
print([name for name in ("numba", "scipy", "matplotlib") if name in sys.modules])
print(design.result.contact.largest_excursion > 0.1, "numba" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    numbers, loaded, later = done.stdout.splitlines()
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.0422, velocity=-0.3)
    )
    f_1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
    compiled = design_gain(scenario, SENSOR, f_1, bounds=(-10.0, -0.01))
    gain, objective = map(float, numbers.split())
    # the objective is flat at its optimum: 1e-13 in it is 1e-7 in the gain at worst
    assert gain == pytest.approx(compiled.gain, rel=1e-7)
    assert objective == pytest.approx(compiled.objective, rel=1e-12)
    assert loaded == "[]"
    assert later == "True False", "the largest excursion is in the closed form, too"
