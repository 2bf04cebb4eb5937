"""What a front says: its knee, its ends, the user's choice, and how far all of it is from what is possible."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pretouch._core.blocks import Cell, Chapter, Listing, Measured, Named, Page, Paragraph, Picture, Rows, named
from pretouch._core.units import format_quantity, format_range, pretty_unit
from pretouch._core.vocabulary import in_short, unit_of, words_for
from pretouch.motion.page_sections import inputs_section, method_section

from ..constraints import impact_rows
from .result import FrontPoint, FrontStatus, ParetoFront

Row = tuple[Cell, ...]

_BEHIND: Final = 1e-3  # of the extent of the front: less is on it
_STATUS: Final = {
    FrontStatus.FOUND: "front found",
    FrontStatus.INFEASIBLE: "infeasible: no choice within the bounds meets every constraint",
    FrontStatus.NO_CONTACT: "no contact: no choice within the bounds ends in contact",
}
_KNEE: Final = (
    "The knee is the point deepest below the straight line, or plane, through the ends of the front, with each "
    "quantity counted in parts of its range along the front: where giving up a little of one gains most of the others. "
    "It moves with the ends, and so with the bounds of what may be chosen."
)
_BESIDE: Final = (
    "The least deviation is that of any robot that accelerates no more and comes to the same relative velocity at "
    "contact; the least acceleration is the one with which any robot comes to that velocity from the same detection "
    "distance."
)
_BOUND: Final = (
    "The physical bound is that of a robot at rest which knows distance and speed of the object from the moment of "
    "detection, gives way without first moving toward it, and accelerates without delay by at most the acceleration "
    "named. No controller can do with less, whatever its sensor."
)


def front_page(front: ParetoFront) -> Page:
    """Describe a front of any status."""
    method = "No encounter is left to be told of." if front.result is None else front.result.method
    return Page(
        kind="What preemptive impact mitigation can trade",
        headline=front.headline,
        status=_STATUS[front.status],
        good=front.status is FrontStatus.FOUND,
        key_figures=tuple(_key_figures(front)),
        blocks=(
            _points(front) if len(front.gain) else None,
            _evidence(front) if len(front.gain) else None,
            inputs_section(front.scenario, front.sensor, *_sought(front)),
            method_section(method, solved_on="loop" if method == "loop" else "motion"),
        ),
    )


def _key_figures(front: ParetoFront) -> Iterator[tuple[str, Cell]]:
    for point in front.marked[:1]:
        yield f"{front.number.label} at the {point.name}", Measured(point.gain, front.number.unit)
        for name, value in point.values.items():
            yield words_for(name), Measured(value, unit_of(name), 3)
        if point.bound is not None and math.isfinite(point.bound.ratio):
            yield "times the least excursion of any robot", Measured(float(point.bound.ratio), "", 3)


def _points(front: ParetoFront) -> Chapter:
    points = (*front.ends, *front.marked)
    caption = (
        "Of the points of the front none is better than another in every quantity; grey points were tried and are "
        "worse. Where the physical bound applies, the excursion of the front stands over the contact speed, beside the "
        "least with which any robot could come to the same speed from the same detection distance."
    )
    name = "Pareto front, what is chosen along it, and its distance from the physical bound"
    sentences = tuple(_sentences(front))
    columns = zip(*(_column(front, point) for point in points), strict=True)
    rows = tuple((cells[0][0], *(cell for _, cell in cells)) for cells in columns)
    note = "" if front.comparison is None else _BESIDE
    return Chapter(
        title="The front",
        blocks=(
            Picture(figure="pareto", of=front, name=name, caption=caption),
            Rows(head=("", *map(_title, points)), rows=rows, note=note, brief=True),
            Listing(items=sentences, brief=True) if sentences else None,
            Paragraph(text=_KNEE, quiet=True),
            Paragraph(text=_BOUND, quiet=True),
        ),
    )


def _title(point: FrontPoint) -> str:
    kind, _, quantity = point.name.partition(" ")
    return f"{kind} {in_short(quantity)}".strip()


def _column(front: ParetoFront, point: FrontPoint) -> Iterator[tuple[Cell, Measured]]:
    """Yield what is chosen at a point, what comes of it, and what any robot could do, each with what it is."""
    n = front.number
    yield Named(n.name, n.symbol), Measured(point.gain, n.unit)
    for name in front.free[1:]:
        yield words_for(name), Measured(getattr(point, name), front.free_units[name])
    for name, value in point.values.items():
        yield named(name, magnitude=True), Measured(value, unit_of(name))
    if front.comparison is None:
        return
    names = ("acceleration", "excursion", "least_excursion", "ratio", "least_acceleration")
    beside = {name: None if point.bound is None else float(getattr(point.bound, name)) for name in names}
    for name, known in (("largest_acceleration", "acceleration"), ("displacement", "excursion")):
        if name not in front.quantities:
            yield named(name, magnitude=True), Measured(beside[known], unit_of(name))
    yield "least deviation, any robot that accelerates as much", Measured(beside["least_excursion"], "m")
    yield "times the least deviation", Measured(beside["ratio"], "", 3)
    yield "least acceleration, any robot", Measured(beside["least_acceleration"], "m/s^2")


def _sentences(front: ParetoFront) -> Iterator[str]:
    """Say what is to be said of the choice and of the bound."""
    if front.choice is not None and front.knee is not None:
        yield _about_choice(front, front.choice)
    if front.no_bound:
        yield f"No physical bound: {front.no_bound}."
    elif front.bound is not None:
        least = float(front.bound.least_contact_speed)
        limit = pretty_unit(format_quantity(float(front.bound.acceleration_limit), "m/s^2"))
        after = format_quantity(float(front.bound.excursion(least)), "m")
        yield (
            f"The best that a robot with {limit} can do: contact at {format_quantity(least, 'm/s')}, after an "
            f"excursion of {after}."
        )


def _about_choice(front: ParetoFront, choice: FrontPoint) -> str:
    if not choice.feasible:
        return "The choice breaks a constraint."
    if not choice.behind > _BEHIND:
        return "The choice lies on the front."
    text = f"The choice lies {100 * choice.behind:.2g} % of the front's extent behind it, in every quantity at once"
    if len(front.quantities) == 2:
        first, second = front.quantities
        least = float(front.of(first)[front.meets(**{second: choice.values[second]})].min())
        text += (
            f": with no more {in_short(second)}, a {in_short(first)} of {format_quantity(least, unit_of(first))} will "
            f"do in the place of {format_quantity(choice.values[first], unit_of(first))}"
        )
    return f"{text}."


def _evidence(front: ParetoFront) -> Chapter:
    pieces = int(front.piece.max()) + 1
    rows = (
        ("tried", f"{front.tried} encounters"),
        ("the front", f"{_count(len(front.gain), 'point')} in {_count(pieces, 'piece')}"),
        (
            "missed",
            "no encounter that was tried, nor one found between the points, is better than they are by more than "
            f"{100 * front.missed:.2g} % of the front's extent in every quantity at once",
        ),
    )
    return Chapter(title="How this is known", titled=True, blocks=(Rows(rows=rows, wraps=True, brief=True),))


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _sought(front: ParetoFront) -> Iterator[Row]:
    """Yield what may be chosen, and what must hold."""
    own = front.number.name
    sought = {"gain": front.bounds, "natural_frequency": front.natural_frequency_bounds}
    for name, bounds in {**sought, "damping_ratio": front.damping_ratio_bounds}.items():
        if bounds is not None:
            yield f"{own if name == 'gain' else words_for(name)}: bounds", format_range(bounds, front.free_units[name])
    for constraint in front.constraints:
        yield f"limit of {words_for(constraint.quantity)}", Measured(constraint.limit, constraint.unit)
    yield from impact_rows(front.impact)
