"""What the page of a verdict promises: repeatable, self-contained, and true to the verdict."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pretouch.design.robust.wording import share_in_words

import pretouch as pt
from page_checks import EVIL, assert_sound, parse
from pretouch._core.errors import OutputExistsError
from pretouch._core.files import is_own_unchanged
from pretouch.report import (
    verdict_report_html,
    write_verdict_report,
)
from verdict_cases import CASES, DRAWERS, STATUS, case, drawn
from verification_samples import (
    loop_of,
    verdict,
)


@pytest.fixture(scope="module", params=CASES)
def found(request: pytest.FixtureRequest) -> pt.Verdict:
    return case(request.param)


@pytest.fixture(scope="module")
def one() -> pt.Verdict:
    return case("VCNL4010 that pushes")


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
    assert f"speed at contact <= 0.12 m/s holds in {100 * held:.4g} % {100 * best.held:.4g} %" in box
    assert words.index("Why it does not hold") < after


def test_a_contact_that_is_harder_than_without_mitigation_is_why_it_does_not_hold() -> None:
    wild = case("4x4 that oscillates")
    assert wild.effect.is_harder
    words = parse(verdict_report_html(wild)).words
    assert f"Contact is harder than without mitigation: {wild.effect.speed:.4g} m/s on average instead of 0.3" in words
    box = words[words.index("The one change that would help most") : words.index("What was tried")]
    assert wild.best_change.standing == 1
    assert "contact harder than without mitigation yes no" in box
    assert "best gain on this loop with a margin of 2 to instability, mean of the runs" in words
    assert "largest excursion 300 mm every run" in words


def test_a_push_that_is_larger_with_mitigation_than_without_is_named(one: pt.Verdict) -> None:
    peak = one.comparison("peak_force")
    assert peak.simulated.mean > peak.unmitigated.mean
    assert "The largest force of the whole contact is larger with mitigation" in parse(verdict_report_html(one)).words


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
