"""Figure 3: the three sensor curves, and their slopes."""

from __future__ import annotations

import numpy as np

from ..given import SENSORS, sensor
from ..result import DataTable, Reproduction
from ..running import run_script

__all__ = ["reproduce"]

_NAMES = ("inverse-power", "exponential-1", "exponential-2")


def reproduce() -> Reproduction:
    """Draw the curves L(3), L(5), L(6) with the parameters of Table I.

    Returns:
        The reproduction.
    """
    code, variables = run_script("figure-3")
    distance = np.array([0.0, 0.01, 0.02, 0.03, 0.0422])
    curves = {name: sensor(name) for name in _NAMES}
    rows = [
        (
            f"{1e3 * d:.1f}",
            *(f"{curves[n].output(d):.4f}" for n in _NAMES),
            *(f"{curves[n].log_slope(d):.2f}" for n in _NAMES),
        )
        for d in distance.tolist()
    ]
    second = {p.symbol: p.value for p in SENSORS["exponential-2"]}
    turn = -second["c_2"] / (2 * second["b_2"])
    return Reproduction(
        id="figure-3",
        title="Sensor output over the distance",
        place="Fig. 3",
        summary=(
            "On the output the three curves look alike; the letter judges them by R² there. The virtual force feels "
            "their slope g = d ln ξ / dl instead, and there they differ: at contact by a quarter, at 42.2 mm nearly "
            f"by a factor of two. The second order turns around at {1e3 * turn:.0f} mm: beyond it the force has the "
            "wrong sign."
        ),
        parameters=tuple(p for name in _NAMES for p in SENSORS[name]),
        comparisons=(),
        tables=(
            DataTable(
                title="Output ξ and slope g",
                head=("l [mm]", *(f"ξ, {n} [V]" for n in _NAMES), *(f"g, {n} [1/m]" for n in _NAMES)),
                rows=tuple(rows),
            ),
        ),
        caption="Left: the output, as in the letter. Right: the slope of its logarithm, not shown there.",
        code=code,
        figure=variables["figure"],
        numbers={
            "distance": variables["distance"],
            "output": {name: curve.output(variables["distance"]) for name, curve in curves.items()},
            "log_slope": {name: curve.log_slope(variables["distance"]) for name, curve in curves.items()},
            "turning_distance_second_order": turn,
        },
    )
