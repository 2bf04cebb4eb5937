"""Table II: contact and objective for several gains, with its two misprints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.optimize import brentq

from pretouch._core.numbers import FloatArray
from pretouch.design import design_gain
from pretouch.motion import find_contact
from pretouch.sensors import SensorModel

from ..comparison import Comparison, compare, resolution
from ..given import APPROACH, BOUNDS, F_1, SENSORS, approach, f_1, over_rounding, sensor
from ..result import DataTable, Evidence, Finding, Reproduction
from ..running import run_script

__all__ = ["PRINTED", "reproduce"]

PRINTED: Final[dict[str, tuple[str, str, str]]] = {
    "-0.1": ("-0.011", "-0.199", "0.442"),
    "-0.6": ("-0.080", "-0.088", "0.111"),
    "-0.7": ("-0.082", "-0.082", "0.107"),
    "-0.8": ("-0.103", "-0.077", "0.107"),
    "-0.9": ("-0.114", "-0.072", "0.110"),
    "-1.0": ("-0.611", "-0.023", "1.49"),
}
"""Gain [N s], and x [m], l' [m/s] and f_1 at contact as printed."""

_MEANT: Final = -10.0
_ROWS: Final = (("x", "m"), ("l'", "m/s"), ("f_1", ""))


def reproduce() -> Reproduction:
    """Solve L(4) for every gain of the table, evaluate L(20) at contact L(21), and compare.

    Returns:
        The reproduction.
    """
    code, variables = run_script("table-2")
    gains = [*map(float, PRINTED), _MEANT]
    values = np.reshape(_contacts(sensor("inverse-power"), gains), (3, -1))
    low, high = over_rounding("inverse-power", lambda s: _contacts(s, gains))
    ranges = np.stack([low.reshape(3, -1), high.reshape(3, -1)], axis=-1)
    optima = _optima()
    terms = np.array([(values[0] / F_1[2].value) ** 2, (values[1] / F_1[3].value) ** 2])
    return Reproduction(
        id="table-2",
        title="Gains for an approaching obstacle",
        place="Table II, Section V-A",
        summary=(
            "The inverse power curve L(3) in L(4), integrated, as in the letter's simulation. Two places of the table "
            "cannot be right (findings 1 and 2); the rest agrees. Where ours misses the last digit by less than one "
            "unit, parameters that round to the printed ones give it."
        ),
        parameters=(*APPROACH, *SENSORS["inverse-power"], *F_1),
        comparisons=(*_comparisons(values, ranges), *_optimum_comparisons(optima)),
        findings=(_repeated(values, ranges), _misheaded(values, ranges)),
        tables=(_table(gains, values, terms),),
        caption=(
            "The objective and its two terms, which cross near the optimum; circles are the gains of the table, the "
            "last of them -10 N s, whose values the letter prints under -1.0."
        ),
        code=code,
        figure=variables["figure"],
        numbers={
            "gain": gains,
            "position": values[0],
            "relative_velocity": values[1],
            "objective": values[2],
            "position_term": terms[0],
            "velocity_term": terms[1],
            "optimal_gain": optima,
            "optimal_objective": float(variables["design"].objective),
            "curve": {"gain": variables["gains"], **{f"{name}_term": v for name, v in variables["terms"].items()}},
        },
    )


def _contacts(curve: SensorModel, gains: Sequence[float]) -> FloatArray:
    """Return x, l' and f_1 at contact for every gain, one after the other."""
    contact = find_contact(approach(), curve, gains).contact
    objective = f_1().value(contact, abs(approach().obstacle.velocity))
    return np.concatenate([contact.position, contact.relative_velocity, objective])


def _comparisons(values: FloatArray, ranges: FloatArray) -> list[Comparison]:
    repeated = "repeats l' of its column; with it f_1 would be 0.102, not the printed 0.107 (finding 1)"
    found = []
    for k, (column, printed) in enumerate(PRINTED.items()):
        misheaded = column == "-1.0"
        for i, (name, unit) in enumerate(_ROWS):
            found.append(
                compare(
                    f"{name} at D_p = {column} N s",
                    printed[i],
                    float(values[i, k]),
                    unit=unit,
                    place="Table II",
                    over_inputs=(float(ranges[i, k, 0]), float(ranges[i, k, 1])),
                    reason="the values of D_p = -10 N s, under another head (finding 2)" if misheaded else repeated,
                )
            )
    for i, (name, unit) in enumerate(_ROWS):
        found.append(
            compare(
                f"{name}, last column as -10 N s",
                PRINTED["-1.0"][i],
                float(values[i, -1]),
                unit=unit,
                place="Table II",
                over_inputs=(float(ranges[i, -1, 0]), float(ranges[i, -1, 1])),
                reason="1.4975 cut off after two decimals, not rounded",
            )
        )
    return found


