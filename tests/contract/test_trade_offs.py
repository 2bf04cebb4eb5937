"""The page on trade-offs does what it shows, and the command, its reports and figures keep what all of them promise."""

from __future__ import annotations

import doctest
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_text import SCENARIO, command, lay_out, strict

import pretouch as pt
from figure_checks import assert_legible, visible_texts
from page_checks import EVIL, assert_sound, parse
from page_rows import line, row, table
from pretouch._core.files import is_own_unchanged
from pretouch._core.units import format_quantity, pretty_unit
from pretouch._core.vocabulary import QUANTITIES
from pretouch.report import plots, report_html
from refusals import refused

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to/trade-offs.md").read_text(encoding="utf-8")
FREE = {"natural_frequency": (3.0, 10.0), "damping_ratio": (0.7, 1.5)}


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    lay_out(tmp_path, monkeypatch)
    return command(monkeypatch, capsys)


@pytest.fixture(scope="module")
def problem():
    return pt.load_scenario(ROOT / "examples" / "approach.toml")


def front_of(problem, quantities=("displacement", "relative_velocity"), choice=None, **more):
    return pt.pareto(
        pt.Task(
            problem.scenario,
            problem.sensor,
            pareto=pt.designs.ParetoOptions(quantities=quantities, choice=choice),
            bounds=problem.bounds,
            **more,
        )
    )


# --- the page


def test_the_python_of_the_page_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == 2
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    runner.run(doctest.DocTestParser().get_doctest("\n".join(blocks), {}, "trade-offs.md", "trade-offs.md", 0))
    assert runner.summarize().failed == 0


@pytest.mark.slow
def test_the_numbers_in_the_text_of_the_page_hold(problem):
    """35 times in the letter's case; two thirds of the way in the example."""
    design = pt.design(problem)
    assert "takes 35 times the smallest possible excursion" in " ".join(PAGE.split())
    assert round(front_of(problem, choice=design).choice.bound.ratio) == 35
    example = pt.load_scenario(ROOT / "examples" / "tradeoff.toml")
    front = pt.pareto(example)
    least = front.of("displacement")[front.meets(relative_velocity=front.choice.values["relative_velocity"])].min()
    assert least / front.choice.values["displacement"] == pytest.approx(2 / 3, abs=0.03)


# --- the command


def test_pareto_prints_the_knee_and_where_the_report_is(run):
    code, out, err = run("pareto", "approach.toml", "--verbose")
    assert (code, err) == (0, "")
    assert out.startswith(
        "The knee of the Pareto front of deviation from the reference and relative velocity is the design with D_p"
    )
    told = strict(run("pareto", "approach.toml", "--json")[1])
    ratios = [told[point]["excursion"] / told[point]["least_excursion"] for point in ("knee", "choice")]
    assert line(out, "relative to the smallest possible deviation").split()[-2:] == [f"{ratio:.3g}" for ratio in ratios]
    assert out.splitlines()[-1] == "Report with figures: approach-pareto.html"
    assert is_own_unchanged("approach-pareto.html")


def test_pareto_as_json_is_one_object(run, tmp_path):
    before = sorted(p.name for p in tmp_path.iterdir())
    code, out, err = run("pareto", "approach.toml", "--json")
    assert (code, err) == (0, "")
    told = strict(out)
    assert told["status"] == "found"
    assert {"quantities", "free", "front", "knee", "choice", "ends", "physical_bound", "approximation_error"} <= set(
        told
    )
    assert {"gain", "displacement", "relative_velocity", "least_excursion"} <= set(told["front"])
    assert told["choice"]["gain"] == pytest.approx(-0.8081, abs=1e-4)  # that of `pretouch design`
    assert sorted(p.name for p in tmp_path.iterdir()) == before
    assert run("pareto", "approach.toml", "--json", "--output", "mine.html")[0] == 0
    assert is_own_unchanged("mine.html")


