"""Section VI-B: the impact force in the objective and as a limit."""

from __future__ import annotations

from typing import Final

from pretouch.design import Constraint, GainDesign, design_gain

from ..given import APPROACH, BOUNDS, F_1, SENSORS, approach, f_1, sensor
from ..result import DataTable, Evidence, Finding, Reproduction
from ..running import run_script

__all__ = ["reproduce"]

_SPRING: Final = "linear spring"
_HERTZ: Final = "sphere by Hertz's law"
_LIMIT: Final = 4.5


def reproduce() -> Reproduction:
    """Replace the relative velocity in L(20) by the peak force of the impact.

    Returns:
        The reproduction.
    """
    code, variables = run_script("impact-force")
    designs: dict[str, GainDesign] = dict(variables["designs"])
    impacts = variables["impacts"]
    velocity = design_gain(approach(), sensor("inverse-power"), f_1(), bounds=BOUNDS)
    limited = design_gain(
        approach(),
        sensor("inverse-power"),
        f_1(),
        bounds=BOUNDS,
        constraints=[Constraint(name="impact_force", limit=_LIMIT)],
        impact=impacts[_SPRING],
    )
    rows = {"speed, f₁": velocity, **{f"force, {n}": d for n, d in designs.items()}, f"f₁, force ≤ {_LIMIT} N": limited}
    return Reproduction(
        id="impact-force",
        title="The force of the impact in place of its speed",
        place="Section VI-B",
        summary=(
            "Where mass and stiffness are known, the peak force can stand in the objective and be limited. The spring "
            "has the 62.7 N s/m of Table III as √(μ k); the sphere is a soft one of 10 mm radius. Both are lossless, "
            "so they bound the peak for their stiffness; the mass is the robot's physical one, not M_a."
        ),
        parameters=(*APPROACH, *SENSORS["inverse-power"], *F_1),
        comparisons=(),
        findings=(_finding(velocity, designs),),
        tables=(_table(rows),),
        caption="The peak force over the gain for two kinds of contact, with the optimum of each objective.",
        code=code,
        figure=variables["figure"],
        numbers={
            "gain": variables["gains"],
            "peak_force": {name: impact.peak_force(variables["speeds"]) for name, impact in impacts.items()},
            "optimal_gain": {name: d.gain for name, d in rows.items()},
        },
    )


def _finding(velocity: GainDesign, designs: dict[str, GainDesign]) -> Finding:
    by_speed, spring, hertz = velocity.gain or 0.0, designs[_SPRING].gain or 0.0, designs[_HERTZ].gain or 0.0
    return Finding(
        id=13,
        title="On a linear contact the force objective changes nothing; on a curved one it shifts the gain",
        place="Section VI-B",
        statement=(
            "F_typ is the peak force without mitigation. On a spring the peak is √(μ k) |l'|, so the objective is f₁ "
            "itself and has its optimum. By Hertz's law the force grows as |l'|^1.2, and the optimum moves."
        ),
        evidence=(
            Evidence(name="optimal gain by speed", value=by_speed, unit="N s"),
            Evidence(name="by force on the spring", value=spring, unit="N s"),
            Evidence(name="by force on the sphere", value=hertz, unit="N s"),
        ),
        holds=bool(abs(spring / by_speed - 1) < 1e-6 < abs(hertz / by_speed - 1)),
    )


def _table(designs: dict[str, GainDesign]) -> DataTable:
    rows = []
    for name, found in designs.items():
        if found.gain is None or found.result is None:
            continue
        contact = found.result.contact
        rows.append(
            (
                name,
                f"{found.gain:.4f}",
                f"{1e3 * contact.largest_excursion:.2f}",
                f"{-1e3 * contact.relative_velocity:.2f}",
            )
        )
    return DataTable(
        title="Optimum by speed and by force",
        head=("objective", "D_p [N s]", "excursion [mm]", "speed at contact [mm/s]"),
        rows=tuple(rows),
    )
