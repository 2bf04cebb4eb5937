"""Every table, figure and section of the letter, computed again: what holds for all of them, and their numbers."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest

from figure_checks import assert_legible
from pretouch._core.blocks import tables_of
from pretouch.designs import Objective
from pretouch.letter import IDS, Agreement, Reproduction, inputs, reproduce
from pretouch.letter.parts import PARTS
from pretouch.letter.program import Program
from pretouch.motion import Admittance, Scenario
from pretouch.sensors import SensorModel
from refusals import refused

QUICK = [name for name in IDS if name not in {"figure-6", "one-gain", "constraints"}]


@cache
def reproduction(name: str) -> Reproduction:
    return reproduce([name]).reproductions[0]


def program(name: str) -> Program:
    return PARTS[name].experiment.PROGRAM


@pytest.mark.slow(keep=3)
@pytest.mark.parametrize("name", IDS)
def test_a_reproduction_holds_and_its_figure_is_legible(name: str) -> None:
    """One test for all, because the slow ones should run once."""
    found = reproduction(name)
    assert found.id == name
    assert found.holds, [f.title for f in found.findings if not f.holds]
    assert found.code == program(name).text
    assert found.parameters
    assert found.findings or found.comparisons or found.tables
    assert all(p.place and np.isfinite(p.value) for p in found.parameters)
    assert all(table.head and table.rows for table in tables_of(found.tables))
    assert_legible(found.figure)
    assert set(found.to_dict()) >= {"parameters", "comparisons", "findings", "numbers"}
    SPECIFIC.get(name, lambda _: None)(found)


# --- the programs beside the figures


@pytest.mark.parametrize("name", IDS)
def test_a_program_is_ten_to_twenty_lines_of_public_names(name: str) -> None:
    tree = ast.parse(program(name).text)
    imports = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    modules = {n.name for i in imports if isinstance(i, ast.Import) for n in i.names}
    modules |= {i.module or "" for i in imports if isinstance(i, ast.ImportFrom)}
    assert "pretouch" in modules
    assert {m.split(".")[0] for m in modules} <= {"numpy", "scipy", "pretouch"}
    assert not {m for m in modules if m.startswith("pretouch.")}, "only what `import pretouch as pt` gives"
    assert not [n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and n.attr.startswith("_")]
    body = [
        line for line in program(name).text.splitlines()[1:] if line.strip() and not line.startswith(("import", "from"))
    ]
    assert 10 <= len(body) <= 20
    assert ast.get_docstring(tree)


def test_a_program_holds_its_inputs_as_the_calls_that_make_them() -> None:
    lines = program("attraction").text.splitlines()
    assert "admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)" in lines
    assert "obstacle = pt.Obstacle(position=0.0422, velocity=-0.3)" in lines
    assert "scenario = pt.Scenario(admittance=admittance, obstacle=obstacle)" in lines  # earlier inputs by their names
    assert "gain = -1.0" in lines
    assert "import numpy as np" in lines
    assert "import numpy as np" not in program("figure-4").text  # which needs none


def _values(thing: Any, depth: int = 0) -> Iterator[Any]:
    yield thing
    if isinstance(thing, Mapping) and depth < 3:
        thing = list(thing.values())
    if isinstance(thing, list | tuple) and depth < 3:
        for part in thing[:3]:
            yield from _values(part, depth + 1)


@pytest.mark.parametrize("name", QUICK)
def test_a_program_works_on_the_printed_inputs(name: str) -> None:
    """The numbers in the program are those of the data that the report lists as its inputs."""
    variables = program(name).run()
    found = [v for key, value in variables.items() if not key.startswith("__") for v in _values(value)]
    curves = [s for s in found if isinstance(s, SensorModel)]
    printed = [inputs.sensor(key) for key in inputs.SENSORS]
    fitted = variables.get("fitted", {})
    assert curves
    assert all(curve in printed or curve in fitted.values() for curve in curves)
    encounters = [inputs.approach(), inputs.disruption()]
    for scenario in (s for s in found if isinstance(s, Scenario)):
        same = [e for e in encounters if e.obstacle == scenario.obstacle]
        assert same
        assert scenario.plant == same[0].plant or name == "attraction"
    assert all(a == encounters[0].admittance for a in found if isinstance(a, Admittance))
    for objective in (o for o in found if isinstance(o, Objective)):
        scales = {t.quantity: t.scale for t in objective.terms}
        assert abs(float(scales["displacement"])) == 0.5
        assert abs(float(scales.get("relative_velocity", -0.3))) == 0.3


# --- numbers that were computed independently (an eighth-order integrator, relative tolerance 1e-11)


def _table_2(found: Reproduction) -> None:
    numbers = found.numbers
    assert np.round(numbers["position"], 4).tolist() == [-0.0112, -0.0796, -0.0915, -0.1029, -0.1138, -0.1242, -0.6107]
    speeds = [-0.1993, -0.0877, -0.0815, -0.0765, -0.0723, -0.0688, -0.0228]
    assert np.round(numbers["relative_velocity"], 4).tolist() == speeds
    assert np.round(numbers["objective"], 4).tolist() == [0.4419, 0.1107, 0.1073, 0.1074, 0.1099, 0.1143, 1.4975]
    assert [round(g, 4) for g in numbers["optimal_gain"].values()] == [-0.7463, -0.8081, -0.6904, -0.7682]
    assert round(numbers["optimal_objective"], 5) == 0.10698
    assert np.allclose(numbers["position_term"] + numbers["velocity_term"], numbers["objective"], rtol=1e-14)


def _figure_4(found: Reproduction) -> None:
    assert [round(x, 4) for x in found.numbers["position_at_contact"].values()] == [-0.1242, -0.1353, -0.1378]


def _figure_5(found: Reproduction) -> None:
    assert [round(100 * r, 1) for r in found.numbers["reduction"].values()] == [77.1, 70.4, 74.4]


def _figure_6(found: Reproduction) -> None:
    gains, speeds = found.numbers["optimal_gain"], found.numbers["speed"]
    assert len(speeds) == 100
    shown = [int(np.argmin(np.abs(speeds - v))) for v in (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)]
    following, fixed = gains["following"]["inverse power"][shown], gains["fixed"]["inverse power"][shown]
    assert np.allclose(following, [-2.84, -1.55, -0.93, -0.746, -0.629, -0.675], rtol=0, atol=5e-3)
    assert np.allclose(fixed, [-0.397, -0.515, -0.649, -0.746, -0.900, -1.198], rtol=0, atol=5.01e-4)


def _table_3(found: Reproduction) -> None:
    numbers = found.numbers
    assert np.round(numbers["time_of_contact"][:5], 3).tolist() == [0.687, 1.751, 2.018, 2.284, 3.084]
    assert round(float(numbers["time_of_contact"][5]), 2) == 27.07
    assert round(numbers["force_per_speed"], 1) == 62.7
    low, high = numbers["force_per_speed_95"]
    assert low < 62.7 < high
    assert round(numbers["optimal_gain"], 4) == -0.5704


def _table_1(found: Reproduction) -> None:
    first, second = (found.numbers["fitted"][name] for name in ("exponential-1", "exponential-2"))
    assert [f"{v:.3g}" for v in first.values()] == ["0.46", "-60.8"]
    assert {k: f"{v:.3g}" for k, v in second.items()} == {"scale": "0.484", "rate": "-74.9", "curvature": "504"}


def _figure_3(found: Reproduction) -> None:
    assert round(1e3 * found.numbers["turning_distance_second_order"]) == 78


SPECIFIC = {
    "table-1": _table_1,
    "table-2": _table_2,
    "table-3": _table_3,
    "figure-3": _figure_3,
    "figure-4": _figure_4,
    "figure-5": _figure_5,
    "figure-6": _figure_6,
}


# --- agreement


def test_what_the_letter_prints_and_the_equations_give() -> None:
    """Where they disagree is known, number by number."""
    found = {c.name: c.agreement for name in QUICK for c in reproduction(name).comparisons}
    disagree = {name for name, agreement in found.items() if agreement is Agreement.DISAGREES}
    assert disagree == {
        "x at D_p = -0.7 N s",
        "x at D_p = -1.0 N s",
        "l' at D_p = -1.0 N s",
        "f_1 at D_p = -1.0 N s",
        "x at contact, second order L(19)",
        "trade-off factor from -0.5 to -0.6 N s",
        "trade-off factor from -0.6 to -0.7 N s",
    }
    within = {name for name, agreement in found.items() if agreement is Agreement.WITHIN_INPUTS}
    assert within == {"l' at D_p = -0.7 N s", "l' at D_p = -0.8 N s", "f_1, last column as -10 N s"}
    assert sum(agreement is Agreement.AGREES for agreement in found.values()) == 26
    assert sum(agreement is Agreement.MEASURED for agreement in found.values()) == 22


def test_every_disagreement_says_why() -> None:
    reasons = [c.reason for n in QUICK for c in reproduction(n).comparisons if c.agreement is Agreement.DISAGREES]
    assert all(len(reason) > 20 for reason in reasons)


# --- the verb


def test_an_unknown_name_is_answered_with_the_nearest_one() -> None:
    with refused("reproduce", value="Table_2", remedy="table-2"):
        reproduce(["Table_2"])


def test_the_order_is_that_of_the_letter_and_progress_names_each() -> None:
    seen: list[str] = []
    report = reproduce(["figure-4", "figure-3"], progress=seen.append)
    assert seen == [r.id for r in report.reproductions] == ["figure-3", "figure-4"]