def test_the_file_says_what_is_traded_and_chosen(run):
    Path("other.toml").write_text(
        SCENARIO + '[pareto]\nquantities = ["time", "relative_velocity", "virtual_force"]\nchoice = "-0.5 N*s"\n'
    )
    told = strict(run("pareto", "other.toml", "--json")[1])
    assert [q["name"] for q in told["quantities"]] == ["time", "relative_velocity", "virtual_force"]
    assert [q["unit"] for q in told["quantities"]] == ["s", "m/s", "N"]
    assert told["choice"]["gain"] == -0.5


@pytest.mark.parametrize(
    ("old", "new", "status"),
    [('excursion = "0.2 m"', 'excursion = "1 um"', "infeasible"), ('"-0.3 m/s"', '"0.3 m/s"', "no-contact")],
)
def test_a_trade_off_whose_answer_is_no_ends_with_1_and_its_object(run, old, new, status):
    Path("no.toml").write_text(SCENARIO.replace(old, new))
    code, out, err = run("pareto", "no.toml", "--json")
    assert (code, err) == (1, "")
    assert strict(out)["status"] == status
    code, out, _ = run("pareto", "no.toml")
    assert code == 1
    assert_sound(Path("no-pareto.html").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_design_chooses_the_admittance_where_the_file_leaves_it_open(run):
    free = SCENARIO.replace("[obstacle]", "damping_ratio_bounds = [0.7, 1.5]\n[obstacle]")
    Path("free.toml").write_text(free)
    code, out, err = run("design", "free.toml")
    assert (code, err) == (0, "")
    assert out.startswith("The optimal admittance has a natural frequency of 5 rad/s and a damping ratio of 1.5")
    assert "The admittance" in Path("free-design.html").read_text(encoding="utf-8")
    told = strict(run("design", "free.toml", "--json")[1])
    assert told["status"] == "optimal"
    assert told["admittance"]["damping_ratio"] == 1.5
    assert told["admittance"]["unchanged"]["gain"] == pytest.approx(-0.8081, abs=1e-4)
    told = strict(run("pareto", "free.toml", "--json")[1])
    assert told["free"] == ["gain", "damping_ratio"]


@pytest.mark.slow
def test_the_lines_that_a_free_admittance_is_replaced_by_are_verified(run):
    loop = '[chain]\nrate = "500 Hz"\nnoise = "1 mV"\n[controller]\nrate = "1 kHz"\nfloor = "34.9 mV"\n'
    text = SCENARIO.replace("scale = 0.458", 'scale = "0.458 V"') + loop
    free = text.replace("[obstacle]", "damping_ratio_bounds = [0.7, 1.5]\n[obstacle]")
    Path("free.toml").write_text(free)
    for verb in (["verify", "--runs", "5"], ["simulate"], ["simulate", "--gain", "-0.7 N*s"]):
        code, out, err = run(verb[0], "free.toml", *verb[1:])
        assert (code, out, "admittance.damping_ratio_bounds" in err) == (2, "", True)
    designed = run("design", "free.toml", "--no-report")[1]
    section = re.search(r"  \[admittance\]\n(?:  \w+ = .*\n)+", designed)[0].replace("  ", "")
    start, end = free.index("[admittance]"), free.index("[obstacle]")
    Path("one.toml").write_text(free[:start] + section + free[end:])
    compared = run("compare", "one.toml", "free.toml", "--runs", "5", "--no-report")[1]
    assert "free was not verified: free.toml, line" in " ".join(compared.split())
    gain = strict(run("simulate", "one.toml", "--json")[1])["gain"]
    assert gain == pytest.approx(strict(run("design", "free.toml", "--json")[1])["gain"], rel=1e-6)


@pytest.mark.parametrize(
    ("section", "line", "says"),
    [
        ("pareto", 'quantities = ["time"]', "expected a list of two or three quantities"),
        ("pareto", 'quantities = ["time", "speed"]', 'quantities[1]: found "speed", expected one of "time"'),
        (
            "pareto",
            'quantities = ["time", "time"]',
            "quantities: found time, time, expected two or three different names",
        ),
        (
            "pareto",
            'quantities = ["time", "impact_force"]',
            "quantities[1]: the quantity impact_force needs the section [impact]",
        ),
        ("pareto", 'choice = "1 m"', 'choice: found "1 m", expected a quantity in N*s'),
        ("pareto", "gain = 1", "gain: found"),
        ("admittance", "damping_ratio_bounds = [1.5, 0.7]", "damping_ratio_bounds: found bounds from 1.5 to 0.7"),
        ("admittance", "damping_ratio_bounds = 1", "damping_ratio_bounds: found 1, expected a list of two numbers"),
        ("admittance", 'natural_frequency_bounds = ["1 Hz", "2 Hz"]', "expected an angular frequency in rad/s"),
        ("admittance", 'natural_frequency_bounds = ["1 m", 2]', 'bounds[0]: found "1 m", expected a quantity in rad'),
    ],
)
def test_a_mistake_in_the_file_is_placed(run, section, line, says):
    text = SCENARIO + f"[pareto]\n{line}\n"
    if section == "admittance":
        text = SCENARIO.replace("[obstacle]", f"{line}\n[obstacle]")
    Path("wrong.toml").write_text(text)
    code, out, err = run("pareto", "wrong.toml")
    assert (code, out) == (2, "")
    number = next(i for i, found in enumerate(text.splitlines(), 1) if found == line)
    assert err.startswith(f"pretouch: wrong.toml, line {number}: {section}.")
    assert says in err


def test_what_only_the_search_finds_out_is_placed_too(run):
    text = SCENARIO.replace('"25 N/m"', '"0 N/m"').replace("[obstacle]", "damping_ratio_bounds = [0.7, 1]\n[obstacle]")
    Path("wrong.toml").write_text(text)
    for verb in ("design", "pareto"):
        code, out, err = run(verb, "wrong.toml")
        assert (code, out) == (2, "")
        assert err.startswith("pretouch: wrong.toml, line 9: admittance.damping_ratio_bounds: found bounds")


# --- figures and reports

FRONTS = {
    "gain": lambda p: front_of(p, choice=-0.7),
    "limits": lambda p: front_of(p, constraints=[pt.Constraint(name="acceleration", limit=5.0)], choice=-0.3),
    "three": lambda p: front_of(p, ("time", "relative_velocity", "largest_acceleration"), choice=-0.7),
    "admittance": lambda p: front_of(p, choice=pt.design(p), **FREE),
    "surface": lambda p: front_of(
        p, ("displacement", "relative_velocity", "acceleration"), natural_frequency=(3.0, 10.0)
    ),
    "one point": lambda p: front_of(p, ("time", "displacement")),
    "no bound": lambda p: pt.pareto(
        pt.Task(
            p.scenario,
            pt.ExponentialSecondOrder(scale=0.48, rate=-74.0, curvature=474.0),
            bounds=p.bounds,
            method="uniform-motion",
        )
    ),
}


@pytest.fixture(scope="module", params=FRONTS)
def front(request, problem):
    return FRONTS[request.param](problem)


@pytest.mark.slow
def test_figures_of_fronts_are_legible(front):
    figure = plots.pareto(front)
    assert_legible(figure)
    texts = " ".join(text for text, _ in visible_texts(figure))
    assert ("knee" in texts) == (front.knee is not None)
    assert ("choice" in texts) == (front.choice is not None)


def printed_number(cell):
    """Return what a cell says in SI, and half a unit of its last digit."""
    number, _, unit = cell.partition(" ")
    factor = {"mm": 1e-3, "mm/s": 1e-3, "ms": 1e-3}.get(unit, 1.0)
    digits = len(number.partition(".")[2])
    return float(number) * factor, 0.5000001 * 10.0**-digits * factor


def check_printed_points(front, text):
    """Solve the encounter of every printed gain, admittance included: its motion has the numbers in the same column."""
    if not len(front.gain):
        return

    def cells(name):
        words = QUANTITIES[name].words
        symbol = QUANTITIES[name].symbol
        return row(text, f"{words} {symbol if '|' in symbol else f'|{symbol}|'}", "The Pareto front")

    inputs = {"gain": [printed_number(cell) for cell in row(text, "gain D_p", "The Pareto front")]}
    for name, words in (("natural_frequency", "natural frequency"), ("damping_ratio", "damping ratio")):
        if name in front.free:
            inputs[name] = [printed_number(cell) for cell in row(text, words, "The Pareto front")]
    method = "uniform-motion" if front.result.method == "uniform-motion" else "auto"
    for k in range(len(inputs["gain"])):

        def values(shifted="", k=k):
            chosen = {name: column[k][0] + (name == shifted) * column[k][1] for name, column in inputs.items()}
            a = front.scenario.admittance
            held = {n: chosen.get(n, getattr(a, n)) for n in ("natural_frequency", "damping_ratio")}
            if len(inputs) > 1:
                a = pt.Admittance.from_natural_frequency(mass=a.mass, **held)
            end = pt.find_contact(
                replace(front.scenario, admittance=a), front.sensor, chosen["gain"], method=method
            ).end
            return np.abs([float(getattr(end, name)) for name in front.quantities])

        # each input is rounded, and so is what is printed of the motion
        doubt = 1.1 * sum(np.abs(values(name) - values()) for name in inputs)
        for i, name in enumerate(front.quantities):
            shown, last = printed_number(cells(name)[k])
            assert shown == pytest.approx(values()[i], abs=last + doubt[i]), (name, k)


@pytest.mark.slow(keep=1)
def test_reports_of_fronts_are_whole_pages(front):
    text = report_html(front, source={"name": EVIL, "text": EVIL, "sha256": "0"})
    assert_sound(text)
    assert ("The knee is the point" in parse(text).words) == (len(front.gain) > 0)
    points = [p for p in (*front.ends, front.knee, front.choice) if p is not None]
    for name, unit in zip(front.quantities, front.units, strict=True):
        q = QUANTITIES[name]
        symbol = q.symbol if "|" in q.symbol else f"|{q.symbol}|"
        shown = [pretty_unit(format_quantity(p.values[name], unit)) for p in points]
        assert row(text, f"{q.words} {symbol}", "The Pareto front") == shown
    if front.comparison is not None:
        ratios = ["\u2013" if np.isnan(p.bound.ratio) else f"{p.bound.ratio:.3g}" for p in points]
        assert row(text, "relative to the smallest possible deviation") == ratios
    check_printed_points(front, text)
    for constraint in front.constraints:
        assert constraint.limit == 5.0
        words = QUANTITIES[constraint.quantity].words
        assert row(text, f"limit of {words}", "Encounter") == ["5 m/s\u00b2"]
    heads = table(text, "The Pareto front")[0]
    assert heads[1 + len(front.ends) :] == [p.name for p in (front.knee, front.choice) if p is not None]
    assert len(str(front).splitlines()) > len(front.quantities) + 4


@pytest.mark.slow
@pytest.mark.parametrize("free", [{"natural_frequency": (3.0, 10.0)}, {"damping_ratio": (0.7, 1.5)}, FREE])
def test_a_designed_admittance_is_drawn_and_reported(problem, free):
    design = pt.design(pt.Task(problem.scenario, problem.sensor, problem.objective, bounds=problem.bounds, **free))
    figure = plots.admittance(design)
    assert_legible(figure)
    assert {"chosen", "without change"} <= {text for text, _ in visible_texts(figure)}
    text = report_html(design)
    assert_sound(text)
    assert "The admittance" in parse(text).words
    json.dumps(design.to_dict(), allow_nan=False)


@pytest.mark.slow
def test_what_cannot_be_drawn_is_refused(problem):
    limits = [pt.Constraint(name="excursion", limit=1e-6)]
    with refused("front"):
        plots.pareto(front_of(problem, constraints=limits))
    design = pt.design(
        pt.Task(problem.scenario, problem.sensor, problem.objective, bounds=problem.bounds, constraints=limits, **FREE)
    )
    with refused("design"):
        plots.admittance(design)
    assert "unchanged" in parse(report_html(design)).words
