"""The report on the letter, as a page and as text: everything in it is shown, and what does not come out is loud."""

from __future__ import annotations

import dataclasses
import json
import re
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import pytest

from letter_samples import CODE, bad, comparisons, finding, good, reproduction
from page_checks import EVIL, as_written, assert_sound, parse
from pretouch._core.blocks import tables_of
from pretouch._core.errors import OutputExistsError
from pretouch._core.files import is_own_unchanged, plain
from pretouch.letter import Agreement, LetterReport, Printed, Step
from pretouch.letter.printed import numeral
from pretouch.report import report_html, write_report
from refusals import refused


@pytest.fixture(scope="module")
def page() -> str:
    return report_html(good())


# --- the page


@pytest.mark.parametrize("make", [good, bad, LetterReport], ids=["good", "bad", "empty"])
def test_a_page_is_sound_and_repeats(make) -> None:
    page = report_html(make())
    words = assert_sound(page).words
    assert "Method and assumptions" in words
    assert report_html(make()) == page


def test_a_page_shows_every_text_of_the_report(page: str) -> None:
    words = parse(page).words
    for part in good().reproductions:
        tables, titles = list(tables_of(part.tables)), [section.title for section in part.tables]
        shown = [part.title, part.place, part.summary, part.caption, *titles]
        shown += [text for p in part.parameters for text in (p.name, p.symbol, p.printed, p.place)]
        shown += [text for c in part.comparisons for text in (c.name, c.printed, c.reason, c.ours, c.off_by)]
        shown += [text for c in part.comparisons for text in (c.agreement.words, c.span)]
        shown += [text for t in tables for text in (t.note, *t.head, *(c for row in t.rows for c in row))]
        shown += [text for f in part.findings for text in (f.title.rstrip("."), f.place, f.statement)]
        shown += [text for f in part.findings for e in f.evidence for text in (e.name, str(e))]
        assert [text for text in shown if text not in words] == []


def test_each_verdict_has_its_own_word_and_shape_and_is_counted(page: str) -> None:
    assert len({a.value for a in Agreement}) == len({a.shape for a in Agreement}) == len(Agreement)
    words = parse(page).words
    for agreement, count in good().counts.items():
        assert f"{agreement.shape} {count} {agreement.meaning}" in words
    rows = [
        unescape(re.sub("<[^>]*>", " ", row)).split() for row in re.findall(r"<tr.*?</tr>", as_written(page), re.DOTALL)
    ]
    for c in comparisons():
        row = next(row for row in rows if row[: len(c.name.split())] == c.name.split())
        assert [c.printed in row, c.ours in row, c.off_by in row] == [True, True, True]
        assert " ".join(row).endswith(f"{c.agreement.shape} {c.agreement.words}")


def test_findings_come_in_order_and_link_to_where_they_were_computed(page: str) -> None:
    heads = re.findall(r'<h3 id="finding-(\d+)">', page)
    assert heads == ["2", "3", "4"]
    part = page[page.index('id="finding-3"') :]
    assert part.index('href="#part-figure-6"') < part.index('id="finding-4"')


def test_the_contents_lead_to_every_part_and_finding(page: str) -> None:
    contents = re.sub("<nav.*?</nav>", "", page[: page.index("<h3")], flags=re.DOTALL)
    anchors = ["part-table-2", "part-figure-6", "finding-2", "finding-3", "finding-4"]
    assert re.findall('href="#([^"]*)"', contents) == anchors
    counted = re.findall(r"<tr>.*?</tr>", contents)
    assert [re.sub("<[^>]*>", " ", row).split()[-4:] for row in counted[1:]] == [["1"] * 4, ["1"] * 4, ["2"] * 4]


def test_a_notebook_shows_counts_and_warnings_without_links() -> None:
    shown = bad()._repr_html_()
    assert "<a " not in shown
    assert "](#" not in shown
    assert "Warning PT901: Does not hold: finding 7: Column 7" in shown
    assert "table-2: The gains of table-2" in shown


def test_the_code_is_shown_as_it_is(page: str) -> None:
    # readers of HTML drop one line end right after <pre>
    assert [text.removeprefix("\n") for text in parse(page).code] == [CODE, CODE]
    assert all(text.startswith("\n") for text in parse(page).code)
    indented = "\n    first()\n\n"
    page = report_html(LetterReport(reproductions=(reproduction(code=indented),)))
    assert parse(page).code == ["\n" + indented]


def test_the_numbers_are_in_the_page_and_can_be_saved(page: str) -> None:
    expected = plain(good().to_dict())
    saved = unquote(parse(page).downloads["letter-numbers.json"].removeprefix("data:application/json,"))
    assert json.loads(saved, parse_constant=pytest.fail) == expected
    assert 'id="numbers" download="letter-numbers.json"' in page
    assert expected["reproductions"]["table-2"]["numbers"]["gain"] == [-0.1, None, None]


def test_hostile_text_stays_text() -> None:
    page = report_html(good(lambda text: f"{text}{EVIL}</pre></style>\\1"))
    assert_sound(page)
    assert "alert(" in parse(page).words
    harmless = report_html(good())
    assert all(page.count(tag) == harmless.count(tag) for tag in ("<script", "<pre", "</style", "<a ", "<td"))


