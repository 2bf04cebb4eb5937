"""What figures and HTML reports promise: legible, repeatable, self-contained, escaped, and modest."""

from __future__ import annotations

import html
import math
import re
import subprocess
import sys
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from figure_checks import assert_legible, visible_texts
from page_checks import EVIL, assert_sound, parse
from page_rows import row, table
from pretouch._core.blocks import Code, Listing, Measured, Named, Page, PageSection, PageTable, Paragraph
from pretouch._core.errors import OutputExistsError
from pretouch._core.files import is_own_unchanged
from pretouch.calibration import Calibration, CalibrationReport, fit, read_calibration
from pretouch.config import load_scenario
from pretouch.designs import (
    Constraint,
    GainDesign,
    Objective,
    SpringImpact,
    Task,
    Term,
    design_gain,
    excursion_objective,
    time_objective,
)
from pretouch.motion import Admittance, Obstacle, Plant, Scenario
from pretouch.report import plots, report_html, write_report
from pretouch.report.blocks_html import blocks_as_html, cell_as_html, page_as_html
from pretouch.report.style import log_ticks, scale_for
from pretouch.sensors import ExponentialFirstOrder, InversePower, Recessed
from refusals import refused
from scenario_text import ENCOUNTER

EXAMPLES = Path(__file__).parents[2] / "examples"
POWER = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
ADMITTANCE = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
LETTER = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.0422, velocity=-0.3))
F1 = excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)


def limits(**given: float) -> list[Constraint]:
    return [Constraint(name=name, limit=limit) for name, limit in given.items()]


THROW = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.0422), plant=Plant(velocity=1.2))
AWAY = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=0.0422, velocity=0.3))
REACH = Scenario(admittance=ADMITTANCE, obstacle=Obstacle(position=-0.035), plant=Plant(position=-0.1))
FINGER = ExponentialFirstOrder(scale=1.25, rate=-63.46)
IMPACT = Objective(
    terms=(Term(quantity="impact_force", scale=10.0), Term(quantity="largest_travel", scale=0.1)),
    name="<gentle & quick>",
)
DESIGNS: dict[str, Callable[[], GainDesign]] = {
    "letter": lambda: design_gain(Task(LETTER, POWER, F1, bounds=BOUNDS)),
    "constrained": lambda: design_gain(
        Task(LETTER, POWER, F1, bounds=BOUNDS, constraints=limits(excursion=0.08, virtual_force=20.0))
    ),
    "infeasible": lambda: design_gain(
        Task(LETTER, POWER, F1, bounds=BOUNDS, constraints=limits(excursion=0.05, relative_velocity=0.05))
    ),
    "no-contact": lambda: design_gain(Task(AWAY, POWER, F1, bounds=BOUNDS)),
    "contact for weak gains only": lambda: design_gain(Task(THROW, POWER, F1, bounds=BOUNDS)),
    "time": lambda: design_gain(
        Task(REACH, FINGER, time_objective(time_scale=1.0, velocity_scale=0.01), bounds=BOUNDS)
    ),
    "both signs": lambda: design_gain(Task(LETTER, POWER, F1, bounds=(-2.0, 1.0))),
    "impact": lambda: design_gain(
        Task(
            LETTER,
            Recessed(sensor=POWER, recess=0.002),
            IMPACT,
            bounds=(-5.0, -0.05),
            impact=SpringImpact(robot_mass=2.0, stiffness=1e4),
            constraints=limits(impact_force=20.0, time=0.6, drive_force=30.0),
        )
    ),
}


@pytest.fixture(scope="module", params=DESIGNS)
def design(request: pytest.FixtureRequest) -> GainDesign:
    return DESIGNS[request.param]()


@pytest.fixture(scope="module")
def letter() -> GainDesign:
    return DESIGNS["letter"]()


def measured(label: str = "", unit: str = "V", *, offset: float = 0.25) -> Calibration:
    """Make readings that clip near the sensor, fade far from it, repeat, and hold one that is wrong."""
    random = np.random.default_rng(1)
    distances = np.repeat(np.arange(0.0, 0.081, 0.005), 4)
    signal = offset + 1.30e-5 / (distances + 0.0419) ** 3.32 + random.normal(0.0, 0.004, len(distances))
    outputs = np.round(np.minimum(signal, 0.55), 3)
    outputs[20] += 0.12
    no_object = np.round(offset + random.normal(0.0, 0.004, 20), 3)
    return Calibration(distances=distances, outputs=outputs, unit=unit, no_object=no_object, label=label)


