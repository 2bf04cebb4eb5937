"""What figures of a verdict promise: legible, and true to the verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import pretouch as pt
from figure_checks import assert_legible, visible_texts
from page_checks import parse
from pretouch.report import plots, report_html
from verdict_cases import CASES, DRAWERS, SPEED, case, drawn
from verification_samples import NOISY, verdict


@pytest.fixture(scope="module", params=CASES)
def found(request: pytest.FixtureRequest) -> pt.verification.Verdict:
    return case(request.param)


@pytest.fixture(scope="module")
def one() -> pt.verification.Verdict:
    return case("VCNL4010 that pushes")


def texts_of(figure: Any) -> str:
    return " ".join(text for text, _ in visible_texts(figure)).replace("\n", " ")


@pytest.mark.slow
@pytest.mark.parametrize("draw", DRAWERS)
def test_figures_are_legible(draw: Any, found: pt.verification.Verdict) -> None:
    figure = drawn(draw, found)
    if figure is not None:
        assert_legible(figure)


@pytest.mark.slow
def test_the_cases_have_every_status() -> None:
    assert {case(name).status.value for name in ("no gain", "ideal robot")} == {"no-gain", "holds"}
    assert case("8x8 that is too slow").status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert case("4x4 that oscillates").status is pt.verification.VerdictStatus.DOES_NOT_HOLD
    assert case("a law of one's own").status is pt.verification.VerdictStatus.HOLDS_NARROWLY
    assert case("a law of one's own").stability is None


@pytest.mark.slow
def test_curves_of_shares_are_the_distribution_of_the_runs(one: pt.verification.Verdict) -> None:
    """Every point of a staircase says in how many runs the quantity is no larger, or just smaller."""
    figure = plots.verdict(one)
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "relative velocity at contact |l\u2032| [m/s]",
        "peak impact force [N]",
        "peak contact force [N]",
        "largest excursion |x \u2212 x_d| [mm]",
        "time of contact [ms]",
        "largest plant speed |x\u2032| [m/s]",
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


def test_the_value_that_is_predicted_with_the_gain_is_the_one_that_is_named(one: pt.verification.Verdict) -> None:
    axes = plots.verdict(one).axes[0]
    rings = {float(line.get_xdata()[0]): line for line in axes.lines if len(line.get_xdata()) == 1}
    predicted = abs(float(one.predicted.end.relative_velocity))
    assert sorted(rings) == pytest.approx([predicted, 0.3])
    named = next(text for text in axes.texts if text.get_text() == "predicted")
    color = next(ring.get_color() for at, ring in rings.items() if at < 0.2)
    assert to_rgb(named.get_color()) == to_rgb(color)


@pytest.mark.slow
def test_runs_that_end_without_contact_leave_a_curve_below_the_whole() -> None:
    some = verdict(replace(NOISY, horizon=0.5), runs=40, uncertainty=SPEED, changes=False)
    share = float(some.mitigated.touched.mean())
    assert 0 < share < 1
    without, with_gain = plots.verdict(some).axes[0].lines[:2]
    assert with_gain.get_ydata()[-1] == pytest.approx(100 * share)
    assert without.get_ydata()[-1] == 100
    none = case("never in time")
    assert none.reached.simulated == 0
    assert set(plots.verdict(none).axes[0].lines[1].get_ydata()) == {0.0}
    assert "5 end without the predicted contact" in parse(report_html(none)).words


def test_the_two_runs_are_the_median_and_the_worst_by_speed_and_end_where_they_touch(
    one: pt.verification.Verdict,
) -> None:
    distance, velocity = plots.verdict_run(one).axes
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


def test_the_figure_of_stability_shows_the_limit_half_of_it_and_the_gain(one: pt.verification.Verdict) -> None:
    axes = plots.verdict_stability(one).axes[0]
    limits, half, own = (line.get_data() for line in axes.lines[:3])
    assert limits[0] == pytest.approx(1e3 * one.stability.limit.distance)
    assert limits[1] == pytest.approx(np.abs(one.stability.limit.gain))
    assert half[1] == pytest.approx(limits[1] / 2)
    assert set(own[1]) == {abs(one.gain)}
    texts = texts_of(plots.verdict_stability(one))
    for text in ("unstable above", "gain margin 2", "verified gain", f"{abs(one.stability.strongest):.4g} N s"):
        assert text in texts


def test_the_figure_of_the_gain_shows_ideal_and_loop_with_their_optima(one: pt.verification.Verdict) -> None:
    figure = plots.verdict_gain(one)
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


def test_the_figure_of_the_gain_shows_how_far_the_margin_of_2_reaches() -> None:
    wild = case("4x4 that oscillates")
    axes = plots.verdict_gain(wild).axes[0]
    strongest = -wild.stability.strongest
    upright = {float(x[0]) for x in (line.get_xdata() for line in axes.lines) if len(x) == 2 and x[0] == x[1]}
    assert {strongest, strongest / 2} <= upright
    on_loop = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) > 10]
    assert min(float(np.max(x)) for x in on_loop) <= strongest / 2 * (1 + 1e-9)
    assert "gain margin 2" in texts_of(plots.verdict_gain(wild))


def test_gains_that_miss_a_limit_are_thin_and_grey() -> None:
    of = case("ideal robot")
    axes = plots.verdict_gain(of).axes[0]
    grey = [line for line in axes.lines if line.get_linewidth() < 1 and len(line.get_xdata()) > 10]
    loud = [line for line in axes.lines if line.get_linewidth() > 1.5 and len(line.get_xdata()) > 10]
    assert len(grey) == len(loud) == 2  # in the ideal world and on the loop
    curve = of.loss.curve
    shown = np.isfinite(loud[1].get_ydata())
    assert np.array_equal(
        np.sort(-curve.gain[curve.standing >= 1 - 1e-12])[: shown.sum()], np.sort(loud[1].get_xdata()[shown])
    )
