"""A front as a JSON object, as text for a terminal and as a table for a notebook."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch._core.units import format_quantity

from .quantities import QUANTITY_UNITS

if TYPE_CHECKING:
    from .front import BoundComparison, FrontPoint, ParetoFront

__all__ = ["front_as_dict", "front_as_html", "front_as_text", "front_headline", "front_rows", "front_sentences"]

_BEHIND = 1e-3  # of the extent of the front: less is on it


def front_as_dict(front: ParetoFront) -> dict[str, Any]:
    """Return a front as one JSON object: numbers in SI, None where there is none."""
    points: dict[str, Any] = {
        "gain": front.gain,
        "natural_frequency": front.natural_frequency,
        "damping_ratio": front.damping_ratio,
        **{name: front.of(name) for name in front.quantities},
        "piece": front.piece,
        **_bound_as_dict(front.comparison),
    }
    bound = front.bound
    return {
        "status": front.status.value,
        "quantities": [{"name": n, "unit": u} for n, u in zip(front.quantities, front.units, strict=True)],
        "free": list(front.free),
        "bounds": {
            "gain": list(front.bounds),
            "natural_frequency": front.natural_frequency_bounds,
            "damping_ratio": front.damping_ratio_bounds,
        },
        "constraints": [{"name": c.name, "unit": c.unit, "limit": c.limit} for c in front.constraints],
        "front": {key: [_number(v) for v in np.asarray(column).tolist()] for key, column in points.items()},
        "knee": _point_as_dict(front.knee),
        "choice": _point_as_dict(front.choice),
        "ends": [_point_as_dict(p) for p in front.ends],
        "physical_bound": None
        if bound is None
        else {
            "acceleration_limit": bound.acceleration_limit,
            "speed_limit": _number(bound.speed_limit),
            "least_contact_speed": bound.least_contact_speed,
            "excursion_at_least_contact_speed": _number(bound.excursion(bound.least_contact_speed)),
        },
        "no_bound": front.no_bound or None,
        "tried": front.tried,
        "missed": _number(front.missed),
    }


def _bound_as_dict(bound: BoundComparison | None) -> dict[str, Any]:
    if bound is None:
        return {}
    return {
        "largest_acceleration": bound.acceleration,
        "excursion": bound.excursion,
        "least_excursion": bound.least_excursion,
        "least_acceleration": bound.least_acceleration,
    }


def _point_as_dict(point: FrontPoint | None) -> dict[str, Any] | None:
    if point is None:
        return None
    return {
        "name": point.name,
        "gain": point.gain,
        "natural_frequency": point.natural_frequency,
        "damping_ratio": _number(point.damping_ratio),
        **point.values,
        "behind": _number(point.behind),
        "feasible": point.feasible,
        "depth": point.depth,
        **{key: _number(value) for key, value in _bound_as_dict(point.bound).items()},
    }


def front_headline(front: ParetoFront) -> str:
    """Return the answer in one sentence."""
    names = [word(n) for n in front.quantities]
    traded = f"{', '.join(names[:-1])} and {names[-1]}"
    if front.status.value == "infeasible":
        return f"Infeasible: no choice within the bounds meets every constraint, so {traded} cannot be traded."
    if front.status.value == "no-contact":
        return "No choice within the bounds ends in contact."
    if len(front.gain) == 1:
        every = "both" if len(names) == 2 else "all"
        return f"{traded[0].upper()}{traded[1:]} do not conflict: {_chosen(front, front.ends[0])} is best in {every}."
    if front.knee is None:
        return f"{len(front.gain)} choices trade {traded}; no knee stands out among them."
    values = ", ".join(f"{word(n)} {format_quantity(v, QUANTITY_UNITS[n])}" for n, v in front.knee.values.items())
    return f"The knee of {traded} lies at {_chosen(front, front.knee)}: {values}."


def _chosen(front: ParetoFront, point: FrontPoint) -> str:
    text = f"D_p = {format_quantity(point.gain, 'N*s')}"
    if "natural_frequency" in front.free:
        text += f", natural frequency {format_quantity(point.natural_frequency, 'rad/s')}"
    if "damping_ratio" in front.free:
        text += f", damping ratio {point.damping_ratio:.4g}"
    return text


def front_rows(front: ParetoFront) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the head and the rows of the table of marked points."""
    head = ["", "gain"]
    free = [(n, u) for n, u in (("natural_frequency", "rad/s"), ("damping_ratio", "")) if n in front.free]
    head += [word(n) for n, _ in free] + [word(n) for n in front.quantities]
    if front.comparison is not None:
        head += ["largest acceleration", "excursion", "least excursion", "ratio"]
    rows = []
    for point in (*front.ends, front.knee, front.choice):
        if point is None:
            continue
        row = [word(point.name), format_quantity(point.gain, "N*s")]
        row += [format_quantity(getattr(point, n), u) for n, u in free]
        row += [format_quantity(point.values[n], QUANTITY_UNITS[n]) for n in front.quantities]
        if front.comparison is not None:
            row += _bound_cells(point.bound)
        rows.append(tuple(row))
    return tuple(head), rows


