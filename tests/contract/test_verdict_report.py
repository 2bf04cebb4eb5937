"""What figures and report of a verdict promise: legible, repeatable, self-contained, and true to the verdict."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from figure_checks import assert_legible, visible_texts
from loop_samples import BareLaw
from page_checks import EVIL, assert_sound, parse
from pretouch._core.errors import OutputExistsError, ResultUnavailableError
from pretouch._core.files import is_own_unchanged
from pretouch.design.robust.wording import share_in_words
from pretouch.report import (
    verdict_figure,
    verdict_gain_figure,
    verdict_report_html,
    verdict_run_figure,
    verdict_stability_figure,
    write_verdict_report,
)
from pretouch.simulation import ClosedLoop
from verification_samples import (
    BOUNDS,
    NOISY,
    OBJECTIVE,
    SCENARIO,
    SENSOR,
    controller,
    loop_of,
    velocity_limit,
    verdict,
)

COUNTS = pt.InversePower(scale=0.13, distance_offset=0.0419, exponent=3.32)
ROBOT = pt.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=60.0, coulomb_friction=1.0)
CONTACT = pt.HuntCrossley(stiffness=2e6, dissipation=1.0)
SPEED = {"obstacle.velocity": pt.TruncatedNormal(location=-0.3, deviation=0.05, low=-0.4, high=-0.2)}
DRAWERS = (verdict_figure, verdict_run_figure, verdict_stability_figure, verdict_gain_figure)
STATUS = {"holds": "holds", "holds-narrowly": "holds narrowly", "does-not-hold": "does not hold", "no-gain": "no gain"}


@dataclass(frozen=True)
class TunedLaw(BareLaw):
    """A law of somebody's own: no `Controller`, so that nothing is known of its stability."""

    def with_gain(self, gain: float) -> TunedLaw:
        return replace(self, gain=gain)


def limit(name: str, size: float, probability: float = 1.0) -> pt.Required:
    return pt.Required(constraint=pt.Constraint(name=name, limit=size), probability=probability)


def pushing(part: str, sensor: Any, conditioning: dict[str, float], **options: Any) -> pt.Verdict:
    """A part's data sheet, a robot behind an impedance controller, and a contact with a force."""
    loop = ClosedLoop(
        law=controller(1e-3, **conditioning), chain=pt.sensor_part(part).chain, plant=ROBOT, contact=CONTACT
    )
    given = {"bounds": BOUNDS, "runs": 40, **options}
    return pt.verify_gain(SCENARIO, sensor, OBJECTIVE, loop, **given)


def tof(part: str, rate: float, *limits: pt.Required) -> pt.Verdict:
    return pushing(part, SENSOR, {"sensor_period": 1 / rate}, constraints=limits, runs=20)


CASES: dict[str, Callable[[], pt.Verdict]] = {
    "VCNL4010 that pushes": lambda: pushing(
        "VCNL4010",
        COUNTS,
        {"floor": 30.0, "sensor_period": 4e-3},
        uncertainty=SPEED,
        constraints=[
            limit("relative_velocity", 0.12, 0.9),
            limit("excursion", 0.2),
            limit("impact_force", 400.0, 0.9),
        ],
    ),
    "4x4 that oscillates": lambda: tof("VL53L5CX-4x4", 60.0, limit("excursion", 0.3)),
    "8x8 that is too slow": lambda: tof("VL53L5CX-8x8", 15.0, limit("relative_velocity", 0.12, 0.9)),
    "ideal robot": lambda: verdict(NOISY, constraints=[velocity_limit(0.1, 0.9)], runs=40),
    "no gain": lambda: verdict(NOISY, constraints=[velocity_limit(0.001)]),
    "a law of one's own": lambda: verdict(
        ClosedLoop(
            law=TunedLaw(gain=0.0, period=1e-3, hold=4e-3), chain=pt.SensorChain(rate=250.0, relative_noise=2e-3)
        ),
        runs=20,
    ),
    "one run, no changes": lambda: verdict(loop_of(), runs=1, changes=False),
    "never in time": lambda: verdict(
        replace(NOISY, horizon=0.47), runs=5, uncertainty={"obstacle.velocity": pt.Uniform(low=-0.22, high=-0.2)}
    ),
    "no mitigation at all": lambda: verdict(loop_of(), runs=3, gain=0.0, changes=False),
    "a gain that drives on": lambda: verdict(loop_of(), runs=3, gain=0.05, bounds=(-2.0, 1.0)),
    "a limit that is not simulated": lambda: verdict(
        NOISY,
        runs=10,
        constraints=[limit("drive_force", 30.0), limit("impact_force", 30.0, 0.5), limit("travel", 0.2)],
        impact=pt.SpringImpact(robot_mass=2.0, stiffness=1e4),
        changes=False,
    ),
}


