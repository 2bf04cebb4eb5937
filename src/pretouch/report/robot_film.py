"""Draw a filmstrip and an animation of a simulated robot.

The animation loops in slow motion.
"""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch.robots import RobotSimulation, SiteContact
from pretouch.robots.rendering import PAPER, Camera, Frame, camera_for, render_frames, silhouettes

from .new_figure import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIZE: Final = 480, 360  # pixels of a frame
_STILLS: Final = 6
_FRAMES: Final = 40
_FRAME_TIME: Final = 0.07  # s
_LAST_TIME: Final = 1.2  # s for which the animation shows its last frame
_QUALITY: Final = 70  # of WebP: with 40 frames, an animation then has about 100 kB
_MOMENT: Final = 2e-3  # s after the first contact for which a still is labeled as contact
_DPI: Final = 100.0
_EDGE: Final = "#33333380"
_PLANAR: Final = (
    "The frames are planar drawings, because MuJoCo cannot render with OpenGL on this computer; on Linux, install "
    "PyOpenGL and Mesa's libEGL."
)


@dataclass(frozen=True, slots=True)
class _Film:
    """Images of a simulated robot over time.

    Args:
        frames: images, shape (height, width, 3).
        stills: indices of the frames that form the filmstrip.
        labels: title of each still.
        slower: duration of the animation divided by the duration of the encounter.
        remark: reason why the frames are drawings; empty if MuJoCo has rendered the frames.
    """

    frames: list[Frame]
    stills: tuple[int, ...]
    labels: tuple[str, ...]
    slower: float
    remark: str


@check_arguments
def robot_film(result: RobotSimulation, run: int = 0) -> Figure:
    """Draw six still images of one run of a simulated robot.

    Args:
        result: the result of `simulate_robot`.
        run: number of the run.

    Returns:
        Six frames from the start until shortly after contact. MuJoCo renders the frames; without OpenGL, the frames are
        planar drawings.
    """
    film = _film_of(result, run, _STILLS)
    figure = new_figure(10.5, 5.7)
    for number, (i, label) in enumerate(zip(film.stills, film.labels, strict=True), 1):
        axes = figure.add_subplot(2, _STILLS // 2, number)
        axes.imshow(film.frames[i])
        axes.set_title(label, fontsize=9, loc="left")
        axes.set_axis_off()
    figure.tight_layout()
    return figure


def film_html(result: RobotSimulation, run: int = 0) -> str:
    """Return an HTML film of one run of a simulated robot.

    The film consists of a filmstrip and an animation. On systems with the setting "reduced motion", a still replaces
    the animation.

    Args:
        result: the result of `simulate_robot`.
        run: number of the run.

    Returns:
        The HTML elements, which contain all images.
    """
    film = _film_of(result, run, _FRAMES)
    still = _address([film.frames[film.stills[-2]]])
    moving = _address(film.frames)
    rows = (
        f'<li><img alt="" src="{_address([film.frames[i]])}">{escape(label)}</li>'
        for i, label in zip(film.stills, film.labels, strict=True)
    )
    remark = f"<p>{escape(film.remark)}</p>" if film.remark else ""
    return (
        f'<div class="film">{remark}<picture><source media="(prefers-reduced-motion: reduce)" srcset="{still}">'
        f'<img alt="Animation, {film.slower:.2g} times slower than the encounter" src="{moving}"></picture>\n'
        f"<ol>{''.join(rows)}</ol></div>"
    )


def _film_of(result: RobotSimulation, run: int, count: int) -> _Film:
    """Draw `count` images of a run at equal time steps. One image is shifted to the moment of the first contact."""
    trace, contacts = result.trace(run), [contacts[run] for contacts in result.contacts]
    rows = np.linspace(0, len(trace.time) - 1, count).round().astype(int)
    touches = [c.time for c in contacts if not math.isnan(c.time)]
    if touches:  # one frame shows the first contact exactly
        touch = int(np.searchsorted(trace.time, min(touches)).clip(max=len(trace.time) - 1))
        contact_frame = 1 + int(np.argmin(np.abs(rows[1:-1] - touch)))
        rows[contact_frame] = touch
        stills = (*np.linspace(0, contact_frame, _STILLS - 1).round().astype(int).tolist(), count - 1)
    else:
        stills = tuple(np.linspace(0, count - 1, _STILLS).round().astype(int).tolist())
    configurations = trace.configuration[rows]
    camera = camera_for(result.model, trace.configuration, result.laws[0].site)
    frames = render_frames(result.model, configurations, camera, width=_SIZE[0], height=_SIZE[1])
    remark = ""
    if frames is None:
        remark = _PLANAR
        frames = [_drawing(result.model, row, camera) for row in configurations]
    labels = tuple(_label(float(trace.time[rows[i]]), float(trace.distance[rows[i], 0]), contacts[0]) for i in stills)
    slower = _FRAME_TIME * (count - 1) / float(trace.time[-1])
    return _Film(frames, stills, labels, slower, remark)


def _label(time: float, distance: float, contact: SiteContact) -> str:
    """Return the title of a still image. It contains the time, and the distance or the word `contact`."""
    clock = format_quantity(time, "s", 3)
    if time >= contact.time:
        return f"{clock}, {'contact' if time < contact.time + _MOMENT else 'after contact'}"
    return f"{clock}, {format_quantity(distance, 'm', 3) if math.isfinite(distance) else 'no object on the axis'}"


def _drawing(model: Any, configuration: FloatArray, camera: Camera) -> Frame:
    """Draw the robot in one joint configuration as planar outlines."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - Matplotlib, only when needed

    figure = new_figure(_SIZE[0] / _DPI, _SIZE[1] / _DPI)
    figure.set_facecolor(f"#{bytes(PAPER).hex()}")
    canvas: Any = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    half = camera.height / 2
    for silhouette in silhouettes(model, configuration, camera):
        axes.fill(*silhouette.outline.T, facecolor=silhouette.color, edgecolor=_EDGE, linewidth=0.8)
    axes.set_xlim(-half * _SIZE[0] / _SIZE[1], half * _SIZE[0] / _SIZE[1])
    axes.set_ylim(-half, half)
    axes.set_axis_off()
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def _address(frames: list[Frame]) -> str:
    """Return images as a data URI. Several images become an animation that loops."""
    from PIL import Image  # noqa: PLC0415 - Matplotlib brings it

    first, *others = [Image.fromarray(frame) for frame in frames]
    content = BytesIO()
    times = [*[round(1000 * _FRAME_TIME)] * len(others), round(1000 * _LAST_TIME)]
    more: dict[str, Any] = {"save_all": True, "append_images": others, "duration": times, "loop": 0} if others else {}
    first.save(content, format="WEBP", quality=_QUALITY, method=4, **more)
    return f"data:image/webp;base64,{base64.b64encode(content.getvalue()).decode()}"