def _bound_cells(bound: BoundComparison | None) -> list[str]:
    if bound is None:
        return ["-"] * 4
    least = float(bound.least_excursion)
    ratio = float(bound.ratio)
    return [
        format_quantity(float(bound.acceleration), "m/s^2"),
        format_quantity(float(bound.excursion), "m"),
        "-" if math.isnan(least) else format_quantity(least, "m"),
        "-" if math.isnan(ratio) else f"{ratio:.3g}",
    ]


def front_sentences(front: ParetoFront) -> list[str]:
    """Return what is to be said of the choice, of the bound and of how the front is known."""
    found = []
    choice = front.choice
    if choice is not None and front.knee is not None:
        found.append(_about_choice(front, choice))
    if front.comparison is not None:
        found += list(_about_bound(front))
    elif front.no_bound:
        found.append(f"no physical bound: {front.no_bound}")
    if len(front.gain):
        evidence = (
            f"evidence: {front.tried} encounters show a front of {_count(int(front.piece.max()) + 1, 'piece')}, given "
            f"by {_count(len(front.gain), 'point')}; none of those encounters is better than it by more than "
            f"{100 * front.missed:.2g} % of its extent in every quantity at once"
        )
        found.append(evidence)
    return found


def _about_choice(front: ParetoFront, choice: FrontPoint) -> str:
    if not choice.feasible:
        return "the choice breaks a constraint"
    if not choice.behind > _BEHIND:
        return "the choice lies on the front"
    text = f"the choice lies {100 * choice.behind:.2g} % of the front's extent behind it, in every quantity at once"
    if len(front.quantities) == 2:
        first, second = front.quantities
        least = float(front.of(first)[front.meets(**{second: choice.values[second]})].min())
        unit = QUANTITY_UNITS[first]
        text += (
            f": with no more {word(second)}, a {word(first)} of {format_quantity(least, unit)} will do in the place of "
            f"{format_quantity(choice.values[first], unit)}"
        )
    return text


def _about_bound(front: ParetoFront) -> list[str]:
    found = []
    for point in (front.knee, front.choice):
        if point is None or point.bound is None or math.isnan(float(point.bound.ratio)):
            continue
        b = point.bound
        found.append(
            f"physical bound, {point.name}: at the same largest acceleration of "
            f"{format_quantity(float(b.acceleration), 'm/s^2')} the best possible motion needs "
            f"{format_quantity(float(b.least_excursion), 'm')} for this contact speed, this controller "
            f"{format_quantity(float(b.excursion), 'm')}, {float(b.ratio):.3g} times as much; any robot needs "
            f"{format_quantity(float(b.least_acceleration), 'm/s^2')} or more for it"
        )
    if front.bound is not None:
        least = float(front.bound.least_contact_speed)
        found.append(
            f"physical bound of a robot with {format_quantity(float(front.bound.acceleration_limit), 'm/s^2')}: "
            f"contact at {format_quantity(least, 'm/s')} at best, after an excursion of "
            f"{format_quantity(float(front.bound.excursion(least)), 'm')}"
        )
    return found


def front_as_text(front: ParetoFront) -> str:
    """Return a front as text for a terminal."""
    lines = [front_headline(front)]
    head, rows = front_rows(front)
    if rows:
        width = [max(len(row[i]) for row in (head, *rows)) for i in range(len(head))]
        lines.append("")
        for row in (head, *rows):
            cells = [c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(row, width, strict=True))]
            lines.append("  ".join(cells).rstrip())
    sentences = front_sentences(front)
    return "\n".join([*lines, *([""] if sentences else []), *sentences])


def front_as_html(front: ParetoFront) -> str:
    """Return a front as a small table for a notebook."""
    head, rows = front_rows(front)
    top = "".join(f"<th>{html.escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    table = f"<table><tr>{top}</tr>{body}</table>" if rows else ""
    return f"<p><b>{html.escape(front_headline(front))}</b></p>{table}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def word(name: str) -> str:
    """Write a name from code for a person."""
    return name.replace("_", " ")


def _number(value: Any) -> Any:
    if isinstance(value, int):
        return value
    number = float(value)
    return number if math.isfinite(number) else None