@pytest.fixture(scope="module")
def usable() -> CalibrationReport:
    return fit(measured(), ("inverse-power", "exponential-1"))


@pytest.fixture(scope="module")
def useless() -> CalibrationReport:
    noise = np.random.default_rng(0).normal(1.0, 0.01, 10)
    return fit(Calibration(distances=np.arange(10) * 0.01, outputs=noise, unit="V"))


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("draw", [plots.trade_off, plots.motion, plots.sensitivity])
def test_design_figures_are_legible(draw: Any, design: GainDesign) -> None:
    assert_legible(draw(design))


def test_calibration_figures_are_legible(usable: CalibrationReport, useless: CalibrationReport) -> None:
    assert_legible(plots.calibration(usable))
    assert_legible(plots.calibration(useless))


def test_names_in_a_calibration_figure_lie_above_the_panels(usable: CalibrationReport) -> None:
    """So none of them can lie on a curve or on the line of the offset."""
    figure = plots.calibration(usable)
    boxes = visible_texts(figure)
    for axes in figure.axes:
        names = [text.get_text() for text in axes.get_legend().get_texts()]
        assert len(set(names)) == len(names) >= 3
        assert not axes.texts
        left, right = axes.bbox.x0 - 1, axes.bbox.x1 + 1
        own = [box for text, box in boxes if text in names and left <= box.x0 <= box.x1 <= right]
        assert len(own) >= len(names)
        assert not any(axes.bbox.y0 < box.y1 and box.y0 < axes.bbox.y1 for box in own)
    assert "outlier, not used" in [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


def test_bars_of_the_drawn_slope_are_two_standard_errors_of_the_differences(usable: CalibrationReport) -> None:
    """A mean of 4 readings of 4 mV of noise, over the signal; the fit knows that noise to some 10 %."""
    axes = plots.calibration(usable).axes[2]
    (bars,) = (lines for lines in axes.collections if hasattr(lines, "get_segments"))
    halves = np.array([np.ptp(segment[:, 1]) / 2 for segment in bars.get_segments()])
    middles = np.array([segment[0, 0] for segment in bars.get_segments()]) * 1e-3
    near, far = (0.002 * (middles + side * 0.0025 + 0.0419) ** 3.32 / 1.30e-5 for side in (-1, 1))
    np.testing.assert_allclose(halves, 2 * np.hypot(near, far) / 0.005, rtol=0.35)
    assert len(halves) >= 8


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("model", ["inverse-power", "exponential-1", "exponential-2", "mittag-leffler", "table"])
def test_the_section_for_the_scenario_file_is_the_fitted_curve(model: str, tmp_path: Path) -> None:
    """Copied from the page into a file it reads back as the fitted curve, measured from the contact surface."""
    distances = np.repeat(np.arange(0.004, 0.045, 0.004), 5)
    signal = 2.0 * np.exp(-55 * distances) if model != "inverse-power" else 3e-4 / (distances + 0.02) ** 2.4
    outputs = signal + 0.002 * np.random.default_rng(3).standard_normal(len(distances))
    report = fit(Calibration(distances=distances, outputs=outputs, unit="V"), (model,), offset="zero")
    (best,) = report.fits
    (section,) = re.findall(r"\[sensor\]\nmodel = .*?(?=</)", html.unescape(report_html(report)), re.DOTALL)
    file = tmp_path / "fitted.toml"
    encounter = ENCOUNTER.replace('"42.2 mm"', '"25 mm"')
    assert encounter != ENCOUNTER
    section = re.sub(
        r"(?m)^(minimum|maximum)_distance = .*\n", "", section
    )  # the other lines instead, as the page says
    section = section.replace("# recess", "recess").replace("# maximum", "maximum")
    file.write_text(f"{section}\n{encounter}", encoding="utf-8")
    sensor = load_scenario(file).sensor
    distance = np.linspace(0.0, best.window.l_max - best.window.l_min, 50)
    for quantity in ("log_output", "log_slope"):
        expected = getattr(best.sensor, quantity)(best.window.l_min + distance[:-1])
        np.testing.assert_allclose(getattr(sensor, quantity)(distance[:-1]), expected, rtol=1e-12)
    assert sensor.valid_range[1] == pytest.approx(distance[-1], rel=1e-5)  # six digits


def test_figures_show_the_numbers_of_the_design(letter: GainDesign) -> None:
    texts = " ".join(text for text, _ in visible_texts(plots.trade_off(letter)))
    assert "\u22120.7463 N s" in texts
    assert "0.1070" in texts
    texts = " ".join(text for text, _ in visible_texts(plots.motion(letter)))
    assert "464 ms" in texts
    assert "141 ms" in texts


def test_trade_off_names_what_blocks_a_gain() -> None:
    texts = " ".join(text for text, _ in visible_texts(plots.trade_off(DESIGNS["infeasible"]())))
    assert "violated: relative velocity" in texts
    assert "violated: excursion" in texts
    assert "no contact" in " ".join(text for text, _ in visible_texts(plots.trade_off(DESIGNS["no-contact"]())))


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_the_same_design_gives_the_same_bytes(kind: str, letter: GainDesign) -> None:
    def drawn() -> bytes:
        content = BytesIO()
        plots.trade_off(letter).savefig(content, format=kind)
        return content.getvalue()

    assert drawn() == drawn()


def test_figures_neither_follow_nor_change_the_settings_of_the_user(letter: GainDesign) -> None:
    def drawn() -> bytes:
        content = BytesIO()
        plots.motion(letter).savefig(content, format="svg")
        return content.getvalue()

    plain = drawn()
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "lines.linewidth": 9, "axes.grid": True}):
        before = dict(mpl.rcParams)
        assert drawn() == plain
        assert dict(mpl.rcParams) == before


