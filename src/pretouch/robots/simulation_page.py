"""Create the report on simulated encounters of a whole robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pretouch._core.blocks import Cell, Film, Listing, Measured, Page, PageTable, Picture
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity

from .result import BodyContact, RobotSimulation, touches_elsewhere

_ROWS = (
    ("time of contact", "time", "s"),
    ("relative velocity at contact", "relative_velocity", "m/s"),
    ("peak contact force", "peak_force", "N"),
    ("largest excursion", "excursion", "m"),
    ("energy of the impact", "energy", "J"),
)

_RECOIL = 1e-6  # a smaller share of the excursion is no recoil

_HARDER = 1.01  # ratio of contact speeds above which a contact is harder than without mitigation

_KEY_FIGURES = (
    ("contact speed", "relative_velocity", "m/s"),
    ("peak contact force", "peak_force", "N"),
    ("largest excursion", "excursion", "m"),
)


def robot_page(result: RobotSimulation) -> Page:
    """Return the report on simulated encounters of a robot."""
    order, elsewhere = result.order(0), touches_elsewhere(result.touches)
    return Page(
        kind="Simulated robot",
        headline=_headline(result, order, elsewhere),
        good=bool(order) and not elsewhere,
        key_figures=tuple(_figures(result, order[0])) if order else (),
        warnings=result.warnings,
        lead="robot",
        findings=result.notes,
        blocks=(
            Listing(items=result.notes, brief=True) if result.notes else None,
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
            *_force_table(result, elsewhere),
            Picture(
                figure="robot",
                of=result,
                name="The first run over time",
                caption="The first run, next to the prediction from the first detection to contact. The reference is "
                "the position along the axis of the site that the control law commands.",
            ),
        ),
    )


def _headline(result: RobotSimulation, order: tuple[str, ...], elsewhere: Sequence[BodyContact]) -> str:
    """Return a headline with the sites and speeds of contacts, and first with what else the robot touched."""
    if elsewhere:
        hits = ", ".join(map(_hit, elsewhere))
        hit = f"The robot is hit away from its sensor sites: {hits}."
        return f"{hit} {_headline(result, order, ())}" if order else hit
    if not order:
        return "No site touched an object" + (" in the first run." if any(result.touches) else ".")
    speeds = [format_quantity(abs(_mean(result.simulated(name, "relative_velocity"))), "m/s", 3) for name in order]
    harder = [_harder(result, name) for name in order]
    if len(order) == 1:
        return f"The site {order[0]} touches the object at {speeds[0]}{harder[0]}."
    speeds = [speed + more for speed, more in zip(speeds, harder, strict=True)]
    listed = ", ".join(f"{name} at {speed}" for name, speed in zip(order, speeds, strict=True))
    return f"Touches in the order {', '.join(order)}. Contact speeds: {listed}."


def _harder(result: RobotSimulation, site: str) -> str:
    """Return a clause on a contact that is faster than one of a robot that does not react, else an empty text."""
    simulated, unmitigated = (
        abs(_mean(values)) for values in (result.simulated(site, "relative_velocity"), result.unmitigated_speeds(site))
    )
    if not simulated > _HARDER * unmitigated:
        return ""
    return f", harder than without mitigation ({format_quantity(unmitigated, 'm/s', 3)})"


def _hit(touch: BodyContact) -> str:
    """Return the contact of one body as a clause."""
    speed, force = format_quantity(abs(touch.relative_velocity), "m/s", 3), format_quantity(touch.peak_force, "N", 3)
    return f"the body {touch.body} touches {touch.object} at {speed} with up to {force}"


def _figures(result: RobotSimulation, site: str) -> Iterator[tuple[str, Cell]]:
    """Yield simulated and predicted results of the first contact. They are contact speed, peak force and excursion."""
    for label, quantity, unit in _KEY_FIGURES:
        share = _moved_share(result, site) if quantity == "excursion" else 1.0
        simulated, predicted = (abs(_mean(share * f(site, quantity))) for f in (result.simulated, result.predicted))
        comparison = "" if np.isnan(predicted) else f"; predicted {format_quantity(predicted, unit, 3)}"
        yield f"{label}{comparison}", Measured(simulated, unit, 3)


def _rows(result: RobotSimulation, site: str) -> Iterator[tuple[Cell, ...]]:
    moved = _moved_share(result, site)
    for label, quantity, unit in _ROWS:
        share = moved if quantity == "excursion" else 1.0
        yield _row(label, unit, *(_mean(share * f(site, quantity)) for f in (result.simulated, result.predicted)))
    if np.any(moved < 1 - _RECOIL):
        both = (_mean(f(site, "excursion")) for f in (result.simulated, result.predicted))
        yield _row("largest excursion of the joints, relative to the base", "m", *both)


def _row(label: str, unit: str, simulated: float, predicted: float) -> tuple[Cell, ...]:
    difference = 100 * (simulated / predicted - 1) if predicted else float("nan")
    change = "-" if np.isnan(difference) else f"{difference:+.2f} %"
    return label, Measured(simulated, unit), Measured(predicted, unit), change


def _moved_share(result: RobotSimulation, site: str) -> FloatArray:
    """Return the share of the excursion relative to the base by which the site itself moves, for each run.

    The rest is the recoil of a base that is not fixed.
    """
    detections = [contact.detection for contact in result.contacts[result.sites.index(site)]]
    return np.array([1.0 if d is None else 1 - d.recoil_share for d in detections])


def _force_table(result: RobotSimulation, elsewhere: Sequence[BodyContact]) -> Iterator[PageTable]:
    """Yield a table of the largest forces on the robot and on its bodies, if more than one body is touched."""
    if elsewhere:
        yield PageTable(
            head=("largest contact force on", "by", "simulated"),
            rows=(
                ("the robot", "all contacts", Measured(max(result.robot_forces), "N")),
                *(
                    (body, other, Measured(force, "N"))
                    for (body, other), force in _largest_forces(result.touches).items()
                ),
            ),
            brief=True,
        )


def _largest_forces(touches: Sequence[Sequence[BodyContact]]) -> dict[tuple[str, str], float]:
    """Return the largest force between each pair of bodies over all runs [N]."""
    forces: dict[tuple[str, str], float] = {}
    for touch in (touch for run in touches for touch in run):
        key = touch.body, touch.object
        forces[key] = max(forces.get(key, 0.0), touch.peak_force)
    return forces


def _mean(values: FloatArray) -> float:
    finite = values[~np.isnan(values)]
    return float(finite.mean()) if len(finite) else float("nan")
