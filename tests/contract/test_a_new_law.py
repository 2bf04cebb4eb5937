"""What a reader sees names the number of the law in question: phi [N s^2] or c [N s^3], never D_p [N s]."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
import scenario_text
from made_law import Cube
from pretouch.control import VirtualDrag
from pretouch.motion import DRAG, find_contact
from pretouch.motion.laws import LAWS
from refusals import refused
from verification_samples import OBJECTIVE, SCENARIO, SENSOR, loop_of

pytestmark = pytest.mark.usefixtures("short_rest")

BOUNDS = (1e-4, 0.1)
TASK = pt.Task(SCENARIO, SENSOR, OBJECTIVE, law="virtual-drag", bounds=BOUNDS)
LOOP = loop_of(noise=1e-3, relative_noise=2e-3)
LOOP = replace(LOOP, law=replace(LOOP.law, law=VirtualDrag(drag=0.0, noise=1e-3, relative_noise=2e-3)))
ON_LOOP = pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=LOOP, bounds=BOUNDS, verify=pt.designs.VerifyOptions(runs=12))
SPEEDS = {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)}

CUBE = Cube(rate=3.0)
CUBES = TASK.replace(law=CUBE, bounds=(1e-3, 1.0))
CUBE_ON_LOOP = ON_LOOP.replace(loop=replace(LOOP, law=replace(LOOP.law, law=CUBE.sampled(0.0))), bounds=CUBES.bounds)
OF_GAIN = pt.Objective(terms=(pt.Term(quantity="gain", scale=0.1), pt.Term(quantity="relative_velocity", scale=0.3)))
LIMITS = (pt.Constraint(name="gain", limit=0.05), pt.Constraint(name="excursion", limit=0.1))

DAMPERS = re.compile(r"D_p|D\u209a|\bN s(?![\u00b2\u00b3^/])|N\*s\b(?!\^|/)")
"""The number of the letter's damper and its unit; N s/m is that of a damping."""

ANSWERS: dict[str, Callable[[], Any]] = {
    "design": lambda: pt.design(TASK),
    "a limit": lambda: pt.design(TASK.replace(constraints=(pt.Constraint(name="excursion", limit=0.03),))),
    "infeasible": lambda: pt.design(
        TASK.replace(bounds=(1e-4, 1e-3), constraints=(pt.Constraint(name="relative_velocity", limit=0.1),))
    ),
    "robust": lambda: pt.robust(
        TASK.replace(uncertainty=SPEEDS, robust=pt.designs.RobustOptions(samples=16, validation=16))
    ),
    "front": lambda: pt.pareto(TASK),
    "encounter": lambda: pt.simulate(ON_LOOP),
    "verdict": lambda: pt.verify(ON_LOOP),
}


