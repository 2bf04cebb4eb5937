"""Recompute Table II of the published letter.

The table has position, velocity and objective at contact for several gains.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch.motion import find_contact
from pretouch.sensors import SensorModel

from .experiment import Finding, Reproduction, Variables, finding, readings
from .inputs import APPROACH, F_1, ONE_APPROACH, SENSORS, approach, best_gain, f_1, over_rounding, sensor
from .printed import Printed, resolution
from .program import Program

PROGRAM: Final = Program(
    "Table II: the objective f_1 of L(20) over the whole range of gains, with the gains of the table marked.",
    ONE_APPROACH,
    """\
objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
design = pt.design(pt.Task(scenario, sensor, objective, bounds=(-10.0, -0.01)))
gains, tabulated = -np.geomspace(0.01, 10.0, 400), np.array([-0.1, -0.6, -0.7, -0.8, -0.9, -1.0, -10.0])
terms = objective.parts(pt.find_contact(scenario, sensor, gains).contact, 0.3)
values = objective.value(pt.find_contact(scenario, sensor, tabulated).contact, 0.3)
names = {"position term (x / 0.5 m)²": "displacement", "velocity term (l′ / 0.3 m/s)²": "relative_velocity"}
curves = [pt.report.Curve(x=-gains, y=sum(terms.values()))]
curves += [pt.report.Curve(x=-gains, y=terms[quantity], label=name) for name, quantity in names.items()]
curves += [pt.report.Curve(x=-tabulated, y=values, label="f₁, gains of Table II", kind="points", style=0)]
best = pt.report.Mark(x=-design.gain, y=design.objective, label=f"optimum {design.gain:.4f} N s", shape="ring")
labels = {"x_label": "virtual force gain −D_p [N s]", "y_label": "objective f₁ and its terms [1]"}
panel = pt.report.Panel(curves=curves, marks=[best], x_log=True, y_log=True, y_limits=(1e-3, 3.0), **labels)
figure = pt.report.panel_figure(panel)
""",
)
PRINTED: Final[dict[str, tuple[str, str, str]]] = {
    "-0.1": ("-0.011", "-0.199", "0.442"),
    "-0.6": ("-0.080", "-0.088", "0.111"),
    "-0.7": ("-0.082", "-0.082", "0.107"),
    "-0.8": ("-0.103", "-0.077", "0.107"),
    "-0.9": ("-0.114", "-0.072", "0.110"),
    "-1.0": ("-0.611", "-0.023", "1.49"),
}
"""Printed gain [N s], and x [m], l' [m/s] and f_1 at contact."""

WAYS: Final = {
    "inverse-power, integration": None,
    "exponential-1, closed form": "-0.8",
    "exponential-2, uniform motion": "-0.7",
    "exponential-2, integration": None,
}
"""Printed optimal gain [N s] of each curve and method; None if the letter prints none."""


def reproduce(variables: Variables) -> Reproduction:
    """Compare computed values at contact with the letter's Table II."""
    gains = [*map(float, PRINTED), -10.0]
    values = _contacts(sensor("inverse-power"), gains)
    ranges = over_rounding("inverse-power", lambda curve: _contacts(curve, gains))
    optima = {way: best_gain(sensor(way.split(", ")[0]), method=way.split(", ")[1].replace(" ", "-")) for way in WAYS}
    terms = np.array([(values[0] / F_1[2].value) ** 2, (values[1] / F_1[3].value) ** 2])
    optimal_gains = ((f"optimal gain, {way}", p, optima[way]) for way, p in WAYS.items() if p is not None)
    columns = {"D_p [N s]": (gains, "g"), "x [m]": (values[0], ".4f"), "l' [m/s]": (values[1], ".4f")}
    columns |= {"(x / x_typ)²": (terms[0], ".4f"), "(l' / l'_typ)²": (terms[1], ".4f"), "f₁": (values[2], ".4f")}
    return Reproduction(
        summary="The motion L(4) with the inverse power curve L(3) is integrated, as in the letter's simulation. Two "
        "entries of the table cannot be right (findings 1 and 2); the others agree. If a computed number differs by "
        "less than one unit in the last digit, parameters that round to the printed ones reproduce the printed number.",
        parameters=(*APPROACH, *SENSORS["inverse-power"], *F_1),
        comparisons=(*_columns(values, ranges), *(Printed(*way, "N s", "Section V-A") for way in optimal_gains)),
        findings=(_repetition_finding(values[:, 2], ranges[:, 2]), _column_finding(values, ranges[:, -1])),
        tables=(readings("Both terms of the objective", columns),),
        caption="The objective and its two terms, which cross near the optimum. Circles are the gains of the table; "
        "the letter prints the values of the gain -10 N s in the column -1.0.",
        numbers={
            "gain": gains,
            **dict(zip(("position", "relative_velocity", "objective"), values, strict=True)),
            **dict(zip(("position_term", "velocity_term"), terms, strict=True)),
            "optimal_gain": optima,
            "optimal_objective": float(variables["design"].objective),
            "curve": {"gain": variables["gains"], **{f"{name}_term": v for name, v in variables["terms"].items()}},
        },
    )


