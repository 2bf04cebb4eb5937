"""Compare the clocks of recorded topics.

Each message has a receive time, from the clock of the recorder, and often a header stamp, from the clock of its sender.
Two topics can be compared by their header stamps only if the senders share a clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value

_MOST_TRANSPORT: Final = 0.1  # s: messages of two topics rarely take so differently long to the recorder
_BLOCKS: Final = 20  # parts of the recording, in each of which the fastest message counts
_FEWEST: Final = 6  # parts with messages of both topics, which a drift needs
_CERTAIN: Final = 6.0  # standard errors of a drift
_LEAST_DRIFT: Final = 5e-3  # s over the recording


class Transport(NamedTuple):
    """Receive times and header stamps of a topic.

    Args:
        topic: the topic.
        received: receive time of each message [ns].
        stamps: its header stamp [ns].
    """

    topic: str
    received: IntArray
    stamps: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockDifference(Value):
    """Difference of receive time minus header stamp, of one topic compared with another one.

    Args:
        topics: the two topics.
        offset: the difference in the middle of the recording [s].
        drift: its change over the recording [s]; 0 unless it is significant.
        rate: this change per second; 0 unless it is significant.
    """

    topics: tuple[str, str]
    offset: float
    drift: float = 0.0
    rate: float = 0.0

    @property
    def is_large(self) -> bool:
        """True if the stamps are probably from two clocks."""
        return bool(abs(self.offset) > _MOST_TRANSPORT or self.drift)

    @property
    def words(self) -> str:
        """The difference, and that the stamps are probably from two clocks."""
        said = (
            f"Relative to the receive times, the header stamps of {self.topics[0]} and {self.topics[1]} differ by "
            f"{format_quantity(abs(self.offset), 's', 3)}"
        )
        if self.drift:
            said += (
                f", and this difference changes by {format_quantity(abs(self.drift), 's', 3)} over the recording "
                f"({1e6 * abs(self.rate):.0f} ppm)"
            )
        return f"{said}, so they are probably from two clocks"


def compare_clocks(one: Transport, other: Transport) -> ClockDifference:
    """Compare how long after their header stamps the messages of two topics arrived.

    The fastest message in each part of the recording counts, because a recorder may write late, but not early.

    Args:
        one: a topic.
        other: another topic of the same recording.

    Returns:
        The difference, that of `one` minus that of `other`.
    """
    topics = (one.topic, other.topic)
    begin = max(int(one.received.min()), int(other.received.min()))
    end = min(int(one.received.max()), int(other.received.max()))
    edges = np.linspace(0.0, max(end - begin, 1) / 1e9, _BLOCKS + 1)
    fastest = _fastest(one, begin, edges) - _fastest(other, begin, edges)
    known = np.isfinite(fastest)
    if not known.any():
        medians = [float(np.median(_seconds(each))) for each in (one, other)]
        return ClockDifference(topics=topics, offset=medians[0] - medians[1])
    offset = float(np.median(fastest[known]))
    if known.sum() < _FEWEST:
        return ClockDifference(topics=topics, offset=offset)
    time = ((edges[1:] + edges[:-1]) / 2)[known]
    spread = time - time.mean()
    rate = float(spread @ fastest[known] / (spread @ spread))
    rest = fastest[known] - fastest[known].mean() - rate * spread
    error = float(np.sqrt(rest @ rest / (len(rest) - 2) / (spread @ spread)))
    drift = rate * float(edges[-1])
    if abs(drift) < _LEAST_DRIFT or abs(rate) < _CERTAIN * error:
        return ClockDifference(topics=topics, offset=offset)
    return ClockDifference(topics=topics, offset=offset, drift=drift, rate=rate)


def _seconds(topic: Transport) -> FloatArray:
    """Return receive time minus header stamp [s]."""
    return np.asarray((topic.received - topic.stamps) / 1e9)


def _fastest(topic: Transport, begin: int, edges: FloatArray) -> FloatArray:
    """Return the smallest difference of receive time and header stamp in each part [s]; NaN in a part without any."""
    place = np.searchsorted(edges, (topic.received - begin) / 1e9, side="right") - 1
    place[(topic.received - begin) / 1e9 == edges[-1]] = _BLOCKS - 1
    inside = (place >= 0) & (place < _BLOCKS)
    fastest = np.full(_BLOCKS, np.inf)
    np.minimum.at(fastest, place[inside], _seconds(topic)[inside])
    return np.where(np.isfinite(fastest), fastest, np.nan)
