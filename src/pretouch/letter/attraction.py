"""Check the letter's claim that all motions converge.

They converge toward a motion with constant relative velocity.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray

from .experiment import Finding, Reproduction, Variables, finding, readings
from .inputs import APPROACH, EXPERIMENT_GAIN, SENSORS, approach, sensor
from .program import Program

PROGRAM: Final = Program(
    "Section VI-A: motions near the uniform motion l = A t + B converge toward it, but contact comes first.",
    {
        **{"admittance": approach().admittance, "obstacle": approach().obstacle},
        **{"scenario": approach(), "sensor": sensor("exponential-2"), "gain": EXPERIMENT_GAIN.value},
    },
    """\
uniform = pt.solve_motion(scenario, sensor, gain, method="uniform-motion")
a, b = uniform.relative_velocity[0], uniform.distance[0]
starts, speeds = (grid.ravel() for grid in np.meshgrid(np.linspace(0.02, 0.075, 7), [-0.3, a, 0.1]))
plants = pt.Plant(position=obstacle.position - starts, velocity=obstacle.velocity - speeds)
around = pt.solve_motion(pt.Scenario(admittance=admittance, obstacle=obstacle, plant=plants), sensor, gain, samples=80)
letter = pt.solve_motion(scenario, sensor, gain)
curves = [pt.report.Curve(x=1e3 * l, y=v, quiet=True) for l, v in zip(around.distance, around.relative_velocity)]
named = {"from the letter's start": letter, "uniform motion": uniform}
curves += [pt.report.Curve(x=1e3 * m.distance, y=m.relative_velocity, label=n, end="contact") for n, m in named.items()]
deviations = [pt.report.Curve(x=t, y=1e3 * (l - a * t - b), quiet=True) for t, l in zip(around.time, around.distance)]
deviations += [pt.report.Curve(x=m.time, y=1e3 * (m.distance - a * m.time - b), label=n) for n, m in named.items()]
figure = pt.report.panel_figure(
    pt.report.Panel(x_label="distance l [mm]", y_label="relative velocity l′ [m/s]", curves=curves),
    pt.report.Panel(x_label="time t [s]", y_label="distance from the uniform motion [mm]", curves=deviations),
)
""",
)
INPUTS: Final = {p.symbol: p.value for p in (*APPROACH, *SENSORS["exponential-2"], EXPERIMENT_GAIN)}


def reproduce(variables: Variables) -> Reproduction:
    """Check that every motion approaches the letter's uniform motion. The energy of its deviation must decrease."""
    a, b, around, same = (
        float(variables["a"]),
        float(variables["b"]),
        variables["around"],
        np.isclose(variables["speeds"], variables["a"]),
    )
    root = float(np.sqrt(1 + 8 * INPUTS["b_2"] * INPUTS["D_p"] * INPUTS["v_o"] / INPUTS["K_a"]))
    deviations = around.distance - a * around.time - b
    remaining = deviations[:, -1] / deviations[:, 0]  # share of the initial deviation that remains at contact
    starts, ends = variables["starts"][same], around.time[same, -1]
    columns = {"l(0) [mm]": (1e3 * starts, ".1f"), "l(0) - B [mm]": (1e3 * (starts - b), "+.1f")}
    columns |= {"share of l(0) - B at contact": (remaining[same], ".3f"), "time of contact [s]": (ends, ".3f")}
    course, names = ("time", "distance", "relative_velocity"), ("around", "letter", "uniform")
    motions = {name: {field: getattr(variables[name], field) for field in course} for name in names}
    return Reproduction(
        summary="With δ = l - (A t + B), L(14) becomes M δ'' + (D + D_p g(l)) δ' + (K + 2 b_2 D_p A) δ = 0, without an "
        "approximation. For the approaching root of L(17) this stiffness is K (1 + s)/2 > 0, with s² = 1 + 8 b_2 "
        "D_p v_o / K, and the damping is positive wherever the output falls with the distance: the energy ½ M δ'² + ½ "
        "K (1 + s)/2 δ² can only fall. This proves, for every start, the attraction that the letter reports.",
        parameters=(*APPROACH, *SENSORS["exponential-2"], EXPERIMENT_GAIN),
        findings=(_attraction_finding(variables, deviations, remaining[same]), _roots(root, a)),
        tables=(readings("Motions that start with the velocity A", columns),),
        caption="Grey: 21 motions from other distances and velocities, until contact. The letter's motion starts and "
        "ends 4 mm from the uniform motion, because its relative velocity must first fall from -0.3 m/s.",
        numbers={
            **{"A": a, "B": b, "s": root},
            "effective_stiffness": INPUTS["K_a"] * (1 + root) / 2,
            "effective_stiffness_other_root": INPUTS["K_a"] * (1 - root) / 2,
            "initial_distance": variables["starts"],
            "initial_relative_velocity": variables["speeds"],
            "deviation_left_at_contact": remaining,
            "motion": motions,
        },
    )


