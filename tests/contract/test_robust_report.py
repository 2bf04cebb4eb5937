"""What figures and report of a robust design promise: legible, repeatable, self-contained, and true to the design."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from figure_checks import assert_legible, visible_texts
from page_checks import EVIL, assert_sound, parse
from pretouch._core.errors import OutputExistsError, ResultUnavailableError
from pretouch._core.files import is_own_unchanged
from pretouch.design import Constraint, DesignStatus, SpringImpact, excursion_objective
from pretouch.design.robust import ConditionalValueAtRisk, Quantile, Required, RobustDesign, design_robust_gain
from pretouch.design.robust.result import WorstEncounter
from pretouch.design.robust.wording import share_in_words
from pretouch.motion import Admittance, Obstacle, Scenario
from pretouch.report import plots, report_html, write_report
from pretouch.sensors import ExponentialFirstOrder, InversePower
from pretouch.uncertainty import CorrelatedNormal, Empirical, Normal, TruncatedNormal, Uniform

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
    return design_robust_gain(SCENARIO, sensor, objective, **asked)


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
    "no-contact": lambda: design(uncertainty={"obstacle.velocity": Normal(mean=0.3, deviation=0.01)}),
}


@pytest.fixture(scope="module", params=DESIGNS)
def found(request: pytest.FixtureRequest) -> RobustDesign:
    return DESIGNS[request.param]()


@pytest.fixture(scope="module")
def one() -> RobustDesign:
    return DESIGNS["tail with limits"]()


@pytest.mark.parametrize("draw", [plots.robust, plots.outcome, plots.price])
def test_figures_are_legible(draw: Any, found: RobustDesign) -> None:
    missing = {plots.price: found.gain is None, plots.outcome: found.status is DesignStatus.NO_CONTACT}
    if missing.get(draw):
        with pytest.raises(ResultUnavailableError):
            draw(found)
        return
    assert_legible(draw(found))


def test_figures_show_the_numbers_of_the_design(one: RobustDesign) -> None:
    texts = " ".join(text for text, _ in visible_texts(plots.robust(one)))
    for gain in (one.gain, one.nominal_gain):
        assert f"{gain:.4g} N s".replace("-", "\u2212") in texts.replace("\n", " ")
    texts = " ".join(text for text, _ in visible_texts(plots.outcome(one)))
    assert "limit" in texts
    assert "relative speed at contact" in texts
    texts = " ".join(text for text, _ in visible_texts(plots.price(one)))
    assert {"obstacle.velocity", "sensor.exponent", "best for each value"} <= {
        name for name in ("obstacle.velocity", "sensor.exponent", "best for each value") if name in texts
    }


def test_curves_of_shares_are_the_distribution_of_the_outcomes(one: RobustDesign) -> None:
    """Every point of a curve says in how many encounters the quantity is no larger."""
    axes = plots.robust(one).axes[1]
    own = one.outcomes().objective
    x, share = axes.lines[0].get_data()
    for at, below in list(zip(x, share, strict=True))[1:]:
        assert abs(np.mean(own <= at) - below / 100) <= 1 / len(own) + 1e-12


def test_reports_are_sound_for_every_status(found: RobustDesign) -> None:
    words = assert_sound(report_html(found)).words
    assert "Method and assumptions" in words
    status = {"optimal": "robust gain found", "infeasible": "infeasible", "no-contact": "no contact"}
    assert status[found.status.value] in words
    for name in found.uncertainty:
        assert name in words or isinstance(found.uncertainty[name], CorrelatedNormal)
    assert ("What knowing one input would gain" in words) == (found.gain is not None)
    assert ("What encounters come to" in words) == (found.status is not DesignStatus.NO_CONTACT)


def test_a_report_contains_the_numbers_of_the_design(one: RobustDesign) -> None:
    words = parse(report_html(one)).words
    v = one.validation
    assert v is not None
    for number in (
        f"{one.gain:.4g} N s",
        f"{v.value:.4g}",
        f"{v.low:.4g} to {v.high:.4g}",
        f"{one.nominal_gain:.4g} N s",
    ):
        assert number in words
    assert "sensor.exponent normal, 3.32 with a standard deviation of 0.1, together with the others" in words
    (speed, excursion) = v.limits
    assert share_in_words(speed.held) in words
    assert share_in_words(speed.low) in words
    assert "every sample" in words
    assert excursion.held == 1
    assert "256 fresh, independent encounters" in words


def test_a_report_tells_what_the_objective_varies_with(one: RobustDesign) -> None:
    words = parse(report_html(one)).words
    assert "What the objective varies with" in words
    for share in one.importance:
        assert f"{share.name} {100 * share.alone:.1f} % ± {100 * share.alone_error:.1f}" in words
    alone = design()  # a single input has all of the variance
    assert "What the objective varies with" not in parse(report_html(alone)).words


def test_a_worst_encounter_is_shown_where_there_is_one(one: RobustDesign) -> None:
    from dataclasses import replace

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
    words = parse(report_html(shown)).words
    for text in ("The worst encounter", "-0.6 m/s, with which the objective only falls", "0.3101, for which 17 boxes"):
        assert text in words
    assert "none exceeds 0.3101 (17 boxes told apart)" in str(shown)
    assert "The worst encounter" not in parse(report_html(one)).words


def test_reports_repeat_and_recognize_themselves(tmp_path: Path) -> None:
    made = design()
    page = report_html(made)
    assert page == report_html(made)
    path = write_report(made, tmp_path / "robust.html")
    assert path.read_text(encoding="utf-8") == page
    assert is_own_unchanged(path)
    (tmp_path / "mine.html").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputExistsError, match=r"mine\.html"):
        write_report(made, tmp_path / "mine.html")


def test_reports_escape_what_users_wrote(one: RobustDesign) -> None:
    source = {"name": f"{EVIL}.toml".replace("/", ""), "text": f"# {EVIL}", "sha256": "abc"}
    page = report_html(one, source=source)
    assert_sound(page)
    assert "<script" not in page
