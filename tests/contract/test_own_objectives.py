"""An objective of a user's own is minimized, named and itemized as what it is, in text, on pages and in JSON."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from page_rows import line, row, table
from pretouch._core.vocabulary import words_for
from pretouch.designs import ImpactModel
from pretouch.motion import ContactState
from pretouch.report import write_report
from refusals import refused
from verification_samples import BOUNDS, NOISY, OBJECTIVE, QUICK, SCENARIO, SENSOR, verdict

pytestmark = pytest.mark.usefixtures("short_rest")

WEIGHTS = (40.0, 11.0)


def whole(state: ContactState) -> Any:
    """The same objective for all of them: what is minimized does not depend on how it is handed over."""
    return 0.5 + WEIGHTS[0] * state.displacement**2 + WEIGHTS[1] * np.abs(state.relative_velocity)


class Overrides(pt.Objective):
    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Any:  # noqa: ARG002
        return whole(state)


class Declares(Overrides):
    def parts(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Any:  # noqa: ARG002
        return {
            "being there": np.full(np.shape(state.time), 0.5),
            "displacement": WEIGHTS[0] * state.displacement**2,
            "speed": WEIGHTS[1] * np.abs(state.relative_velocity),
        }


class DeclaresOnly(pt.Objective):
    parts = Declares.parts


class Misdeclares(Overrides):
    def parts(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Any:  # noqa: ARG002
        return {"displacement": WEIGHTS[0] * state.displacement**2}


@dataclass(frozen=True)
class Own:
    """No subclass: a class of the user's that can tell what a contact is worth."""

    weight: float = 1.0

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None) -> Any:  # noqa: ARG002
        return self.weight * whole(state)


class Rough(pt.Term):
    """A term that is not squared."""

    def value(self, state: ContactState, obstacle_speed: Any, impact: ImpactModel | None = None) -> Any:
        return np.sqrt(pt.Term.value(self, state, obstacle_speed, impact))


def scaled(state: ContactState, factor: float) -> Any:
    return factor * whole(state)


GIVEN: dict[str, tuple[Any, str, set[str]]] = {
    "subclass": (Overrides(), "Overrides", set()),
    "subclass with terms of another": (Overrides(terms=OBJECTIVE.terms, name="excursion"), "Overrides", set()),
    "subclass with items": (Declares(), "Declares", {"being there", "displacement", "speed"}),
    "subclass with items alone": (DeclaresOnly(), "DeclaresOnly", {"being there", "displacement", "speed"}),
    "subclass with items that miss": (Misdeclares(), "Misdeclares", set()),
    "class": (Own(), "Own", set()),
    "function": (whole, "whole", set()),
    "partial": (partial(scaled, factor=1.0), "scaled", set()),
    "lambda": (lambda state: whole(state), "a function without a name", set()),  # noqa: PLW0108 - it is what is tried
}
"""What is handed over, the name that it must go by, and its items."""


@pytest.fixture(params=list(GIVEN))
def given(request: pytest.FixtureRequest) -> tuple[Any, str, set[str]]:
    return GIVEN[request.param]


