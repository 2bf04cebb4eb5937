"""Build the report on a gain and an admittance that were optimized together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from pretouch._core.blocks import Cell, Measured, Page, PageSection, PageTable, Paragraph, Picture

from .admittance_result import AdmittanceDesign
from .certificate import DesignStatus
from .page import gain_page
from .page_sentences import step_without_gain

Row = tuple[Cell, ...]


def admittance_page(design: AdmittanceDesign) -> Page:
    """Return the report of a combined gain and admittance design."""
    chosen = design.gain_design is not None
    page = gain_page(design.gain_design or design.unchanged)
    head = ("", "natural frequency", "damping ratio", design.number.label, "objective")
    evidence = tuple(_evidence(design))
    follows = Paragraph(
        text=f"{'At this admittance' if chosen else 'With the unchanged admittance'}: {page.headline}", brief=True
    )
    picture = Picture(
        figure="admittance",
        of=design,
        name="Best objective over the admittance",
        caption="The best objective that any gain reaches, for each admittance of the search grid. The "
        "chosen optimum is refined by local searches from the grid.",
    )
    admittance = PageSection(
        title="The admittance",
        opened=True,
        blocks=(
            PageTable(head=head, rows=tuple(_rows(design)), brief=True),
            picture if design.certificate is not None else None,
            PageTable(rows=evidence, wraps=True, brief=True) if evidence else None,
            follows,
        ),
    )
    step = page.next_step
    if design.status is DesignStatus.INFEASIBLE:
        step = step_without_gain(design.problem.task, contact=True, relaxations=design.relaxations)
    lines = _lines_for_scenario(design) if chosen else ()
    if lines:
        step = f"replace [admittance] of the scenario file by the lines below. Then {step}"
    return replace(
        page,
        headline=design.headline,
        good=chosen,
        next_step=step,
        next_lines=lines,
        blocks=(admittance, *page.blocks),
    )


def _lines_for_scenario(design: AdmittanceDesign) -> tuple[str, ...]:
    """Return the section [admittance] with the optimal admittance, which verification and export need."""
    chosen = design.scenario.admittance
    return (
        "[admittance]",
        f'mass = "{float(chosen.mass):.9g} kg"',
        f'natural_frequency = "{float(chosen.natural_frequency):.9g} rad/s"',
        f"damping_ratio = {float(chosen.damping_ratio):.9g}",
    )


def _rows(design: AdmittanceDesign) -> Iterator[Row]:
    for i, m in enumerate(() if design.certificate is None else design.certificate.local_minima):
        cells = (Measured(m.damping_ratio), Measured(m.gain, design.number.unit), Measured(m.objective))
        yield "local minimum" if i else "optimal", Measured(m.natural_frequency, "rad/s"), *cells
    before = design.unchanged
    unchanged = before.scenario.admittance
    ratio = Measured(float(unchanged.damping_ratio) if unchanged.stiffness > 0 else None)
    cells = (ratio, Measured(before.gain, design.number.unit), Measured(before.objective))
    yield "unchanged", Measured(float(unchanged.natural_frequency), "rad/s"), *cells


def _evidence(design: AdmittanceDesign) -> Iterator[Row]:
    c = design.certificate
    if c is None:
        return
    active = ", ".join(f"{name.replace('_', ' ')} (multiplier {value:.3g})" for name, value in c.active)
    yield (
        "searched",
        f"the search evaluated {c.grid} combinations of gain and admittance on a grid. A test of {c.tests} other "
        "combinations found none that is better than the optimum",
    )
    yield "active limits and bounds", active or "none: the optimum lies inside"
    yield "first-order residual, relative to the objective", f"{c.residual:.1e}"
