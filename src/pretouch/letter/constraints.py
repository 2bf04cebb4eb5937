"""Recompute the constrained designs in Section VI-B of the letter.

Excursion and contact speed are limited.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pretouch.designs import Constraint, GainDesign, Task, design_gain

from .experiment import Finding, Reproduction, Variables, finding, readings
from .inputs import APPROACH, BOUNDS, F_1, ONE_APPROACH, SENSORS, approach, f_1, sensor
from .program import Program

PROGRAM: Final = Program(
    "Section VI-B: limits on the range of motion and on the relative velocity as inequality constraints.",
    ONE_APPROACH,
    """\
task = pt.Task(scenario, sensor, pt.excursion_objective(position_scale=0.5, velocity_scale=0.3), bounds=(-10, -0.01))
limits = np.linspace(0.05, 0.13, 41)
excursions = [pt.Constraint(name="excursion", limit=limit) for limit in limits]
velocity = pt.Constraint(name="relative_velocity", limit=0.09)
cases = {"range of motion limited": [], "relative velocity, too": [velocity]}
gains, speeds = {}, {}
for name, more in cases.items():
    designs = [pt.design(task.replace(constraints=[e, *more])) for e in excursions]
    gains[name] = [d.gain or np.nan for d in designs]
    speeds[name] = [-d.result.contact.relative_velocity if d.result else np.nan for d in designs]
panels = {"optimal gain D_p [N s]": (gains, {}), "speed at contact [m/s]": (speeds, {"limit of the velocity": 0.09})}
curves = [[pt.report.Curve(x=1e3 * limits, y=y, label=n) for n, y in values.items()] for values, _ in panels.values()]
labels = {"x_label": "largest excursion allowed [mm]"}
drawn = [pt.report.Panel(y_label=y, curves=c, levels=p[1], **labels) for c, (y, p) in zip(curves, panels.items())]
figure = pt.report.panel_figure(*drawn)
""",
)
CASES: Final[tuple[dict[str, float], ...]] = (
    {},
    {"excursion": 0.08},
    {"relative_velocity": 0.07},
    {"excursion": 0.13, "relative_velocity": 0.07},
    {"excursion": 0.08, "relative_velocity": 0.07},
)


def reproduce(variables: Variables) -> Reproduction:
    """Minimize the letter's objective f_1 under two limits."""
    designs = [_design(case) for case in CASES]
    return Reproduction(
        summary="The letter states without an example that such limits can be passed to the solver. Here the optimum "
        "lies on its limit until the limit is no longer active. If two limits conflict, the result names them and the "
        "amount of the conflict.",
        parameters=(*APPROACH, *SENSORS["inverse-power"], *F_1),
        findings=(_limits_finding(designs),),
        tables=(readings("The optimum under limits", _columns(designs)),),
        caption="Left: the optimal gain over the largest allowed excursion. Right: the speed at contact. If the speed "
        "is limited, too, no gain is feasible below the excursion at which the second curve begins.",
        numbers={
            "excursion_limit": variables["limits"],
            "optimal_gain": variables["gains"],
            "speed_at_contact": variables["speeds"],
            "cases": [
                {"limits": case, "status": d.status, "gain": d.gain, "objective": d.objective}
                for case, d in zip(CASES, designs, strict=True)
            ],
        },
    )


def _design(limits: dict[str, float]) -> GainDesign:
    constraints = [Constraint(name=name, limit=limit) for name, limit in limits.items()]
    return design_gain(Task(approach(), sensor("inverse-power"), f_1(), bounds=BOUNDS, constraints=constraints))


def _limits_finding(designs: Sequence[GainDesign]) -> Finding:
    free, near, slow, both, neither = designs
    on_limit = [abs((o.margin or 0.0) / o.limit) for d in (near, slow) for o in d.constraints]
    worse = all((d.objective or 0.0) > (free.objective or 0.0) for d in (near, slow, both))
    refused = neither.gain is None and all(o.achievable for o in neither.constraints)
    return finding(
        11,
        "The optimum lies on an active limit; conflicting limits are named",
        "Section VI-B",
        "With the excursion limited to 80 mm, or the speed at contact to 70 mm/s, the optimum lies on that limit. Each "
        "of the two limits can be met alone. No gain meets both, and the design reports this instead of a gain.",
        ("limited optima lie on their limit, within a millionth of the limit", max(on_limit) < 1e-6),
        ("every limited objective is above the unlimited one", worse),
        ("the limits 80 mm and 70 mm/s can each be met alone, but not together", refused),
    )


def _columns(designs: Sequence[GainDesign]) -> dict[str, tuple[list[str], str]]:
    names = {"excursion": ("|x - x_d|", "mm"), "relative_velocity": ("|l'|", "mm/s")}
    cases = (", ".join(f"{names[n][0]} ≤ {1e3 * v:g} {names[n][1]}" for n, v in case.items()) for case in CASES)
    binding = (", ".join(names[o.name][0] for o in d.constraints if o.active) or "none" for d in designs)
    at = [None if d.result is None else d.result.contact for d in designs]
    return {
        "limits": ([case or "none" for case in cases], ""),
        "active": ([b if d.result else d.status.value for b, d in zip(binding, designs, strict=True)], ""),
        "D_p [N s]": (["" if d.gain is None else f"{d.gain:.4f}" for d in designs], ""),
        "excursion [mm]": (["" if c is None else f"{1e3 * c.largest_excursion:.2f}" for c in at], ""),
        "speed at contact [mm/s]": (["" if c is None else f"{-1e3 * c.relative_velocity:.2f}" for c in at], ""),
        "f₁": (["" if d.objective is None else f"{d.objective:.5f}" for d in designs], ""),
    }