@cache
def case(name: str) -> pt.Verdict:
    return CASES[name]()


@pytest.fixture(scope="module", params=CASES)
def found(request: pytest.FixtureRequest) -> pt.Verdict:
    return case(request.param)


@pytest.fixture(scope="module")
def one() -> pt.Verdict:
    return case("VCNL4010 that pushes")


def texts_of(figure: Any) -> str:
    return " ".join(text for text, _ in visible_texts(figure)).replace("\n", " ")


def drawn(draw: Any, of: pt.Verdict) -> Any:
    """The figure; None where there is nothing to draw, which must be for a reason that the verdict has."""
    missing = {
        verdict_figure: of.gain is None,
        verdict_run_figure: of.gain is None,
        verdict_stability_figure: of.stability is None,
        verdict_gain_figure: not np.isfinite(of.design.trade_off.objective).any(),
    }
    if missing[draw]:
        with pytest.raises(ResultUnavailableError):
            draw(of)
        return None
    return draw(of)


@pytest.mark.parametrize("draw", DRAWERS)
def test_figures_are_legible(draw: Any, found: pt.Verdict) -> None:
    figure = drawn(draw, found)
    if figure is not None:
        assert_legible(figure)


def test_the_cases_have_every_status() -> None:
    assert {case(name).status.value for name in ("no gain", "ideal robot")} == {"no-gain", "holds"}
    assert case("8x8 that is too slow").status is pt.VerdictStatus.DOES_NOT_HOLD
    assert case("4x4 that oscillates").status is pt.VerdictStatus.HOLDS_NARROWLY
    assert case("a law of one's own").stability is None


def test_curves_of_shares_are_the_distribution_of_the_runs(one: pt.Verdict) -> None:
    """Every point of a staircase says in how many runs the quantity is no larger, or just smaller."""
    figure = verdict_figure(one)
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "speed at contact |l\u2032| [m/s]",
        "impact force [N]",
        "largest contact force [N]",
        "largest excursion |x \u2212 x_d| [mm]",
        "time of contact [ms]",
        "largest robot speed |x\u2032| [m/s]",
    ]
    names = ("relative_velocity", "impact_force", "peak_force", "largest_excursion", "time", "largest_speed")
    factors = (1.0, 1.0, 1.0, 1e-3, 1e-3, 1.0)
    for axes, name, factor in zip(figure.axes, names, factors, strict=True):
        lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
        own = np.abs(getattr(one.mitigated, name)) / factor
        x, share = lines[-1].get_data() if name in {"largest_excursion", "largest_speed"} else lines[1].get_data()
        below = [(own < at * (1 - 1e-12)).mean() for at in x]
        upto = [(own <= at * (1 + 1e-12)).mean() for at in x]
        assert np.all(share >= 100 * np.array(below) - 1e-9)
        assert np.all(share <= 100 * np.array(upto) + 1e-9)
        assert share[-1] == 100


def test_runs_that_end_without_contact_leave_a_curve_below_the_whole() -> None:
    some = verdict(replace(NOISY, horizon=0.5), runs=40, uncertainty=SPEED, changes=False)
    share = float(some.mitigated.touched.mean())
    assert 0 < share < 1
    without, with_gain = verdict_figure(some).axes[0].lines[:2]
    assert with_gain.get_ydata()[-1] == pytest.approx(100 * share)
    assert without.get_ydata()[-1] == 100
    none = case("never in time")
    assert none.reached.simulated == 0
    assert set(verdict_figure(none).axes[0].lines[1].get_ydata()) == {0.0}
    assert "5 end without the one that is predicted" in parse(verdict_report_html(none)).words


