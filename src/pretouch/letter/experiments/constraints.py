"""Section VI-B: the range of motion and the relative velocity as inequality constraints."""

from __future__ import annotations

from typing import Final

from pretouch.design import Constraint, GainDesign, design_gain

from ..given import APPROACH, BOUNDS, F_1, SENSORS, approach, f_1, sensor
from ..result import DataTable, Evidence, Finding, Reproduction
from ..running import run_script

__all__ = ["reproduce"]

_CASES: Final[tuple[dict[str, float], ...]] = (
    {},
    {"excursion": 0.08},
    {"relative_velocity": 0.07},
    {"excursion": 0.13, "relative_velocity": 0.07},
    {"excursion": 0.08, "relative_velocity": 0.07},
)


def reproduce() -> Reproduction:
    """Minimize L(20) under limits of the excursion and of the relative velocity at contact.

    Returns:
        The reproduction.
    """
    code, variables = run_script("constraints")
    designs = [_design(case) for case in _CASES]
    return Reproduction(
        id="constraints",
        title="Limits on motion and velocity",
        place="Section VI-B",
        summary=(
            "The letter says that such limits can be handed to the solver, and shows none. Here the optimum follows "
            "its limit until the limit no longer binds, and where two limits contradict each other the answer is "
            "which ones do, and by how much."
        ),
        parameters=(*APPROACH, *SENSORS["inverse-power"], *F_1),
        comparisons=(),
        findings=(_finding(designs),),
        tables=(_table(designs),),
        caption=(
            "Left: the optimal gain over the largest excursion that is allowed. Right: the speed at contact. With the "
            "speed limited, too, no gain is left below the excursion at which the second curve begins."
        ),
        code=code,
        figure=variables["figure"],
        numbers={
            "excursion_limit": variables["limits"],
            "optimal_gain": variables["gains"],
            "speed_at_contact": variables["speeds"],
            "cases": [
                {"limits": case, "status": d.status, "gain": d.gain, "objective": d.objective}
                for case, d in zip(_CASES, designs, strict=True)
            ],
        },
    )


def _design(limits: dict[str, float]) -> GainDesign:
    constraints = [Constraint(name=name, limit=limit) for name, limit in limits.items()]
    return design_gain(approach(), sensor("inverse-power"), f_1(), bounds=BOUNDS, constraints=constraints)


def _finding(designs: list[GainDesign]) -> Finding:
    free, near, slow, both, neither = designs
    on_limit = [abs((o.margin or 0.0) / o.limit) for d in (near, slow) for o in d.constraints]
    worse = all((d.objective or 0.0) > (free.objective or 0.0) for d in (near, slow, both))
    refused = neither.gain is None and all(o.achievable for o in neither.constraints)
    return Finding(
        id=11,
        title="A limit that binds holds the optimum on itself, and limits that contradict each other are named",
        place="Section VI-B",
        statement=(
            "With the excursion limited to 80 mm, or the speed at contact to 70 mm/s, the optimum sits on that limit. "
            "Each of the two can be met alone; together no gain meets them, and the design says so instead of giving "
            "one."
        ),
        evidence=(
            Evidence(name="bound optima lie on their limit, to a millionth of it", value=max(on_limit) < 1e-6),
            Evidence(name="every limited objective is above the free one", value=worse),
            Evidence(name="80 mm and 70 mm/s: each can be met, both cannot", value=refused),
        ),
        holds=bool(max(on_limit) < 1e-6 and worse and refused),
    )


def _table(designs: list[GainDesign]) -> DataTable:
    names = {"excursion": ("|x - x_d|", "mm"), "relative_velocity": ("|l'|", "mm/s")}
    rows = []
    for case, found in zip(_CASES, designs, strict=True):
        limits = ", ".join(f"{names[n][0]} ≤ {1e3 * v:g} {names[n][1]}" for n, v in case.items()) or "none"
        if found.gain is None or found.objective is None or found.result is None:
            rows.append((limits, found.status.value, "", "", "", ""))
            continue
        contact = found.result.contact
        binding = ", ".join(names[o.name][0] for o in found.constraints if o.active) or "none"
        numbers = (
            f"{found.gain:.4f}",
            f"{1e3 * contact.largest_excursion:.2f}",
            f"{-1e3 * contact.relative_velocity:.2f}",
        )
        rows.append((limits, binding, *numbers, f"{found.objective:.5f}"))
    return DataTable(
        title="The optimum under limits",
        head=("limits", "binding", "D_p [N s]", "excursion [mm]", "speed at contact [mm/s]", "f₁"),
        rows=tuple(rows),
    )
