"""Draw the time per contact over batch size, compared with the time of the exponentials alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .measuring import cost
from .protocol import Peer, Way
from .work import SENSORS, contacts

__all__ = ["Growth", "draw", "follow"]

_EXPONENTIALS = 4  # two evaluations of the closed form, of two exponentials each
_LONGEST = 8.0  # [s]: a curve ends before a call that would take longer
_TITLES = {"exponential-1": "exponential-1: closed form", "inverse-power": "inverse power: integration"}
_STYLES = {"pretouch": 0, "heyoka": 1, "JAX": 2, "diffrax": 2, "NumPy": 3, "SciPy": 3}  # the others take the last


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """The time per contact of one method over batch sizes.

    Args:
        peer: the library.
        way: what it does.
        sensor: a name of `work.SENSORS`.
        sizes: contacts in one call.
        seconds: time per contact [s].
    """

    peer: str
    way: str
    sensor: str
    sizes: tuple[int, ...]
    seconds: tuple[float, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the fields by name."""
        return asdict(self)


def follow(peers: Sequence[Peer], largest: int, budget: float) -> list[Growth]:
    """Measure each method of the figure over batch sizes up to the largest."""
    sizes = [round(10 ** (k / 2)) for k in range(13)]
    sizes = [size for size in sizes if size <= largest]
    return [
        _follow(peer.name, way, sizes, budget)
        for sensor in SENSORS
        for peer in peers
        for way in peer.cases()
        if way.sensor == sensor and "B" in way.cases and way.grows
    ]


def _follow(peer: str, way: Way, sizes: Sequence[int], budget: float) -> Growth:
    seconds: list[float] = []
    for size in sizes:
        if seconds and (seconds[-1] * size > _LONGEST or size > way.largest):
            break
        job = way.make(*contacts(size))
        job()
        seconds.append(cost(job, budget) / size)
    return Growth(
        peer=peer, way=way.name, sensor=way.sensor, sizes=tuple(sizes[: len(seconds)]), seconds=tuple(seconds)
    )


def draw(grown: Sequence[Growth], limit: float, file: Path) -> None:
    """Draw the figure; `limit` is the time of one exp() [s]."""
    from pretouch.report import Curve, Panel, panel_figure  # noqa: PLC0415

    floor = {f"limit: {_EXPONENTIALS} exp() of {limit * 1e9:.2g} ns": _EXPONENTIALS * limit * 1e6}
    panels = []
    for sensor in SENSORS:
        curves = [
            Curve(
                x=growth.sizes,
                y=[second * 1e6 for second in growth.seconds],
                label=growth.peer,
                style=_STYLES.get(growth.peer, 4),
                kind="both",
            )
            for growth in grown
            if growth.sensor == sensor
        ]
        if not curves:
            continue
        panels.append(
            Panel(
                title=_TITLES[sensor],
                x_label="contacts in one call [1]",
                y_label="time per contact [µs]",
                curves=curves,
                levels=floor if sensor == "exponential-1" else {},  # any other curve needs no exponential
                x_log=True,
                y_log=True,
            )
        )
    panel_figure(*panels, height=3.8).savefig(file)
