"""Recompute the optimal gains in Fig. 6 of the letter.

The optimal gain depends on the speed of the obstacle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray

from .experiment import Finding, Reproduction, Variables, finding, readings
from .inputs import ADMITTANCE, F_1, SENSORS, approach, sensor
from .program import Program

PROGRAM: Final = Program(
    "Figure 6: the optimal gain over the obstacle's speed, for both readings of the typical velocity l'_typ.",
    {
        **{"admittance": approach().admittance, "power": sensor("inverse-power")},
        **{"first": sensor("exponential-1"), "second": sensor("exponential-2")},
    },
    """\
models = {"inverse power": (power, "integration"), "first order": (first, "closed-form")}
models["second order"] = (second, "uniform-motion")
speeds = np.arange(1, 101) / 100
encounters = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-speeds))
gains = {}
for scale in ("obstacle speed", 0.3):
    f_1 = pt.excursion_objective(position_scale=0.5, velocity_scale=scale)
    for name, (sensor, way) in models.items():
        designs = pt.design(pt.Task(encounters, sensor, f_1, bounds=(-20.0, -0.01), method=way))
        gains[scale, name] = designs.gain
labels = {"x_label": "obstacle speed [m/s]", "y_label": "optimal gain −D_p [N s]", "y_log": True}
titles = {"obstacle speed": "l′_typ follows the obstacle", 0.3: "l′_typ fixed at 0.3 m/s"}
curves = {scale: [pt.report.Curve(x=speeds, y=-gains[scale, name], label=name) for name in models] for scale in titles}
panels = [pt.report.Panel(curves=curves[scale], title=title, **labels) for scale, title in titles.items()]
figure = pt.report.panel_figure(*panels)
""",
)
MODELS: Final = ("inverse power", "first order", "second order")
SCALES: Final[Mapping[str, Any]] = {"following": "obstacle speed", "fixed": 0.3}
SHOWN: Final = [0, 4, 9, 19, 29, 49, 99]  # 0.01, 0.05, 0.1, 0.2, 0.3, 0.5 and 1 m/s


def reproduce(variables: Variables) -> Reproduction:
    """Design the gain for 100 speeds, three sensor curves and both readings of the letter's l'_typ."""
    speeds = variables["speeds"]
    gains = {s: {name: np.asarray(variables["gains"][value, name]) for name in MODELS} for s, value in SCALES.items()}
    titles = {"following": "l'_typ follows the obstacle", "fixed": "l'_typ fixed at 0.3 m/s"}
    return Reproduction(
        summary="100 velocities from -0.01 to -1.00 m/s. The letter's trend, a larger |D_p| for slow obstacles and "
        "hardly a change above 0.2 m/s, is reproduced if l'_typ is the obstacle's speed. With l'_typ = -0.3 m/s from "
        "Section V-A, the trend reverses (finding 5). The figure has no printed numbers. With the first order and a "
        "fixed l'_typ, mitigation is not worthwhile below 0.03 m/s: the optimum is the end of the range.",
        parameters=(*ADMITTANCE, *(p for name in [*SENSORS][:3] for p in SENSORS[name]), *F_1),
        findings=(_trend(speeds, gains),),
        tables=tuple(
            readings(
                f"Optimal gain D_p [N s], {titles[scale]}",
                {"obstacle speed [m/s]": (speeds[SHOWN], ".2f")} | {n: (g[SHOWN], ".4f") for n, g in by_curve.items()},
            )
            for scale, by_curve in gains.items()
        ),
        caption="Left: l'_typ follows the obstacle, with the letter's trend. Right: l'_typ is fixed, with the opposite "
        "trend; the first order jumps to the end of the range if mitigation is not worthwhile. The inverse power is "
        "integrated, the first order solved in closed form, the second order by its uniform motion.",
        numbers={"speed": speeds, "optimal_gain": gains},
    )


def _at(speeds: FloatArray, values: FloatArray, speed: float) -> float:
    return float(values[int(np.argmin(np.abs(speeds - speed)))])


def _trend(speeds: FloatArray, gains: Mapping[str, Mapping[str, FloatArray]]) -> Finding:
    steps, fast, shown = [], speeds >= 0.2, speeds >= 0.05
    for name in MODELS:
        following, fixed = -gains["following"][name], -gains["fixed"][name]
        slow = _at(speeds, following, 0.05) / _at(speeds, following, 0.3)
        spread = following[fast].max() / following[fast].min()
        rise, always = fixed[-1] / _at(speeds, fixed, 0.05), bool((np.diff(fixed[shown]) > 0).all())
        steps.append(
            (
                f"{name} curve, typical velocity equal to the obstacle speed: gain |D_p| at the obstacle speed "
                "0.05 m/s divided by the gain at 0.3 m/s",
                slow,
            )
        )
        steps.append(
            (
                f"{name} curve, typical velocity equal to the obstacle speed: largest gain |D_p| divided by the "
                "smallest one, for obstacle speeds from 0.2 to 1 m/s",
                spread,
            )
        )
        steps.append(("the first of these two ratios is above 2, the second is below 2", bool(slow > 2 and spread < 2)))
        steps.append(
            (
                f"{name} curve, fixed typical velocity: gain |D_p| at the obstacle speed 1 m/s divided by the gain at "
                "0.05 m/s",
                rise,
            )
        )
        steps.append(
            (
                f"{name} curve, fixed typical velocity: from 0.05 m/s on, the gain |D_p| grows with the obstacle speed",
                always,
            )
        )
    power = {scale: by_curve["inverse power"] for scale, by_curve in gains.items()}
    pairs = {s: ", ".join(f"{_at(speeds, g, v):.3g} at {v:g} m/s" for v in (0.05, 0.3, 1.0)) for s, g in power.items()}
    return finding(
        5,
        "Fig. 6 holds only if l'_typ follows the obstacle's speed",
        "Fig. 6, Section V-A",
        "According to the letter, the optimal gain |D_p| is larger for slow obstacles. Above 0.2 m/s, it hardly "
        "changes. This is true if the typical velocity l'_typ in the objective is the obstacle's speed. With the "
        f"inverse power curve, the gain D_p in N s is then {pairs['following']}. In Section V-A, l'_typ is fixed at "
        f"-0.3 m/s. Then the gain |D_p| grows with the obstacle's speed: the gain D_p in N s is {pairs['fixed']}. So "
        "the choice of l'_typ decides the trend.",
        *steps,
    )