def test_figures_show_themselves_in_a_notebook(letter: GainDesign) -> None:
    figure = plots.trade_off(letter)
    assert isinstance(figure, Figure)
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_importing_reports_loads_no_drawing_library() -> None:
    code = "import sys, pretouch.report; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.slow(keep=1)
def test_design_reports_are_sound_for_every_status(design: GainDesign) -> None:
    words = assert_sound(report_html(design)).words
    assert "Method and assumptions" in words
    assert {"optimal": "optimal gain found", "infeasible": "infeasible", "no-contact": "no contact"}[
        design.status.value
    ] in words
    for warning in design.warnings:
        assert warning in words


def test_design_report_contains_the_numbers_of_the_design(letter: GainDesign) -> None:
    page = report_html(letter)
    assert row(page, "deviation from the reference at contact x \u2212 x_d") == ["0 mm", "-96.87 mm", ""]
    assert row(page, "relative velocity at contact l\u2032") == ["-0.3 m/s", "-0.07906 m/s", "-73.6 %"]
    assert row(page, "time of contact t")[1] == "463.6 ms"
    assert row(page, "objective f (excursion)")[-1] == "0.10698"
    assert row(page, "at contact, l = 0 mm") == ["-0.7463 N s", "-79.24 1/m", "59.14 N s/m"]
    assert row(page, "obstacle: velocity") == ["-0.3 m/s"]
    assert table(page, "The contact")[0][1:] == ["without mitigation", "optimal, D_p = -0.7463 N s", "change"]


def test_infeasible_report_names_the_limits_and_what_is_achievable() -> None:
    page = report_html(DESIGNS["infeasible"]())
    for name, limit in (("largest excursion", "50 mm"), ("relative velocity at contact", "0.05 m/s")):
        value, held, margin, state, least = row(page, name, "Constraints")
        assert held == limit
        assert state in {"met", "exceeded"}
        assert " at -" in least
        assert margin.startswith("-") == (state == "exceeded")
        assert value


def test_a_report_says_which_limit_is_active_and_which_is_met() -> None:
    page = report_html(DESIGNS["constrained"]())
    assert row(page, "largest excursion", "Constraints")[:2] == ["80 mm", "80 mm"]
    states = {name: row(page, name, "Constraints")[3] for name in ("largest excursion", "largest virtual force")}
    assert states == {"largest excursion": "active", "largest virtual force": "met"}


