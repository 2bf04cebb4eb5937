"""What a practitioner takes from Figure 6: one gain for all speeds, and what it costs at each."""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray

from ..given import ADMITTANCE, F_1, SENSORS
from ..result import DataTable, Evidence, Finding, Reproduction
from ..running import run_script

__all__ = ["reproduce"]

_ALL: Final = "one gain for all speeds"
_FAST: Final = "one gain from 0.2 m/s on"
_BEST: Final = "best gain for each speed"
_SHOWN: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


def reproduce() -> Reproduction:
    """Find the gains whose largest relative loss in L(20) over a range of speeds is least.

    Returns:
        The reproduction.
    """
    code, variables = run_script("one-gain")
    speeds: FloatArray = variables["speeds"]
    gain = {name: float(variables["candidates"][i]) for name, i in variables["best"].items()}
    loss = {name: np.asarray(variables["losses"][i]) for name, i in variables["best"].items()}
    left = {name: np.asarray(values) for name, values in variables["left"].items()}
    best = np.asarray(variables["designs"].gain)
    return Reproduction(
        id="one-gain",
        title="One gain for all speeds",
        place="Section VI-C, Fig. 6",
        summary=(
            "The letter advises to design for a fast obstacle and to keep that gain. Here is what one gain costs, for "
            "the inverse power curve and l'_typ equal to the obstacle's speed: the loss in f₁ beside the best gain of "
            f"each speed. {gain[_FAST]:.3f} N s has the least largest loss from 0.2 to 1 m/s; over all speeds from "
            f"0.01 m/s it would be {gain[_ALL]:.3f} N s, which suits no range well."
        ),
        parameters=(*ADMITTANCE, *SENSORS["inverse-power"], *F_1[:3]),
        comparisons=(),
        findings=(_finding(speeds, gain, loss, left),),
        tables=(_table(speeds, best, loss, left),),
        caption=(
            "Left: the loss beside the best gain for each speed. Right: the speed at contact; where the relative loss "
            "is large, the contact is slow in absolute terms."
        ),
        code=code,
        figure=variables["figure"],
        numbers={"speed": speeds, "gain": gain, "best_gain": best, "loss": loss, "speed_at_contact": left},
    )


def _finding(
    speeds: FloatArray, gain: dict[str, float], loss: dict[str, FloatArray], left: dict[str, FloatArray]
) -> Finding:
    slow = speeds < 0.2
    price, worst = float(loss[_FAST][~slow].max()), float(loss[_FAST][slow].max())
    hardest, slowest_fast = float(left[_FAST][slow].max()), float(left[_FAST][~slow].min())
    return Finding(
        id=12,
        title="One gain serves all speeds from 0.2 m/s on, and leaves slow contacts slow",
        place="Section VI-C",
        statement=(
            f"With D_p = {gain[_FAST]:.3f} N s, f₁ is at most {100 * price:.1f} % above its optimum at any speed from "
            "0.2 to 1 m/s: the letter's argument holds, and this is its price. Below 0.2 m/s the loss grows to "
            f"{100 * worst:.0f} % at 0.01 m/s, yet contact is never faster than {1e3 * hardest:.0f} mm/s there."
        ),
        evidence=(
            Evidence(name="the gain", value=gain[_FAST], unit="N s"),
            Evidence(name="largest loss from 0.2 to 1 m/s", value=100 * price, unit="%"),
            Evidence(name="largest loss below 0.2 m/s", value=100 * worst, unit="%"),
            Evidence(name="fastest contact below 0.2 m/s", value=hardest, unit="m/s"),
            Evidence(name="slowest contact from 0.2 m/s on", value=slowest_fast, unit="m/s"),
        ),
        holds=bool(price < 0.1 and hardest < slowest_fast),
    )


def _table(speeds: FloatArray, best: FloatArray, loss: dict[str, FloatArray], left: dict[str, FloatArray]) -> DataTable:
    rows = []
    for shown in _SHOWN:
        i = int(np.argmin(np.abs(speeds - shown)))
        losses = (f"{100 * loss[name][i]:.1f}" for name in (_FAST, _ALL))
        contacts = (f"{1e3 * left[name][i]:.1f}" for name in (_BEST, _FAST, _ALL))
        rows.append((f"{shown:.2f}", f"{best[i]:.3f}", *losses, *contacts))
    return DataTable(
        title="The loss at each speed",
        head=(
            "obstacle speed [m/s]",
            "best D_p [N s]",
            f"loss, {_FAST} [%]",
            f"loss, {_ALL} [%]",
            "contact, best gain [mm/s]",
            f"contact, {_FAST} [mm/s]",
            f"contact, {_ALL} [mm/s]",
        ),
        rows=tuple(rows),
        note="Each of the two gains has the least largest loss over its range of speeds.",
    )
