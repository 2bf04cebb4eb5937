"""Plot the design of a virtual drag.

The drag, a damping that is quadratic in speed, is compared with a fixed gain.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch.designs.drag import DragDesign, drag_trade_off
from pretouch.designs.drag.page import at_speeds, letters_optimum, speeds_of
from pretouch.designs.gain import GainDesign
from pretouch.motion import DAMPER

from .panel_figure import panel_figure
from .panels import Curve, Mark, Panel, containing
from .style import scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHARE: Final = "contact speed / approach speed [%]"
_SPEED: Final = "approach speed [m/s]"
_POINTS: Final = 60
_RATIOS: Final = np.exp(-np.linspace(1e-3, 6.0, 121))


@check_arguments
def drag(design: DragDesign) -> Figure:
    """Draw the contact speed and the excursion of many virtual drags.

    Args:
        design: the drag of a task; if the task has an objective, the letter's optimal gain is drawn as well.

    Returns:
        Four panels: the ratio of contact speed to approach speed over the excursion, compared with the letter's law at
        the speed of the encounter; then ratio, excursion and largest acceleration over the approach speed.
    """
    letter = letters_optimum(design)
    low, high, nominal = speeds_of(design)
    speed = np.geomspace(low, high, _POINTS)
    laws: list[tuple[str, Any, Any, Any]] = [
        ("virtual drag", design.contact_speed(speed), np.full(_POINTS, design.excursion), design.acceleration(speed))
    ]
    if letter is not None:
        end = DAMPER.contact(at_speeds(design.scenario, speed), design.sensor, letter.gain).end
        magnitudes = (np.abs(v) for v in (end.relative_velocity, end.displacement, end.largest_acceleration))
        laws.append((f"letter's gain for {nominal:g} m/s", *magnitudes))
    length = scale_for("m", max(float(np.nanmax(law[2])) for law in laws))
    positive = all(float(np.min(law[3])) > 0 for law in laws)
    rows: list[tuple[str, list[Any], str, bool]] = [
        ("Contact speed", [100 * law[1] / speed for law in laws], _SHARE, False),
        (
            "Excursion",
            [law[2] / length.factor for law in laws],
            f"excursion at contact [{length.unit}]",
            False,
        ),
        ("Acceleration", [law[3] for law in laws], "largest acceleration [m/s\u00b2]", positive),
    ]
    panels = [
        containing(
            x_label=_SPEED,
            y_label=label,
            title=title,
            curves=[
                Curve(x=speed, y=y, label=law[0], style=i) for i, (law, y) in enumerate(zip(laws, values, strict=True))
            ],
            x_log=True,
            y_log=log,
            y_limits=None if log else (0.0, 1.25 * max(float(np.nanmax(y)) for y in values)),
        )
        for title, values, label, log in rows
    ]
    return panel_figure(_trade_off(design, letter, nominal), *panels)


def _trade_off(design: DragDesign, letter: GainDesign | None, speed: float) -> Panel:
    """Return a plot of the contact speed ratio versus the excursion."""
    curve = drag_trade_off(design.sensor, design.detection_distance, design.mass, _RATIOS)
    points = [(design.excursion, design.ratio, "chosen, at every speed", 0)]
    shown = [(curve.excursion, curve.ratio, "virtual drag", 0)]
    if letter is not None and letter.result is not None:
        trade, end = letter.trade_off, letter.result.end
        order = np.argsort(trade.gain)
        excursion = np.where(trade.reached, np.abs(trade.state.displacement), np.nan)[order]
        ratio = np.where(trade.reached, np.abs(trade.state.relative_velocity) / speed, np.nan)[order]
        shown.append((excursion, ratio, f"letter's law at {speed:g} m/s", 1))
        points.append((abs(float(end.displacement)), abs(float(end.relative_velocity)) / speed, "letter's optimum", 1))
    most = 1.8 * max(point[0] for point in points)
    scale = scale_for("m", most)
    curves = [
        Curve(x=x / scale.factor, y=np.where(x <= most, 100 * y, np.nan), label=label, style=i)
        for x, y, label, i in shown
    ]
    marks = [
        Mark(x=float(x) / scale.factor, y=100 * float(y), label=label, style=i, shape="square" if i else "dot")
        for x, y, label, i in points
    ]
    return containing(
        x_label=f"excursion at contact [{scale.unit}]",
        y_label=_SHARE,
        title="Trade-off",
        curves=curves,
        marks=marks,
        x_limits=(0.0, most / scale.factor),
        y_limits=(0.0, 104.0),
    )
