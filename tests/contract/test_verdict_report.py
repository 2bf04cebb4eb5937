"""What the page of a verdict promises: repeatable, self-contained, and true to the verdict."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pretouch as pt
from page_checks import EVIL, assert_sound, parse
from page_rows import row, table
from pretouch._core.errors import OutputExistsError
from pretouch._core.files import is_own_unchanged
from pretouch.report import report_html, write_report
from pretouch.uncertainty.ensemble import share_in_words
from refusals import refused
from verdict_cases import CASES, DRAWERS, STATUS, case, drawn
from verification_samples import loop_of, verdict


@pytest.fixture(scope="module", params=CASES)
def found(request: pytest.FixtureRequest) -> pt.verification.Verdict:
    return case(request.param)


@pytest.fixture(scope="module")
def one() -> pt.verification.Verdict:
    return case("VCNL4010 that pushes")


@pytest.mark.slow
def test_reports_are_sound_for_every_status(found: pt.verification.Verdict) -> None:
    page = report_html(found)
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
        "Predicted and simulated": found.gain is not None,
        "Is the sensor fast enough, and is the loop stable?": found.gain is not None,
        "Tried changes": bool(found.changes),
        "Assumptions": found.gain is not None,
        "The loop": True,
        "Inputs": True,
        "Provenance": True,
    }
    assert [title for title in sections_of(page) if title in sections] == [t for t, shown in sections.items() if shown]
    assert page.count("<figure") == sum(drawn(draw, found) is not None for draw in DRAWERS)


def test_the_assumptions_name_the_number_of_runs_and_their_seed(one: pt.verification.Verdict) -> None:
    alone = case("one run, no changes")
    assert any("40 independent runs with the random seed 0" in text for text in one.assumptions)
    assert any("a single run with the random seed 0" in text for text in alone.assumptions)


def sections_of(page: str) -> list[str]:
    return [re.sub(r"<[^>]*>", "", title) for title in re.findall(r"<h2[^>]*>(.*?)</h2>", page)]


@pytest.mark.slow
def test_a_report_contains_the_numbers_of_the_verdict(one: pt.verification.Verdict) -> None:
    page, s, loss = report_html(one), one.stability, one.loss
    shown = {
        "relative_velocity": "relative velocity at contact |l\u2032|",
        "impact_force": "peak impact force F",
        "peak_force": "peak contact force max F",
    }
    for name, label in shown.items():
        c = one.comparison(name)
        spread, unit = c.simulated, c.unit
        expected = (
            "\u2013" if c.predicted is None else f"{c.predicted:.4g} {unit}",
            f"{spread.mean:.4g} {unit}",
            f"{spread.low:.3g} to {spread.high:.3g} {unit}",
            f"{spread.worst:.4g} {unit}",
            "\u2013" if c.predicted_unmitigated is None else f"{c.predicted_unmitigated:.4g} {unit}",
            f"{c.unmitigated.mean:.4g} {unit}",
        )
        assert tuple(row(page, label)) == expected
    assert row(page, "strongest stable gain") == [f"{s.strongest:.4g} N s"]
    assert row(page, "oscillation frequency at the limit") == [f"{s.frequency:.4g} Hz"]
    assert row(page, "lowest sensor rate for a stable loop") == [f"{s.lowest_rate:.3g} Hz"]
    assert row(page, "lowest sensor rate for a gain margin of 2") == [f"{s.lowest_rate_for_margin_2:.3g} Hz"]
    assert row(page, "readings") == ["250 Hz, one every 4 ms"]
    best = row(page, "best gain with a gain margin of 2 on the simulated loop, mean of the runs")
    assert best == [f"{loss.loop_gain:.4g} N s", f"{loss.loop_objective:.5g}"]
    own, mean = row(page, "verified gain, mean of the runs")
    assert (own, mean.split(" \u00b1 ")[0]) == (f"{one.gain:.4g} N s", f"{loss.objective:.5g}")
    assert row(page, "obstacle.velocity", "What is uncertain")[0].startswith("normal, -0.3 m/s")
    for check, cells in zip(one.limits, table(page, "Limits")[1:], strict=True):
        every = "every run" if check.required.probability == 1 else "90 %"
        assert cells[0] == check.label
        assert cells[2:5] == [every, share_in_words(check.held), share_in_words(check.low)]
    words = parse(page).words
    assert f"{s.margin:.3g} gain margin" in words
    assert "Each change was simulated in 40 runs" in words


def test_the_change_that_helps_most_stands_out_with_its_numbers() -> None:
    slow = case("8x8 that is too slow")
    best, title = slow.best_change, "What to do next"
    assert best is not None
    assert best.standing < 1
    page = report_html(slow)
    margins = [f"{slow.stability.margin:.3g}", f"{best.margin:.3g}"]
    assert row(page, "gain margin", title) == margins
    shares = [f"{100 * slow.limits[0].held:.4g} %", f"{100 * best.held:.4g} %"]
    assert row(page, "runs with relative velocity at contact <= 0.25 m/s", title) == shares
    titles = sections_of(page)
    assert titles.index("Why it does not hold") + 1 == titles.index(title)
    head, *tried = table(page, "Tried changes")
    assert head == ["change", "objective", "limits met", "gain margin", "what to do"]
    own, *tried = tried
    assert own == [
        "unchanged",
        "",
        f"not all: {100 * slow.unchanged[0].held:.4g} %",
        margins[0],
        "Compare changes with this row.",
    ]
    assert [cells[-1] for cells in tried] == [change.sentence for change in slow.changes]
    assert [cells[0].endswith(": helps") for cells in tried] == [change.helps for change in slow.changes]
    words = parse(page[page.rindex(title) : page.rindex("Tried changes")]).words
    assert f"which is not enough alone: {best.sentence}" in words


def test_a_contact_that_is_harder_than_without_mitigation_is_why_it_does_not_hold() -> None:
    wild = case("4x4 that oscillates")
    assert wild.effect.is_harder
    page = report_html(wild)
    words = parse(page).words
    assert f"contact is harder than without mitigation: {wild.effect.speed:.4g} m/s on average instead of 0.3" in words
    assert wild.best_change.standing == 1
    title = "What to do next"
    assert row(page, "contact harder than without mitigation", title) == ["yes", "no"]
    best = row(page, "best gain with a gain margin of 2 on the simulated loop, mean of the runs")
    assert best[0] == f"{wild.loss.loop_gain:.4g} N s"
    assert row(page, "largest excursion", "Limits")[:2] == ["300 mm", "every run"]


@pytest.mark.slow
def test_a_push_that_is_larger_with_mitigation_than_without_is_named(one: pt.verification.Verdict) -> None:
    peak = one.comparison("peak_force")
    assert peak.simulated.mean > peak.unmitigated.mean
    assert "After the impact, " in parse(report_html(one)).words


def test_a_verdict_without_a_gain_says_how_near_each_limit_can_be_come() -> None:
    of = case("no gain")
    page = report_html(of)
    (limited,) = of.design.constraints
    nearest = [f"{limited.best_value:.4g} m/s", f"{limited.best_gain:.4g} N s"]
    asked = row(page, "relative velocity at contact", "Why it was not verified")
    assert asked == ["0.001 m/s", *nearest]
    assert "Nothing was simulated" in parse(page).words


@pytest.mark.slow
def test_where_nothing_helps_or_nothing_was_tried_the_report_says_so() -> None:
    still = verdict(loop_of(period=1e-3, rate=1e3), runs=2)
    assert still.best_change is None
    page = report_html(still)
    assert "No change helps" in sections_of(page)
    assert (
        "None of the tried changes improves the result of the verification. None lowers the objective significantly "
        "and by at least 1 %." in parse(page).words
    )
    untried = sections_of(report_html(case("one run, no changes")))
    assert {"No change helps", "What would help most", "Tried changes"}.isdisjoint(untried)


@pytest.mark.slow
def test_reports_repeat_and_recognize_themselves(tmp_path: Path) -> None:
    made = case("one run, no changes")
    page = report_html(made)
    assert page == report_html(CASES["one run, no changes"]())
    path = write_report(made, tmp_path / "verdict.html")
    assert path.read_text(encoding="utf-8") == page
    assert is_own_unchanged(path)
    (tmp_path / "mine.html").write_text("mine", encoding="utf-8")
    with refused(str(tmp_path / "mine.html"), error=OutputExistsError, remedy="--force"):
        write_report(made, tmp_path / "mine.html")


@pytest.mark.slow
def test_reports_escape_what_users_wrote_and_show_where_a_curve_is_from() -> None:
    made = case("no gain")
    report = pt.fit(pt.read_calibration(Path(__file__).parents[2] / "examples" / "sensor.csv"))
    source = {"name": f"{EVIL}.toml".replace("/", ""), "text": f"# {EVIL}", "sha256": "abc"}
    page = report_html(made, calibration=report, source=source)
    words = assert_sound(page).words
    assert "<script" not in page
    assert "SHA-256 abc" in words
    assert "Sensor calibration: sensor.csv" in words
