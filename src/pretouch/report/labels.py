"""Place plot labels without covering text or curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation, Text


_DIRECTIONS: Final = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
_GAPS: Final = (5.0, 11.0, 20.0, 34.0, 52.0, 75.0, 100.0)
_ALIGN_X: Final[dict[int, Any]] = {1: "left", 0: "center", -1: "right"}
_ALIGN_Y: Final[dict[int, Any]] = {1: "bottom", 0: "center", -1: "top"}
_LEADERLESS: Final = 11.0
_AIR: Final = 1.5
_CURVE_AIR: Final = 3.0  # pixels between a label and a curve
_COVERING: Final = 4.0  # cost of covering one more point of a curve
_BACKGROUND: Final = 0.01  # relative cost of covering a point of a line with zorder below 1
_REFERENCES_FROM: Final = 1.5  # least zorder of reference lines
_CURVES_FROM: Final = 2.5  # least zorder of leader lines and curves
_OWN: Final = 5.0  # pixels around an anchor in which its own curve is ignored
_NARROW: Final = 2.0  # pixels to a point of a curve, below which a line crosses the curve
_WORD_SPACE: Final = 6.0  # least pixels between two texts in a row


def label_near(
    axes: Axes,
    x: Any,
    y: Any,
    text: str,
    *,
    color: str,
    size: float = 8.0,
    weight: str = "normal",
    reach: float = 100.0,
    side: int = 1,
    marks: list[FloatArray] | None = None,
) -> Annotation | None:
    """Write a label next to a plotted point or curve.

    A place is free if it touches no text and covers no curve, and no curve separates it from its anchor. Lines with
    zorder below 1 may be covered. The limits of the axes must be final.

    Args:
        axes: the axes.
        x: horizontal data coordinates of possible anchor points, the preferred points first.
        y: their vertical data coordinates.
        text: the label; a `$` is printed as it is.
        color: its color.
        size: its font size [pt].
        weight: its font weight.
        reach: largest distance from the anchor [pt].
        side: 1 to prefer places above the anchor, -1 to prefer places below.
        marks: result of `marks_in`, to reuse it for several labels; the leader line is added to it.

    Returns:
        The label, with a thin leader line if it is far from its anchor; None if no place is free.
    """
    label = _new_label(axes, text, color=color, fontsize=size, fontweight=weight)
    anchors = _display(axes, x, y)
    places, boxes = _candidates(anchors, axes.figure.dpi / 72, *size_of(label), side)
    occupied = boxes_in(axes, label)
    apart = np.array([-_WORD_SPACE, 0.0, _WORD_SPACE, 0.0])
    free = free_places(axes, boxes, occupied + apart) & (places[:, 3] <= reach)
    marks = marks_in(axes) if marks is None else marks
    all_marks = np.concatenate(marks)
    choice = _best_place(anchors, places, boxes, all_marks, occupied=occupied, free=np.flatnonzero(free))
    if choice < 0:
        label.remove()
        return None
    marks += _move_to(axes, label, anchors[int(places[choice, 0])], places[choice, 1:4])
    return label


def _best_place(
    anchors: FloatArray,
    places: FloatArray,
    boxes: FloatArray,
    marks: FloatArray,
    *,
    occupied: FloatArray,
    free: Any,
) -> int:
    """Return the index of the best free label position.

    The index is -1 if no position is free.
    """
    best, choice = np.inf, -1
    for i in free[np.argsort(places[free, 4], kind="stable")]:
        if places[i, 4] >= best:
            break
        covered = _covered(boxes[i], marks, _CURVE_AIR)
        cost, anchor = places[i, 4] + _COVERING * covered, anchors[int(places[i, 0])]
        if cost >= best or covered >= 1 or _behind(anchor, boxes[i], places[i, 3], marks):
            continue
        if not _crosses(anchor, boxes[i], places[i, 3], occupied):
            best, choice = cost, int(i)
    return choice


def label_inside(axes: Axes, x: Any, y: Any, text: str, *, color: str, size: float, fill: str) -> Annotation | None:
    """Write a label inside a plot, centered on one of several points.

    The label is rotated by 90 degrees if it is too wide.

    Args:
        axes: the axes; its limits must be final.
        x: horizontal data coordinates of possible centers, the preferred points first; the label stays between the
            smallest and the largest of them.
        y: their vertical data coordinates.
        text: the label.
        color: its color.
        size: its font size [pt].
        fill: its background color.

    Returns:
        The label; None if no place is free.
    """
    box = {"facecolor": fill, "edgecolor": "none", "pad": 1.0}
    label = _new_label(axes, text, color=color, fontsize=size, ha="center", va="center", bbox=box, zorder=1)
    anchors = _display(axes, x, y)
    width, height = size_of(label)
    if width + 4 > np.ptp(anchors[:, 0]):
        label.set_rotation(90)
        width, height = height, width
    half = np.array([width, height]) / 2 + 1
    boxes = np.column_stack([anchors - half, anchors + half])
    low, high = anchors[:, 0].min() - 1, anchors[:, 0].max() + 1
    free = free_places(axes, boxes, boxes_in(axes, label)) & (boxes[:, 0] >= low) & (boxes[:, 2] <= high)
    if not free.any():
        label.remove()
        return None
    marks = np.concatenate(marks_in(axes))
    costs = np.array([_covered(box, marks) for box in boxes]) + 0.5 * np.arange(len(boxes))
    costs[~free] = np.inf
    label.xycoords = "data"
    label.xy = tuple(axes.transData.inverted().transform(anchors[int(np.argmin(costs))]))
    return label


def _new_label(axes: Axes, text: str, **style: Any) -> Annotation:
    return axes.annotate(
        text,
        (0, 0),
        xytext=(0, 0),
        xycoords="figure pixels",
        textcoords="offset points",
        parse_math=False,
        annotation_clip=False,
        **{"zorder": 6, **style},
    )


def _crosses(anchor: FloatArray, box: FloatArray, gap: float, occupied: FloatArray) -> bool:
    """Return True if a leader line would cross another label."""
    if gap <= _LEADERLESS or not len(occupied):
        return False
    end = np.clip(anchor, box[:2], box[2:])
    path = anchor + np.linspace(0.0, 1.0, 25)[:, None] * (end - anchor)
    inside = (path[:, None] > occupied[:, :2] - _AIR) & (path[:, None] < occupied[:, 2:] + _AIR)
    return bool(inside.all(axis=2).any())


def _behind(anchor: FloatArray, box: FloatArray, gap: float, marks: FloatArray) -> bool:
    """Return True if a curve lies between a label and its plotted point."""
    # Leader lines may cross reference lines.
    end = np.clip(anchor, box[:2], box[2:])
    length = float(np.hypot(*(end - anchor)))
    if length <= _OWN:
        return False
    curves = marks[marks[:, 2] >= (_REFERENCES_FROM if gap <= _LEADERLESS else _CURVES_FROM), :2]
    curves = curves[(np.abs(curves - anchor) < length + _OWN).all(axis=1)]
    path = anchor + np.linspace(_OWN / length, 1.0, int(length / 2) + 2)[:, None] * (end - anchor)
    return bool((np.hypot(*(path[:, None] - curves).T) < _NARROW).any())


def _candidates(
    anchors: FloatArray, dots: float, width: float, height: float, side: int
) -> tuple[FloatArray, FloatArray]:
    """Return all possible positions of a label around its anchor points.

    Each position has a cost and a bounding box [pixel].
    """
    # A place is (anchor, dx, dy, gap, cost).
    rank, turn, nth = np.indices((len(anchors), len(_DIRECTIONS), len(_GAPS))).reshape(3, -1)
    gap = np.array(_GAPS)[nth]
    way = np.array(_DIRECTIONS)[turn] * np.array([1, side])
    cost = 0.5 * rank + 0.15 * turn + gap / 8
    reach = gap * dots / np.where(way.all(axis=1), np.sqrt(2), 1.0)
    corner = anchors[rank] + way * reach[:, None]
    size = np.array([width, height])
    low = corner + np.where(way > 0, 0.0, np.where(way < 0, -1.0, -0.5)) * size
    return np.column_stack([rank, way, gap, cost]), np.column_stack([low, low + size])


def free_places(axes: Axes, boxes: FloatArray, occupied: FloatArray) -> Any:
    """Return a mask of the unobstructed label positions inside the plot."""
    (x0, y0), (x1, y1) = axes.bbox.get_points()
    inside = (boxes[:, 0] >= x0 + 1) & (boxes[:, 2] <= x1 + 4) & (boxes[:, 1] >= y0 + 1) & (boxes[:, 3] <= y1 + 2)
    apart = (
        (boxes[:, None, 0] > occupied[:, 2] + _AIR)
        | (boxes[:, None, 2] < occupied[:, 0] - _AIR)
        | (boxes[:, None, 1] > occupied[:, 3] + _AIR)
        | (boxes[:, None, 3] < occupied[:, 1] - _AIR)
    )
    return inside & apart.all(axis=1)


def _move_to(axes: Axes, label: Annotation, anchor: FloatArray, place: FloatArray) -> list[FloatArray]:
    """Move a plot label to its position."""
    # If the position is far from the anchor, a leader line is drawn.
    # The points of the leader line are returned.
    dx, dy, gap = int(place[0]), int(place[1]), float(place[2])
    reach = gap / (np.sqrt(2) if dx and dy else 1)
    label.xy = tuple(axes.transData.inverted().transform(anchor))
    label.xycoords = "data"
    label.set_position((dx * reach, dy * reach))
    label.set_horizontalalignment(_ALIGN_X[dx])
    label.set_verticalalignment(_ALIGN_Y[dy])
    if gap > _LEADERLESS:
        dots = axes.figure.dpi / 72 * np.array([dx * reach, dy * reach])
        ends = axes.transData.inverted().transform(anchor + np.outer([4.0 / gap, 1 - 2.0 / gap], dots))
        return _marks_along(
            axes.plot(*ends.T, color=label.get_color(), linewidth=0.6, scalex=False, scaley=False, zorder=2.5)[0]
        )
    return []


def _display(axes: Axes, x: Any, y: Any) -> FloatArray:
    points = np.column_stack([np.atleast_1d(np.asarray(x, float)), np.atleast_1d(np.asarray(y, float))])
    pixels = np.asarray(axes.transData.transform(points[np.isfinite(points).all(axis=1)]))
    low, high = axes.bbox.get_points()
    return np.asarray(pixels[((pixels >= low - 1) & (pixels <= high + 1)).all(axis=1)])


def size_of(label: Text) -> tuple[float, float]:
    """Return the width and the height of a label in pixels."""
    extent = label.get_window_extent(_renderer(label))
    return extent.width, extent.height


def _renderer(artist: Any) -> Any:
    figure = artist.get_figure(root=True)
    if not hasattr(figure.canvas, "get_renderer"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415

        FigureCanvasAgg(figure)
    return figure.canvas.get_renderer()


def boxes_in(axes: Axes, new: Annotation | None = None) -> FloatArray:
    """Return the bounding boxes of existing plot labels [pixel]."""
    texts = [t for t in axes.texts if t is not new and t.get_text()]
    return np.array([t.get_window_extent(_renderer(t)).extents for t in texts]).reshape(-1, 4)


def marks_in(axes: Axes) -> list[FloatArray]:
    """Return closely spaced points along all lines and markers [pixel].

    Labels avoid these points.
    """
    parts = [np.empty((0, 3))]
    for line in axes.lines:
        parts += _marks_along(line)
    for collection in axes.collections:
        segments: list[Any] = getattr(collection, "get_segments", list)()
        if segments:
            pixels = [np.asarray(axes.transData.transform(segment)) for segment in segments]
            parts.append(_with_zorder(np.concatenate([dense_points(run) for run in pixels]), collection))
    return parts


def _marks_along(line: Any) -> list[FloatArray]:
    points = line.get_transform().transform(np.column_stack(line.get_data(orig=False)))
    points = points[np.isfinite(points).all(axis=1)]
    return [_with_zorder(points if line.get_linestyle() in {"None", ""} else dense_points(points), line)]


def _with_zorder(points: FloatArray, artist: Any) -> FloatArray:
    return np.column_stack([points, np.full(len(points), artist.get_zorder())])


def dense_points(points: FloatArray) -> FloatArray:
    """Resample a curve in small steps [pixel].

    Returns:
        The points, so that labels also avoid long straight segments.
    """
    if len(points) < 2:
        return points
    steps = np.abs(np.diff(points, axis=0)).max(axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.minimum(steps, 2000.0))])
    if along[-1] == 0:
        return points[:1]
    fine = np.linspace(0.0, along[-1], int(along[-1] / 4) + 2)
    return np.column_stack([np.interp(fine, along, points[:, i]) for i in (0, 1)])


def _covered(box: FloatArray, marks: FloatArray, air: float = 1.0) -> float:
    """Return a penalty for a plot label that covers curves."""
    x, y = marks[:, 0], marks[:, 1]
    inside = (x > box[0] - air) & (x < box[2] + air) & (y > box[1] - air) & (y < box[3] + air)
    behind = np.count_nonzero(inside & (marks[:, 2] < 1))
    return float(np.count_nonzero(inside) - (1 - _BACKGROUND) * behind)
