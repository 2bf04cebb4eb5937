"""The HTML report of a simulated encounter."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch._core.files import write_text
from pretouch.verification import SimulatedEncounter

from .html import fitted_part, picture, render_page, source_part

if TYPE_CHECKING:
    from pretouch.calibration.result import CalibrationReport

__all__ = ["simulation_report_html", "write_simulation_report"]


def simulation_report_html(
    encounter: SimulatedEncounter,
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
) -> str:
    """Write a simulated encounter as one self-contained HTML page.

    Args:
        encounter: what `simulate_encounter` returned, however it ended.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file: an object, or a mapping, with `name` or `path`, `text` and `sha256`.

    Returns:
        The page, signed as pretouch's own.
    """
    from .simulation_figures import simulation_figure  # noqa: PLC0415
    from .simulation_page import simulation_page  # noqa: PLC0415

    return render_page(
        "simulation.html.j2",
        **simulation_page(encounter),
        figure=picture(simulation_figure(encounter), "run"),
        fitted=fitted_part(calibration, encounter),
        source=source_part(source),
    )


def write_simulation_report(
    encounter: SimulatedEncounter,
    path: str | os.PathLike[str],
    *,
    calibration: CalibrationReport | None = None,
    source: object = None,
    overwrite: bool = False,
) -> Path:
    """Write a report of a simulated encounter to a file.

    Args:
        encounter: what `simulate_encounter` returned, however it ended.
        path: where the page goes.
        calibration: the calibration that the sensor curve was fitted to, where there is one.
        source: the scenario file, as `simulation_report_html` takes it.
        overwrite: whether a file that stands there may be replaced.

    Returns:
        The path.
    """
    page = simulation_report_html(encounter, calibration=calibration, source=source)
    return write_text(path, page, overwrite=overwrite)