def _attraction_finding(variables: Variables, deviations: FloatArray, remaining: FloatArray) -> Finding:
    stiffness = INPUTS["K_a"] + 2 * INPUTS["b_2"] * INPUTS["D_p"] * variables["a"]
    energy = (
        INPUTS["M_a"] * (variables["around"].relative_velocity - variables["a"]) ** 2 / 2
        + stiffness * deviations**2 / 2
    )
    falls = bool(np.diff(energy / energy[:, :1], axis=1).max() < 0)
    at_contact, at_b = np.abs(variables["sensor"].log_slope(np.array([0.0, variables["b"]])))
    deviation = variables["letter"].relative_velocity[-1] / variables["a"] - 1
    return finding(
        9,
        "Motions converge toward the uniform motion, but contact comes first",
        "Section VI-A",
        "The letter rightly states that motions converge toward the uniform motion. Each motion deviates from the "
        "uniform motion, and the energy of this deviation falls over time. But the convergence is slow. At contact, "
        f"{100 * remaining.min():.0f} to {100 * remaining.max():.0f} % of the initial deviation in distance remain. "
        "Therefore, the optimal gains for the uniform motion L(19) and for the integrated motion differ by 10 %.",
        ("the energy falls along every motion, from each of 80 samples to the next", falls),
        ("smallest share of the deviation at contact", remaining.min()),
        ("largest share of the deviation at contact", remaining.max()),
        ("both shares are between 0 and 1", bool(remaining.min() > 0 and remaining.max() < 1)),
        ("g(B) / g(0), the limit for strong gains", at_b / at_contact),
        ("relative velocity at contact from the letter's start, relative to A", 100 * deviation, "%"),
    )


def _roots(root: float, a: float) -> Finding:
    speed, stiffness, other = abs(INPUTS["v_o"]), INPUTS["K_a"], 2 * INPUTS["v_o"] / (1 - root)
    return finding(
        10,
        "The criterion for the sign in L(17) admits both roots in the letter's case",
        "Section III-B2",
        "The letter takes the root with 0 ≤ |A| ≤ |v_o|. For s ≥ 3 both roots meet this criterion, and at D_p = -1 N "
        "s, s is 6.8. The second root recedes from the obstacle, and its stiffness K (1 - s)/2 is negative: motions "
        "diverge from it. The intended root is the one that approaches.",
        ("s", root),
        ("A of the root that approaches", a, "m/s"),
        ("A of the other root", other, "m/s"),
        ("both roots meet 0 ≤ |A| ≤ |v_o|", max(abs(a), abs(other)) <= speed),
        ("one approaches, one recedes", a < 0 < other),
        ("stiffness of the deviation, approaching root", stiffness * (1 + root) / 2, "N/m"),
        ("stiffness, other root", stiffness * (1 - root) / 2, "N/m"),
    )
