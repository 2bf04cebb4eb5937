"""Prepare a scenario for a page without server, which must compute everything itself."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch.motion.laws import DAMPER, DRAG

from .answers import LIMITS, SECTIONS, ratio_of_drag, reservations_at, texts_of
from .curves import IN_THE_PAGE

if TYPE_CHECKING:
    from pretouch.designs import Task

_KINDS: Final = {"excursion", "time"}
"""The kinds of objectives that the page computes from their fields."""


def scenario_of_page(file: Path) -> dict[str, Any]:
    """Read a scenario file for a page without a server.

    A calibrated sensor gets the parameters of its fitted curve, because the page cannot fit.

    Args:
        file: the scenario file (TOML).

    Returns:
        `title`, the name of the file; `key`, under which the browser stores changes; `fields`, the values by
        `section.key`; `note`, a sentence on parts of the scenario that the page does not use.

    Raises:
        InvalidInputError: the page cannot compute this scenario without a server.
    """
    from pretouch.config import load_scenario  # noqa: PLC0415 - only when a file is read

    task = load_scenario(file)
    text = file.read_text(encoding="utf-8-sig")
    document = tomllib.loads(text)
    reason = next(_obstacles(task, document), None)
    if reason is not None:
        raise InvalidInputError(
            f"{file}: a page without a server cannot compute this scenario. The reason is: {reason}. Use the page with "
            f"its server instead. Run the command pretouch studio {file} without the option --output"
        )
    fields = dict(texts_of(document))
    notes = [f"This page starts with the scenario of {file.name}."]
    if "calibration" in document["sensor"]:
        fields = {**_fitted_curve(task), **_without("sensor", fields)}
        notes.append(f"The sensor curve was fitted to {document['sensor']['calibration']}.")
        notes += _warning(task)
    if task.drag_effect is not None:
        ratio = fields.get("law.ratio") or ratio_of_drag(task)
        fields = {**_without("law", fields), "law.kind": "virtual-drag", "law.ratio": ratio}
    unused = [f"[{name}]" for name in document if name not in SECTIONS]
    if unused:
        notes.append(
            f"The page ignores the sections {', '.join(unused)}. If you save a file with the button Scenario file, "
            "this file does not contain these sections."
        )
    key = hashlib.sha256(repr(fields).encode()).hexdigest()[:16]
    return {"title": file.name, "key": key, "fields": fields, "note": " ".join(notes)}


def _obstacles(task: Task, document: dict[str, Any]) -> Iterator[str]:
    """Yield the reasons why the page cannot compute a scenario without Python."""
    curve = task.sensor.bare[0]
    if type(curve) not in IN_THE_PAGE:
        yield f"the page computes only inverse power and exponential curves, but the curve is {curve.name}"
    if task.sensor.valid_range[0] > 0:
        yield "the sensor curve does not extend down to contact"
    if "model" in document.get("robot", {}):
        yield "[robot] names a robot model"
    if task.scenario.obstacle.course or task.scenario.reference.acceleration:
        yield "the page computes only objects without a course and references without an acceleration"
    if task.is_admittance_free:
        yield "the admittance has bounds"
    if task.law not in (DAMPER, DRAG):
        yield f"the page computes only virtual dampers and virtual drags, but the scenario has the law {task.law.kind}"
    objective = document.get("objective", {})
    if task.drag_effect is None and (task.law == DRAG or task.bounds is None or not objective):
        yield "the page needs [objective] and [gain] with bounds, or a virtual drag with an effect such as ratio"
    elif task.drag_effect is None and (objective.get("kind") not in _KINDS or "force_scale" in objective):
        yield 'the page computes only the objectives "excursion" and "time" with a velocity_scale'
    others = [constraint.name for constraint in task.limits if constraint.name not in LIMITS]
    if others:
        yield (
            f"the page supports only the constraints {', '.join(LIMITS)}, but the section [constraints] also has "
            f"the constraints {', '.join(others)}"
        )


def _fitted_curve(task: Task) -> dict[str, Any]:
    """Return the scenario keys and values of a fitted sensor curve. Distances count from the contact surface."""
    from pretouch.config.sensor import keys_of_curve  # noqa: PLC0415 - only when a file is read

    return {f"sensor.{name}": text for name, text in keys_of_curve(task.sensor).items()}


def _warning(task: Task) -> Iterator[str]:
    """Yield a sentence on the contact speeds that the calibration allows, for the gain of the scenario or the best."""
    from pretouch.designs.gain import designed_number  # noqa: PLC0415

    gain = designed_number(task) if task.gain is None else task.gain
    found = None if gain is None else reservations_at(task, gain)
    text = None if found is None else found.headline or found.spread
    if gain is not None and text is not None:
        yield f"With {task.law.number.equals(gain)}: {text}"


def _without(section: str, fields: dict[str, Any]) -> dict[str, Any]:
    return {key: text for key, text in fields.items() if not key.startswith(f"{section}.")}