def page(write: Callable[..., Any], found: Any, folder: Path) -> str:
    path = folder / "page.html"
    write(found, path, overwrite=True)
    return re.sub(r"\s+", " ", path.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_design_says_what_was_minimized(given: tuple[Any, str, set[str]], tmp_path: Path) -> None:
    objective, name, items = given
    design = pt.design(pt.Task(SCENARIO, SENSOR, objective, bounds=BOUNDS))
    assert design.objective == pytest.approx(float(whole(design.result.end)), rel=1e-9)
    for gain in (0.9 * design.gain, 1.1 * design.gain):
        assert float(whole(pt.find_contact(SCENARIO, SENSOR, gain).contact)) > design.objective
    assert set(design.objective_parts) == items
    assert line(str(design), f"objective f ({name})") == f"{design.objective:.5g}"
    plain = json.loads(json.dumps(design.to_dict(), allow_nan=False))
    assert plain["objective_name"] == name
    assert set(plain["objective_terms"]) == items
    if items:
        assert sum(plain["objective_terms"].values()) == pytest.approx(design.objective, rel=1e-9)
    text = page(write_report, design, tmp_path)
    assert row(text, f"objective f ({name})") == ["", "", f"{design.objective:.5g}"]
    for item, value in design.objective_parts.items():
        assert row(text, words_for(item), "The trade-off")[-1] == f"{value:.4g}"
    assert "L(20) and L(22)" not in text
    assert "thin line of equal objective" not in text
    assert ("the objective and its terms" in text) == bool(items)
    assert repr(design).startswith("<GainDesign: Optimal gain")


@pytest.mark.slow
@pytest.mark.parametrize("case", ["subclass with items", "class", "function"])
def test_other_verbs_say_it_too(case: str, tmp_path: Path) -> None:
    objective, name, _ = GIVEN[case]
    robust = pt.robust(
        pt.Task(
            SCENARIO,
            SENSOR,
            objective,
            bounds=BOUNDS,
            uncertainty={"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)},
            robust=pt.designs.RobustOptions(samples=32, validation=32),
        )
    )
    assert robust.to_dict()["objective_name"] == robust.definition.name == name
    assert row(page(write_report, robust, tmp_path), f"{name}: a user-defined objective") == ["", ""]
    assert str(robust).startswith("Robust gain")
    together = pt.design(pt.Task(SCENARIO, SENSOR, objective, bounds=BOUNDS, damping_ratio=(0.7, 1.3)))
    assert together.to_dict()["objective_name"] == name
    assert line(str(together), f"objective f ({name})") == f"{together.objective:.5g}"
    assert together.objective <= pt.design(pt.Task(SCENARIO, SENSOR, objective, bounds=BOUNDS)).objective
    front = pt.pareto(pt.Task(SCENARIO, SENSOR, bounds=BOUNDS, pareto=pt.designs.ParetoOptions(choice=together)))
    assert front.choice.gain == together.gain
    assert "knee" in page(write_report, front, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["subclass with terms of another", "class", "function"])
def test_a_verdict_is_given_by_the_same_objective(name: str, tmp_path: Path) -> None:
    """On a loop that is as good as ideal, what runs come to is what was predicted: to a step of the loop, 1e-4 s."""
    objective, called, _ = GIVEN[name]
    found = pt.verify(
        pt.Task(SCENARIO, SENSOR, objective, loop=QUICK, bounds=BOUNDS, verify=pt.designs.VerifyOptions(runs=2))
    )
    assert found.loss.objective == pytest.approx(found.loss.predicted, rel=5e-3)
    assert found.loss.predicted == pytest.approx(found.design.objective, rel=1e-9)
    assert found.to_dict()["objective_name"] == called
    assert f"objective ({called})" in str(found)
    assert row(page(write_report, found, tmp_path), f"{called}: a user-defined objective") == ["", ""]


@pytest.mark.slow
def test_a_sum_of_terms_stays_what_it_was(tmp_path: Path) -> None:
    design = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS))
    assert design.definition is OBJECTIVE
    assert design.to_dict()["objective_name"] == "excursion"
    assert "L(20) and L(22)" in page(write_report, design, tmp_path)
    found = verdict(NOISY, runs=2, changes=False)
    assert found.to_dict()["objective_name"] == "excursion"


def test_terms_without_a_weight_count_nothing_and_are_shown_as_that(tmp_path: Path) -> None:
    terms = (*OBJECTIVE.terms, pt.Term(quantity="time", scale=1.0, weight=0.0))
    design = pt.design(pt.Task(SCENARIO, SENSOR, pt.Objective(terms=terms, name="mine"), bounds=BOUNDS))
    same = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS))
    assert design.gain == pytest.approx(same.gain, rel=1e-7)  # where f is flat to rounding, a gain is known to its root
    assert design.objective_parts["time"] == 0
    assert sum(design.objective_parts.values()) == pytest.approx(design.objective, rel=1e-9)
    page(write_report, design, tmp_path)
    with refused("terms"):
        pt.Objective(terms=(pt.Term(quantity="time", scale=1.0, weight=0.0),))
    with refused("terms"):
        pt.Objective()


def test_two_terms_of_one_quantity_both_count(tmp_path: Path) -> None:
    twice = pt.Objective(terms=(*OBJECTIVE.terms, pt.Term(quantity="displacement", scale=0.25)))
    once = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3, position_weight=5.0)
    design = pt.design(pt.Task(SCENARIO, SENSOR, twice, bounds=BOUNDS))
    same = pt.design(pt.Task(SCENARIO, SENSOR, once, bounds=BOUNDS))
    assert design.gain == pytest.approx(same.gain, rel=1e-7)
    assert sum(design.objective_parts.values()) == pytest.approx(design.objective, rel=1e-9)
    text = page(write_report, design, tmp_path)
    terms = table(text, "The trade-off")
    shares = [float(cells[-1]) for cells in terms if cells[0] == "deviation from the reference at contact"]
    assert len(shares) == 2
    assert sum(shares) == pytest.approx(design.objective_parts["displacement"], rel=1e-3)  # four digits are printed


