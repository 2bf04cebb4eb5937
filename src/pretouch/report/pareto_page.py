"""What the reports of a trade-off and of a designed admittance say, as plain rows of text for their templates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pretouch._core.units import pretty_unit
from pretouch.design.admittance_result import AdmittanceDesign
from pretouch.design.front import FrontPoint, ParetoFront
from pretouch.design.front_summary import front_headline, front_rows, front_sentences
from pretouch.design.quantities import QUANTITY_UNITS

from .design_page import scenario_rows, sensor_rows
from .wording import quantity, quantity_label, word

__all__ = ["admittance_block", "pareto_page"]

_STATUS = {
    "found": "front found",
    "infeasible": "infeasible: no choice within the bounds meets every constraint",
    "no-contact": "no contact: no choice within the bounds ends in contact",
}


def pareto_page(front: ParetoFront) -> dict[str, Any]:
    """Collect the text of a report on a trade-off.

    Args:
        front: a front of any status.

    Returns:
        The template's variables, all text.
    """
    head, rows = front_rows(front)
    return {
        "headline": front_headline(front),
        "status": front.status.value,
        "status_text": _STATUS[front.status.value],
        "tiles": list(_tiles(front)),
        "head": head,
        "rows": [tuple(pretty_unit(cell) for cell in row) for row in rows],
        "sentences": [pretty_unit(f"{s[0].upper()}{s[1:]}.") for s in front_sentences(front)],
        "sought_rows": list(_sought(front)),
        "scenario_rows": list(scenario_rows(front.scenario)),
        "sensor_rows": list(sensor_rows(front.sensor)),
    }


def _tiles(front: ParetoFront) -> Iterator[tuple[str, str]]:
    """Yield the few numbers that matter most, with their names."""
    point: FrontPoint | None = front.knee or front.choice
    if point is None:
        return
    yield f"gain D_p at the {point.name}", quantity(point.gain, "N*s")
    for name, value in point.values.items():
        yield quantity_label(name), quantity(value, QUANTITY_UNITS[name], 3)
    if point.bound is not None and np.isfinite(point.bound.ratio):
        yield "times the least excursion of any robot", quantity(float(point.bound.ratio), "", 3)


def _sought(front: ParetoFront) -> Iterator[tuple[str, str]]:
    low, high = front.bounds
    yield "gain", f"{quantity(low, 'N*s')} to {quantity(high, 'N*s')}"
    if front.natural_frequency_bounds is not None:
        low, high = front.natural_frequency_bounds
        yield "natural frequency", f"{quantity(low, 'rad/s')} to {quantity(high, 'rad/s')}"
    if front.damping_ratio_bounds is not None:
        low, high = front.damping_ratio_bounds
        yield "damping ratio", f"{quantity(low)} to {quantity(high)}"
    for constraint in front.constraints:
        yield f"limit of {quantity_label(constraint.quantity)}", quantity(constraint.limit, constraint.unit)


def admittance_block(design: AdmittanceDesign) -> dict[str, Any]:
    """Collect what a design report says of the admittance that was designed with the gain.

    Args:
        design: a design of any status.

    Returns:
        The headline, rows of the local minima, and rows of evidence.
    """
    c = design.certificate
    rows: list[tuple[str, ...]] = []
    evidence: list[tuple[str, str]] = []
    if c is not None:
        rows = [
            (
                "chosen" if i == 0 else "local minimum",
                quantity(m.natural_frequency, "rad/s"),
                quantity(m.damping_ratio),
                quantity(m.gain, "N*s"),
                quantity(m.objective),
            )
            for i, m in enumerate(c.local_minima)
        ]
        held = ", ".join(f"{word(name)} (multiplier {value:.3g})" for name, value in c.active)
        evidence = [
            ("searched", f"{c.grid} encounters on a grid; none of {c.tests} others is better than what was found"),
            ("the optimum is held by", held or "nothing: it lies inside"),
            ("first-order residual, of the objective", f"{c.residual:.1e}"),
        ]
    before = design.as_it_is
    own = before.scenario.admittance
    rows.append(
        (
            "as it is",
            quantity(float(own.natural_frequency), "rad/s"),
            quantity(float(own.damping_ratio) if own.stiffness > 0 else None),
            quantity(before.gain, "N*s"),
            quantity(before.objective),
        )
    )
    return {"headline": repr(design)[len("<AdmittanceDesign: ") : -1], "rows": rows, "evidence": evidence}
