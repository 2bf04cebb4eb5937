"""Build the report section on sensors that fail."""

from __future__ import annotations

from pretouch._core.blocks import Measured, PageSection, PageTable, Paragraph
from pretouch._core.units import format_quantity

from .breakage import PLACES, Breakage


def breakage_section(breakage: Breakage | None) -> PageSection | None:
    """Return the report section on sensors that fail."""
    if breakage is None:
        return None
    head = ("disturbance", "toward the object at most", "begins at", "hardest contact", "harder than unmitigated")
    rows = tuple(
        (
            one.name,
            Measured(one.speed, "m/s", 3),
            Measured(one.distance, "m", 3),
            Measured(one.contact_speed, "m/s", 3),
            f"{one.harder_than_unmitigated} of {one.runs} runs",
        )
        for one in breakage.results
    )
    shares = ", ".join(f"{100 * place:g}" for place in PLACES)
    note = (
        f"Each disturbance begins at {shares} % of the start distance. Speeds toward the object are beyond that of the "
        "reference, until the first contact. Readings that are stuck cause no force, so that only the admittance moves "
        "the robot; no check of the readings prevents this motion. Over all rows, "
        f"contact is harder than with such readings in {breakage.harder} of {breakage.runs} runs."
    )
    if breakage.bound:
        note += f" The bound is {format_quantity(breakage.bound, 'm/s', 3)}."
    if breakage.return_rate:
        note += (
            f" It contains the return to the reference: at most {format_quantity(breakage.return_rate, '1/s', 3)} "
            f"times the excursion before, which is up to {format_quantity(breakage.excursion, 'm', 3)}."
        )
    if breakage.jump:
        note += (
            " A jump of the readings that largest_rate still allows causes at most "
            f"{format_quantity(breakage.jump, 'm/s', 3)}: |D_p| times largest_rate times the sum of sensor period "
            "and half of fade_time, divided by the virtual mass."
        )
    table = PageTable(head=head, rows=rows, note=note, brief=True)
    return PageSection(title="If the sensor fails", blocks=(Paragraph(text=f"{breakage.text}.", brief=True), table))
