"""What a design report says, section by section, as plain rows of text for the template."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from pretouch.design.own_objective import OwnObjective
from pretouch.design.quantities import QUANTITY_UNITS, quantity_of
from pretouch.design.result import ConstraintOutcome, DesignStatus, GainDesign
from pretouch.design.robust.result import RobustDesign
from pretouch.design.summary import headline, ideal_in_words
from pretouch.motion import ContactResult, ContactStatus, Scenario
from pretouch.sensors import SensorModel

from .trade_off_panels import shows_equals
from .wording import QUANTITY_LABELS, number, objective_rows, quantity, quantity_label, word

__all__ = ["METHODS", "design_page", "scenario_rows", "sensor_rows", "solved_on"]

Row = tuple[str, ...]

_STATUS = {
    DesignStatus.OPTIMAL: "optimal gain found",
    DesignStatus.INFEASIBLE: "infeasible: no gain within the bounds meets every constraint",
    DesignStatus.NO_CONTACT: "no contact: no gain within the bounds ends in contact",
}
METHODS: Final = {
    "closed-form": "Closed form L(10)-(13), exact for a curve of constant slope g.",
    "integration": "Integration of L(1) with L(2) for the sensor curve as it is, with the contact located as a root.",
    "uniform-motion": (
        "Uniform-motion solution L(16)-(19): one particular motion of the second-order exponential curve, which does "
        "not start from the given state. It shifts the optimal gain by about 10 %."
    ),
    "loop": (
        "The sampled loop: sensor chain, controller with a period of its own, and robot, run with every gain and the "
        "same noise."
    ),
}
_AT = {
    "interior": "inside the bounds, where the objective is stationary",
    "bound": "on a bound of the gain: a wider range may hold a better one",
    "edge of contact": "where contact is just still made",
    "corner": "inside the bounds, where the objective has a corner or a jump: no derivative holds there",
}


def design_page(design: GainDesign) -> dict[str, Any]:
    """Collect the text of a design report.

    Args:
        design: a design of any status.

    Returns:
        The template's variables, all text.
    """
    return {
        "headline": headline(design),
        "status": design.status.value,
        "status_text": _STATUS[design.status],
        "tiles": list(_tiles(design)),
        "warnings": list(design.warnings),
        "contact_head": _contact_head(design),
        "contact_rows": list(_contact_rows(design)),
        "constraint_rows": [_constraint_row(outcome) for outcome in design.constraints],
        "objective_rows": list(_objective_rows(design)),
        "itemized": bool(design.objective_parts or not isinstance(design.definition, OwnObjective)),
        "of_terms": not isinstance(design.definition, OwnObjective),
        "shows_equals": shows_equals(design),
        "damping_rows": list(_damping_rows(design)),
        "certificate_rows": list(_certificate_rows(design)),
        "minima": list(_minima(design)),
        "sensitivities": list(_sensitivities(design)),
        "scenario_rows": [*scenario_rows(design.scenario), *_search_rows(design)],
        "sensor_rows": list(sensor_rows(design.sensor)),
        "method": METHODS.get(design.method, design.method),
        "solved_on": solved_on(design),
    }


def solved_on(design: GainDesign | RobustDesign) -> str:
    """Tell what encounters were solved on: `loop`, `other` (a function of the user's) or `motion`, that of L(1)."""
    if not design.on_evaluator:
        return "motion"
    return "loop" if design.method == "loop" else "other"


def _shown(design: GainDesign) -> ContactResult | None:
    return design.result or design.nearest


def _tiles(design: GainDesign) -> Iterator[tuple[str, str]]:
    """Yield the few numbers that matter most, with their names."""
    run, before = _shown(design), design.no_mitigation
    if run is None:
        yield "nearest approach without mitigation", quantity(float(before.closest_distance), "m")
        return
    yield "gain D_p" if design.result else "nearest gain D_p", quantity(float(run.gain), "N*s")
    speed = abs(float(run.end.relative_velocity))
    yield "relative speed at contact", quantity(speed, "m/s", 3)
    if before.reached.all():
        free = abs(float(before.end.relative_velocity))
        yield "without mitigation", quantity(free, "m/s", 3)
        yield "change of speed", f"{100 * (speed / free - 1):+.1f} %"
    yield "time of contact", quantity(float(run.end.time), "s", 3)


def _contact_head(design: GainDesign) -> Row:
    run = _shown(design)
    if run is None:
        return "quantity", "without mitigation"
    name = "with the gain" if design.result else "with the nearest gain"
    return "quantity", f"{name} {quantity(float(run.gain), 'N*s')}", "without mitigation", "change"


def _contact_rows(design: GainDesign) -> Iterator[Row]:
    runs = [run for run in (_shown(design), design.no_mitigation) if run is not None]
    ended = all(run.reached.all() for run in runs)
    if not ended:
        yield ("ends with", *(word(ContactStatus(int(run.status)).label) for run in runs), *[""] * (len(runs) - 1))
        nearest = (quantity(float(run.closest_distance), "m") for run in runs)
        yield ("smallest distance", *nearest, *[""] * (len(runs) - 1))
    for name in QUANTITY_LABELS:
        if name == "gain" or (name in {"drive_force", "impact_force"} and design.impact is None):
            continue
        unit = QUANTITY_UNITS[name]
        values = [float(quantity_of(name, run.end, design.impact)) for run in runs]
        largest = max(abs(v) for v in values)
        label, symbol = QUANTITY_LABELS[name]
        label = label if ended else label.replace("at contact", "at the end").replace("of contact", "of the end")
        cells = [quantity(0.0 if abs(v) < 1e-9 * largest or abs(v) < 1e-15 else v, unit) for v in values]
        yield (f"{label} {symbol}", *cells, *([_change(*values)] if len(values) > 1 else []))


def _change(value: float, before: float) -> str:
    if not np.isfinite([value, before]).all() or abs(before) < 1e-9 * max(abs(value), 1e-9):
        return "\u2013"
    return f"{100 * (abs(value) / abs(before) - 1):+.1f} %"


def _constraint_row(outcome: ConstraintOutcome) -> Row:
    if outcome.best_value is None:
        state, nearest = "no contact", "\u2013"
    else:
        nearest = f"{quantity(outcome.best_value, outcome.unit)} at {quantity(outcome.best_gain, 'N*s')}"
        exceeded = outcome.margin is not None and outcome.margin < 0 and not outcome.active
        state = "exceeded" if exceeded else "active: holds the optimum" if outcome.active else "met"
        state = state if outcome.achievable else "cannot be met"
    return (
        f"{word(outcome.name)}: {quantity_label(outcome.quantity)}",
        quantity(outcome.limit, outcome.unit),
        quantity(outcome.value, outcome.unit),
        quantity(outcome.margin, outcome.unit),
        state,
        nearest,
    )


def _objective_rows(design: GainDesign) -> Iterator[Row]:
    definition, result = design.definition, design.result
    if isinstance(definition, OwnObjective):
        for name, part in design.objective_parts.items():
            yield quantity_label(name), "\u2013", "\u2013", number(part)
        yield f"f, as {definition.name} computes it", "", "", number(design.objective, 5)
        return
    speed = abs(design.scenario.obstacle.velocity)
    for term, row in zip(definition.terms, objective_rows(definition), strict=True):
        yield *row, number(None if result is None else float(term.value(result.end, speed, design.impact)))
    yield "sum f", "", "", number(design.objective, 5)


def _damping_rows(design: GainDesign) -> Iterator[Row]:
    """Yield D_p g at contact and at the start: what the motion feels of gain and sensor together."""
    run = _shown(design)
    if run is None:
        return
    gain, (low, high) = float(run.gain), design.sensor.valid_range
    for name, distance in (("at contact", 0.0), ("at the start", float(design.scenario.distance))):
        if low <= distance <= high:
            slope = float(design.sensor.log_slope(distance))
            yield (
                f"{name}, l = {quantity(distance, 'm')}",
                quantity(gain, "N*s"),
                quantity(slope, "1/m"),
                quantity(gain * slope, "N*s/m"),
            )


def _certificate_rows(design: GainDesign) -> Iterator[Row]:
    known, low_high = design.certificate, design.bounds
    yield "searched", f"every gain from {quantity(low_high[0], 'N*s')} to {quantity(low_high[1], 'N*s')}"
    if known is None:
        yield "scan", f"{len(design.trade_off.gain)} gains"
    else:
        yield (
            "scan",
            (f"{known.scanned} gains; neighbors predict each to {known.resolution:.1e} of the objective's range"),
        )
        count = len(known.local_minima)
        yield "local minima found and refined", str(count)
        yield "the optimum lies", _AT.get(known.at, f"on the limit of the constraint {word(known.at)}")
        low, high = sorted(known.bracket)
        yield "enclosed between", f"{quantity(low, 'N*s', 8)} and {quantity(high, 'N*s', 8)}"
        if known.stationarity is not None:
            yield "first-order residual |df / d ln|D_p|| / f", f"{known.stationarity:.1e}"
    if design.ideal is not None:
        yield "ideal design, in continuous time", ideal_in_words(design.ideal)
    run = _shown(design)
    if run is not None and solved_on(design) != "loop":
        residual = float(np.asarray(run.impulse_residual))
        missing = "not defined for the uniform motion" if run.method == "uniform-motion" else "not known"
        text = missing if np.isnan(residual) else f"{residual:.1e} of its largest term"
        yield "impulse balance M \u0394x\u2032 + D \u0394x + K \u222bx dt = D_p \u0394 ln \u03be", text


def _minima(design: GainDesign) -> Iterator[Row]:
    if design.certificate is not None and len(design.certificate.local_minima) > 1:
        for gain, value in design.certificate.local_minima:
            yield quantity(gain, "N*s"), number(value, 5)


def _sensitivities(design: GainDesign) -> Iterator[dict[str, str]]:
    """Yield the inputs by their influence, with the share of the largest for a bar."""
    ranked = sorted(design.sensitivities, key=lambda s: abs(s.gain_change_per_percent), reverse=True)
    largest = max((abs(s.gain_change_per_percent) for s in ranked), default=0.0)
    for s in ranked:
        if abs(s.gain_change_per_percent) > 1e-6 * largest or (s.value == 0 and abs(s.gain_derivative) > 1e-9):
            per_unit = f"N s per {s.unit}" if s.unit else "N s"
            yield {
                "name": s.name,
                "value": quantity(s.value, s.unit),
                "derivative": f"{s.gain_derivative:.4g} {per_unit}".replace("*", " ").replace("^2", "\u00b2"),
                "objective": f"{s.objective_derivative:.3g}",
                "change": f"{1e3 * s.gain_change_per_percent:+.3g}" if s.value else "\u2013",
                "share": f"{100 * abs(s.gain_change_per_percent) / largest:.0f}" if largest else "0",
                "sign": "more" if s.gain_change_per_percent < 0 else "less",
            }


def scenario_rows(scenario: Scenario) -> Iterator[Row]:
    """Yield every input of an encounter."""
    a, o, p, r = (getattr(scenario, name) for name in ("admittance", "obstacle", "plant", "reference"))
    yield "admittance: mass M_a", quantity(float(a.mass), "kg")
    yield "admittance: damping D_a", quantity(float(a.damping), "N*s/m")
    yield "admittance: stiffness K_a", quantity(float(a.stiffness), "N/m")
    if a.stiffness > 0:
        yield "natural frequency", quantity(float(a.natural_frequency), "rad/s")
        yield "damping ratio", number(float(a.damping_ratio))
    for name, body in (("obstacle", o), ("plant", p), ("reference", r)):
        yield f"{name}: position", quantity(float(body.position), "m")
        yield f"{name}: velocity", quantity(float(body.velocity), "m/s")
        if hasattr(body, "acceleration"):
            yield f"{name}: acceleration", quantity(float(body.acceleration), "m/s^2")
    yield "distance at the start", quantity(float(scenario.distance), "m")


def _search_rows(design: GainDesign) -> Iterator[Row]:
    yield "gain: bounds", " to ".join(quantity(b, "N*s") for b in design.bounds)
    if design.impact is not None:
        yield "physical mass of the robot", quantity(design.impact.robot_mass, "kg")
        yield "mass of the obstacle", quantity(design.impact.obstacle_mass, "kg")


def sensor_rows(sensor: SensorModel) -> Iterator[Row]:
    """Yield the parameters of a curve and where it holds."""
    yield "curve", sensor.name
    units: dict[str, str] = {}
    part: Any = sensor
    while part is not None:
        units |= {f.name: f.metadata.get("unit", "m") for f in part.__dataclass_fields__.values()}
        yield from [("recessed curve", part.sensor.name)] if hasattr(part, "sensor") else []
        part = getattr(part, "sensor", None)
    for name, value in sensor.parameters.items():
        yield word(name), quantity(value, units.get(name, ""), 6)
    low, high = sensor.valid_range
    yield "valid for distances", f"{quantity(low, 'm')} to {quantity(high, 'm')}"
