"""Small letter reports that hold every kind of thing a real one may hold, made without computing anything."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pretouch.letter.experiment import Finding, LetterReport, Reproduction, Step, readings
from pretouch.letter.printed import Agreement, Parameter, Printed
from pretouch.report.new_figure import new_figure

CODE = '''\
"""Makes the figure."""

import pretouch as pt

if 1 < 2 and "ξ" != '</pre>':
    print(pt.__name__, "a & b", "\\n")
'''
NUMBERS = {
    "gain": np.array([-0.1, np.nan, -np.inf]),
    "steps": (np.int64(3), np.bool_(True), None),
    "verdict": Agreement.AGREES,
    "text": "</script><!-- ξ",
    "curves": {"first": [0.1, 1e-300]},
}


def figure():
    drawn = new_figure(3.0, 2.0)
    axes = drawn.subplots()
    axes.plot([0.0, 1.0], [0.0, 2.0])
    axes.set_xlabel("time t [s]")
    return drawn


def comparisons(write: Callable[[str], str] = str) -> tuple[Printed, ...]:
    place, repeats = write("Table II"), write("the printed value repeats l'")
    span, friction = (-0.0921, -0.0909), write("friction")
    return (
        Printed(write("l' at contact"), "-0.088", -0.08766, write("m/s"), place),
        Printed(write("scale"), "1.30e-5", 1.312e-5, "", write("Table I"), over_inputs=(1.29e-5, 1.32e-5)),
        Printed(write("x at contact, -0.7"), "-0.082", -0.091534, write("m"), place, repeats, over_inputs=span),
        Printed(write("time"), "0.94", 0.687, "s", write("Table III"), friction, hardware=True),
    )


def finding(*, id: int = 2, holds: bool = True, write: Callable[[str], str] = str) -> Finding:  # noqa: A002 - its field
    return Finding(
        id=id,
        title=write(f"Column {id} is headed -1.0 and holds the values of D_p = -10."),
        place=write("Table II"),
        statement=write("Its values follow from D_p = -10 only."),
        evidence=(
            Step(write("x at contact, D_p = -10"), np.float64(-0.61071), write("N*s")),
            Step(write("in words"), write("as printed")),
            Step(write("the printed column is that of -10"), np.bool_(holds)),
        ),
    )


def reproduction(
    id: str = "table-2",  # noqa: A002 - its field
    *,
    given: tuple[Printed, ...] | None = None,
    findings: tuple[Finding, ...] = (),
    write: Callable[[str], str] = str,
    code: str = CODE,
) -> Reproduction:
    columns = {write("D_p [N s]"): ([write("-0.75"), "-0.76"], ""), "f1": ([0.107, 0.108], ".3f")}
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
        tables=(readings(write("Gains between"), columns, write("Read, not printed.")),),
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
    odd = Printed("f1 at -0.9", "0.110", 0.25, "", "Table II")
    return LetterReport(
        reproductions=(reproduction(given=(odd, *comparisons()), findings=(finding(id=1), finding(id=7, holds=False))),)
    )