def _optima() -> dict[str, float]:
    ways = {
        "inverse-power, integration": ("inverse-power", "integration"),
        "exponential-1, closed form": ("exponential-1", "closed-form"),
        "exponential-2, uniform motion": ("exponential-2", "uniform-motion"),
        "exponential-2, integration": ("exponential-2", "integration"),
    }
    designs = {
        label: design_gain(approach(), sensor(name), f_1(), bounds=BOUNDS, method=way)
        for label, (name, way) in ways.items()
    }
    return {label: float("nan") if d.gain is None else d.gain for label, d in designs.items()}


def _optimum_comparisons(optima: dict[str, float]) -> list[Comparison]:
    pairs = (("exponential-1, closed form", "-0.8"), ("exponential-2, uniform motion", "-0.7"))
    return [
        compare(f"optimal gain, {label}", printed, optima[label], unit="N s", place="Section V-A")
        for label, printed in pairs
    ]


def _rounded(printed: str) -> tuple[float, float]:
    """Return the numbers, without their sign, that round to a printed one."""
    value, half = abs(float(printed)), resolution(printed) / 2
    return value - half, value + half


def _repeated(values: FloatArray, ranges: FloatArray) -> Finding:
    x, v, f = PRINTED["-0.7"]
    k = list(PRINTED).index("-0.7")
    (_, x_high), (v_low, v_high), (f_low, f_high) = (_rounded(number) for number in (x, v, f))
    x_typ, v_typ = abs(F_1[2].value), abs(F_1[3].value)
    largest = (x_high / x_typ) ** 2 + (v_high / v_typ) ** 2
    implied = tuple(x_typ * np.sqrt(a - (b / v_typ) ** 2) for a, b in ((f_low, v_high), (f_high, v_low)))
    ours = -float(values[0, k])
    return Finding(
        id=1,
        title="Table II prints l' in place of x at D_p = -0.7",
        place="Table II, column -0.7",
        statement=(
            f"x is printed as {x} m, the same as l' below it. The equations give {-ours:.4f} m, and only such a value "
            f"goes with the f₁ = {f} that the column ends in."
        ),
        evidence=(
            Evidence(name="x by L(4)", value=float(values[0, k]), unit="m"),
            Evidence(name="printed x is the printed l'", value=x == v),
            Evidence(name="largest f₁ that the printed x and l' allow; printed 0.107", value=largest),
            Evidence(name="smallest |x| that the printed l' and f₁ allow", value=float(implied[0]), unit="m"),
            Evidence(name="largest |x| that they allow", value=float(implied[1]), unit="m"),
        ),
        holds=bool(
            x == v
            and largest < f_low
            and implied[0] <= ours <= implied[1]
            and not ranges[0, k, 0] <= float(x) <= ranges[0, k, 1]
        ),
    )


def _misheaded(values: FloatArray, ranges: FloatArray) -> Finding:
    x, v, f = PRINTED["-1.0"]
    curve = sensor("inverse-power")
    ends = [
        float(brentq(lambda g, p=p: find_contact(approach(), curve, g).contact.position + p, -20.0, -0.01))
        for p in _rounded(x)
    ]
    at = list(PRINTED).index("-1.0")
    near = all(
        r[0] - resolution(p) <= float(p) <= r[1] + resolution(p) for r, p in zip(ranges[:, -1], (x, v, f), strict=True)
    )
    return Finding(
        id=2,
        title="The last column of Table II is that of D_p = -10, not -1.0",
        place="Table II, column -1.0",
        statement=(
            "x = -0.611 m is reached at one gain only, and that is -10 N s; the other two values of the column are "
            f"those of -10 N s as well. Table III ends in -10, too. At -1.0 N s the equations give {values[0, at]:.4f} "
            f"m, {values[1, at]:.4f} m/s and {values[2, at]:.4f}."
        ),
        evidence=(
            Evidence(name="gain at which x rounds to -0.611 m, from", value=ends[1], unit="N s"),
            Evidence(name="to", value=ends[0], unit="N s"),
            Evidence(name="l' at -10 N s; printed -0.023", value=float(values[1, -1]), unit="m/s"),
            Evidence(name="f₁ at -10 N s; printed 1.49", value=float(values[2, -1])),
            Evidence(name="x at -1.0 N s", value=float(values[0, at]), unit="m"),
            Evidence(name="l' at -1.0 N s", value=float(values[1, at]), unit="m/s"),
            Evidence(name="f₁ at -1.0 N s", value=float(values[2, at])),
        ),
        holds=bool(ends[1] <= _MEANT <= ends[0] and near),
    )


def _table(gains: Sequence[float], values: FloatArray, terms: FloatArray) -> DataTable:
    rows = [
        (f"{g:g}", f"{x:.4f}", f"{v:.4f}", f"{p:.4f}", f"{q:.4f}", f"{f:.4f}")
        for g, x, v, p, q, f in zip(gains, values[0], values[1], terms[0], terms[1], values[2], strict=True)
    ]
    return DataTable(
        title="Both terms of the objective",
        head=("D_p [N s]", "x [m]", "l' [m/s]", "(x / x_typ)²", "(l' / l'_typ)²", "f₁"),
        rows=tuple(rows),
    )
