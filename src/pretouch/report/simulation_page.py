"""What a report of a simulated encounter says, section by section, as plain rows of text for the template."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from pretouch._core.units import pretty_unit
from pretouch.verification import SimulatedEncounter
from pretouch.verification.encounter_comparison import LoopContact, ReportedFlag
from pretouch.verification.encounter_wording import (
    contact_end_in_words,
    detection_in_words,
    difference_in_words,
    ending_in_words,
)

from .design_page import METHODS, scenario_rows, sensor_rows
from .loop_rows import chain_rows, contact_rows, controller_rows, loop_rows, robot_rows
from .wording import quantity

__all__ = ["simulation_page"]

Row = tuple[str, ...]

_DASH: Final = "\u2013"
_SYMBOLS: Final = {
    "time": "t",
    "relative_velocity": "l\u2032",
    "position": "x",
    "closest_distance": "min l",
    "largest_virtual_force": "max |F_p|",
}


def simulation_page(encounter: SimulatedEncounter) -> dict[str, Any]:
    """Collect the text of a report of a simulated encounter.

    Args:
        encounter: what `simulate_encounter` returned, however it ended.

    Returns:
        The template's variables, all text.
    """
    loop = encounter.loop
    return {
        "headline": encounter.headline,
        "touched": bool(encounter.run.touched),
        "status_text": f"on the loop: {ending_in_words(encounter.run.status)}",
        "tiles": list(_tiles(encounter)),
        "warnings": list(encounter.warnings),
        "detection": _sentence(detection_in_words(encounter)),
        "comparison_rows": list(_comparison_rows(encounter)),
        "contact_rows": [_contact_row(c) for c in encounter.contacts] if encounter.has_contact_force else [],
        "flag_rows": [_flag_row(flag) for flag in encounter.flags],
        "elastic": encounter.impact is not None and encounter.has_contact_force,
        "loop_rows": [("gain D_p", quantity(encounter.gain, "N*s")), *loop_rows(loop)],
        "chain_rows": list(chain_rows(loop.chain)),
        "controller_rows": list(controller_rows(loop.law)),
        "robot_rows": list(robot_rows(loop.plant)),
        "force_rows": list(contact_rows(loop.contact)),
        "scenario_rows": [*scenario_rows(encounter.scenario), *_impact_rows(encounter)],
        "sensor_rows": list(sensor_rows(encounter.sensor)),
        "method": METHODS.get(encounter.prediction.method, encounter.prediction.method),
    }


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


def _tiles(encounter: SimulatedEncounter) -> Iterator[tuple[str, str]]:
    """Yield the few numbers that matter most, with their names."""
    run, predicted, free = encounter.run, encounter.prediction, encounter.unmitigated
    yield "gain D_p", quantity(encounter.gain, "N*s")
    if run.touched:
        yield "relative speed at contact, on the loop", quantity(abs(run.relative_velocity), "m/s", 3)
    else:
        yield "smallest distance, on the loop", quantity(run.closest_distance, "m", 3)
    if predicted.reached.all():
        yield "predicted", quantity(abs(float(predicted.end.relative_velocity)), "m/s", 3)
    if free.touched:
        yield "without mitigation, on the loop", quantity(abs(free.relative_velocity), "m/s", 3)
    if run.touched and encounter.has_contact_force:
        yield "impact force, on the loop", quantity(run.impact_force, "N", 3)
    elif run.touched:
        yield "time of contact, on the loop", quantity(run.time, "s", 3)


def _comparison_rows(encounter: SimulatedEncounter) -> Iterator[Row]:
    results = (encounter.run, encounter.prediction, encounter.unmitigated, encounter.unmitigated_prediction)
    words = [ending_in_words(result.status) for result in results]
    if set(words) != {"contact"}:
        yield ("ends with", words[0], words[1], "", words[2], words[3])
    for row in (row for row in encounter.comparisons if not row.is_empty):
        label = f"{row.label} {_SYMBOLS.get(row.name, '')}".strip()
        cells = [quantity(value, row.unit) for value in row.values]
        difference = _DASH if row.difference is None else pretty_unit(difference_in_words(row))
        yield (label, *cells[:2], difference, *cells[2:])


def _contact_row(contact: LoopContact) -> Row:
    return (
        f"after {quantity(contact.time, 's')}",
        quantity(contact.relative_velocity, "m/s"),
        quantity(contact.peak_force, "N"),
        quantity(contact.impulse, "N*s"),
        pretty_unit(contact_end_in_words(contact)),
        quantity(contact.duration, "s", 3),
    )


def _flag_row(flag: ReportedFlag) -> Row:
    return (
        flag.name,
        flag.meaning,
        quantity(flag.since, "s", 3),
        quantity(flag.duration, "s", 3),
        quantity(flag.approach_duration, "s", 3),
    )


def _impact_rows(encounter: SimulatedEncounter) -> Iterator[Row]:
    if encounter.impact is not None:
        yield "predicted impact: physical mass of the robot", quantity(encounter.impact.robot_mass, "kg")
        yield "predicted impact: mass of the obstacle", quantity(encounter.impact.obstacle_mass, "kg")
