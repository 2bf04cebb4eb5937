"""Compare candidates, such as sensors, by contact speed and excursion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import ResultUnavailableError
from pretouch.verification.candidates import CandidateComparison

from .panel_figure import panel_figure
from .panels import Curve, Mark, containing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_HOLDS, _FAILS = 0, 1  # palette indices
_AIR: Final = 1.2


@check_arguments
def candidates(comparison: CandidateComparison) -> Figure:
    """Draw the mean contact speed of each candidate versus its excursion.

    The excursion of a candidate is the mean of the largest excursions of its runs.

    Args:
        comparison: a comparison of candidates.

    Returns:
        One panel. A bar ends at the speed that 95 % of the runs stay below. Candidates that hold are filled, others
        are rings.

    Raises:
        ResultUnavailableError: no run of any candidate ends in contact.
    """
    shown = [c for c in comparison.candidates if math.isfinite(c.contact_speed)]
    if not shown:
        raise ResultUnavailableError("candidates: no run ends in contact, so there is nothing to draw")
    curves, marks = [], []
    for c in shown:
        style = _HOLDS if c.status.is_passed else _FAILS
        x, speed = 1e3 * c.mean_of("largest_excursion"), c.contact_speed
        high = max(speed, c.high_contact_speed)  # rounding may put the quantile of equal speeds below their mean
        curves.append(Curve(x=[x], y=[speed], low=[speed], high=[high], kind="points", style=style))
        marks.append(Mark(x=x, y=speed, label=c.name, style=style, shape="dot" if c.status.is_passed else "ring"))
    return panel_figure(
        containing(
            x_label="largest excursion, mean [mm]",
            y_label="speed at contact [m/s]",
            curves=curves,
            marks=marks,
            x_limits=(0.0, _AIR * max(mark.x for mark in marks) or 1.0),
            y_limits=(0.0, _AIR * max(c.high_contact_speed for c in shown) or 1.0),
        ),
        columns=1,
        height=3.6,
    )
