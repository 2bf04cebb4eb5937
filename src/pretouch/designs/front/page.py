"""Build the report of a Pareto front.

It shows the knee, the end points and the physical limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pretouch._core.blocks import (
    Cell,
    Listing,
    Measured,
    Named,
    Page,
    PageSection,
    PageTable,
    Paragraph,
    Picture,
    named,
    named_entry,
)
from pretouch._core.units import format_quantity, format_range, pretty_unit
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.motion.page_sections import inputs_section, method_section

from ..impact import impact_rows
from ..page_sentences import step_without_gain
from .result import FrontPoint, FrontStatus, ParetoFront

Row = tuple[Cell, ...]

_BEHIND: Final = 1e-3  # a point within this share of the front's extent counts as on the front
_STATUS: Final = {
    FrontStatus.FOUND: "Pareto front found",
    FrontStatus.INFEASIBLE: "infeasible: no point within the bounds meets every constraint",
    FrontStatus.NO_CONTACT: "no contact: no point within the bounds ends in contact",
}
_KNEE: Final = (
    "The knee is the point with the largest distance below the straight line, or plane, through the ends of the front. "
    "Each quantity is scaled by its range along the front. At the knee, a small loss in one quantity gains most in the "
    "others. Other bounds of the gain and the admittance move the ends of the front, and so the knee."
)
_COMPARED: Final = (
    "The smallest possible deviation is that of an ideal robot with the same largest acceleration and the same "
    "relative velocity at contact. The smallest possible acceleration is the one that an ideal robot needs to reach "
    "that velocity from the same detection distance."
)
_BOUND: Final = (
    "The physical bound holds for every controller and every sensor. It assumes an ideal robot: at rest at detection, "
    "it knows distance and speed of the object from then on, retreats without first moving toward it, and reaches the "
    "given acceleration limit without delay."
)


def front_page(front: ParetoFront) -> Page:
    """Return the report page that shows a Pareto front."""
    method = "No point is feasible." if front.result is None else front.result.method
    return Page(
        kind="Pareto front of preemptive impact mitigation",
        headline=front.headline,
        status=_STATUS[front.status],
        good=front.status is FrontStatus.FOUND,
        key_figures=tuple(_key_figures(front)),
        warnings=(*front.problem.task.start_warnings(None), *front.problem.task.warnings),
        findings=tuple(_sentences(front)) if len(front.gain) else (),
        next_step=_next_step(front),
        lead="pareto",
        blocks=(
            _points(front) if len(front.gain) else None,
            _evidence(front) if len(front.gain) else None,
            inputs_section(front.scenario, front.sensor, *_settings(front)),
            method_section(method, solved_on="loop" if method == "loop" else "motion"),
        ),
    )


def _next_step(front: ParetoFront) -> str:
    if front.status is FrontStatus.FOUND:
        return "choose a point of the front in the report, and use its values as limits of a design"
    contact = front.status is not FrontStatus.NO_CONTACT
    return step_without_gain(front.problem.task, contact=contact, relaxations=front.relaxations)


def _key_figures(front: ParetoFront) -> Iterator[tuple[str, Cell]]:
    for point in front.marked[:1]:
        yield f"{front.number.label} at the {point.name}", Measured(point.gain, front.number.unit)
        for name, value in point.values.items():
            yield front.number.entry(name).words, Measured(value, front.number.entry(name).unit, 3)
        if point.bound is not None and math.isfinite(point.bound.ratio):
            yield "relative to the smallest possible excursion", Measured(float(point.bound.ratio), "", 3)


def _points(front: ParetoFront) -> PageSection:
    points = (*front.ends, *front.marked)
    caption = (
        "No point of the Pareto front is better than another in every quantity; gray points are feasible and worse. If "
        "the physical bound applies, a plot compares the excursion along the front with the smallest possible "
        "excursion for the same contact speed and detection distance."
    )
    name = "Pareto front, the parameters along it, and the physical bound"
    sentences = tuple(_sentences(front))
    columns = zip(*(_column(front, point) for point in points), strict=True)
    rows = tuple((cells[0][0], *(cell for _, cell in cells)) for cells in columns)
    note = "" if front.comparison is None else _COMPARED
    return PageSection(
        title="The Pareto front",
        opened=True,
        blocks=(
            Picture(figure="pareto", of=front, name=name, caption=caption),
            PageTable(head=("", *(_title(front, point) for point in points)), rows=rows, note=note, brief=True),
            Listing(items=sentences, brief=True) if sentences else None,
            Paragraph(text=_KNEE, quiet=True),
            Paragraph(text=_BOUND, quiet=True),
        ),
    )


def _title(front: ParetoFront, point: FrontPoint) -> str:
    kind, _, quantity = point.name.partition(" ")
    return f"{kind} {front.number.entry(quantity).short}" if quantity else kind


def _column(front: ParetoFront, point: FrontPoint) -> Iterator[tuple[Cell, Measured]]:
    """Yield labels and values of one Pareto point."""
    n = front.number
    yield Named(n.name, n.symbol), Measured(point.gain, n.unit)
    for name in front.free[1:]:
        yield words_for(name), Measured(getattr(point, name), front.free_units[name])
    for name, value in point.values.items():
        yield named_entry(n.entry(name), magnitude=True), Measured(value, n.entry(name).unit)
    if front.comparison is None:
        return
    names = ("acceleration", "excursion", "least_excursion", "ratio", "least_acceleration")
    bound = {name: None if point.bound is None else float(getattr(point.bound, name)) for name in names}
    for name, attribute in (("largest_acceleration", "acceleration"), ("displacement", "excursion")):
        if name not in front.quantities:
            yield named(name, magnitude=True), Measured(bound[attribute], unit_of(name))
    yield "smallest possible deviation", Measured(bound["least_excursion"], "m")
    yield "relative to the smallest possible deviation", Measured(bound["ratio"], "", 3)
    yield "smallest possible acceleration", Measured(bound["least_acceleration"], "m/s^2")


def _sentences(front: ParetoFront) -> Iterator[str]:
    """Yield report sentences on the user's chosen design and the physical bound."""
    if front.choice is not None and front.knee is not None:
        yield _about_choice(front, front.choice)
    if front.no_bound:
        yield f"No physical bound: {front.no_bound}."
    elif front.bound is not None:
        least = float(front.bound.least_contact_speed)
        limit = pretty_unit(format_quantity(float(front.bound.acceleration_limit), "m/s^2"))
        after = format_quantity(float(front.bound.excursion(least)), "m")
        yield (
            f"With an acceleration limit of {limit}, the smallest contact speed that any robot can reach is "
            f"{format_quantity(least, 'm/s')}, at an excursion of {after}."
        )


