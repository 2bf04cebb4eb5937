"""Plot encounters and workspace maps of a whole robot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch.robots import RobotSimulation

from .new_figure import new_figure
from .panel_figure import panel_figure
from .panels import Curve, Panel
from .simulation_figures import thin_out
from .style import scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PREDICTED: Final = 4
_MAPS: Final = ("reflected_mass", "relative_velocity", "remaining_excursion")


@check_arguments
def robot(result: RobotSimulation, run: int = 0) -> Figure:
    """Draw one run of a simulated robot and its prediction.

    Args:
        result: the result of `simulate_robot`.
        run: number of the run.

    Returns:
        Panels with the distance of each site, the reference of its law, the contact force, and the torques of the
        joints.
    """
    trace, predicted = result.trace(run), result.predicted_courses(run)
    end = float(trace.time[-1])
    clock = scale_for("s", end)
    times = trace.time

    def panel(label: str, unit: str, values: FloatArray, names: tuple[str, ...], others: Any = ()) -> Panel:
        values = np.where(np.isfinite(values), values, np.nan)
        scale = scale_for(unit, float(np.nanmax(np.abs(values), initial=0.0)) or 1.0)
        curves = []
        for i, name in enumerate(names):
            t, v = thin_out(times, values[:, i], end)
            if np.isfinite(v).any():
                curves.append(Curve(x=t / clock.factor, y=v / scale.factor, label=name, style=i % 4))
        for t, v in others:
            keep = t <= end
            curves.append(
                Curve(x=t[keep] / clock.factor, y=v[keep] / scale.factor, label="predicted", style=_PREDICTED)
            )
        return Panel(x_label=f"time [{clock.unit}]", y_label=f"{label} [{scale.unit}]", curves=curves)

    courses = [course for course in predicted if course is not None]
    joints = tuple(f"joint {i + 1}" for i in range(min(trace.torque.shape[1], 4)))
    panels = [
        panel("distance l", "m", trace.distance, result.sites, [(c.time, c.distance) for c in courses]),
        panel("reference of the site", "m", trace.reference, result.sites, [(c.time, c.position) for c in courses]),
        panel("contact force", "N", trace.force, result.sites),
        panel("torque of the drives", "N*m", trace.torque, joints),
    ]
    return panel_figure(*(p for p in panels if p.curves), height=2.75)


def workspace(dataset: Any) -> Figure:
    """Draw workspace maps of a robot for one gain.

    The maps show the reflected mass, the contact speed and the still available excursion.

    Args:
        dataset: the dataset of a sweep after `Workspace.describe`.

    Returns:
        One map for each quantity, in the plane in which the places spread most. Arrows show the directions; crosses
        mark places at which a limit of the robot is exceeded.

    Raises:
        InvalidInputError: the argument is not such a dataset.
    """
    if not {"position_x", "direction_x", "holds"} <= set(getattr(dataset, "data_vars", ())):
        raise InvalidInputError(
            f"dataset: found {dataset!r:.60} of the type {type(dataset).__name__}, expected the dataset that "
            "`Workspace.describe` returns",
            value=dataset,
        )
    positions = np.array([np.asarray(dataset[f"position_{axis}"]) for axis in "xyz"])
    directions = np.array([np.asarray(dataset[f"direction_{axis}"]) for axis in "xyz"])
    across, up = sorted(np.argsort(np.ptp(positions, axis=1))[-2:])
    figure = new_figure(10.5, 3.6)
    holds = np.asarray(dataset["holds"], dtype=bool)
    for number, (name, values) in enumerate(_mapped(dataset), 1):
        axes = figure.add_subplot(1, len(_MAPS), number)
        colors = axes.quiver(
            *(positions[[across, up]]),
            *(directions[[across, up]]),
            values,
            cmap="viridis",
            norm="log" if name.startswith("reflected") else "linear",
            pivot="tail",
            width=0.008,
            scale=14,
        )
        axes.plot(*positions[[across, up]][:, ~holds], "x", color="#c0392b", markersize=5)
        axes.set_aspect("equal", "datalim")
        axes.set_title(name, fontsize=9, loc="left")
        axes.set_xlabel(f"{'xyz'[across]} [m]")
        axes.set_ylabel(f"{'xyz'[up]} [m]" if number == 1 else "")
        figure.colorbar(colors, ax=axes, fraction=0.046)
    figure.tight_layout()
    return figure


def _mapped(dataset: Any) -> Iterator[tuple[str, FloatArray]]:
    """Yield title and values of each workspace map."""
    for name in _MAPS:
        values = np.abs(np.asarray(dataset[name])) if name == "relative_velocity" else np.asarray(dataset[name])
        unit = {"reflected_mass": "kg", "relative_velocity": "m/s", "remaining_excursion": "m"}[name]
        words = "contact speed" if name == "relative_velocity" else name.replace("_", " ")
        scale = scale_for(unit, float(np.nanmax(np.abs(values))))
        yield f"{words} [{scale.unit}]", values / scale.factor
