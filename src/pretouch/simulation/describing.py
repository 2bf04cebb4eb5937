"""What every page says of a sampled loop: sensor chain, controller, robot, contact, as rows and as sentences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pretouch._core.block_text import cell_as_text
from pretouch._core.blocks import Cell, Chapter, Measured, Rows
from pretouch.control import Controller

from .closed_loop import ClosedLoop
from .contact import ContactModel
from .law import SampledLaw

__all__ = ["contact_rows", "law_rows", "loop_rows", "loop_section", "loop_sentences"]

Row = tuple[str, Cell]


def loop_section(loop: ClosedLoop, *first: Row) -> Chapter:
    """Return the section of a page that says what a loop is made of, after rows of the page's own."""
    parts = (
        ("Sensor chain", loop.chain.rows()),
        ("Controller", law_rows(loop.law)),
        ("Robot", loop.plant.rows()),
        ("Contact", contact_rows(loop.contact)),
    )
    sections = (Chapter(title=title, blocks=(Rows(rows=tuple(rows), wraps=True),)) for title, rows in parts)
    return Chapter(title="The loop", blocks=(Rows(rows=(*first, *loop_rows(loop))), *sections))


def loop_sentences(loop: ClosedLoop) -> Iterator[str]:
    """Yield what a loop is made of in a sentence for each part, in plain text."""
    yield f"Sensor: {_joined(loop.chain.rows())}; noise is normal, and independent from reading to reading."
    yield f"Controller: {_joined(law_rows(loop.law))}."
    follow = () if loop.contact is None else (("followed for", Measured(loop.follow, "s")),)
    for rows in (loop.plant.rows(), (*contact_rows(loop.contact), *follow)):
        (name, kind), *others = rows
        yield f"{name.capitalize()}: {'; '.join(part for part in (cell_as_text(kind), _joined(others)) if part)}."


def _joined(rows: Iterable[Row]) -> str:
    return "; ".join(f"{name} {cell_as_text(cell)}" for name, cell in rows).replace("\u03be", "xi")


def loop_rows(loop: ClosedLoop) -> Iterator[Row]:
    """Yield how runs of a loop are drawn and how long they last."""
    yield "seed of the noise", str(loop.seed)
    yield "waits for contact", Measured(loop.horizon, "s")
    if loop.contact is not None:
        yield "goes on after the first contact", Measured(loop.follow, "s")


def law_rows(law: SampledLaw) -> Iterable[Row]:
    """Return the parameters of a controller, its gain left out; of any other law its name and its period."""
    if isinstance(law, Controller):
        return law.rows()
    return ("law", type(law).__name__), ("period", Measured(law.period, "s"))


def contact_rows(contact: ContactModel | None) -> Iterator[Row]:
    """Yield the parameters of a contact force, where the loop has one."""
    if contact is None:
        yield "contact", "no contact force: a run ends at the touch"
    else:
        yield from contact.rows()
