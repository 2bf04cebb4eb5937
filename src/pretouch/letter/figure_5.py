"""Recompute Figure 5 of the published letter: relative velocity until contact."""

from __future__ import annotations

from functools import partial
from typing import Final

from pretouch.motion import find_contact
from pretouch.sensors import SensorModel

from .experiment import Finding, Reproduction, Variables, finding
from .figure_4 import INPUTS, MOTIONS, NAMES, PARAMETERS
from .inputs import EXPERIMENT_GAIN, approach, over_rounding
from .printed import Printed
from .program import Program

PROGRAM: Final = Program(
    "Figure 5: the relative velocity until contact, D_p = -1 N s, by three ways to solve the motion.",
    INPUTS,
    MOTIONS
    + """\
reduction = {name: 1 - m.relative_velocity[-1] / scenario.obstacle.velocity for name, m in motions.items()}
curves = [pt.report.Curve(x=m.time, y=m.relative_velocity, label=name, end="contact") for name, m in motions.items()]
labels = {"x_label": "time t [s]", "y_label": "relative velocity l′ [m/s]"}
figure = pt.report.panel_figure(pt.report.Panel(curves=curves, levels={"without mitigation": -0.3}, **labels))
""",
)
PLACE: Final = "Section IV-D, Fig. 5"
PRINTED: Final = {"inverse-power": "78.0", "exponential-1": "70.4", "exponential-2": "74.4"}
"""The numbers that the letter prints as ratios l'/v_o, of the experiment and of both models [%]."""

MODELS: Final = {"exponential-1": ("closed-form", "9.74"), "exponential-2": ("uniform-motion", "4.62")}
"""Solution method of each model, and the printed relative error of its ratio [%]."""


def reproduce(variables: Variables) -> Reproduction:
    """Compare computed with published relative velocities at contact."""
    motions = {name: variables["motions"][label] for name, label in NAMES.items()}
    reductions = {name: 100 * float(variables["reduction"][label]) for name, label in NAMES.items()}
    true, hardware = PRINTED["inverse-power"], "the letter's value was measured on hardware"
    first = "reduction 1 - l'/v_o, experiment; computed: inverse power"
    numbers = [Printed(first, true, reductions["inverse-power"], "%", PLACE, hardware, hardware=True)]
    for name, (method, _) in MODELS.items():
        span = over_rounding(name, partial(_reduction, method=method))
        label = f"reduction 1 - l'/v_o, {NAMES[name]}"
        numbers.append(Printed(label, PRINTED[name], reductions[name], "%", PLACE, over_inputs=span))
    for name, (_, error) in MODELS.items():
        ours = 100 * abs(float(PRINTED[name]) - float(true)) / float(true)
        numbers.append(Printed(f"relative error of {PRINTED[name]} % compared with 78.0 %", error, ours, "%", PLACE))
    return Reproduction(
        summary="Without mitigation the obstacle arrives at 0.3 m/s. The letter's \"ratio l'/v_o\" is the reduction of "
        "that speed by mitigation, not the remaining speed (finding 3). As reductions, the model values agree.",
        parameters=PARAMETERS,
        comparisons=tuple(numbers),
        findings=(_reduction_finding(reductions),),
        caption="Mitigation reduces the relative velocity most in the first 0.1 s. From then until contact, the "
        "relative velocity grows again for the first order, and hardly for the inverse power. It is constant in the "
        "uniform motion.",
        numbers={
            "relative_velocity_at_contact": {name: float(m.relative_velocity[-1]) for name, m in motions.items()},
            "reduction": {name: part / 100 for name, part in reductions.items()},
            "motion": {name: {"time": m.time, "relative_velocity": m.relative_velocity} for name, m in motions.items()},
        },
    )


def _reduction(curve: SensorModel, method: str) -> float:
    """Return the reduction of speed at contact [%], relative to the obstacle's initial speed."""
    contact = find_contact(approach(), curve, EXPERIMENT_GAIN.value, method=method).contact
    return float(100 - 100 * contact.relative_velocity / approach().obstacle.velocity)


def _reduction_finding(reductions: dict[str, float]) -> Finding:
    steps, printed = [], {name: float(text) for name, text in PRINTED.items()}
    for name, part in reductions.items():
        steps.append((f"l'/v_o at contact, {NAMES[name]}", 100 - part, "%"))
        steps.append((f"1 - l'/v_o; printed as the ratio {PRINTED[name]} %", part, "%"))
    for name in MODELS:
        error = 100 * ((100 - printed[name]) / (100 - printed["inverse-power"]) - 1)
        less, true = PRINTED[name], PRINTED["inverse-power"]
        steps.append(
            (f"error of the remaining speed, computed with the reduction {less} % instead of {true} %", error, "%")
        )
    near = all(abs(part - printed[name]) < 1.0 < abs(100 - part - printed[name]) for name, part in reductions.items())
    remain, less = (
        ", ".join(f"{v:.1f}" for v in values)
        for values in ([100 - t for t in reductions.values()], reductions.values())
    )
    return finding(
        3,
        "The ratio l'/v_o of Section IV-D is the reduction 1 - l'/v_o",
        "Section IV-D",
        f"According to the letter, {', '.join(PRINTED.values())} % of the obstacle's speed remain at contact (ratio "
        f"l'/v_o). In the models, {remain} % remain. The speed reductions of the models are {less} %. Therefore, the "
        "published numbers are reductions. The published errors of 9.74 and 4.62 % are errors of these reductions. "
        "But the impact depends on the remaining speeds. The errors of the remaining speeds are 35 and 16 %.",
        *steps,
        ("the printed numbers are within 1 % of the reductions, but not of the ratios", near),
    )
