"""An optimum at a limit is found at the edge of feasibility, with few evaluations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pretouch.designs.search import HELD, MEASURED, Landscape, search_axis

EDGE = 0.41372
SHAPES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "line": lambda d: 1 + 0.3 * d,
    "cube": lambda d: 1 + 0.2 * d + 40 * d**3,
    "kink at the edge": lambda d: 1 + np.where(d > 0, 8.0, 0.01) * d,
    "kinks of a quantile": lambda d: 1 + np.round(d, 3) + 0.2 * (d - np.round(d, 3)),
    "jump": lambda d: np.where(d > 0, 1.2, 0.9),
    "no contact beyond": lambda d: np.where(d > 0, np.inf, 0.9),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("side", [-1, 1])
def test_an_optimum_beyond_a_limit_is_put_on_its_edge(shape: str, side: int) -> None:
    evaluated = []

    def evaluate(u: np.ndarray) -> Landscape:
        evaluated.extend(u)
        ratio = SHAPES[shape](side * (u - EDGE))
        objective = np.where(np.isfinite(ratio), 1 + (u - EDGE - 0.3 * side) ** 2, np.inf)
        return Landscape(objective=objective, ratios=ratio[None])

    scanned, minima = search_axis(evaluate, EDGE - 1.0, EDGE + 1.1, MEASURED)
    assert len(minima) == 1
    found = evaluate(np.array([minima[0].coordinate]))
    assert found.feasible[0]
    assert minima[0].edge
    # the ratio may be below HELD by 1e-12, and a coordinate has an error of 1e-14
    slope = 0.01 if shape == "kink at the edge" else 0.2
    assert abs(minima[0].coordinate - EDGE) <= 2e-14 + (1 - HELD + 2e-12) / slope
    refined = len(evaluated) - len(scanned.coordinate)  # 180 to 190 if rounds of nine coordinates narrow the edge
    assert refined <= (80 if shape in {"line", "cube", "kinks of a quantile"} else 130)


def test_a_minimum_inside_the_limits_is_no_edge() -> None:
    def evaluate(u: np.ndarray) -> Landscape:
        return Landscape(objective=np.cosh(u - EDGE), ratios=(1 + 0.3 * (u - EDGE - 0.02))[None])

    _, minima = search_axis(evaluate, EDGE - 1.0, EDGE + 1.1, MEASURED)
    assert minima[0].coordinate == pytest.approx(EDGE, abs=1e-9)
    assert not minima[0].edge
