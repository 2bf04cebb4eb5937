"""Draw a sensor curve as a text plot for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

_WIDTH: Final = 60
_HEIGHT: Final = 10


def text_curve(distances: Sequence[float], outputs: Sequence[float], *, unit: str = "") -> list[str]:
    """Draw sensor output versus distance as lines of a text plot.

    Args:
        distances: the distances, shape (N,).
        outputs: the outputs, shape (N,).
        unit: unit of the distances, for the axis.

    Returns:
        The lines, the largest output at the top; none with fewer than two different distances.

    Examples:
        >>> lines = text_curve([0, 10, 20], [900, 300, 100], unit="mm")
        >>> len(lines), lines[0].rstrip()
        (12, '   900 ┤●')
        >>> lines[-1].split()
        ['0', 'mm', '20', 'mm']
    """
    x, y = np.asarray(distances, dtype=float), np.asarray(outputs, dtype=float)
    if len(x) < 2 or np.ptp(x) == 0:
        return []
    height = float(np.ptp(y)) or 1.0
    columns = np.rint((x - x.min()) / np.ptp(x) * (_WIDTH - 1)).astype(int)
    rows = np.rint((y.max() - y) / height * (_HEIGHT - 1)).astype(int)
    cells = [[" "] * _WIDTH for _ in range(_HEIGHT)]
    for row, column in zip(rows, columns, strict=True):
        cells[row][column] = "●"
    labels = {0: f"{y.max():.4g}", _HEIGHT - 1: f"{y.min():.4g}"}
    width = max(6, *map(len, labels.values()))
    lines = [f"{labels.get(i, ''):>{width}} ┤{''.join(row)}" for i, row in enumerate(cells)]
    near, far = f"{x.min():.4g} {unit}".rstrip(), f"{x.max():.4g} {unit}".rstrip()
    axis = f"{'':>{width}} └{'─' * _WIDTH}"
    return [*lines, axis, f"{'':>{width}}  {near}{far:>{_WIDTH - len(near)}}"]