def test_fit_reports_are_sound(usable: CalibrationReport, useless: CalibrationReport) -> None:
    words = " ".join(assert_sound(report_html(usable)).text)
    assert usable.best is not None
    assert usable.best.model in words
    assert usable.window.end_reason in words
    assert "0.473 V at 25 mm" in words
    assert 'model = "inverse-power"' in words
    page, window = report_html(usable), usable.window
    assert row(page, "window") == [f"{1e3 * window.l_min:.4g} mm to {1e3 * window.l_max:.4g} mm", ""]
    assert row(page, "reason for its end")[1] == window.end_reason
    exponent = usable.best.parameters["exponent"]
    assert row(page, "exponent")[0] == f"{exponent.value:.5g}"
    words = " ".join(assert_sound(report_html(useless)).text)
    assert "no usable signal" in words


@pytest.mark.slow
def test_reports_repeat_and_recognize_themselves(letter: GainDesign, tmp_path: Path) -> None:
    page = report_html(letter)
    assert page == report_html(letter)
    path = write_report(letter, tmp_path / "design.html")
    assert path.read_text(encoding="utf-8") == page
    assert is_own_unchanged(path)


def test_reports_do_not_overwrite_unasked(usable: CalibrationReport, tmp_path: Path) -> None:
    path = tmp_path / "fit.html"
    path.write_text("mine", encoding="utf-8")
    with refused(str(tmp_path / "fit.html"), error=OutputExistsError, remedy="--force"):
        write_report(usable, path)
    assert path.read_text(encoding="utf-8") == "mine"
    write_report(usable, path, overwrite=True)
    assert is_own_unchanged(path)


@pytest.mark.slow
def test_reports_escape_what_users_wrote(letter: GainDesign) -> None:
    report = fit(measured(label=EVIL, unit=EVIL), ("exponential-1",))
    page = report_html(report)
    assert_sound(page)
    assert "<script" not in page
    source = {"name": f"{EVIL}.toml".replace("/", ""), "text": f"# {EVIL}", "sha256": "abc"}
    page = report_html(letter, calibration=report, source=source)
    assert_sound(page)
    assert "<script" not in page
    assert "alert(" in " ".join(parse(page).text)
    custom = report_html(DESIGNS["impact"]())
    assert "<gentle" not in custom


@pytest.mark.slow
def test_source_may_be_an_object_or_a_mapping(letter: GainDesign) -> None:
    text = "[sensor]\n"
    found = SimpleNamespace(path=Path("/home/me/approach.toml"), text=text, sha256="0123abcd")
    page = report_html(letter, source=found)
    assert "approach.toml" in page
    assert "/home/me" not in page
    assert "0123abcd" in page
    hashed = report_html(letter, source={"name": "approach.toml", "text": text})
    assert re.search(r"<code>[0-9a-f]{64}</code>", hashed)


@pytest.mark.parametrize(
    ("unit", "largest", "shown"),
    [("m", 0.04, "mm"), ("m", 2.0, "m"), ("s", 0.4, "ms"), ("m/s", 0.3, "m/s"), ("N", 5.0, "N"), ("m", 0.0, "m")],
)
def test_quantities_are_shown_in_units_that_suit_them(unit: str, largest: float, shown: str) -> None:
    assert scale_for(unit, largest).unit == shown


@pytest.mark.parametrize(("low", "high"), [(0.01, 10.0), (1e-6, 1e6), (0.3, 2.5), (1.0, 5.0)])
def test_logarithmic_axes_have_some_ticks_and_not_too_many(low: float, high: float) -> None:
    ticks = log_ticks(low, high)
    assert 2 <= len(ticks) <= 7
    assert all(low <= tick <= high for tick in ticks)


