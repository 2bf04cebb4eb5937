"""What a design of gain and admittance says, before what it says of the gain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from pretouch._core.blocks import Cell, Chapter, Measured, Page, Paragraph, Picture, Rows

from .admittance_result import AdmittanceDesign
from .page import gain_page

__all__ = ["admittance_page"]

Row = tuple[Cell, ...]


def admittance_page(design: AdmittanceDesign) -> Page:
    """Describe a design of any status: the page of its gain, at the chosen admittance or as it is, after its own."""
    chosen = design.gain_design is not None
    page = gain_page(design.gain_design or design.as_it_is)
    head = ("", "natural frequency", "damping ratio", "gain D_p", "objective")
    evidence = tuple(_evidence(design))
    follows = Paragraph(
        text=f"{'At this admittance' if chosen else 'With the admittance as it is'}: {page.headline}", brief=True
    )
    picture = Picture(
        figure="admittance",
        of=design,
        name="Best objective over the admittance",
        caption="The best objective over the gains, for the admittances of the search grid; the chosen point is the "
        "minimum that was found from there.",
    )
    own = Chapter(
        title="The admittance",
        blocks=(
            Rows(head=head, rows=tuple(_rows(design)), brief=True),
            picture if design.certificate is not None else None,
            Rows(rows=evidence, wraps=True, brief=True) if evidence else None,
            follows,
        ),
    )
    return replace(page, headline=design.headline, good=chosen, blocks=(own, *page.blocks))


def _rows(design: AdmittanceDesign) -> Iterator[Row]:
    for i, m in enumerate(() if design.certificate is None else design.certificate.local_minima):
        cells = (Measured(m.damping_ratio), Measured(m.gain, "N*s"), Measured(m.objective))
        yield "local minimum" if i else "chosen", Measured(m.natural_frequency, "rad/s"), *cells
    before = design.as_it_is
    own = before.scenario.admittance
    ratio = Measured(float(own.damping_ratio) if own.stiffness > 0 else None)
    cells = (ratio, Measured(before.gain, "N*s"), Measured(before.objective))
    yield "as it is", Measured(float(own.natural_frequency), "rad/s"), *cells


def _evidence(design: AdmittanceDesign) -> Iterator[Row]:
    c = design.certificate
    if c is None:
        return
    held = ", ".join(f"{name.replace('_', ' ')} (multiplier {value:.3g})" for name, value in c.active)
    yield "searched", f"{c.grid} encounters on a grid; none of {c.tests} others is better than what was found"
    yield "the optimum is held by", held or "nothing: it lies inside"
    yield "first-order residual, of the objective", f"{c.residual:.1e}"
