"""Figure 6: the optimal gain over the obstacle's speed, and what its trend hangs on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray

from ..given import ADMITTANCE, F_1, SENSORS
from ..result import DataTable, Evidence, Finding, Reproduction
from ..running import run_script

__all__ = ["reproduce"]

_MODELS: Final = ("inverse power", "first order", "second order")
_SCALES: Final[Mapping[str, Any]] = {"following": "obstacle speed", "fixed": 0.3}
_SHOWN: Final = (0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


def reproduce() -> Reproduction:
    """Design the gain by L(20), L(21) for 100 speeds, three curves and both readings of l'_typ.

    Returns:
        The reproduction.
    """
    code, variables = run_script("figure-6")
    speeds: FloatArray = variables["speeds"]
    gains = {
        scale: {name: np.asarray(variables["gains"][value, name]) for name in _MODELS}
        for scale, value in _SCALES.items()
    }
    return Reproduction(
        id="figure-6",
        title="Optimal gain over the obstacle's speed",
        place="Fig. 6, Section V-A",
        summary=(
            "100 velocities from -0.01 to -1.00 m/s. The letter's trend, a larger |D_p| for slow obstacles and hardly "
            "a change above 0.2 m/s, comes out where l'_typ is the obstacle's own speed. With the l'_typ = -0.3 m/s "
            "that Section V-A names, it reverses (finding 5). The figure itself prints no numbers. With the first "
            "order and a fixed l'_typ, mitigation does not pay at all below 0.03 m/s: the optimum is the end of the "
            "range."
        ),
        parameters=(
            *ADMITTANCE,
            *(p for n in ("inverse-power", "exponential-1", "exponential-2") for p in SENSORS[n]),
            *F_1,
        ),
        comparisons=(),
        findings=(_finding(speeds, gains),),
        tables=tuple(_table(scale, speeds, found) for scale, found in gains.items()),
        caption=(
            "Left: l'_typ follows the obstacle, the letter's trend. Right: l'_typ fixed, the opposite one; where "
            "mitigation does not pay, the first order jumps to the end of the range. The inverse power is integrated, "
            "the first order solved in closed form, the second order by its uniform motion."
        ),
        code=code,
        figure=variables["figure"],
        numbers={"speed": speeds, "optimal_gain": gains},
    )


def _at(speeds: FloatArray, values: FloatArray, speed: float) -> float:
    return float(values[int(np.argmin(np.abs(speeds - speed)))])


def _finding(speeds: FloatArray, gains: dict[str, dict[str, FloatArray]]) -> Finding:
    evidence, holds = [], True
    fast, shown = speeds >= 0.2, speeds >= 0.05
    for name in _MODELS:
        following, fixed = -gains["following"][name], -gains["fixed"][name]
        slow = _at(speeds, following, 0.05) / _at(speeds, following, 0.3)
        spread = float(following[fast].max() / following[fast].min())
        rise = float(fixed[-1]) / _at(speeds, fixed, 0.05)
        always = bool((np.diff(fixed[shown]) > 0).all())
        evidence += [
            Evidence(name=f"{name}, following: |D_p| at 0.05 m/s over that at 0.3 m/s", value=slow),
            Evidence(name=f"{name}, following: largest over smallest |D_p| from 0.2 m/s on", value=spread),
            Evidence(name=f"{name}, fixed: |D_p| at 1 m/s over that at 0.05 m/s", value=rise),
            Evidence(name=f"{name}, fixed: |D_p| grows with every step from 0.05 m/s on", value=always),
        ]
        holds = holds and slow > 2 and spread < 2 and always
    power = {scale: found["inverse power"] for scale, found in gains.items()}
    pairs = {s: ", ".join(f"{_at(speeds, g, v):.3g} at {v:g} m/s" for v in (0.05, 0.3, 1.0)) for s, g in power.items()}
    return Finding(
        id=5,
        title="Fig. 6 holds only if l'_typ follows the obstacle's speed",
        place="Fig. 6, Section V-A",
        statement=(
            "The text describes a larger |D_p| for slow obstacles and hardly a change above 0.2 m/s. That is so if "
            f"l'_typ is the obstacle's own speed (inverse power: {pairs['following']}). With l'_typ fixed at -0.3 m/s, "
            f"as Section V-A sets it, |D_p| grows with the speed ({pairs['fixed']}): the typical value decides the "
            "trend."
        ),
        evidence=tuple(evidence),
        holds=bool(holds),
    )


def _table(scale: str, speeds: FloatArray, gains: dict[str, FloatArray]) -> DataTable:
    titles = {"following": "l'_typ follows the obstacle", "fixed": "l'_typ fixed at 0.3 m/s"}
    rows = tuple((f"{v:.2f}", *(f"{_at(speeds, gains[name], v):.4f}" for name in _MODELS)) for v in _SHOWN)
    return DataTable(
        title=f"Optimal gain D_p [N s], {titles[scale]}", head=("obstacle speed [m/s]", *_MODELS), rows=rows
    )
