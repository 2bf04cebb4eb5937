"""Describe simulated encounters of a whole robot as a report."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pretouch._core.blocks import Cell, Measured, Page, PageTable, Picture
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity

from .result import RobotSimulation

_ROWS = (
    ("time of contact", "time", "s"),
    ("relative velocity at contact", "relative_velocity", "m/s"),
    ("peak contact force", "peak_force", "N"),
    ("largest excursion", "excursion", "m"),
    ("energy of the impact", "energy", "J"),
)


def robot_page(result: RobotSimulation) -> Page:
    """Return the report on simulated encounters of a robot."""
    order = result.order(0)
    touched = f"Touches in the order {', '.join(order)}." if order else "No site touched an object."
    speeds = [
        f"{name} at {format_quantity(float(abs(np.nanmean(result.simulated(name, 'relative_velocity')))), 'm/s')}"
        for name in order
    ]
    return Page(
        kind="Simulated robot",
        headline=f"{touched} {'Contact speeds: ' + ', '.join(speeds) + '.' if speeds else ''}".strip(),
        good=bool(order),
        warnings=result.warnings,
        lead="robot",
        blocks=(
            *(
                PageTable(
                    head=(name, "simulated", "predicted", "difference"),
                    rows=tuple(_rows(result, name)),
                    note="" if result.runs == 1 else f"means over {result.runs} runs",
                    brief=True,
                )
                for name in result.sites
            ),
            Picture(
                figure="robot",
                of=result,
                name="The first run over time",
                caption="The first run, next to the prediction from the first detection to contact. The reference is "
                "that of the law along the axis of the site.",
            ),
        ),
    )


def _rows(result: RobotSimulation, site: str) -> Iterator[tuple[Cell, ...]]:
    for label, quantity, unit in _ROWS:
        simulated, predicted = (_mean(f(site, quantity)) for f in (result.simulated, result.predicted))
        difference = 100 * (simulated / predicted - 1) if predicted else float("nan")
        change = "-" if np.isnan(difference) else f"{difference:+.2f} %"
        yield label, Measured(simulated, unit), Measured(predicted, unit), change


def _mean(values: FloatArray) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")