def test_a_term_of_ones_own_is_no_square(tmp_path: Path) -> None:
    objective = pt.Objective(terms=(Rough(quantity="displacement", scale=0.5), *OBJECTIVE.terms[1:]), name="rough")
    design = pt.design(pt.Task(SCENARIO, SENSOR, objective, bounds=BOUNDS))
    assert design.definition.name == "rough"
    end = design.result.end
    assert design.objective == pytest.approx(abs(end.displacement) / 0.5 + (end.relative_velocity / 0.3) ** 2, rel=1e-9)
    assert sum(design.objective_parts.values()) == pytest.approx(design.objective, rel=1e-9)
    assert "L(20) and L(22)" not in page(write_report, design, tmp_path)


def test_an_objective_that_is_nothing_at_its_best_is_designed(tmp_path: Path) -> None:
    """Every gain is as good as any other: a design without a loss, not a division by 0."""
    design = pt.design(pt.Task(SCENARIO, SENSOR, lambda state: 0 * state.time, bounds=BOUNDS, evaluate=NOISY))
    assert design.objective == 0
    assert str(design)
    assert json.dumps(design.to_dict(), allow_nan=False)
    page(write_report, design, tmp_path)


@pytest.mark.parametrize(
    ("objective", "fields"),
    [
        (3.0, {"argument": "objective", "value": 3.0}),
        (pt.Objective, {"argument": "objective"}),
        (None, {"argument": "objective"}),
        (lambda state: -state.time, {"argument": "objective"}),
        (lambda state: math.nan * state.time, {"argument": "objective"}),
        (lambda state: max(state.time, 0.1), {"argument": "objective"}),
        (lambda state: np.ones(3), {"argument": "objective"}),  # noqa: ARG005
        (lambda: 1.0, {"argument": "objective"}),
    ],
)
def test_what_is_no_objective_is_refused(objective: Any, fields: dict[str, Any]) -> None:
    with refused(**fields):
        pt.design(pt.Task(SCENARIO, SENSOR, objective, bounds=BOUNDS))


def test_arrays_and_sweeps_of_designs_take_one() -> None:
    several = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=np.array([-0.3, -0.25])))
    designs = pt.design(pt.Task(several, SENSOR, whole, bounds=BOUNDS))
    assert designs.gain[0] == pytest.approx(pt.design(pt.Task(SCENARIO, SENSOR, whole, bounds=BOUNDS)).gain, rel=1e-6)
    pytest.importorskip("xarray")
    swept = pt.sweep(pt.Task(SCENARIO, SENSOR, objective=whole, bounds=BOUNDS), {"obstacle.velocity": [-0.3, -0.25]})
    assert swept.gain.to_numpy() == pytest.approx(designs.gain, rel=1e-6)
    inputs = json.loads(swept.attrs["inputs"])["objective"]
    assert inputs["name"] == "whole"
    other = pt.sweep(pt.Task(SCENARIO, SENSOR, objective=Own(2.0), bounds=BOUNDS), {"obstacle.velocity": [-0.3, -0.25]})
    assert json.loads(other.attrs["inputs"])["objective"]["values"] != inputs["values"]


class OwnMean(pt.designs.Expected):
    def of(self, values: Any) -> Any:
        return 2 * np.mean(values, axis=-1)


class OwnWorst(pt.designs.WorstCase):
    label = "own"

    def of(self, values: Any) -> Any:
        return np.mean(values, axis=-1)

    estimate = pt.designs.WorstCase.estimate


@pytest.mark.parametrize(
    ("measure", "fields"), [(OwnMean(), {"argument": "measure"}), (OwnWorst(), {"argument": "measure"})]
)
def test_a_measure_that_would_be_told_as_another_is_refused(measure: Any, fields: dict[str, Any]) -> None:
    with refused(**fields):
        pt.robust(
            pt.Task(
                SCENARIO,
                SENSOR,
                OBJECTIVE,
                bounds=BOUNDS,
                uncertainty={"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)},
                robust=pt.designs.RobustOptions(measure=measure),
            )
        )
