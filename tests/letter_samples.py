"""Small letter reports that hold every kind of thing a real one may hold, made without computing anything."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pretouch.letter.comparison import Comparison, Parameter, Verdict, compare, measured
from pretouch.letter.result import DataTable, Evidence, Finding, LetterReport, Reproduction
from pretouch.report.style import new_figure

CODE = '''\
"""Makes the figure."""

import pretouch as pt

if 1 < 2 and "ξ" != '</pre>':
    print(pt.__name__, "a & b", "\\n")
'''
NUMBERS = {
    "gain": np.array([-0.1, np.nan, -np.inf]),
    "steps": (np.int64(3), np.bool_(True), None),
    "verdict": Verdict.AGREES,
    "text": "</script><!-- ξ",
    "curves": {"first": [0.1, 1e-300]},
}


def figure():
    drawn = new_figure(3.0, 2.0)
    axes = drawn.subplots()
    axes.plot([0.0, 1.0], [0.0, 2.0])
    axes.set_xlabel("time t [s]")
    return drawn


def comparisons(write: Callable[[str], str] = str) -> tuple[Comparison, ...]:
    repeated = compare(
        write("x at contact, -0.7"),
        "-0.082",
        -0.091534,
        unit=write("m"),
        place=write("Table II"),
        reason=write("the printed value repeats l'"),
        over_inputs=(-0.0921, -0.0909),
    )
    return (
        compare(write("l' at contact"), "-0.088", -0.08766, unit=write("m/s"), place=write("Table II")),
        compare(write("scale"), "1.30e-5", 1.312e-5, unit="", place=write("Table I"), over_inputs=(1.29e-5, 1.32e-5)),
        repeated,
        measured(write("time"), "0.94", 0.687, unit="s", place=write("Table III"), reason=write("friction")),
    )


def finding(*, id: int = 2, holds: bool = True, write: Callable[[str], str] = str) -> Finding:  # noqa: A002 - its field
    return Finding(
        id=id,
        title=write(f"Column {id} is headed -1.0 and holds the values of D_p = -10."),
        place=write("Table II"),
        statement=write("Its values follow from D_p = -10 only."),
        evidence=(
            Evidence(name=write("x at contact, D_p = -10"), value=np.float64(-0.61071), unit=write("N*s")),
            Evidence(name=write("in words"), value=write("as printed")),
            Evidence(name=write("the printed column is that of -10"), value=holds),
        ),
        holds=holds,
    )


def reproduction(
    id: str = "table-2",  # noqa: A002 - its field
    *,
    given: tuple[Comparison, ...] | None = None,
    findings: tuple[Finding, ...] = (),
    write: Callable[[str], str] = str,
    code: str = CODE,
) -> Reproduction:
    return Reproduction(
        id=id,
        title=write(f"The gains of {id}"),
        place=write("Table II, Section IV-B"),
        summary=write("Every gain was run to contact."),
        parameters=(
            Parameter(name=write("mass"), symbol=write("M_a"), printed="1.0", unit=write("kg"), place=write("IV-B")),
            Parameter(name=write("exponent"), symbol="n", printed="3.32", unit="", place=write("Table I")),
        ),
        comparisons=comparisons(write) if given is None else given,
        findings=findings,
        tables=(
            DataTable(
                title=write("Gains between"),
                head=(write("D_p [N s]"), "f1"),
                rows=((write("-0.75"), "0.107"), ("-0.76", "0.108")),
                note=write("Read, not printed."),
            ),
        ),
        caption=write("The objective over the gain."),
        code=code,
        figure=figure(),
        numbers={**NUMBERS, write("key"): write("value")},
    )


def good(write: Callable[[str], str] = str) -> LetterReport:
    """Make a report in which everything comes out."""
    return LetterReport(
        reproductions=(
            reproduction("table-2", findings=(finding(id=4, write=write), finding(id=2, write=write)), write=write),
            reproduction("figure-6", findings=(finding(id=3, write=write),), write=write),
        )
    )


def bad() -> LetterReport:
    """Make a report in which one finding and one number do not come out."""
    odd = compare("f1 at -0.9", "0.110", 0.25, unit="", place="Table II")
    return LetterReport(
        reproductions=(reproduction(given=(odd, *comparisons()), findings=(finding(id=1), finding(id=7, holds=False))),)
    )
