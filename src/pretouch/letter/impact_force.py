"""Recompute Section VI-B of the letter with the impact force.

The peak force is part of the objective or a limit.
"""

from __future__ import annotations

from typing import Final

from pretouch.designs import Constraint, GainDesign, Task, design_gain

from .experiment import Finding, Reproduction, Variables, finding, readings
from .inputs import APPROACH, BOUNDS, F_1, ONE_APPROACH, SENSORS, approach, f_1, sensor
from .program import Program

PROGRAM: Final = Program(
    "Section VI-B: the peak force of the impact instead of the speed, if mass and stiffness are known.",
    ONE_APPROACH,
    """\
impacts = {
    "linear spring": pt.SpringImpact(robot_mass=1.0, stiffness=62.7**2),
    "sphere by Hertz's law": pt.HertzImpact(robot_mass=1.0, effective_modulus=1e6, radius=0.01),
}
gains, excursion = -np.geomspace(0.05, 10.0, 200), pt.Term(quantity="displacement", scale=0.5)
speeds = pt.find_contact(scenario, sensor, gains).contact.relative_velocity
designs, curves, marks = {}, [], []
for name, impact in impacts.items():
    force = pt.Term(quantity="impact_force", scale=impact.peak_force(0.3))
    goal = pt.Objective(terms=(excursion, force))
    design = designs[name] = pt.design(pt.Task(scenario, sensor, goal, bounds=(-10.0, -0.01), impact=impact))
    curves.append(pt.report.Curve(x=-gains, y=impact.peak_force(speeds), label=name))
    peak = impact.peak_force(design.result.contact.relative_velocity)
    marks.append(pt.report.Mark(x=-design.gain, y=peak, label=f"optimum {design.gain:.3f} N s", shape="ring"))
labels = {"x_label": "gain −D_p [N s]", "y_label": "peak force [N]", "x_log": True}
figure = pt.report.panel_figure(pt.report.Panel(curves=curves, marks=marks, **labels))
""",
)
LIMIT: Final = 4.5  # N


def reproduce(variables: Variables) -> Reproduction:
    """Design gains with the peak impact force instead of l' in the letter's objective, or as a limit."""
    by_force, impacts = dict(variables["designs"]), variables["impacts"]
    limited = {"constraints": [Constraint(name="impact_force", limit=LIMIT)], "impact": impacts["linear spring"]}
    problem = (approach(), sensor("inverse-power"), f_1())
    designs: dict[str, GainDesign] = {
        "speed, f₁": design_gain(Task(*problem, bounds=BOUNDS)),
        **{f"force, {name}": design for name, design in by_force.items()},
        f"f₁, force ≤ {LIMIT} N": design_gain(Task(*problem, bounds=BOUNDS, **limited)),
    }
    gains = {name: float("nan") if d.gain is None else d.gain for name, d in designs.items()}
    at = [d.result.contact for d in designs.values() if d.result is not None]
    columns = {"objective": (gains, ""), "D_p [N s]": (gains.values(), ".4f")}
    columns["excursion [mm]"] = ([1e3 * c.largest_excursion for c in at], ".2f")
    columns["speed at contact [mm/s]"] = ([-1e3 * c.relative_velocity for c in at], ".2f")
    return Reproduction(
        summary="If mass and stiffness are known, the peak force can be a term of the objective or a limit. The spring "
        "has √(μ k) = 62.7 N s/m, as found from Table III; the sphere is soft, with a radius of 10 mm. Both models are "
        "lossless, and a contact with moderate damping has a lower peak force. The mass is the robot's physical mass, "
        "not M_a.",
        parameters=(*APPROACH, *SENSORS["inverse-power"], *F_1),
        findings=(_shift_finding(*[*gains.values()][:3]),),
        tables=(readings("Optimum by speed and by force", columns),),
        caption="The peak force over the gain for two kinds of contact, with the optimum of each objective.",
        numbers={
            "gain": variables["gains"],
            "peak_force": {name: impact.peak_force(variables["speeds"]) for name, impact in impacts.items()},
            "optimal_gain": gains,
        },
    )


def _shift_finding(by_speed: float, spring: float, hertz: float) -> Finding:
    return finding(
        13,
        "For a linear contact, the force objective does not change the gain; for a Hertz contact, it does",
        "Section VI-B",
        "F_typ is the peak force without mitigation. On a spring the peak is √(μ k) |l'|, so the objective equals f₁, "
        "with the same optimum. By Hertz's law the force grows as |l'|^1.2, and the optimum moves.",
        ("optimal gain for the speed", by_speed, "N s"),
        ("optimal gain for the force on the spring", spring, "N s"),
        ("optimal gain for the force on the sphere", hertz, "N s"),
        (
            "only the spring leaves the optimal gain unchanged",
            abs(spring / by_speed - 1) < 1e-6 < abs(hertz / by_speed - 1),
        ),
    )
