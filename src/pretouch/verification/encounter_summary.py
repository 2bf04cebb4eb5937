"""A simulated encounter as a JSON object, as text for a terminal and as a table for a notebook."""

from __future__ import annotations

import html
from collections.abc import Iterator
from dataclasses import asdict, fields, is_dataclass
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.numbers import finite_or_none
from pretouch._core.text_table import aligned
from pretouch._core.units import format_quantity
from pretouch.motion import ContactStatus
from pretouch.simulation import SimulationResult

from .encounter_comparison import LoopContact, ReportedFlag
from .encounter_wording import (
    contact_end_in_words,
    detection_in_words,
    difference_in_words,
    ending_in_words,
    time_in_words,
)

if TYPE_CHECKING:
    from .encounter import SimulatedEncounter

__all__ = ["encounter_as_dict", "encounter_as_html", "encounter_as_text"]

_NONE: Final = "-"
_HEAD: Final = ("", "on the loop", "predicted", "difference", "loop, D_p = 0", "predicted, D_p = 0")


def encounter_as_dict(encounter: SimulatedEncounter) -> dict[str, Any]:
    """Return an encounter as one JSON object: numbers in SI, None where there is none."""
    detection, loop = encounter.detection, encounter.loop
    return {
        "status": _label(encounter.run),
        "headline": encounter.headline,
        "gain": encounter.gain,
        "method": encounter.prediction.method,
        "loop": _run_as_dict(encounter.run),
        "loop_no_mitigation": _run_as_dict(encounter.unmitigated),
        "predicted": encounter.prediction,
        "predicted_no_mitigation": encounter.unmitigated_prediction,
        "comparisons": [
            {**asdict(row), "difference": row.difference, "relative_difference": row.relative_difference}
            for row in encounter.comparisons
        ],
        "contacts": [asdict(contact) for contact in encounter.contacts],
        "contacts_no_mitigation": [asdict(contact) for contact in encounter.unmitigated_contacts],
        "flags": [asdict(flag) for flag in encounter.flags],
        "detection": None if detection is None else asdict(detection),
        "setup": {
            "law": type(loop.law).__name__,
            "period": loop.law.period,
            "chain": _value_as_dict(loop.chain),
            "plant": {"model": type(loop.plant).__name__, **_value_as_dict(loop.plant)},
            "contact": None
            if loop.contact is None
            else {"model": type(loop.contact).__name__, **_value_as_dict(loop.contact)},
            "seed": loop.seed,
            "horizon": loop.horizon,
            "follow": loop.follow,
        },
        "warnings": list(encounter.warnings),
    }


def _label(run: SimulationResult) -> str:
    """Return the word for how a run ended in files and JSON."""
    return ContactStatus(run.status).label


_RUN: Final = (
    *("time", "position", "velocity", "displacement", "relative_velocity", "closest_distance", "largest_excursion"),
    *("largest_travel", "largest_speed", "largest_virtual_force", "peak_force", "impact_force", "impulse"),
    *("rebound_velocity", "detection_time", "end_time"),
)


def _run_as_dict(run: SimulationResult) -> dict[str, Any]:
    numbers = {name: finite_or_none(getattr(run, name)) for name in _RUN}
    return {"status": _label(run), **numbers, "contacts": run.contacts, "flags": run.flags}


def _value_as_dict(value: object) -> dict[str, Any]:
    """Return the fields of a part of the loop; a class of a user's own may have none."""
    if not is_dataclass(value):
        return {}
    found = {f.name: getattr(value, f.name) for f in fields(value)}
    return {name: finite_or_none(v) if isinstance(v, float) else v for name, v in found.items()}


def encounter_as_text(encounter: SimulatedEncounter) -> str:
    """Return an encounter as text for a terminal."""
    lines = [encounter.headline, ""]
    lines += [f"warning: {w}" for w in encounter.warnings] + ([""] if encounter.warnings else [])
    lines += [*aligned([_HEAD, *_comparison_rows(encounter)]), ""]
    if encounter.has_contact_force and encounter.contacts:
        head = ("contact", "l'", "peak force", "impulse", "l' after", "duration")
        lines += [*aligned([head, *map(_contact_row, encounter.contacts)]), ""]
    if encounter.flags:
        lines += [*aligned([("reported by the law", "since", "in all"), *map(_flag_row, encounter.flags)]), ""]
    sentence = detection_in_words(encounter)
    lines += [f"detection: {sentence[0].lower()}{sentence[1:]}"] if encounter.detection else []
    loop = encounter.loop
    lines.append(
        f"loop: {type(loop.law).__name__} every {time_in_words(loop.law.period)}, readings at {loop.chain.rate:g} Hz, "
        f"{type(loop.plant).__name__}, {'no contact model' if loop.contact is None else type(loop.contact).__name__}, "
        f"seed {loop.seed}"
    )
    lines.append(f"prediction: {encounter.prediction.method}")
    return "\n".join(lines)


def encounter_as_html(encounter: SimulatedEncounter) -> str:
    """Return an encounter as a small table for a notebook."""
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in _comparison_rows(encounter)
    )
    head = "".join(f"<th>{html.escape(h)}</th>" for h in _HEAD)
    warnings = "".join(f"<p>Warning: {html.escape(w)}</p>" for w in encounter.warnings)
    return f"<p><b>{html.escape(encounter.headline)}</b></p>{warnings}<table><tr>{head}</tr>{rows}</table>"


def _comparison_rows(encounter: SimulatedEncounter) -> Iterator[tuple[str, ...]]:
    results = (encounter.run, encounter.prediction, encounter.unmitigated, encounter.unmitigated_prediction)
    words = [ending_in_words(result.status) for result in results]
    if set(words) != {"contact"}:
        yield ("ends with", words[0], words[1], "", words[2], words[3])
    for row in encounter.comparisons:
        if row.is_empty:
            continue
        loop, predicted, *rest = (_NONE if v is None else format_quantity(v, row.unit) for v in row.values)
        yield (row.label, loop, predicted, difference_in_words(row), *rest)


def _contact_row(contact: LoopContact) -> tuple[str, ...]:
    return (
        f"after {time_in_words(contact.time)}",
        format_quantity(contact.relative_velocity, "m/s"),
        _NONE if contact.peak_force is None else format_quantity(contact.peak_force, "N"),
        _NONE if contact.impulse is None else format_quantity(contact.impulse, "N*s"),
        contact_end_in_words(contact),
        _NONE if contact.duration is None else time_in_words(contact.duration),
    )


def _flag_row(flag: ReportedFlag) -> tuple[str, ...]:
    return f"{flag.name}: {flag.meaning}", time_in_words(flag.since), time_in_words(flag.duration)