OF_CUBE: dict[str, Callable[[], Any]] = {
    "design": lambda: pt.design(CUBES),
    "an objective and limits of the number": lambda: pt.design(CUBES.replace(objective=OF_GAIN, constraints=LIMITS)),
    "infeasible": lambda: pt.design(CUBES.replace(constraints=(pt.Constraint(name="gain", limit=1e-4),))),
    "admittance": lambda: pt.design(CUBES.replace(damping_ratio=(0.7, 1.3))),
    "robust": lambda: pt.robust(
        CUBES.replace(
            uncertainty=SPEEDS, robust=pt.designs.RobustOptions(samples=16, validation=16), constraints=LIMITS
        )
    ),
    "front": lambda: pt.pareto(
        CUBES.replace(pareto=pt.designs.ParetoOptions(quantities=("gain", "relative_velocity")), constraints=LIMITS)
    ),
    "encounter": lambda: pt.simulate(CUBE_ON_LOOP),
    "verdict": lambda: pt.verify(CUBE_ON_LOOP.replace(constraints=LIMITS)),
}
"""The same of a law of which pretouch knows nothing, and of its number as a quantity."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("answers", "name", "symbol", "unit"),
    [(ANSWERS, name, "\u03c6", r"N s(\^2|\u00b2)") for name in ANSWERS]
    + [(OF_CUBE, name, "c = |cube c", r"N s(\^3|\u00b3)") for name in OF_CUBE],
    ids=[*(f"drag: {name}" for name in ANSWERS), *(f"cube: {name}" for name in OF_CUBE)],
)
def test_text_and_page_name_the_number_of_the_law(answers, name, symbol, unit, tmp_path):
    found = answers[name]()
    pt.report.write_report(found, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    written = re.sub(r"<(style|script)\b.*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL)
    for text in (repr(found), str(found), written):
        assert not DAMPERS.findall(text), [text[max(m.start() - 60, 0) : m.end() + 20] for m in DAMPERS.finditer(text)]
    for text in (str(found), written):
        assert re.search(symbol, text)
    assert re.search(unit, written)


def test_a_number_that_is_optimal_is_the_letters_gain_over_the_cubes_factor():
    """A search ends where the objective no longer changes, which tells a minimum to the root of rounding, 1e-8."""
    letter = pt.design(TASK.replace(law="virtual-damper", bounds=(-9.0, -9e-3)))
    assert pt.design(CUBES).gain == pytest.approx(-letter.gain / 9, rel=1e-6)
    assert pt.design(CUBES).damping_at_contact == pytest.approx(letter.damping_at_contact, rel=1e-6)


def test_the_drag_that_is_optimal_is_that_of_a_plain_scan():
    drags = np.geomspace(1e-3, 0.05, 4001)
    end = find_contact(SCENARIO, SENSOR, drags, law=DRAG).end
    plain = (end.displacement / 0.5) ** 2 + (end.relative_velocity / 0.3) ** 2
    best = int(np.argmin(plain))
    design = pt.design(TASK)
    assert drags[best - 1] < design.gain < drags[best + 1]
    assert design.objective <= plain[best] <= design.objective * (1 + 1e-4)  # a step is 0.1 % of phi, and f is flat


def test_a_mitigating_drag_is_not_said_to_drive_toward_the_object():
    assert not [warning for warning in pt.design(TASK).warnings if "moves the robot toward" in warning]


def test_the_damping_at_contact_is_that_of_the_law():
    design = pt.design(TASK)
    felt = 2 * design.gain * SENSOR.log_slope(0.0) ** 2 * abs(design.result.end.relative_velocity)
    assert design.damping_at_contact == pytest.approx(felt, rel=1e-12)


def test_one_more_entry_in_the_list_of_laws_is_all_that_files_need(monkeypatch, tmp_path):
    monkeypatch.setitem(LAWS, "cube", Cube(rate=1.0))
    path = tmp_path / "cube.toml"
    bounds = scenario_text.replaced('["-10 N*s", "-0.01 N*s"]', '["0.001 N*s^3", "1 N*s^3"]')
    path.write_text(bounds + '[law]\nkind = "cube"\nrate = "3 1/s"\n', encoding="utf-8")
    task = pt.load_scenario(path)
    assert task.law == CUBE
    assert pt.design(task).headline.startswith("Optimal cube c = 0.08293 N s\u00b3")
    assert pt.Task(SCENARIO, SENSOR, law="cube").law == Cube(rate=1.0)


@pytest.mark.parametrize("verb", [pt.design, pt.pareto])
def test_an_admittance_that_is_held_off_is_not_searched(verb):
    with refused("damping_ratio", error=ValueError):
        verb(TASK.replace(damping_ratio=(0.7, 2.0)))


def test_bounds_are_refused_in_the_unit_of_the_law():
    with refused("bounds", error=ValueError, value=(0.1, 0.0001)):
        pt.design(TASK.replace(bounds=(0.1, 1e-4)))


def test_a_sweep_says_the_unit_of_the_law():
    found = pt.sweep(TASK.replace(objective=None, bounds=None), axes={"gain": [0.01, 0.02]})
    assert found["gain"].attrs == {"long_name": "drag \u03c6", "units": "N*s^2"}
    designed = pt.sweep(TASK, axes={"obstacle.velocity": [-0.4, -0.2]})
    assert designed["gain"].attrs == {"long_name": "optimal drag \u03c6", "units": "N*s^2"}
    cubes = pt.sweep(CUBES.replace(constraints=LIMITS), axes={"constraint.gain": [0.02, 0.04]})
    assert cubes["constraint.gain"].attrs["units"] == cubes["gain"].attrs["units"] == "N*s^3"
