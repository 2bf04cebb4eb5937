"""Draw what the exported controllers are connected to: python examples/connection_pictures.py docs/images."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from matplotlib.patches import Rectangle

from pretouch.report.new_figure import new_figure
from pretouch.report.style import CHOSEN, INK, QUIET

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE: Final = (4.3, 4.9)  # inches, so that letters are large enough on a phone
_PALE: Final = "#e3edf6"
_TITLE: Final = 10.5
_LETTERS: Final = 9.5


class Box(NamedTuple):
    """A box with a title and a line of details, at its center; one of them is the exported controller."""

    x: float
    y: float
    title: str
    details: str = ""
    width: float = 0.56
    is_law: bool = False
    height: float = 0.13


class Arrow(NamedTuple):
    """An arrow between two boxes with what it carries; `beside` is the side of the label."""

    start: int
    end: int
    label: str = ""
    beside: str = "right"


PICTURES: Final[dict[str, tuple[tuple[Box, ...], tuple[Arrow, ...]]]] = {
    "arduino-loop": (
        (
            Box(0.3, 0.92, "Proximity sensor", "sees the object"),
            Box(0.3, 0.63, "Board", "runs the law each period", is_law=True),
            Box(0.3, 0.34, "Driver of the motor", "follows the reference"),
            Box(0.3, 0.07, "Motor and robot", "retreats from the object"),
            Box(0.85, 0.63, "Computer", "saves the log", width=0.28),
        ),
        (
            Arrow(0, 1, "readings\n(I2C or analog pin)"),
            Arrow(1, 2, "position and velocity\n(pins, servo, serial or CAN)"),
            Arrow(2, 3, "motion"),
            Arrow(1, 4, "USB", "above"),
        ),
    ),
    "ros2-controller": (
        (
            Box(0.25, 0.9, "Proximity sensor", "interface or topic", width=0.46),
            Box(0.76, 0.9, "Reference x_d", "controller or topic", width=0.46),
            Box(0.5, 0.56, "Pre-contact controller", "each period, called by the\ncontroller manager", 0.7, True, 0.17),
            Box(0.22, 0.16, "Joint", "position, velocity\nor effort", 0.4, height=0.17),
            Box(0.74, 0.16, "admittance_controller", "wrench_reference", 0.5),
        ),
        (
            Arrow(0, 2, "reading"),
            Arrow(1, 2, "motion"),
            Arrow(2, 3, "command"),
            Arrow(2, 4, "or virtual force"),
        ),
    ),
}


def draw(axes: Axes, boxes: tuple[Box, ...], arrows: tuple[Arrow, ...]) -> None:
    """Draw boxes, and arrows from border to border with their labels."""
    axes.set(xlim=(0, 1), ylim=(0, 1))
    axes.set_axis_off()
    for box in boxes:
        corner = (box.x - box.width / 2, box.y - box.height / 2)
        color = CHOSEN if box.is_law else QUIET
        axes.add_patch(Rectangle(corner, box.width, box.height, facecolor=_PALE, edgecolor=color, linewidth=1.4))
        lift = 0.012 + 0.018 * (1 + box.details.count("\n")) if box.details else 0.0
        centered: dict[str, Any] = {"ha": "center", "va": "center"}
        axes.text(box.x, box.y + lift, box.title, fontsize=_TITLE, fontweight="bold", color=INK, **centered)
        axes.text(box.x, box.y - 0.024, box.details, fontsize=_LETTERS, color=INK, **centered)
    for arrow in arrows:
        first, second = boxes[arrow.start], boxes[arrow.end]
        if first.y == second.y:
            start, end = (first.x + first.width / 2, first.y), (second.x - second.width / 2, second.y)
        else:
            inside = max(min(first.x, second.x + second.width / 2 - 0.06), second.x - second.width / 2 + 0.06)
            outside = max(min(second.x, first.x + first.width / 2 - 0.06), first.x - first.width / 2 + 0.06)
            x = inside if second.width >= first.width else outside
            start, end = (x, first.y - first.height / 2), (x, second.y + second.height / 2)
        style = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", xy=end, xytext=start, arrowprops=style)
        x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
        place = {"right": (x + 0.02, y, "left", "center"), "left": (x - 0.02, y, "right", "center")}
        x, y, horizontal, vertical = place.get(arrow.beside, (x, y + 0.015, "center", "bottom"))
        axes.text(x, y, arrow.label, fontsize=_LETTERS, color=INK, ha=horizontal, va=vertical)


def main(folder: Path) -> None:
    """Write each picture to a folder."""
    for name, (boxes, arrows) in PICTURES.items():
        figure = new_figure(*_SIZE)
        draw(figure.add_axes((0.01, 0.01, 0.98, 0.98)), boxes, arrows)
        figure.savefig(folder / f"{name}.png", dpi=110, metadata={"Software": None}, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
