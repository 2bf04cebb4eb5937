"""Compute the loss from one gain for all obstacle speeds.

The published letter recommends such a gain. The loss is the increase of the objective.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from .experiment import Finding, Reproduction, Variables, finding, readings
from .inputs import ADMITTANCE, F_1, SENSORS, approach, sensor
from .program import Program

PROGRAM: Final = Program(
    "One gain for all speeds: its loss compared with the best gain for each speed.",
    {"admittance": approach().admittance, "sensor": sensor("inverse-power")},
    """\
f_1 = pt.excursion_objective(position_scale=0.5, velocity_scale="obstacle speed")
speeds, candidates = np.arange(1, 101) / 100, -np.geomspace(0.5, 5.0, 500)
encounters = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422, velocity=-speeds))
designs = pt.design(pt.Task(encounters, sensor, f_1, bounds=(-20.0, -0.01)))
contact = pt.find_contact(encounters, sensor, candidates[:, None]).contact
losses = f_1.value(contact, speeds) / designs.objective - 1
ranges = {"one gain for all speeds": speeds > 0, "one gain from 0.2 m/s on": speeds >= 0.2}
best = {name: losses[:, part].max(axis=1).argmin() for name, part in ranges.items()}
final_speeds = {name: -contact.relative_velocity[i] for name, i in best.items()}
final_speeds["best gain for each speed"] = -pt.find_contact(encounters, sensor, designs.gain).contact.relative_velocity
curves = [pt.report.Curve(x=speeds, y=100 * losses[i], label=name) for name, i in best.items()]
contacts = [pt.report.Curve(x=speeds, y=y, label=name) for name, y in final_speeds.items()]
panels = {"loss in f₁ [%]": curves, "speed at contact [m/s]": contacts}
x_label = "obstacle speed [m/s]"
figure = pt.report.panel_figure(*[pt.report.Panel(x_label=x_label, y_label=y, curves=c) for y, c in panels.items()])
""",
)
ALL, FAST, BEST = "one gain for all speeds", "one gain from 0.2 m/s on", "best gain for each speed"


def reproduce(variables: Variables) -> Reproduction:
    """Find the single gain with the smallest worst-case loss."""
    speeds, best, final_speed = variables["speeds"], np.asarray(variables["designs"].gain), variables["final_speeds"]
    gain = {name: float(variables["candidates"][i]) for name, i in variables["best"].items()}
    loss = {name: np.asarray(variables["losses"][i]) for name, i in variables["best"].items()}
    shown = [0, 1, 4, 9, 19, 29, 49, 99]
    columns = {"obstacle speed [m/s]": (speeds[shown], ".2f"), "best D_p [N s]": (best[shown], ".3f")}
    columns |= {f"loss, {name} [%]": (100 * loss[name][shown], ".1f") for name in (FAST, ALL)}
    columns |= {f"contact, {name} [mm/s]": (1e3 * final_speed[name][shown], ".1f") for name in (BEST, FAST, ALL)}
    note = "Each of the two gains minimizes the largest loss over its range of speeds."
    return Reproduction(
        summary="The published letter recommends one gain for all speeds. This gain is designed for a fast obstacle. "
        "The loss is the relative increase of the objective f₁ over its optimum at each speed. The velocity scale "
        f"l'_typ of f₁ is the obstacle's speed. At obstacle speeds from 0.2 to 1 m/s, the gain "
        f"{gain[FAST]:.3f} N s has the smallest worst-case loss. At obstacle speeds from 0.01 to 1 m/s, the gain "
        f"{gain[ALL]:.3f} N s has the smallest worst-case loss. But this loss is {100 * loss[ALL].max():.0f} %.",
        parameters=(*ADMITTANCE, *SENSORS["inverse-power"], *F_1[:3]),
        findings=(_price(gain[FAST], loss[FAST], final_speed[FAST], speeds < 0.2),),
        tables=(readings("The loss at each speed", columns, note),),
        caption="Left: the loss compared with the best gain for each speed. Right: the speed at contact. The relative "
        "loss is large only for slow contacts.",
        numbers={"speed": speeds, "gain": gain, "best_gain": best, "loss": loss, "speed_at_contact": final_speed},
    )


def _price(gain: float, loss: Any, final_speed: Any, slow: Any) -> Finding:
    price, worst = loss[~slow].max(), loss[slow].max()
    hardest, least = final_speed[slow].max(), final_speed[~slow].min()
    return finding(
        12,
        "One gain suits all speeds from 0.2 m/s on, and slow contacts stay slow",
        "Section VI-C",
        f"The gain D_p = {gain:.3f} N s is for obstacle speeds from 0.2 to 1 m/s. In this range, the objective f₁ is "
        f"at most {100 * price:.1f} % above its optimum. At this cost, the letter's advice to use one gain for all "
        f"speeds is right. At obstacle speeds below 0.2 m/s, the objective is up to {100 * worst:.0f} % above its "
        f"optimum. But the contact speed is never above {1e3 * hardest:.0f} mm/s at these low speeds.",
        ("the gain", gain, "N s"),
        ("largest loss from 0.2 to 1 m/s", 100 * price, "%"),
        ("this loss is below 10 %", bool(price < 0.1)),
        ("largest loss below 0.2 m/s", 100 * worst, "%"),
        ("fastest contact below 0.2 m/s", hardest, "m/s"),
        ("slowest contact from 0.2 m/s on", least, "m/s"),
        ("every contact below 0.2 m/s is slower than every contact from 0.2 m/s on", bool(hardest < least)),
    )