def test_what_does_not_come_out_is_loud_and_what_does_is_not(page: str) -> None:
    words = parse(page).words
    assert "reproduced" in words
    assert "not reproduced" not in words
    assert "NOT HOLD" not in words
    assert 'class="warning"' not in page

    page = report_html(bad())
    words = parse(page).words
    assert "not reproduced" in words
    assert words.count("DOES NOT HOLD") == 2  # in the list of findings, and where it stands
    assert words.count("does NOT hold") == 2  # in the warning, and where it stands
    assert "Does not hold: finding 7: Column 7" in words
    assert "Unexplained disagreement: The gains of table-2: f1 at -0.9" in words
    assert "f1 at -0.9: NO REASON KNOWN" in words
    assert page.index("Does not hold") < page.index("<table")


def test_a_reason_that_many_share_stands_once() -> None:
    same = tuple(dataclasses.replace(comparisons()[3], name=f"time {i}") for i in range(3))
    words = parse(report_html(LetterReport(reproductions=(reproduction(given=same),)))).words
    assert words.count("friction") - words.count("friction and modeling") == 1
    assert "all numbers: friction" in words
    more = (*same[:2], comparisons()[0])
    words = parse(report_html(LetterReport(reproductions=(reproduction(given=more),)))).words
    assert "time 0; time 1: friction" in words


def test_parts_without_inputs_numbers_or_tables_have_no_empty_headings() -> None:
    bare = dataclasses.replace(reproduction(given=()), parameters=(), tables=())
    page = report_html(LetterReport(reproductions=(bare,)))
    words = assert_sound(page).words
    assert "Inputs, as printed in the letter" not in words
    assert "Printed and computed numbers" not in words
    assert "Where the letter" not in words


def test_a_page_is_written_like_every_report(tmp_path: Path) -> None:
    path = write_report(good(), tmp_path / "letter.html")
    assert path.read_text(encoding="utf-8") == report_html(good())
    assert is_own_unchanged(path)
    path.write_text("mine", encoding="utf-8")
    with refused(str(tmp_path / "letter.html"), error=OutputExistsError, remedy="--force"):
        write_report(good(), path)
    write_report(good(), path, overwrite=True)
    assert is_own_unchanged(path)


# --- numbers


@pytest.mark.parametrize(
    ("value", "printed", "shown"),
    [
        (-0.0915341, "-0.082", "-0.09153"),
        (1.312e-5, "1.30e-5", "1.3120e-5"),
        (473.98, "474", "473.98"),
        (-1e-9, "-0.082", "0.00000"),
        (12.0, "1.0E+1", "1.200e1"),
        (1e300, "0.5", "1e300"),
        (float("nan"), "0.5", "not a number"),
        (float("inf"), "0.5", "infinite"),
        (float("-inf"), "1e3", "-infinite"),
    ],
)
def test_ours_has_two_digits_more_than_the_printed_number(value: float, printed: str, shown: str) -> None:
    assert numeral(value, printed) == shown


def test_differences_have_a_sign() -> None:
    def off_by(printed: str, value: float) -> str:
        return Printed("a", printed, value, "", "").off_by

    assert off_by("-0.088", -0.08766) == "+0.00034"
    assert off_by("-0.082", -0.0915) == "-0.00950"
    assert off_by("0.5", 0.5) == "0.000"
    assert off_by("1.30e-5", 1.312e-5) == "+1.20e-7"
    assert off_by("1.30e-5", 1.30e-5) == "0.00"
    assert off_by("1.30e-5", float("nan")) == "not a number"


def test_a_step_is_a_number_a_text_or_a_condition() -> None:
    assert [str(step) for step in finding(holds=False).evidence] == ["-0.61071 N s", "as printed", "does NOT hold"]
    assert str(Step("", True)) == "holds"
    assert finding().holds
    assert not finding(holds=False).holds


# --- the text


def test_the_text_shows_counts_findings_and_disagreements() -> None:
    text = str(good())
    lines = text.splitlines()
    assert lines[0].startswith("8 printed numbers of the letter compared. Reproduced: ")
    assert "all 2 2 2 2" in [" ".join(line.split()) for line in lines]
    for part in good().reproductions:
        assert [line.split()[-4:] for line in lines if line.startswith(f"{part.id}: ")] == [["1", "1", "1", "1"]]
    found = [line for line in lines if re.match(r" +\d+\. ", line)]
    assert [int(line.split(".")[0]) for line in found] == [2, 3, 4]
    assert all(line.endswith(": holds") for line in found)
    assert text.count("printed -0.082 m, computed -0.09153 m: the printed value repeats l'") == 2
    assert "friction" not in text  # measured numbers are not claimed to agree
    assert "](#" not in text


def test_the_dictionary_has_every_finding_with_its_evidence() -> None:
    findings = plain(good().to_dict())["findings"]
    assert [finding["holds"] for finding in findings] == [True] * len(good().findings)
    assert [finding["title"] for finding in findings] == [finding.title for finding in good().findings]
    assert all(finding["evidence"] for finding in findings)
    assert not all(finding["holds"] for finding in plain(bad().to_dict())["findings"])


def test_the_text_is_loud_about_what_does_not_come_out() -> None:
    lines = str(bad()).splitlines()
    assert lines[0].endswith("NOT REPRODUCED: finding 7; f1 at -0.9 (table-2).")
    (line,) = [line for line in lines if line.endswith("DOES NOT HOLD")]
    assert line.startswith("  7. ")
    assert any("finding 7: " in line and "the printed column is that of -10: does NOT hold" in line for line in lines)
    assert any("printed 0.110, computed 0.25000: NO REASON KNOWN" in line for line in lines)
