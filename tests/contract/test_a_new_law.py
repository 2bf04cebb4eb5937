"""What a reader sees names the number of the law that was asked about: under the drag phi [N s^2], never D_p [N s]."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.control import VirtualDrag
from pretouch.motion import DRAG, find_contact
from verification_samples import OBJECTIVE, SCENARIO, SENSOR, loop_of

BOUNDS = (1e-4, 0.1)
TASK = pt.Task(SCENARIO, SENSOR, OBJECTIVE, law="virtual-drag", bounds=BOUNDS)
LOOP = loop_of(noise=1e-3, relative_noise=2e-3)
LOOP = replace(LOOP, law=replace(LOOP.law, law=VirtualDrag(drag=0.0, noise=1e-3, relative_noise=2e-3)))
ON_LOOP = pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=LOOP, bounds=BOUNDS, verify=pt.VerifyOptions(runs=12))
SPEEDS = {"obstacle.velocity": pt.robust.Uniform(low=-0.4, high=-0.2)}

DAMPERS = re.compile(r"D_p|D\u209a|\bN s(?![\u00b2^/])|N\*s\b(?!\^|/)")
"""The number of the letter's damper and its unit; N s/m is that of a damping."""

ANSWERS: dict[str, Callable[[], Any]] = {
    "design": lambda: pt.design_gain(TASK),
    "a limit": lambda: pt.design_gain(TASK.replace(constraints=(pt.Constraint(name="excursion", limit=0.03),))),
    "infeasible": lambda: pt.design_gain(
        TASK.replace(bounds=(1e-4, 1e-3), constraints=(pt.Constraint(name="relative_velocity", limit=0.1),))
    ),
    "robust": lambda: pt.robust.design_robust_gain(
        TASK.replace(uncertainty=SPEEDS, robust=pt.robust.RobustOptions(samples=16, validation=16))
    ),
    "front": lambda: pt.pareto_front(TASK),
    "encounter": lambda: pt.simulate_encounter(ON_LOOP),
    "verdict": lambda: pt.verify_gain(ON_LOOP),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_text_and_page_name_the_number_of_the_law(name, tmp_path):
    found = ANSWERS[name]()
    pt.report.write_report(found, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    written = re.sub(r"<(style|script)\b.*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL)
    for text in (repr(found), str(found), written):
        assert not DAMPERS.findall(text), [text[max(m.start() - 60, 0) : m.end() + 20] for m in DAMPERS.finditer(text)]
    for text in (str(found), written):
        assert "\u03c6" in text
    assert re.search(r"N s(\^2|\u00b2)", written)


def test_the_drag_that_is_optimal_is_that_of_a_plain_scan():
    drags = np.geomspace(1e-3, 0.05, 4001)
    end = find_contact(SCENARIO, SENSOR, drags, law=DRAG).end
    plain = (end.displacement / 0.5) ** 2 + (end.relative_velocity / 0.3) ** 2
    best = int(np.argmin(plain))
    design = pt.design_gain(TASK)
    assert drags[best - 1] < design.gain < drags[best + 1]
    assert design.objective <= plain[best] <= design.objective * (1 + 1e-4)  # a step is 0.1 % of phi, and f is flat


def test_a_mitigating_drag_is_not_said_to_drive_toward_the_object():
    assert not [warning for warning in pt.design_gain(TASK).warnings if "drives the robot" in warning]


def test_the_damping_at_contact_is_that_of_the_law():
    design = pt.design_gain(TASK)
    felt = 2 * design.gain * SENSOR.log_slope(0.0) ** 2 * abs(design.result.end.relative_velocity)
    assert design.damping_at_contact == pytest.approx(felt, rel=1e-12)


@pytest.mark.parametrize("verb", [pt.design_admittance, pt.pareto_front])
def test_an_admittance_that_is_held_off_is_not_searched(verb):
    with pytest.raises(ValueError, match="stiffness and damping do not affect the encounter"):
        verb(TASK.replace(damping_ratio=(0.7, 2.0)))


def test_bounds_are_refused_in_the_unit_of_the_law():
    with pytest.raises(ValueError, match=r"found \[0\.1, 0\.0001\] N\*s\^2"):
        pt.design_gain(TASK.replace(bounds=(0.1, 1e-4)))


def test_a_sweep_says_the_unit_of_the_law():
    found = pt.sweep(TASK.replace(objective=None, bounds=None), axes={"gain": [0.01, 0.02]})
    assert found["gain"].attrs == {"long_name": "drag \u03c6", "units": "N*s^2"}
    designed = pt.sweep(TASK, axes={"obstacle.velocity": [-0.4, -0.2]})
    assert designed["gain"].attrs == {"long_name": "optimal drag \u03c6", "units": "N*s^2"}
