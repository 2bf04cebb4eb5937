"""Where the letter's text disagrees with its own equations: derived, so that with other data nothing would be found."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from pretouch.letter import (
    Agreement,
    Finding,
    Parameter,
    Printed,
    figure_4,
    figure_5,
    figure_6,
    inputs,
    reproduce,
    table_1,
    table_2,
    table_3,
)
from pretouch.letter.printed import resolution


def finding(name: str, number: int) -> Finding:
    return next(f for f in reproduce([name]).findings if f.id == number)


@pytest.mark.parametrize(
    ("name", "numbers"),
    [("table-1", [7]), ("table-2", [1, 2]), ("table-3", [6, 8]), ("figure-4", [4]), ("figure-5", [3])],
)
def test_each_finding_holds_and_shows_its_steps(name: str, numbers: list[int]) -> None:
    found = reproduce([name]).findings
    assert [f.id for f in found] == numbers
    for f in found:
        assert f.holds
        assert len(f.evidence) >= 2
        assert f.place
        assert len(f.statement) > 80


def test_a_correct_table_2_would_not_be_corrected(monkeypatch: pytest.MonkeyPatch) -> None:
    right = {
        **table_2.PRINTED,
        "-0.7": ("-0.092", "-0.081", "0.107"),
        "-1.0": ("-0.124", "-0.069", "0.114"),
    }
    monkeypatch.setattr(table_2, "PRINTED", right)
    found = reproduce(["table-2"])
    assert [f.holds for f in found.findings] == [False, False]
    assert not found.holds
    own = [c for c in found.reproductions[0].comparisons if "last column" not in c.name]
    assert all(c.agreement in {Agreement.AGREES, Agreement.WITHIN_INPUTS} for c in own)


def test_a_ratio_that_were_one_would_not_be_renamed(monkeypatch: pytest.MonkeyPatch) -> None:
    left = {"inverse-power": "22.9", "exponential-1": "29.6", "exponential-2": "25.6"}
    monkeypatch.setattr(figure_5, "PRINTED", left)
    assert not finding("figure-5", 3).holds


def test_the_right_position_would_not_be_corrected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figure_4, "SECOND", "-0.138")
    assert not finding("figure-4", 4).holds


def test_a_trend_that_does_not_turn_is_no_finding() -> None:
    speeds = np.arange(1, 101) / 100
    falling = dict.fromkeys(("inverse power", "first order", "second order"), -1 / speeds)
    assert not figure_6._trend(speeds, {"following": falling, "fixed": falling}).holds


def test_times_in_another_order_are_no_ranking(monkeypatch: pytest.MonkeyPatch) -> None:
    swapped = {**table_3.PRINTED, "-0.1": ("2.24", "3.65"), "-0.5": ("0.94", "1.82")}
    monkeypatch.setattr(table_3, "PRINTED", swapped)
    assert not finding("table-3", 6).holds


def test_factors_from_unrounded_percentages_would_not_be_corrected(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = (("-0.5", "-0.6", "45", "17", "2.73"), ("-0.6", "-0.7", "11", "6", "1.91"))
    monkeypatch.setattr(table_3, "STEPS", exact)
    assert not finding("table-3", 8).holds


def test_other_parameters_are_not_recovered(monkeypatch: pytest.MonkeyPatch) -> None:
    steeper = tuple(
        Parameter(p.name, p.symbol, "-66.0", p.unit, p.place) if p.name == "rate" else p
        for p in inputs.SENSORS["exponential-1"]
    )
    changed: Mapping[str, tuple[Parameter, ...]] = {**inputs.SENSORS, "exponential-1": steeper}
    monkeypatch.setattr(inputs, "SENSORS", changed)
    monkeypatch.setattr(table_1, "SENSORS", changed)
    assert not finding("table-1", 7).holds


# --- agreement


@pytest.mark.parametrize(
    ("printed", "ours", "over_inputs", "agreement"),
    [
        ("-0.088", -0.0876, None, Agreement.AGREES),
        ("-0.088", -0.0875, None, Agreement.AGREES),  # half a unit rounds either way
        ("-0.088", -0.0874, None, Agreement.DISAGREES),
        ("-0.088", -0.0874, (-0.0876, -0.0872), Agreement.WITHIN_INPUTS),
        ("-0.088", -0.0864, (-0.0866, -0.0862), Agreement.DISAGREES),
        ("1.30e-5", 1.304e-5, None, Agreement.AGREES),
        ("474", 474.4, None, Agreement.AGREES),
        ("474", 475.0, None, Agreement.DISAGREES),
    ],
)
def test_a_number_agrees_where_it_rounds_to_the_printed_digits(
    printed: str, ours: float, over_inputs: tuple[float, float] | None, agreement: Agreement
) -> None:
    found = Printed("a number", printed, ours, "m", "here", "why", over_inputs=over_inputs)
    assert found.agreement is agreement
    assert found.reason == ("why" if agreement is Agreement.DISAGREES else "")
    assert found.difference == ours - float(printed)


def test_a_disagreement_without_a_reason_is_unexplained() -> None:
    assert Printed("a number", "1.0", 2.0, "", "here").unexplained
    assert not Printed("a number", "1.0", 2.0, "", "here", "a misprint").unexplained
    assert not Printed("a number", "1.0", 2.0, "", "here", hardware=True).unexplained


def test_the_resolution_is_the_last_printed_place() -> None:
    assert [resolution(t) for t in ("0.480", "474", "-74.0", "1.30e-5")] == [0.001, 1.0, 0.1, 1e-7]


# --- the rounding of the printed inputs


def test_the_range_over_the_rounding_holds_every_sensor_that_rounds_to_the_printed_one() -> None:
    """100 sensors inside the box, against its corners: the slope is monotone in both parameters."""
    rng = np.random.default_rng(3)
    low, high = inputs.over_rounding("inverse-power", lambda s: s.log_slope(np.array([0.0, 0.02]))).T
    for n, l_0 in zip(3.32 + 0.005 * rng.uniform(-1, 1, 100), 0.0419 + 5e-5 * rng.uniform(-1, 1, 100), strict=True):
        slope = inputs.sensor("inverse-power", [1.3e-5, l_0, n]).log_slope(np.array([0.0, 0.02]))
        assert (low <= slope).all()
        assert (slope <= high).all()
