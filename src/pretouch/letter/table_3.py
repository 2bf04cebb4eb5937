"""Compare computed motions with the hardware measurements in Table III of the published letter."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray

from .experiment import Finding, Reproduction, Variables, finding, readings
from .inputs import DISRUPTION, F_2, SENSORS, best_gain, disruption, f_2, sensor
from .printed import Printed
from .program import Program

PROGRAM: Final = Program(
    "Table III: contact times and impact forces measured on hardware, and the model's contact times and speeds.",
    {"admittance": disruption().admittance, "scenario": disruption(), "sensor": sensor("fingertip")},
    """\
gains = np.array([-0.1, -0.5, -0.6, -0.7, -1.0, -10.0])
time, force = np.array([0.94, 2.24, 2.61, 2.76, 3.52, 38.9]), np.array([3.65, 1.82, 1.00, 0.89, 0.80])
contact = pt.find_contact(scenario, sensor, gains).contact
speed = -contact.relative_velocity[:5]
slope = speed @ force / (speed @ speed)
error = np.sqrt(np.sum((force - slope * speed) ** 2) / 4 / (speed @ speed))
interval = slope + np.array([-1, 1]) * t.ppf(0.975, df=4) * error
x = np.linspace(0.0, 0.065, 60)
line = pt.report.Curve(x=x, y=slope * x, low=interval[0] * x, high=interval[1] * x, label=f"{slope:.1f} N s/m × speed")
points = pt.report.Curve(x=speed, y=force, label="measured", kind="points")
series = {"model": contact.time, "measured": time}
times = [pt.report.Curve(x=-gains, y=y, label=n, kind="both") for n, y in series.items()]
force_panel = pt.report.Panel(x_label="model speed at contact [m/s]", y_label="impact force [N]", curves=[line, points])
labels = {"x_label": "gain −D_p [N s]", "y_label": "time of contact [s]"}
figure = pt.report.panel_figure(force_panel, pt.report.Panel(curves=times, x_log=True, y_log=True, **labels))
""",
    imports=("from scipy.stats import t",),
)
PRINTED: Final[dict[str, tuple[str, str]]] = {
    "-0.1": ("0.94", "3.65"),
    "-0.5": ("2.24", "1.82"),
    "-0.6": ("2.61", "1.00"),
    "-0.7": ("2.76", "0.89"),
    "-1.0": ("3.52", "0.80"),
    "-10": ("38.9", ""),
}
"""Printed gain [N s], time of contact [s] and impact force [N]; the force is empty if the letter found no peak."""

STEPS: Final = (("-0.5", "-0.6", "45", "17", "2.65"), ("-0.6", "-0.7", "11", "6", "1.83"))
"""From one gain to the next: printed force reduction [%], time increase [%] and trade-off factor (Section V-C)."""


def reproduce(variables: Variables) -> Reproduction:
    """Compare computed with measured contact times and forces."""
    time, speed = np.asarray(variables["contact"].time), -np.asarray(variables["contact"].relative_velocity)
    optimum = best_gain(sensor("fingertip"), disruption(), f_2())
    printed = np.array([float(text) for text, _ in PRINTED.values()])
    columns: dict[str, Any] = {"D_p [N s]": (PRINTED, ""), "model t [s]": (time, ".3f")}
    columns |= {"measured t_c [s]": (printed, "g"), "delay [%]": (100 * (printed / time - 1), ".0f")}
    columns["model |l'| [mm/s]"] = (1e3 * speed, ".2f")
    columns["measured F_im [N]"] = ([force or "no peak" for _, force in PRINTED.values()], "")
    return Reproduction(
        summary="The force sensor detects contact 14 to 44 % later than the model. Only the hardware has friction, "
        "servo lag and a threshold. The ranking of the gains is the same, and the measured force is proportional to "
        "the model's speed at contact.",
        parameters=(*DISRUPTION, *SENSORS["fingertip"], *F_2),
        comparisons=(
            *_measured(time, speed, float(variables["slope"])),
            Printed("optimal gain of f_2", "-0.6", optimum, "N s", "Section V-C"),
            *_steps(),
        ),
        findings=(_hardware(time, speed, printed, variables), _trade_off()),
        tables=(readings("Model and measurement", columns),),
        caption="Left: measured force over the model's speed, with the line through the origin and the 95 % confidence "
        "interval of its slope. Right: times of contact; the ranking of the gains is the same.",
        numbers={
            "gain": [float(g) for g in PRINTED],
            "time_of_contact": time,
            "relative_velocity_at_contact": -speed,
            "measured_time": printed,
            "measured_force": [float(f) for _, f in PRINTED.values() if f],
            "force_per_speed": float(variables["slope"]),
            "force_per_speed_95": variables["interval"],
            "optimal_gain": optimum,
            "trade_off_factors": [less / later for less, later in (_changes(a, b) for a, b, *_ in STEPS)],
        },
    )


def _measured(time: FloatArray, speed: FloatArray, slope: float) -> list[Printed]:
    late = "friction, servo lag and the threshold of the force sensor delay the measured contact"
    fitted = (
        f"the computed force is the contact speed of the model times {slope:.1f} N s/m; this factor was fitted to the "
        "published forces"
    )
    numbers = []
    for (gain, (printed, force)), t, v in zip(PRINTED.items(), time.tolist(), speed.tolist(), strict=True):
        numbers.append(Printed(f"t_c at D_p = {gain} N s", printed, t, "s", "Table III", late, hardware=True))
        if force:
            name = f"F_im at D_p = {gain} N s"
            numbers.append(Printed(name, force, slope * v, "N", "Table III", fitted, hardware=True))
    return numbers


def _changes(first: str, second: str) -> tuple[float, float]:
    """Return the relative decrease of the force and the relative increase of the time between two gains."""
    (t1, f1), (t2, f2) = (tuple(map(float, PRINTED[g])) for g in (first, second))
    return 1 - f2 / f1, t2 / t1 - 1


def _steps() -> list[Printed]:
    numbers = []
    for a, b, less, later, factor in STEPS:
        (force, time), step, place = _changes(a, b), f"from {a} to {b} N s", "Section V-C"
        why = f"the letter computes this factor from rounded percentages: {less} % divided by {later} % (see finding 8)"
        numbers.append(Printed(f"force reduction {step}", less, 100 * force, "%", place))
        numbers.append(Printed(f"time increase {step}", later, 100 * time, "%", place))
        numbers.append(Printed(f"trade-off factor {step}", factor, force / time, "", place, why))
    return numbers


def _trade_off() -> Finding:
    steps = []
    for a, b, less, later, printed in STEPS:
        force, time = _changes(a, b)
        rounded, exact = float(less) / float(later), force / time
        only = abs(rounded - float(printed)) < 0.005 < abs(exact - float(printed))
        steps.append(
            (
                f"force reduction divided by time increase, if the gain changes from {a} to {b} N s (computed from the "
                "published times and forces)",
                exact,
            )
        )
        steps.append(
            (
                f"rounded force reduction of {less} % divided by rounded time increase of {later} % (the letter prints "
                f"the quotient {printed})",
                rounded,
            )
        )
        steps.append(("only the factor from rounded percentages rounds to the printed factor", only))
    return finding(
        8,
        "The trade-off factors 2.65 and 1.83 come from percentages that were rounded first",
        "Section V-C",
        "45/17 and 11/6 give the printed factors. Computed from the times and forces of Table III, the factors "
        "are 2.73 and 1.91. The order of the factors, and so the letter's conclusion, is unchanged. Times and forces "
        "have only two or three digits.",
        *steps,
    )


def _hardware(time: FloatArray, speed: FloatArray, printed: FloatArray, variables: Variables) -> Finding:
    force = np.array([float(f) for _, f in PRINTED.values() if f])
    slope, (low, high) = float(variables["slope"]), variables["interval"].tolist()
    residual = force - slope * speed[: len(force)]
    r_squared = float(1 - residual @ residual / np.sum((force - force.mean()) ** 2))
    late = 100 * (printed / time - 1)
    return finding(
        6,
        "In Table III, contact is later than in the model, gains rank equally, and force is proportional to speed",
        "Table III",
        f"The values in Table III were measured, so they can differ from the model. The measured contacts are "
        f"{late.min():.0f} to {late.max():.0f} % later than the contacts of the model. But measurement and model rank "
        "the gains in the same order. The measured force is proportional to the contact speed of the model. The factor "
        f"is {slope:.1f} N s/m. The confidence interval of this factor is wide, because only five points were "
        "measured.",
        ("smallest delay relative to the model", late.min(), "%"),
        ("largest delay relative to the model", late.max(), "%"),
        ("contact is never earlier", bool(late.min() > 0)),
        ("measured and modeled times rank the gains equally", bool((np.diff([printed, time]) > 0).all())),
        ("force over speed, through the origin", slope, "N s/m"),
        ("lower end of the 95 % confidence interval of this factor", low, "N s/m"),
        ("upper end of the 95 % confidence interval of this factor", high, "N s/m"),
        ("R² about the mean force", r_squared),
        ("the interval is above 0, and R² above 0.9", r_squared > 0.9 and low > 0),
    )
