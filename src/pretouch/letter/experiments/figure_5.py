"""Figure 5: the relative velocity until contact, and the reductions of Section IV-D."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from pretouch.motion import Motion, find_contact
from pretouch.sensors import SensorModel

from ..comparison import Comparison, compare, measured
from ..given import EXPERIMENT_GAIN, approach, over_rounding
from ..result import Evidence, Finding, Reproduction
from ..running import run_script
from .figure_4 import NAMES, PARAMETERS

__all__ = ["reproduce"]

_PLACE = "Section IV-D, Fig. 5"
_PRINTED = {"inverse-power": "78.0", "exponential-1": "70.4", "exponential-2": "74.4"}
_METHODS = {"exponential-1": "closed-form", "exponential-2": "uniform-motion"}


def reproduce() -> Reproduction:
    """Solve the motion by integration, L(10) and L(16), and compare the relative velocities at contact.

    Returns:
        The reproduction.
    """
    code, variables = run_script("figure-5")
    labels = {**NAMES, "exponential-2": "second order, uniform motion L(16)"}
    motions: Mapping[str, Motion] = {name: variables["motions"][label] for name, label in labels.items()}
    speed = {name: float(m.relative_velocity[-1]) for name, m in motions.items()}
    ratio = {name: 100 * v / approach().obstacle.velocity for name, v in speed.items()}
    return Reproduction(
        id="figure-5",
        title="Relative velocity until contact",
        place=_PLACE,
        summary=(
            "Without mitigation the obstacle would arrive at 0.3 m/s. What the letter calls the ratio l'/v_o is what "
            "mitigation takes away of that speed, not what it leaves (finding 3); read so, its model values agree."
        ),
        parameters=PARAMETERS,
        comparisons=tuple(_comparisons(ratio)),
        findings=(_finding(ratio),),
        caption=(
            "Mitigation takes most of the velocity in the first 0.1 s. With the first order the plant then speeds up "
            "again until contact, with the inverse power hardly; the uniform motion has one velocity."
        ),
        code=code,
        figure=variables["figure"],
        numbers={
            "relative_velocity_at_contact": speed,
            "reduction": {name: 1 - r / 100 for name, r in ratio.items()},
            "motion": {name: {"time": m.time, "relative_velocity": m.relative_velocity} for name, m in motions.items()},
        },
    )


def _comparisons(ratio: dict[str, float]) -> list[Comparison]:
    found = [
        measured(
            "reduction 1 - l'/v_o, experiment; ours: inverse power",
            _PRINTED["inverse-power"],
            100 - ratio["inverse-power"],
            unit="%",
            place=_PLACE,
            reason="the letter's value is of the hardware",
        )
    ]
    for name, method in _METHODS.items():
        low, high = over_rounding(name, partial(_taken, method=method))
        found.append(
            compare(
                f"reduction 1 - l'/v_o, {NAMES[name]}",
                _PRINTED[name],
                100 - ratio[name],
                unit="%",
                place=_PLACE,
                over_inputs=(float(low[0]), float(high[0])),
            )
        )
    true = float(_PRINTED["inverse-power"])
    for name, printed in (("exponential-1", "9.74"), ("exponential-2", "4.62")):
        error = 100 * abs(float(_PRINTED[name]) - true) / true
        found.append(compare(f"relative error of {_PRINTED[name]} % to 78.0 %", printed, error, unit="%", place=_PLACE))
    return found


def _taken(curve: SensorModel, method: str) -> list[float]:
    """Return which part of the obstacle's speed is taken away at contact [%]."""
    contact = find_contact(approach(), curve, EXPERIMENT_GAIN.value, method=method).contact
    return [100 - 100 * contact.relative_velocity / approach().obstacle.velocity]


def _finding(ratio: dict[str, float]) -> Finding:
    evidence, holds = [], True
    remain = ", ".join(f"{left:.1f}" for left in ratio.values())
    taken = ", ".join(f"{100 - left:.1f}" for left in ratio.values())
    for name, left in ratio.items():
        printed = float(_PRINTED[name])
        evidence.append(Evidence(name=f"l'/v_o at contact, {NAMES[name]}", value=left, unit="%"))
        evidence.append(
            Evidence(name=f"1 - l'/v_o; printed as the ratio {_PRINTED[name]} %", value=100 - left, unit="%")
        )
        holds = holds and abs(100 - left - printed) < 1.0 < abs(left - printed)
    return Finding(
        id=3,
        title="The ratio l'/v_o of Section IV-D is the reduction 1 - l'/v_o",
        place="Section IV-D",
        statement=(
            f"The section prints {', '.join(_PRINTED.values())} % as l'/v_o. The models leave {remain} % of the "
            f"obstacle's speed and take {taken} % away: the printed numbers are reductions. Its relative errors, 9.74 "
            "and 4.62 %, are of these reductions; of the speeds that are left, which the impact feels, they are 35 "
            "and 16 %."
        ),
        evidence=(
            *evidence,
            *(
                Evidence(
                    name=f"error of the speed left, {_PRINTED[name]} % against {_PRINTED['inverse-power']} % taken",
                    value=100 * ((100 - float(_PRINTED[name])) / (100 - float(_PRINTED["inverse-power"])) - 1),
                    unit="%",
                )
                for name in _METHODS
            ),
        ),
        holds=holds,
    )
