"""Create notebook reports on encounters, contacts and motions."""

from __future__ import annotations

from typing import Any

from pretouch._core.blocks import Measured, Page, PageTable, Picture, named
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import QUANTITIES

from .contact import ContactResult, Motion
from .page_sections import scenario_rows
from .scenario import Scenario

_SHOWN = ("time", "relative_velocity", "position", "displacement", "largest_excursion", "largest_virtual_force")


def scenario_page(scenario: Scenario) -> Page:
    """Create the notebook report on an encounter."""
    if scenario.shape:
        return Page(kind="Encounters", headline=f"Encounters of shape {scenario.shape}")
    velocity, distance = float(scenario.relative_velocity), format_quantity(float(scenario.distance), "m")
    speed = format_quantity(abs(velocity), "m/s")
    if velocity < 0:
        headline = f"The object starts at a distance of {distance} from the robot, and approaches at a speed of {speed}"
    elif velocity > 0:
        headline = f"The object starts at a distance of {distance} from the robot, and recedes at a speed of {speed}"
    else:
        headline = f"The object starts at a distance of {distance} from the robot, and rests"
    return Page(
        kind="Encounter", headline=headline, blocks=(PageTable(rows=tuple(scenario_rows(scenario)), brief=True),)
    )


def contact_page(result: ContactResult) -> Page:
    """Create the notebook report on a contact."""
    status: Any = result.status
    if result.reached.ndim:
        count, total = int(result.reached.sum()), result.reached.size
        return Page(kind="Contacts", headline=f"{count} of {total} encounters end in contact ({result.method})")
    rows = tuple((named(name), Measured(float(getattr(result.end, name)), QUANTITIES[name].unit)) for name in _SHOWN)
    table = PageTable(rows=rows, brief=True)
    return Page(kind="Contact", headline=f"{status.meaning} ({result.method})", blocks=(table,))


def motion_page(motion: Motion) -> Page:
    """Create the notebook report on a motion, including its plot."""
    if motion.time.ndim > 1:
        return Page(kind="Motions", headline=f"Motions of shape {motion.time.shape[:-1]}")
    page = contact_page(motion.result)
    name = "Distance and relative velocity over time"
    figure = Picture(figure="sampled_motion", of=motion, name=name, caption="The motion until it ends.")
    return Page(kind="Motion", headline=page.headline, blocks=(figure, *page.blocks), lead="sampled_motion")