def _contacts(curve: SensorModel, gains: Sequence[float]) -> FloatArray:
    """Return robot position, relative velocity and objective f_1 at contact for every gain, shape (3, n)."""
    contact, speed = find_contact(approach(), curve, gains).contact, abs(approach().obstacle.velocity)
    return np.stack([contact.position, contact.relative_velocity, f_1().value(contact, speed)])


def _columns(values: FloatArray, ranges: FloatArray) -> list[Printed]:
    repeated = "the column prints l' again; with this x, f_1 would be 0.102, not the printed 0.107 (finding 1)"
    reasons = {"-1.0": "these are the values of D_p = -10 N s, printed under another column head (finding 2)"}
    heads = {f" at D_p = {head} N s": (column, reasons.get(head, repeated)) for head, column in PRINTED.items()}
    heads[", last column as -10 N s"] = PRINTED["-1.0"], "1.4975 was truncated after two decimals, not rounded"
    numbers = []
    for k, (head, (printed, why)) in enumerate(heads.items()):
        for i, (name, unit) in enumerate((("x", "m"), ("l'", "m/s"), ("f_1", ""))):
            ours, span = float(values[i, k]), tuple(ranges[i, k].tolist())
            numbers.append(Printed(name + head, printed[i], ours, unit, "Table II", why, over_inputs=span))
    return numbers


def _rounded(printed: str) -> tuple[float, float]:
    """Return the smallest and the largest magnitude that round to a published number."""
    return abs(float(printed)) - resolution(printed) / 2, abs(float(printed)) + resolution(printed) / 2


def _repetition_finding(values: FloatArray, ranges: FloatArray) -> Finding:
    x, v, f = PRINTED["-0.7"]
    (_, x_high), (v_low, v_high), (f_low, f_high) = (_rounded(number) for number in (x, v, f))
    x_typ, v_typ = abs(F_1[2].value), abs(F_1[3].value)
    largest = (x_high / x_typ) ** 2 + (v_high / v_typ) ** 2
    low, high = (float(x_typ * np.sqrt(a - (b / v_typ) ** 2)) for a, b in ((f_low, v_high), (f_high, v_low)))
    reached = bool(ranges[0, 0] <= float(x) <= ranges[0, 1])
    return finding(
        1,
        "Table II prints l' instead of x at D_p = -0.7",
        "Table II, column -0.7",
        f"Table II prints the robot position x = {x} m. The same number is printed in the row below, as the relative "
        f"velocity l'. According to the equations, the position is x = {values[0]:.4f} m. The table also prints the "
        f"objective f₁ = {f} in this column. Only a position near the computed one is consistent with this objective.",
        ("x by L(4)", values[0], "m"),
        ("printed x is the printed l'", x == v),
        ("no sensor parameters that round to the printed ones give the printed x", not reached),
        ("largest f₁ that the printed x and l' allow; printed 0.107", largest),
        ("this f₁ is below all numbers that round to the printed f₁", largest < f_low),
        ("smallest |x| that the printed l' and f₁ allow", low, "m"),
        ("largest |x| that the printed l' and f₁ allow", high, "m"),
        ("|x| by L(4) is between these two limits", low <= -values[0] <= high),
    )


def _column_finding(values: FloatArray, ranges: FloatArray) -> Finding:
    from scipy.optimize import brentq  # noqa: PLC0415 - slow to import

    curve, printed, at = sensor("inverse-power"), PRINTED["-1.0"], values[:, -2]

    def gain(x: float) -> float:
        return float(brentq(lambda g: find_contact(approach(), curve, g).contact.position + x, -20.0, -0.01))

    high, low = map(gain, _rounded(printed[0]))
    near = (r[0] - resolution(p) <= float(p) <= r[1] + resolution(p) for r, p in zip(ranges, printed, strict=True))
    return finding(
        2,
        "The last column of Table II belongs to D_p = -10, not -1.0",
        "Table II, column -1.0",
        "The published position x = -0.611 m results from the gain -10 N s, not from the printed gain -1.0 N s. The "
        "other two values of the column also belong to -10 N s. The last gain of Table III is -10 N s, too. For the "
        f"printed gain -1.0 N s, the equations give other values: a position of {at[0]:.4f} m, a relative velocity of "
        f"{at[1]:.4f} m/s and an objective of {at[2]:.4f}.",
        ("lowest gain at which x rounds to -0.611 m", low, "N s"),
        ("highest gain at which x rounds to -0.611 m", high, "N s"),
        ("-10 N s lies between the two gains", low <= -10.0 <= high),
        ("l' at -10 N s; printed -0.023", values[1, -1], "m/s"),
        ("f₁ at -10 N s; printed 1.49", values[2, -1]),
        ("x, l' and f₁ at -10 N s are within one unit of the last printed place", all(near)),
        ("x at -1.0 N s", at[0], "m"),
        ("l' at -1.0 N s", at[1], "m/s"),
        ("f₁ at -1.0 N s", at[2]),
    )
