"""Plot the fit of one sensor model: readings, fitted curve and residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch.calibration import SensorFit

from .panel_figure import panel_figure
from .panels import Curve, Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_POINTS: Final = 200


@check_arguments
def sensor_fit(fit: SensorFit) -> Figure:
    """Draw a fitted sensor curve with its readings and residuals.

    The residuals are those of the log output ln xi.

    Args:
        fit: the fit of one model.

    Returns:
        Two panels over the distance: the signal above the offset with the fitted curve, and the residuals in percent.
    """
    low, high = float(fit.distances.min()), float(fit.distances.max())
    distance = np.linspace(low, high, _POINTS)
    curve = np.asarray(fit.sensor.output(distance))
    points = np.exp(np.asarray(fit.sensor.log_output(fit.distances)) + fit.residuals)
    return panel_figure(
        Panel(
            x_label="distance l [mm]",
            y_label="signal above the offset [unit of the readings]",
            title=fit.model,
            curves=[
                Curve(x=1e3 * fit.distances, y=points, label="readings", kind="points", style=1),
                Curve(x=1e3 * distance, y=curve, label="fitted curve", style=0),
            ],
            y_log=True,
        ),
        Panel(
            x_label="distance l [mm]",
            y_label="residual of ln ξ [%]",
            title="residuals",
            curves=[Curve(x=1e3 * fit.distances, y=100 * fit.residuals, kind="points", style=1)],
            levels={"": 0.0},
        ),
        columns=2,
    )