def test_a_report_begins_with_answer_numbers_figure_limits_and_next_step_and_folds_what_does_not_explain_it() -> None:
    design = design_gain(load_scenario(EXAMPLES / "approach.toml"))
    page = report_html(design)
    assert_sound(page)
    parts = ('class="answer"', 'class="tiles"', "<figure>", "limit 200 mm: met", "Next:", "<details")
    order = [page.index(part) for part in parts]
    assert order == sorted(order)
    sections = re.findall(r'<details( open)?>\n<summary><h2>(.*?)</h2></summary>\n<div id="[^"]+">', page)
    assert len(sections) == page.count("<summary><h2>")
    assert [title for is_open, title in sections if is_open] == ["The contact", "Constraints"]
    assert sections[-1] == ("", "Provenance")
    assert page.count(">The contact<") == 1, "a section is listed once"
    assert page.count('id="motion-all"') == 1, "the first figure is drawn once"


def test_symbols_and_numbers_of_the_text_look_as_in_the_figures_and_copied_text_stays() -> None:
    text = 'use --gain "-0.5 N*s" or `D_p = -1`, with D_p = -0.5 N s, x_d and F_p <= -2 (first-order)'
    shown = "".join(blocks_as_html((Paragraph(text=text), Code(text="gain = -1")), str))
    assert "D<sub>p</sub> = \u22120.5 N s, x<sub>d</sub> and F<sub>p</sub> \u2264 \u22122 (first-order)" in shown
    assert all(copied in shown for copied in ("&quot;-0.5 N*s&quot;", "<code>D_p = -1</code>", "gain = -1"))
    cells = (Measured(-0.5, "m"), Measured(-math.inf), Named("gain", "D_p"), "-")
    assert list(map(cell_as_html, cells)) == ["\u2212500 mm", "\u2212\u221e", "gain D<sub>p</sub>", "\u2013"]


def test_a_sentence_of_an_open_section_is_not_repeated_and_labels_of_cells_have_no_tags() -> None:
    reasons = PageSection(title="Why", blocks=(Listing(items=("one", "two")), Paragraph(text="x")), opened=True)
    table = PageTable(head=("", "at D_p = -1 N s"), rows=(("a", "1"),))
    page = Page(
        kind="test", headline="h", findings=("two", "three"), blocks=(Listing(items=("three",)), reasons, table)
    )
    shown = page_as_html(page, str)
    assert [shown.count(f"<li>{word}</li>") for word in ("one", "two", "three")] == [1, 1, 1]
    assert 'data-label="at D\u209a = \u22121 N s"' in shown


def test_the_best_model_sets_the_axis_of_the_residuals() -> None:
    """A model that does not fit leaves the axis, and the legend says so."""
    report = fit(read_calibration(EXAMPLES / "sensor.csv"))
    axes = plots.calibration(report).axes[-1]
    best, worst = (np.abs(report.fits[i].residuals).max() for i in (0, 3))
    assert worst > 5 * best
    assert axes.get_ylim()[1] < 3 * best
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert [label for label in labels if "off the axis" in label] == [f"{report.fits[3].model}, off the axis"]


def test_a_narrow_screen_shows_panels_and_cards_and_a_dark_one_inverts_figures() -> None:
    page = report_html(design_gain(load_scenario(EXAMPLES / "approach.toml")))
    views = re.findall(r'<svg viewBox="([\d. -]+)" style="max-width: (\d+)pt"><use href="#motion-all"/></svg>', page)
    assert len(views) == 4  # distance, position, velocity, force
    whole = [float(v) for v in re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', page).groups()]
    boxes = [[float(v) for v in box.split()] for box, _ in views]
    for x, y, width, height in boxes:
        assert 0.3 * whole[0] < width < 0.6 * whole[0]
        assert -5 <= x < x + width <= whole[0] + 5
        assert -5 <= y < y + height <= whole[1] + 5
    centers = {(round(x + w / 2) // 100, round(y + h / 2) // 100) for x, y, w, h in boxes}
    assert len(centers) == 4, "panels are different parts of the figure"
    assert 'data-label="without mitigation"' in page
    style = page[page.index("<style>") : page.index("</style>")]
    assert "prefers-color-scheme: dark" in style
    assert re.search(r"figure svg \{ filter: invert", style)
    assert re.search(r"@media \(max-width: 600px\)[^@]*\.whole[^@]*attr\(data-label\)", style, re.DOTALL)
