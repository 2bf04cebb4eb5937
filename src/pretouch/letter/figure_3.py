"""Recompute Figure 3 of the published letter: the three sensor curves of Table I."""

from __future__ import annotations

from typing import Final

import numpy as np

from .experiment import Reproduction, Variables, readings
from .inputs import SENSORS, sensor
from .program import Program

CURVES: Final = {name: sensor(name) for name in ("inverse-power", "exponential-1", "exponential-2")}
PROGRAM: Final = Program(
    "Figure 3: the three curves of Table I over the distance, and their slopes g, which determine the motion.",
    {"power": CURVES["inverse-power"], "first": CURVES["exponential-1"], "second": CURVES["exponential-2"]},
    """\
sensors = {"inverse power L(3)": power, "first order L(5)": first, "second order L(6)": second}
distance = np.linspace(0.0, 0.0422, 200)
x, x_label = 1e3 * distance, "distance l [mm]"
outputs = [pt.report.Curve(x=x, y=sensor.output(distance), label=name) for name, sensor in sensors.items()]
slopes = [pt.report.Curve(x=x, y=sensor.log_slope(distance), label=name) for name, sensor in sensors.items()]
figure = pt.report.panel_figure(
    pt.report.Panel(x_label=x_label, y_label="sensor output ξ [V]", curves=outputs),
    pt.report.Panel(x_label=x_label, y_label="slope g = d ln ξ / dl [1/m]", curves=slopes),
)
""",
)


def reproduce(variables: Variables) -> Reproduction:
    """Tabulate the sensor curves in Fig. 3 of the letter."""
    second = {p.symbol: p.value for p in SENSORS["exponential-2"]}
    turn, shown = -second["c_2"] / (2 * second["b_2"]), np.array([0.0, 0.01, 0.02, 0.03, 0.0422])
    columns = {"l [mm]": (1e3 * shown, ".1f")} | {f"ξ, {n} [V]": (c.output(shown), ".4f") for n, c in CURVES.items()}
    columns |= {f"g, {n} [1/m]": (c.log_slope(shown), ".2f") for n, c in CURVES.items()}
    return Reproduction(
        summary="The published letter compares the outputs ξ of the three sensor curves. These outputs are similar. "
        "But the virtual force depends on the slope g = d ln ξ / dl, with the distance l. The slopes differ by a "
        f"quarter at contact, and by nearly a factor of two at 42.2 mm. Beyond {1e3 * turn:.0f} mm, the output of the "
        "second-order curve rises. There, the force has the wrong sign.",
        parameters=tuple(p for name in CURVES for p in SENSORS[name]),
        tables=(readings("Output ξ and slope g", columns),),
        caption="Left: the output, as in the letter. Right: the slope of its logarithm, not shown in the letter.",
        numbers={
            "distance": variables["distance"],
            "output": {name: curve.output(variables["distance"]) for name, curve in CURVES.items()},
            "log_slope": {name: curve.log_slope(variables["distance"]) for name, curve in CURVES.items()},
            "turning_distance_second_order": turn,
        },
    )
