"""Create the report on simulated encounters of a whole robot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pretouch._core.blocks import Cell, Film, Measured, Page, PageTable, Picture
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

_KEY_FIGURES = (
    ("contact speed", "relative_velocity", "m/s"),
    ("peak contact force", "peak_force", "N"),
    ("largest excursion", "excursion", "m"),
)


def robot_page(result: RobotSimulation) -> Page:
    """Return the report on simulated encounters of a robot."""
    order = result.order(0)
    return Page(
        kind="Simulated robot",
        headline=_headline(result, order),
        good=bool(order),
        key_figures=tuple(_figures(result, order[0])) if order else (),
        warnings=result.warnings,
        lead="robot",
        findings=result.notes,
        blocks=(
            Film(
                figure="robot_film",
                of=result,
                name="The robot and the object during the first run",
                caption="The first run in slow motion. Below each frame are the time and the distance from the site "
                f"{result.sites[0]} to the object.",
            ),
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
                "the position along the axis of the site that the control law commands.",
            ),
        ),
    )


def _headline(result: RobotSimulation, order: tuple[str, ...]) -> str:
    """Return a headline with the sites and speeds of contacts."""
    if not order:
        return "No site touched an object."
    speeds = [format_quantity(abs(_mean(result.simulated(name, "relative_velocity"))), "m/s", 3) for name in order]
    if len(order) == 1:
        return f"The site {order[0]} touches the object at {speeds[0]}."
    listed = ", ".join(f"{name} at {speed}" for name, speed in zip(order, speeds, strict=True))
    return f"Touches in the order {', '.join(order)}. Contact speeds: {listed}."


def _figures(result: RobotSimulation, site: str) -> Iterator[tuple[str, Cell]]:
    """Yield simulated and predicted results of the first contact. They are contact speed, peak force and excursion."""
    for label, quantity, unit in _KEY_FIGURES:
        simulated, predicted = (abs(_mean(f(site, quantity))) for f in (result.simulated, result.predicted))
        comparison = "" if np.isnan(predicted) else f"; predicted {format_quantity(predicted, unit, 3)}"
        yield f"{label}{comparison}", Measured(simulated, unit, 3)


def _rows(result: RobotSimulation, site: str) -> Iterator[tuple[Cell, ...]]:
    for label, quantity, unit in _ROWS:
        simulated, predicted = (_mean(f(site, quantity)) for f in (result.simulated, result.predicted))
        difference = 100 * (simulated / predicted - 1) if predicted else float("nan")
        change = "-" if np.isnan(difference) else f"{difference:+.2f} %"
        yield label, Measured(simulated, unit), Measured(predicted, unit), change


def _mean(values: FloatArray) -> float:
    finite = values[~np.isnan(values)]
    return float(finite.mean()) if len(finite) else float("nan")