def test_the_two_runs_are_the_median_and_the_worst_by_speed_and_end_where_they_touch(one: pt.Verdict) -> None:
    distance, velocity = verdict_run_figure(one).axes
    speed = np.sort(np.abs(one.mitigated.relative_velocity))
    marked = [tuple(map(float, np.ravel(line.get_data()))) for line in velocity.lines if len(line.get_xdata()) == 1]
    ends = sorted(y for _, y in marked)
    median, predicted = speed[(len(speed) - 1) // 2], abs(float(one.predicted.end.relative_velocity))
    assert ends == pytest.approx(sorted([-speed[-1], -median, -predicted]))
    for line in distance.lines[:3]:
        assert line.get_ydata()[-1] == pytest.approx(0.0, abs=1e-3)  # mm; the predicted contact is located to a root
    at = {"worst": int(np.argmax(np.abs(one.mitigated.relative_velocity)))}
    moving = one.mitigated.trace(at["worst"])
    x, y = velocity.lines[0].get_data()
    before = x < 1e3 * one.mitigated.time[at["worst"]] - 1e-9
    given = (moving.obstacle_position[1] - moving.obstacle_position[0]) / (moving.time[1] - moving.time[0])
    own = np.interp(x[before] / 1e3, moving.time, given - moving.velocity)
    assert y[before] == pytest.approx(own, abs=1e-9)  # the obstacle moves uniformly: its difference is its velocity


def test_the_figure_of_stability_shows_the_limit_half_of_it_and_the_gain(one: pt.Verdict) -> None:
    axes = verdict_stability_figure(one).axes[0]
    limits, half, own = (line.get_data() for line in axes.lines[:3])
    assert limits[0] == pytest.approx(1e3 * one.stability.limit.distance)
    assert limits[1] == pytest.approx(np.abs(one.stability.limit.gain))
    assert half[1] == pytest.approx(limits[1] / 2)
    assert set(own[1]) == {abs(one.gain)}
    texts = texts_of(verdict_stability_figure(one))
    for text in ("unstable above", "margin of 2", "verified gain", f"{abs(one.stability.strongest):.4g} N s"):
        assert text in texts


def test_the_figure_of_the_gain_shows_ideal_and_loop_with_their_optima(one: pt.Verdict) -> None:
    figure = verdict_gain_figure(one)
    texts = texts_of(figure).replace("\u2212", "-")
    for text in ("ideal", "on the loop", f"verified {one.gain:.4g} N s", f"best on the loop {one.loss.loop_gain:.4g}"):
        assert text in texts
    marked = [tuple(map(float, np.ravel(x.get_data()))) for x in figure.axes[0].lines if len(x.get_xdata()) == 1]
    for point in (
        (-one.design.gain, one.design.objective),
        (-one.gain, one.loss.objective),
        (-one.loss.loop_gain, one.loss.loop_objective),
    ):
        assert any(np.allclose(point, at) for at in marked)


def test_gains_that_miss_a_limit_are_thin_and_grey() -> None:
    of = case("ideal robot")
    axes = verdict_gain_figure(of).axes[0]
    grey = [line for line in axes.lines if line.get_linewidth() < 1 and len(line.get_xdata()) > 10]
    loud = [line for line in axes.lines if line.get_linewidth() > 1.5 and len(line.get_xdata()) > 10]
    assert len(grey) == len(loud) == 2  # in the ideal world and on the loop
    curve = of.loss.curve
    shown = np.isfinite(loud[1].get_ydata())
    assert np.array_equal(
        np.sort(-curve.gain[curve.standing >= 1 - 1e-12])[: shown.sum()], np.sort(loud[1].get_xdata()[shown])
    )


def test_reports_are_sound_for_every_status(found: pt.Verdict) -> None:
    page = verdict_report_html(found)
    words = assert_sound(page).words
    assert STATUS[found.status.value] in words
    assert found.status.meaning in words
    assert found.headline in words
    for text in (*found.warnings, *found.assumptions):
        assert text in words
    for reason in found.reasons:
        assert reason[1:] in words
    for change in found.changes:
        assert change.sentence in words
    assert "Whether a robot cell is acceptable is for its integrator to assess" in words
    sections = {
        "What was tried": bool(found.changes),
        "Predicted and simulated": found.gain is not None,
        "Is the sensor fast enough?": found.gain is not None,
        "What this rests on": found.gain is not None,
        "What to look at": bool(found.warnings),
        "The loop": True,
        "Provenance": True,
    }
    for title, shown in sections.items():
        assert (f" {title} " in words) == shown, title
    shown = [sections_of(page).index(title) for title, there in sections.items() if there]
    assert shown == sorted(shown)
    assert page.count("<figure") == sum(drawn(draw, found) is not None for draw in DRAWERS)


def sections_of(page: str) -> list[str]:
    return [re.sub(r"<[^>]*>", "", title) for title in re.findall(r"<h2[^>]*>(.*?)</h2>", page)]


def test_a_report_contains_the_numbers_of_the_verdict(one: pt.Verdict) -> None:
    words = parse(verdict_report_html(one)).words
    speed, force, s = one.comparison("relative_velocity"), one.comparison("impact_force"), one.stability
    for number in (
        f"{one.gain:.4g} N s",
        f"{speed.simulated.mean:.4g} m/s",
        f"{speed.simulated.worst:.4g} m/s",
        f"{speed.simulated.low:.3g} to {speed.simulated.high:.3g} m/s",
        f"{speed.predicted:.4g} m/s",
        f"{speed.unmitigated.mean:.4g} m/s",
        f"{force.simulated.mean:.4g} N",
        f"{one.comparison('peak_force').unmitigated.mean:.3g} N",
        f"\u00d7 {s.margin:.3g}",
        f"{s.strongest:.4g} N s",
        f"{s.lowest_rate:.3g} Hz",
        f"{s.lowest_rate_with_margin:.3g} Hz",
        f"{s.frequency:.4g} Hz",
        f"{one.loss.loop_gain:.4g} N s",
        f"{one.loss.objective:.5g}",
        "obstacle.velocity normal, -0.3 m/s",
        "250 Hz, one every 4 ms",
    ):
        assert number in words
    for check in one.limits:
        assert f"{share_in_words(check.held)} {share_in_words(check.low)}" in words
    assert "Each was simulated on the same 40 runs" in words
    assert "every run 100 %" in words


def test_the_change_that_helps_most_stands_out_with_its_numbers() -> None:
    slow = case("8x8 that is too slow")
    best = slow.best_change
    assert best is not None
    assert best.standing < 1
    words = parse(verdict_report_html(slow)).words
    after = words.index("The one change that would help most, though it alone is not enough")
    before = words.index("What was tried")
    box = words[after:before]
    assert best.sentence in box
    assert f"margin to instability \u00d7 {slow.stability.margin:.3g} \u00d7 {best.margin:.3g}" in box
    held = slow.limits[0].held
    assert f"relative velocity holds in {100 * held:.4g} % {100 * best.held:.4g} %" in box
    assert words.index("Why it does not hold") < after


def test_a_verdict_without_a_gain_says_how_near_each_limit_can_be_come() -> None:
    of = case("no gain")
    words = parse(verdict_report_html(of)).words
    (limited,) = of.design.constraints
    assert f"0.001 m/s {limited.best_value:.4g} m/s {limited.best_gain:.4g} N s" in words
    assert "Nothing was run" in words


def test_where_nothing_helps_or_nothing_was_tried_the_report_says_so() -> None:
    still = verdict(loop_of(period=1e-3, rate=1e3), runs=2)
    assert still.best_change is None
    assert "None of the changes that were tried helps by more than chance." in parse(verdict_report_html(still)).words
    assert "change" not in parse(verdict_report_html(case("one run, no changes"))).words.split("Predicted and")[0]


def test_reports_repeat_and_recognize_themselves(tmp_path: Path) -> None:
    made = case("one run, no changes")
    page = verdict_report_html(made)
    assert page == verdict_report_html(CASES["one run, no changes"]())
    path = write_verdict_report(made, tmp_path / "verdict.html")
    assert path.read_text(encoding="utf-8") == page
    assert is_own_unchanged(path)
    (tmp_path / "mine.html").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputExistsError, match=r"mine\.html"):
        write_verdict_report(made, tmp_path / "mine.html")


def test_reports_escape_what_users_wrote_and_show_where_a_curve_is_from() -> None:
    made = case("no gain")
    report = pt.rank_models(pt.read_calibration(Path(__file__).parents[2] / "examples" / "sensor.csv"))
    source = {"name": f"{EVIL}.toml".replace("/", ""), "text": f"# {EVIL}", "sha256": "abc"}
    page = verdict_report_html(made, calibration=report, source=source)
    words = assert_sound(page).words
    assert "<script" not in page
    assert "SHA-256 abc" in words
    assert "Its calibration: sensor.csv" in words
