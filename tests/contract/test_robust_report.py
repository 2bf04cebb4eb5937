"""What figures and report of a robust design promise: legible, repeatable, self-contained, and true to the design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from figure_checks import assert_legible, visible_texts
from page_checks import EVIL, assert_sound, parse
from page_rows import line, row, table
from pretouch._core.errors import OutputExistsError, ResultUnavailableError
from pretouch._core.files import is_own_unchanged
from pretouch._core.warning_codes import split_code
from pretouch.designs import (
    ConditionalValueAtRisk,
    Constraint,
    DesignStatus,
    Quantile,
    Required,
    RobustDesign,
    SpringImpact,
    Task,
    excursion_objective,
)
from pretouch.designs.robust import robust
from pretouch.designs.robust.worst_case import WorstEncounter
from pretouch.motion import Admittance, Obstacle, Scenario
from pretouch.report import plots, report_html, write_report
from pretouch.sensors import ExponentialFirstOrder, InversePower
from pretouch.uncertainty import CorrelatedNormal, Empirical, Normal, TruncatedNormal, Uniform
from pretouch.uncertainty.ensemble import share_in_words
from refusals import refused
from robust_samples import with_robust_options

SCENARIO = Scenario(
    admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.0422, velocity=-0.3)
)
CONSTANT = ExponentialFirstOrder(scale=0.458, rate=-61.0)
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SPEED = {"obstacle.velocity": TruncatedNormal(location=-0.3, deviation=0.1, low=-0.6, high=-0.05)}
FITTED = CorrelatedNormal(
    names=("sensor.exponent", "sensor.distance_offset"),
    mean=(3.32, 0.0419),
    covariance=((1e-2, 1.8e-4), (1.8e-4, 4e-6)),
)


def limit(name: str, size: float, probability: float) -> Required:
    return Required(constraint=Constraint(name=name, limit=size), probability=probability)


def design(sensor: Any = CONSTANT, **given: Any) -> RobustDesign:
    asked = {"uncertainty": SPEED, "samples": 256, "validation": 256, "bounds": (-10.0, -0.01), **given}
    objective = excursion_objective(position_scale=0.5, velocity_scale=0.3)
    scenario = asked.pop("scenario", SCENARIO)
    return robust(Task(scenario, sensor, objective, **with_robust_options(**asked)))


DESIGNS: dict[str, Callable[[], RobustDesign]] = {
    "one input": design,
    "tail with limits": lambda: design(
        POWER,
        uncertainty={**SPEED, "calibration": FITTED, "obstacle.position": Uniform(low=0.038, high=0.046)},
        measure=ConditionalValueAtRisk(probability=0.9),
        constraints=[limit("relative_velocity", 0.1, 0.95), limit("excursion", 0.2, 1.0)],
    ),
    "impact": lambda: design(
        impact=SpringImpact(robot_mass=2.0, stiffness=1e4),
        constraints=[limit("impact_force", 14.0, 0.9), limit("time", 2.0, 0.9), limit("travel", 0.2, 0.9)],
        uncertainty={**SPEED, "plant.velocity": Empirical(samples=(0.0, 0.01, 0.03))},
    ),
    "both signs": lambda: design(bounds=(-2.0, 1.0)),
    "some never come": lambda: design(
        uncertainty={"obstacle.velocity": Uniform(low=-0.4, high=0.05)}, measure=Quantile(probability=0.8)
    ),
    "infeasible": lambda: design(constraints=[limit("relative_velocity", 0.01, 0.9), limit("excursion", 0.05, 0.9)]),
    "no-contact": lambda: design(
        scenario=replace(SCENARIO, obstacle=Obstacle(position=0.0422, velocity=0.3)),
        uncertainty={"obstacle.velocity": Normal(mean=0.3, deviation=0.01)},
    ),
}


@pytest.fixture(scope="module", params=DESIGNS)
def found(request: pytest.FixtureRequest) -> RobustDesign:
    return DESIGNS[request.param]()


@pytest.fixture(scope="module")
def one() -> RobustDesign:
    return DESIGNS["tail with limits"]()


@pytest.fixture(scope="module")
def page(one: RobustDesign) -> str:
    return report_html(one)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("draw", [plots.robust, plots.outcome, plots.price])
def test_figures_are_legible(draw: Any, found: RobustDesign) -> None:
    missing = {plots.price: found.gain is None, plots.outcome: found.status is DesignStatus.NO_CONTACT}
    if missing.get(draw):
        with pytest.raises(ResultUnavailableError):
            draw(found)
        return
    assert_legible(draw(found))


@pytest.mark.slow
def test_figures_show_the_numbers_of_the_design(one: RobustDesign) -> None:
    texts = " ".join(text for text, _ in visible_texts(plots.robust(one)))
    for gain in (one.gain, one.nominal_gain):
        assert f"{gain:.4g} N s".replace("-", "\u2212") in texts.replace("\n", " ")
    texts = " ".join(text for text, _ in visible_texts(plots.outcome(one)))
    assert "limit" in texts
    assert "relative velocity at contact" in texts
    texts = " ".join(text for text, _ in visible_texts(plots.price(one)))
    assert {"obstacle.velocity", "sensor.exponent", "best gain for each value"} <= {
        name for name in ("obstacle.velocity", "sensor.exponent", "best gain for each value") if name in texts
    }


def test_curves_of_shares_are_the_distribution_of_the_outcomes(one: RobustDesign) -> None:
    """Every point of a curve says in how many encounters the quantity is no larger."""
    axes = plots.robust(one).axes[1]
    own = one.outcomes().objective
    x, share = axes.lines[0].get_data()
    for at, below in list(zip(x, share, strict=True))[1:]:
        assert abs(np.mean(own <= at) - below / 100) <= 1 / len(own) + 1e-12


@pytest.mark.slow
def test_reports_are_sound_for_every_status(found: RobustDesign) -> None:
    page = report_html(found)
    words = assert_sound(page).words
    assert "Method and assumptions" in words
    status = {"optimal": "robust gain found", "infeasible": "infeasible", "no-contact": "no contact"}
    assert status[found.status.value] in words
    inputs = {cells[0] for cells in table(page, "Uncertain inputs")}
    assert inputs == {"uncertain input", *(m for n, k in found.uncertainty.items() for m in getattr(k, "names", (n,)))}
    assert ("Value of knowing one input exactly" in words) == (found.gain is not None)
    assert ('aria-label="Distributions of contact quantities"' in page) == (found.status is not DesignStatus.NO_CONTACT)


@pytest.mark.slow
def test_a_report_contains_the_numbers_of_the_design(one: RobustDesign, page: str) -> None:
    v = one.validation
    assert v is not None
    assert v.loss is not None
    head = table(page, "Results on fresh samples")[0]
    assert head == ["on 256 fresh samples (95 % confidence)", "robust gain", "nominal gain", "no mitigation"]
    measure = row(page, "mean of the worst 10 % of the objective")
    assert measure[:2] == [f"{v.value:.4g} ({v.low:.4g} to {v.high:.4g})", f"{v.nominal:.4g}"]
    assert row(page, "increase over the robust gain")[1].startswith(f"{100 * v.loss.relative:+.3g} \u00b1 ")
    own = np.abs(one.outcomes().state.relative_velocity)
    assert row(page, "relative velocity at contact, median")[0] == f"{np.sort(own)[127]:.3g} m/s"
    told = row(page, "sensor.exponent", "Uncertain inputs")
    assert told == ["normal, 3.32 with a standard deviation of 0.1, jointly with the other inputs of calibration"]
    (speed, excursion) = v.limits
    cells = row(page, "relative velocity at contact |l\u2032|", "Constraints")
    assert cells[:4] == ["0.1 m/s", "95 %", share_in_words(speed.held), share_in_words(speed.low)]
    assert excursion.held == 1
    cells = row(page, "largest excursion max |x \u2212 x_d|", "Constraints")
    assert cells[1:3] == ["every sample", "100 %"]
    assert cells[-1] == "met in every sample"
    assert row(page, "gain: bounds") == ["-10 N s to -0.01 N s"]
    tiles = parse(page).words
    for number in (f"{one.gain:.4g} N s robust gain D_p", f"{one.nominal_gain:.4g} N s nominal gain D_p"):
        assert number in tiles


@pytest.mark.slow
def test_text_and_page_say_the_same(one: RobustDesign, page: str) -> None:
    text = str(one)
    for label in ("end in contact", "time of contact, median", "scan", "seed"):
        assert line(text, label) == " ".join(row(page, label))
    assert "Value of knowing one input" not in text  # which takes its time


def test_a_new_distribution_is_one_class() -> None:
    """Design, object and page know it from what it says of itself."""

    @dataclass(frozen=True, kw_only=True)
    class Triangular(Uniform):
        def _quantile(self, probability: Any) -> Any:
            half = np.sqrt(0.5 * np.minimum(probability, 1 - probability))
            return self.low + (self.high - self.low) * np.where(probability < 0.5, half, 1 - half)

        def described(self, unit: str) -> str:
            return f"triangular, in {unit}"

    found = design(uncertainty={"obstacle.velocity": Triangular(low=-0.4, high=-0.2)})
    assert line(str(found), "obstacle.velocity") == "triangular, in m/s"
    told = found.to_dict()["uncertainty"]["obstacle.velocity"]
    assert told == {"kind": "Triangular", "low": -0.4, "high": -0.2}


def test_a_report_tells_what_the_objective_varies_with(one: RobustDesign, page: str) -> None:
    for share in one.importance:
        cells = row(page, share.name, "Importance of the uncertain inputs")
        assert cells[0] == f"{100 * share.alone:.1f} % \u00b1 {100 * share.alone_error:.1f}"
    alone = design()  # a single input has all of the variance
    assert "importance of the uncertain inputs" not in str(alone)


def test_a_report_tells_what_knowing_an_input_would_gain(one: RobustDesign, page: str) -> None:
    assert [price.name for price in one.prices] == [
        cells[0] for cells in table(page, "Value of knowing one input exactly")[1:]
    ]
    dearest = one.prices[0]
    most = float(np.nanmax(dearest.loss))
    assert most == max(float(np.nanmax(price.loss)) for price in one.prices)
    assert row(page, dearest.name, "Value of knowing one input exactly")[2].startswith(f"{100 * most:.3g} % at ")


def test_a_worst_encounter_is_shown_where_there_is_one(one: RobustDesign, page: str) -> None:
    worst = WorstEncounter(
        inputs={"obstacle.velocity": -0.6},
        value=0.31,
        bound=0.3101,
        lower=0.29,
        boxes=17,
        monotone={"obstacle.velocity": -1},
        encounters=((-0.6,),),
    )
    shown = replace(one, worst=worst)
    text = str(shown).partition("\nthe worst encounter\n")[2]
    assert text.split("\n")[0].split(maxsplit=1) == [
        "obstacle.velocity",
        "-0.6 m/s (the objective decreases with this input)",
    ]
    assert line(text, "upper bound for all encounters") == "0.3101"
    assert line(text, "boxes of inputs in the search") == "17"
    assert line(text, "lower bound for all gains") == "0.29"
    assert table(page, "The worst encounter") == []


def test_what_fresh_samples_refuse_is_a_warning(one: RobustDesign) -> None:
    """Fewer hold it than chance explains, and some never touch: both are said before anything else."""
    v = one.validation
    assert v is not None
    missed = replace(v.limits[0], held=0.5)
    warned = replace(one, validation=replace(v, limits=(missed,), reached=0.75))
    assert [split_code(text)[1][:30] for text in warned.warnings] == [
        "25 % of the fresh encounters e",
        "the limit of the relative velo",
    ]
    assert all(f"warning {text}\n" in str(warned) for text in warned.warnings)
    assert line(str(warned), "relative velocity at contact").endswith(" missed")


@pytest.mark.slow
def test_reports_repeat_and_recognize_themselves(tmp_path: Path) -> None:
    made = design()
    page = report_html(made)
    assert page == report_html(made)
    path = write_report(made, tmp_path / "robust.html")
    assert path.read_text(encoding="utf-8") == page
    assert is_own_unchanged(path)
    (tmp_path / "mine.html").write_text("mine", encoding="utf-8")
    with refused(str(tmp_path / "mine.html"), error=OutputExistsError, remedy="--force"):
        write_report(made, tmp_path / "mine.html")


@pytest.mark.slow
def test_reports_escape_what_users_wrote(one: RobustDesign) -> None:
    source = {"name": f"{EVIL}.toml".replace("/", ""), "text": f"# {EVIL}", "sha256": "abc"}
    page = report_html(one, source=source)
    assert_sound(page)
    assert "<script" not in page
