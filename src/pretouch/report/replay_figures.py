"""Plot a replayed recording over time.

The plots show readings, sensor output, virtual force and commanded motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import FloatArray
from pretouch.recording import Replay

from .panel_figure import panel_figure
from .panels import Curve, Panel, Span, containing
from .simulation_figures import thin_out
from .style import Scale, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_SPANS: Final = 100  # detections that are shaded


@check_arguments
def replay(replay: Replay) -> Figure:
    """Draw recorded sensor readings and the resulting virtual force and motion.

    The control law computes force and motion from the readings.

    Args:
        replay: the replay.

    Returns:
        Panels over the same time axis: readings, sensor output relative to the floor, virtual force and commanded
        motion. Detections are shaded.
    """
    steps, end = replay.steps, float(replay.steps.time[-1])
    clock = scale_for("s", end)
    is_distance = replay.recording.kind == "distance"
    recorded = replay.recording.values if is_distance else replay.readings
    panels = [
        _panel(replay, clock, replay.recording.time, recorded, ("distance", "m") if is_distance else ("reading", "")),
        _panel(replay, clock, steps.time, steps.log_level, ("ln(\u03be / floor)", "1")),
        _panel(replay, clock, steps.time, steps.virtual_force, ("virtual force F\u209a", "N")),
        _panel(replay, clock, steps.time, steps.position, ("commanded motion", "m")),
    ]
    return panel_figure(*[panel for panel in panels if panel is not None], height=2.5)


def _panel(replay: Replay, clock: Scale, time: FloatArray, values: FloatArray, axis: tuple[str, str]) -> Panel | None:
    """Return a plot of one quantity over time. The plot is None if the quantity has no finite value."""
    label, unit = axis
    end = float(replay.steps.time[-1])
    order = np.argsort(time, kind="stable")
    shown_time, shown = thin_out(time[order], values[order], end)
    if not np.isfinite(shown).any():
        return None
    scale = scale_for(unit, float(np.nanmax(np.abs(shown))))
    factor = clock.factor
    spans = [
        Span(start=d.start / factor, end=min(d.end, end) / factor, kind="used")
        for d in replay.detections[:_MOST_SPANS]
        if min(d.end, end) > d.start
    ]
    return containing(
        x_label=f"time [{clock.unit}]",
        y_label=f"{label} [{scale.unit or 'unit of the readings'}]",
        curves=[Curve(x=shown_time / factor, y=shown / scale.factor, style=0)],
        spans=spans,
        x_limits=(0.0, max(end, 1e-6) / factor),
    )
