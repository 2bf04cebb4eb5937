"""Section VI-A: whether neighboring orbits are drawn to the uniform motion, which the letter states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pretouch._core.numbers import FloatArray

from ..given import APPROACH, EXPERIMENT_GAIN, SENSORS
from ..result import DataTable, Evidence, Finding, Reproduction
from ..running import run_script

__all__ = ["reproduce"]


def reproduce() -> Reproduction:
    """Follow motions L(14) that start around the uniform motion L(16)-(18), and hold them to an energy that must fall.

    Returns:
        The reproduction.
    """
    code, variables = run_script("attraction")
    given = {p.symbol: p.value for p in (*APPROACH, *SENSORS["exponential-2"], EXPERIMENT_GAIN)}
    root = float(np.sqrt(1 + 8 * given["b_2"] * given["D_p"] * given["v_o"] / given["K_a"]))
    a, b = float(variables["a"]), float(variables["b"])
    energy = _energy(variables, given, a, b)
    left = _left(variables, a, b)
    return Reproduction(
        id="attraction",
        title="Attraction of the uniform motion",
        place="Section VI-A",
        summary=(
            "With δ = l - (A t + B), L(14) becomes M δ'' + (D + D_p g(l)) δ' + (K + 2 b_2 D_p A) δ = 0, without an "
            "approximation. For the approaching root of L(17) the stiffness in it is K (1 + s)/2 > 0, with s² = 1 + 8 "
            "b_2 D_p v_o / K, and the damping is positive wherever the output falls with the distance: the energy ½ M "
            "δ'² + ½ K (1 + s)/2 δ² can only fall. That is the attraction the letter reports, proved for every start."
        ),
        parameters=(*APPROACH, *SENSORS["exponential-2"], EXPERIMENT_GAIN),
        comparisons=(),
        findings=(_attraction(energy, left, variables, b), _roots(given, root, a)),
        tables=(_table(variables, left),),
        caption=(
            "Grey: 21 motions from other distances and velocities, each to its own contact. The letter's own motion "
            "starts 4 mm from the uniform one and ends 4 mm from it: a velocity of -0.3 m/s has to be braked first."
        ),
        code=code,
        figure=variables["figure"],
        numbers={
            "A": a,
            "B": b,
            "s": root,
            "effective_stiffness": given["K_a"] * (1 + root) / 2,
            "effective_stiffness_other_root": given["K_a"] * (1 - root) / 2,
            "initial_distance": variables["starts"],
            "initial_relative_velocity": variables["speeds"],
            "deviation_left_at_contact": left,
            "motion": {
                name: {"time": m.time, "distance": m.distance, "relative_velocity": m.relative_velocity}
                for name, m in ((n, variables[n]) for n in ("around", "letter", "uniform"))
            },
        },
    )


def _apart(motion: Any, a: float, b: float) -> FloatArray:
    return np.asarray(motion.distance - a * motion.time - b)


def _energy(variables: Mapping[str, Any], given: Mapping[str, float], a: float, b: float) -> FloatArray:
    """Return the energy of every motion over its time, as a part of what it started with."""
    motion = variables["around"]
    stiffness = given["K_a"] + 2 * given["b_2"] * given["D_p"] * a
    rate = motion.relative_velocity - a
    energy = given["M_a"] * rate**2 / 2 + stiffness * _apart(motion, a, b) ** 2 / 2
    return np.asarray(energy / energy[:, :1])


def _left(variables: Mapping[str, Any], a: float, b: float) -> FloatArray:
    """Return which part of the first deviation is left at contact, for motions that start with the velocity A."""
    apart = _apart(variables["around"], a, b)
    return np.asarray(apart[:, -1] / apart[:, 0])


def _same_velocity(variables: Mapping[str, Any]) -> Any:
    return np.isclose(variables["speeds"], variables["a"])


def _attraction(energy: FloatArray, left: FloatArray, variables: Mapping[str, Any], b: float) -> Finding:
    same = _same_velocity(variables)
    growth = float(np.diff(energy, axis=1).max())
    slope = np.abs(variables["sensor"].log_slope(np.array([0.0, b])))
    own = variables["letter"].relative_velocity[-1] / variables["a"] - 1
    smallest, largest = float(left[same].min()), float(left[same].max())
    return Finding(
        id=9,
        title="Orbits are drawn to the uniform motion, but contact comes first",
        place="Section VI-A",
        statement=(
            "The energy of the deviation falls along every orbit, so the letter's statement is right. It is slow, "
            f"though: of a deviation in distance {100 * smallest:.0f} to {100 * largest:.0f} % are left at contact. "
            "For strong gains that part tends to g(l)/g(0), the ratio of the sensor's slopes, whatever gain and "
            "speed. This is why the optimum by L(19) differs from the integrated one by 10 %."
        ),
        evidence=(
            Evidence(name="the energy falls along every orbit, from each of 80 samples to the next", value=growth < 0),
            Evidence(name="smallest part of the deviation left at contact", value=smallest),
            Evidence(name="largest part", value=largest),
            Evidence(name="g(B) / g(0), the limit for strong gains", value=float(slope[1] / slope[0])),
            Evidence(
                name="relative velocity at contact from the letter's start, against A", value=100 * float(own), unit="%"
            ),
        ),
        holds=bool(growth < 0 < smallest and largest < 1),
    )


def _roots(given: Mapping[str, float], root: float, a: float) -> Finding:
    v_o, stiffness = given["v_o"], given["K_a"]
    other = 2 * v_o / (1 - root)
    return Finding(
        id=10,
        title="The criterion for the sign in L(17) leaves both roots in the letter's own case",
        place="Section III-B2",
        statement=(
            "The letter takes the root with 0 ≤ |A| ≤ |v_o|. For s ≥ 3 both roots meet it, and at D_p = -1 N s s is "
            "6.8. The second one recedes from the obstacle, and its stiffness K (1 - s)/2 is negative: orbits leave "
            "it. The root that is meant is the one that approaches."
        ),
        evidence=(
            Evidence(name="s", value=root),
            Evidence(name="A of the root that approaches", value=a, unit="m/s"),
            Evidence(name="A of the other root", value=other, unit="m/s"),
            Evidence(name="both meet 0 ≤ |A| ≤ |v_o|", value=max(abs(a), abs(other)) <= abs(v_o)),
            Evidence(name="stiffness of the deviation, approaching root", value=stiffness * (1 + root) / 2, unit="N/m"),
            Evidence(name="stiffness, other root", value=stiffness * (1 - root) / 2, unit="N/m"),
        ),
        holds=bool(max(abs(a), abs(other)) <= abs(v_o) and a < 0 < other and root > 1),
    )


def _table(variables: Mapping[str, Any], left: FloatArray) -> DataTable:
    same = _same_velocity(variables)
    rows = tuple(
        (f"{1e3 * start:.1f}", f"{1e3 * (start - variables['b']):+.1f}", f"{part:.3f}", f"{time[-1]:.3f}")
        for start, part, time in zip(variables["starts"][same], left[same], variables["around"].time[same], strict=True)
    )
    return DataTable(
        title="Motions that start with the velocity A",
        head=("l(0) [mm]", "l(0) - B [mm]", "part of it left at contact", "time of contact [s]"),
        rows=rows,
    )
