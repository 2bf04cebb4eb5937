"""Draw the plots of good calibrations into a folder: python examples/calibration_pictures.py docs/images."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final

import numpy as np

from calibration_cases import PEDESTAL, Array, Case, cases, report
from pretouch.report.new_figure import new_figure
from pretouch.report.style import BASELINE, CHOSEN, INK, QUIET, drawing, log_axis, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WINDOW: Final = "#e3edf6"
_TRUTH: Final = "#b9b9b9"
_FINE: Final = 300
_SMALL: Final = 7.5


def output_panel(axes: Axes, case: Case) -> None:
    """Plot the signal above the offset on a logarithmic axis: readings, fitted and true curve, window."""
    found = report(case.name)
    readings, left_out = case.calibration, _left_out(case)
    offset = 0.0 if found.offset is None else found.offset.value
    signal = readings.outputs - offset
    every = np.linspace(0.0, float(readings.distances.max()), _FINE)
    truth = case.signal(every) + (PEDESTAL if found.offset is None else 0.0)
    low = 0.55 * float(min(truth.min(), signal[(signal > 0) & ~left_out].min()))
    high = 2.2 * float(max(truth.max(), signal.max()))
    _distance_axis(axes, case)
    axes.set_ylabel("output [counts]" if found.offset is None else "output above the offset [counts]")
    log_axis(axes, "y", low, high)
    axes.plot(every * 1e3, truth, color=_TRUTH, linewidth=4.5, zorder=1.2, solid_capstyle="butt", label="true curve")
    shown = np.clip(signal, 1.12 * low, None)
    few = len(readings.distinct_distances) < 100
    style = {"linestyle": "None", "markersize": 3.6 if few else 1.2, "zorder": 2.2}
    kept = ~left_out & (signal > low)
    place = readings.distances * 1e3
    axes.plot(place[kept], shown[kept], "o", color=INK, markerfacecolor="white", markeredgewidth=0.7, **style)
    if left_out.any():
        worn = {**style, "markersize": 4.8, "zorder": 3.5}
        axes.plot(place[left_out], shown[left_out], "X", color=BASELINE, label="left out", **worn)
    if found.best is not None:
        inside = np.linspace(*found.best.sensor.valid_range, _FINE)
        fitted = found.best.sensor.output(inside)
        axes.plot(inside * 1e3, fitted, color=CHOSEN, linewidth=1.6, zorder=3, label=f"fitted: {found.best.model}")
    _legend(axes)


def slope_panel(axes: Axes, case: Case, wrong: Callable[[Array], Array] | None = None, title: str = "") -> None:
    """Plot the slope g: of neighboring readings, of the fitted curve with its uncertainty, and the true one."""
    found = report(case.name)
    if found.best is None or found.offset is None or found.slope is None:
        raise AssertionError
    places = case.calibration.distinct_distances
    means = np.array([case.calibration.outputs[case.calibration.distances == d].mean() for d in places])
    local = np.diff(np.log(means - found.offset.value)) / np.diff(places)
    between = (places[1:] + places[:-1]) / 2
    inside = np.linspace(*found.best.sensor.valid_range, _FINE)
    every = np.linspace(float(places[0]), float(places[-1]), _FINE)
    fitted, truth = found.best.sensor.log_slope(inside), case.slope(every)
    known = found.slope
    low_band, high_band = known.slope * (1 + known.uncertainty), known.slope * (1 - known.uncertainty)
    drawn = [fitted, truth, local, low_band, np.zeros(1)] + ([] if wrong is None else [wrong(every)])
    _distance_axis(axes, case)
    axes.set_title(title or f"Slope g: {case.name}")
    axes.set_ylabel("slope g [1/m]")
    low, high = span(np.concatenate(drawn), 0.1)
    axes.set_ylim(low, high)
    axes.axhline(0, color=QUIET, linewidth=0.7, zorder=1.1)
    axes.plot(every * 1e3, truth, color=_TRUTH, linewidth=4.5, zorder=1.2, solid_capstyle="butt", label="true g")
    band = {"color": CHOSEN, "alpha": 0.22, "linewidth": 0, "zorder": 1.4, "label": "known to this (95 %)"}
    axes.fill_between(known.distances * 1e3, low_band, high_band, **band)
    dots = {"color": INK, "markerfacecolor": "white", "markersize": 3.4, "zorder": 2.2}
    axes.plot(between * 1e3, local, "o", label="of neighboring readings", **dots)
    axes.plot(inside * 1e3, fitted, color=CHOSEN, linewidth=1.6, zorder=3, label="fitted")
    if wrong is not None:
        dashed = {"color": BASELINE, "linestyle": (0, (5, 1.6)), "linewidth": 1.6, "zorder": 3}
        axes.plot(every * 1e3, wrong(every), label="curve through all readings", **dashed)
    _legend(axes)


def residual_panel(axes: Axes, case: Case) -> None:
    """Plot residuals of readings and means from the fitted curve, and the difference between fitted and true curve."""
    found = report(case.name)
    if found.best is None or found.offset is None:
        raise AssertionError
    distance, sensor = case.calibration.distances, found.best.sensor
    near = (distance >= found.window.l_min) & (distance <= _SHOWN)
    distance, outputs = distance[near], case.calibration.outputs[near]
    share = 100 * ((outputs - found.offset.value) / sensor.output(distance) - 1)
    places = np.unique(distance)
    means = np.array([share[distance == d].mean() for d in places])
    every = np.linspace(found.window.l_min, _SHOWN, _FINE)
    truth = 100 * (case.signal(every) / sensor.output(every) - 1)
    _distance_axis(axes, case, last=_SHOWN)
    axes.set_ylabel("off the fitted curve [% of the signal]")
    axes.set_ylim(-14, 14)
    axes.axhline(0, color=CHOSEN, linewidth=1.6, zorder=1.5, label="fitted")
    axes.plot(every * 1e3, truth, color=_TRUTH, linewidth=4.5, zorder=1.2, label="true curve")
    inside = np.abs(share) < 13.8
    axes.plot(distance[inside] * 1e3, share[inside], ".", color=QUIET, markersize=3.0, zorder=2, label="readings")
    axes.plot(places * 1e3, means, "o", color=INK, markersize=4.6, zorder=3, label="means")
    _legend(axes)


_SHOWN: Final = 0.036  # of distances where residuals are of interest [m]


def _distance_axis(axes: Axes, case: Case, last: float | None = None) -> None:
    axes.set_title(case.title)
    axes.set_xlabel("distance l [mm]")
    end = 1e3 * (float(case.calibration.distances.max()) if last is None else last)
    axes.set_xlim(-0.03 * end, 1.03 * end)
    axes.locator_params(axis="x", nbins=6)
    window = report(case.name).window.distances
    if window and last is None:
        axes.axvspan(window[0] * 1e3, window[-1] * 1e3, color=_WINDOW, linewidth=0, zorder=0, label="usable window")


def _legend(axes: Axes) -> None:
    axes.legend(frameon=False, fontsize=_SMALL, handlelength=1.6)


def _left_out(case: Case) -> Array:
    """Return which readings were left out of all fits."""
    found, given = report(case.name), case.calibration.distances
    if found.best is None:
        return np.zeros(len(given), dtype=bool)
    out = (given < found.window.l_min) | (given > found.window.l_max)
    if len(case.calibration.distinct_distances) < 100:
        out = ~np.isin(given, found.window.distances)
        out[list(found.best.outliers)] = True
    else:
        out[:] = False
    return out


def through_all(case: Case) -> Callable[[Array], Array]:
    """Return g of a parabola in ln xi through all readings, a simple fit of a second-order exponential."""
    signal = case.calibration.outputs - case.calibration.no_object.mean()
    bend = np.polyfit(case.calibration.distances, np.log(signal), 2)
    return lambda distance: np.asarray(np.polyval(np.polyder(bend), distance))


def _figure(*panels: Callable[[Axes], None]) -> Figure:
    """Arrange panels in rows of two."""
    rows = (len(panels) + 1) // 2
    with drawing():
        figure = new_figure(7.4, 2.9 * rows)
        for i, draw in enumerate(panels):
            draw(figure.add_subplot(rows, 2, i + 1))
        figure.subplots_adjust(
            left=0.095, right=0.985, bottom=0.15 / rows, top=1 - 0.09 / rows, wspace=0.27, hspace=0.36
        )
    return figure


def _outputs(*names: str) -> tuple[Callable[[Axes], None], ...]:
    return tuple(partial(output_panel, case=cases()[name]) for name in names)


def _slope(name: str) -> Callable[[Axes], None]:
    return partial(slope_panel, case=cases()[name])


@dataclass(frozen=True)
class Picture:
    """A plot of the page: its cases and the function that draws it."""

    cases: tuple[str, ...]
    draw: Callable[[], Figure]


def pictures() -> dict[str, Picture]:
    """Return the plots by name."""
    soft = cases()["soft saturation"]
    return {
        "good": Picture(("good",), lambda: _figure(*_outputs("good"), _slope("good"))),
        "offset": Picture(
            ("offset measured", "offset withheld"),
            lambda: _figure(
                *_outputs("offset measured", "offset withheld"), _slope("offset measured"), _slope("offset withheld")
            ),
        ),
        "declared": _beside("offset too low", "offset too high"),
        "saturation": Picture(
            (soft.name,),
            lambda: _figure(*_outputs(soft.name), lambda axes: slope_panel(axes, soft, through_all(soft))),
        ),
        "clipping": _beside("clipping", "good"),
        "peak": Picture(("near-field peak",), lambda: _figure(*_outputs("near-field peak"), _slope("near-field peak"))),
        "rising": _beside("rising", "inverted"),
        "reflection": _beside("second reflection", "good"),
        "misfit": Picture(
            ("noise", "misfit"),
            lambda: _figure(*(partial(residual_panel, case=cases()[name]) for name in ("noise", "misfit"))),
        ),
        "outliers": _beside("a bad distance", "lost readings"),
        "dense": _beside("dense", "few"),
    }


def _beside(left: str, right: str) -> Picture:
    return Picture((left, right), lambda: _figure(*_outputs(left, right)))


def write(picture: Picture, file: str | Path | BinaryIO) -> None:
    """Write a plot to a PNG file."""
    picture.draw().savefig(file, format="png", dpi=110, metadata={"Software": None}, pil_kwargs={"optimize": True})


def main(folder: str) -> None:
    """Draw all plots."""
    for name, picture in pictures().items():
        write(picture, Path(folder) / f"calibration-{name}.png")


if __name__ == "__main__":
    main(sys.argv[1])