def _about_choice(front: ParetoFront, choice: FrontPoint) -> str:
    if not choice.feasible:
        return "The choice violates a constraint."
    if not choice.distance_to_front > _BEHIND:
        return "The choice lies on the Pareto front."
    text = (
        "The Pareto front improves every quantity of your choice by at least "
        f"{100 * choice.distance_to_front:.2g} % of its range."
    )
    if len(front.quantities) == 2:
        first, second = front.quantities
        one, other = front.number.entry(first), front.number.entry(second)
        best = front.of(first)[front.meets(**{second: choice.values[second]})].min()
        least, chosen = (format_quantity(float(value), one.unit) for value in (best, choice.values[first]))
        text += f" At equal {other.short}, the front reduces the {one.short} from {chosen} to {least}."
    return text


def _evidence(front: ParetoFront) -> PageSection:
    pieces = int(front.piece.max()) + 1
    rows = (
        ("searched", f"{front.evaluated} encounters"),
        ("Pareto front", f"{_count(len(front.gain), 'point')} in {_count(pieces, 'piece')}"),
        (
            "largest error",
            "no other evaluated design improves all quantities by more than "
            f"{100 * front.approximation_error:.2g} % of their ranges",
        ),
    )
    return PageSection(title="Evidence", titled=True, blocks=(PageTable(rows=rows, wraps=True, brief=True),))


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _settings(front: ParetoFront) -> Iterator[Row]:
    """Yield table rows with the bounds of free parameters, the limits and the impact model of a front."""
    gain_name = front.number.name
    free = {"gain": front.bounds, "natural_frequency": front.natural_frequency_bounds}
    for name, bounds in {**free, "damping_ratio": front.damping_ratio_bounds}.items():
        if bounds is not None:
            label = gain_name if name == "gain" else words_for(name)
            yield f"{label}: bounds", format_range(bounds, front.free_units[name])
    for constraint in front.constraints:
        limited = front.number.entry(constraint.quantity)
        yield f"limit of {limited.words}", Measured(constraint.limit, limited.unit)
    yield from impact_rows(front.impact)
