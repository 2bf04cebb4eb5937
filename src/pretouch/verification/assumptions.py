"""What a verdict rests on: sensor chain, controller, robot, contact, what is uncertain, what is left out."""

from __future__ import annotations

from pretouch._core.units import format_quantity
from pretouch.control import Controller
from pretouch.design import ImpactModel
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, HuntCrossley, ImpedancePlant, PositionPlant, SpringDamper
from pretouch.uncertainty import Uncertainty
from pretouch.uncertainty.describing import uncertainty_in_words

from .elastic import ElasticImpact
from .timing import fills_period, told_period

__all__ = ["assumptions_of"]


def assumptions_of(
    loop: ClosedLoop,
    sensor: SensorModel,
    uncertainty: Uncertainty | None,
    *,
    impact: ImpactModel | None,
    runs: int,
    compared: int,
) -> tuple[str, ...]:
    """Say what a verdict rests on.

    Args:
        loop: the loop.
        sensor: the sensor curve.
        uncertainty: what is known of inputs.
        impact: the impact that is predicted with.
        runs: how many runs.
        compared: how many of them changes and gains are compared by.

    Returns:
        Sentences.
    """
    said = [
        _sensor(loop),
        _noise(loop),
        _controller(loop),
        _robot(loop),
        _contact(loop, impact),
        *_uncertain(sensor, uncertainty),
        _runs(runs, compared, loop.seed),
        "Predicted is the nominal encounter in continuous time with a perfect sensor, the robot following exactly.",
        "Stability is that of the loop linearized at each distance of the nominal curve, without noise, misfit, "
        "jitter, limits and friction.",
        "Left out: whatever changes the sensor curve (color, shape and angle of the object, other light) beyond what "
        "is named as uncertain, elasticity between drive and contact surface, and contact elsewhere on the robot.",
    ]
    return tuple(text for text in said if text)


def _runs(runs: int, compared: int, seed: int) -> str:
    if runs == 1:
        return f"Runs: a single one, of seed {seed}; other gains and changes meet the same noise."
    first = f" in the first {compared} of them" if compared < runs else ""
    return f"Runs: {runs}, independent, from seed {seed}; other gains and changes meet the same noise{first}."


def _sensor(loop: ClosedLoop) -> str:
    c = loop.chain
    over = "its whole period" if fills_period(c) else format_quantity(c.exposure, "s") if c.exposure else ""
    text = f"Sensor: {c.rate:.6g} readings per second"
    text += f", each averaged over {over}" if over else ", each of an instant"
    text += f", handed over {format_quantity(c.delay, 's')} later" if c.delay else ", handed over at once"
    text += f"; it starts {format_quantity(c.phase, 's')} after the encounter" if c.phase else ""
    phase = "another phase of its period in each run" if c.random_phase else "the same phase of its period in every run"
    text += f"; {phase}"
    text += f", jitter {format_quantity(c.jitter, 's')}" if c.jitter else ""
    return text + ("; it measures distances, from which its driver makes xi." if c.reports_distance else ".")


def _noise(loop: ClosedLoop) -> str:
    c, parts = loop.chain, []
    for value, text in (
        (c.noise, f"standard deviation {c.noise:.3g} in the unit of xi"),
        (c.relative_noise, f"standard deviation {100 * c.relative_noise:.3g} % of xi"),
        (c.distance_noise, f"standard deviation {format_quantity(c.distance_noise, 'm')} of the distance"),
        (c.resolution, f"steps of {c.resolution:.3g} in the unit of xi"),
        (c.distance_resolution, f"steps of {format_quantity(c.distance_resolution, 'm')}"),
        (c.offset + c.crosstalk, f"a pedestal of {c.offset + c.crosstalk:.3g} in the unit of xi"),
        (c.drift, f"drifting by {c.drift:.3g} per second"),
        (c.dropout, f"{100 * c.dropout:.3g} % of the readings missing"),
    ):
        parts += [text] if value else []
    text = "Readings: without noise, steps, pedestal and dropouts."
    if parts:
        text = f"Readings: {', '.join(parts)}; noise independent from reading to reading and normal."
    if not c.misfit:
        return text
    return (
        f"{text} The sensor lies off its curve by a standard deviation of {100 * c.misfit:.3g} % of xi, another error "
        f"in each run and the same in all its readings, alike over {format_quantity(c.misfit_length, 'm')} of distance."
    )


def _controller(loop: ClosedLoop) -> str:
    law = loop.law
    text = f"Controller: a step every {format_quantity(law.period, 's')}"
    if not isinstance(law, Controller):
        return text + "; what it does with a reading is its own."
    c, limits = law.conditioning, law.limits
    text += (
        f", told of a reading every {format_quantity(told_period(law), 's')}; floor {c.floor:.3g} above an offset of "
    )
    text += f"{c.offset:.3g}"
    text += f", median over {c.median_window} readings" if c.median_window > 1 else ", no median"
    if c.low_pass_order and c.cutoff is not None:
        text += f", low-pass of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}"
    else:
        text += ", no low-pass"
    rate = c.largest_rate
    text += "" if rate is None else f", readings that need more than {format_quantity(rate, '1/s')} not used"
    named = (
        ("force", limits.force, "N"),
        ("speed", limits.speed, "m/s"),
        ("acceleration", limits.acceleration, "m/s^2"),
        ("excursion", limits.excursion, "m"),
    )
    bounded = [f"{name} {format_quantity(value, unit)}" for name, value, unit in named if value is not None]
    return text + (f"; limited to {', '.join(bounded)}." if bounded else "; no limits.")


def _robot(loop: ClosedLoop) -> str:
    plant = loop.plant
    mass = plant.coefficients()[0]
    if mass == 0:
        return "Robot: ideal, it is where the controller wants it."
    text = f"Robot: {format_quantity(mass, 'kg')} of physical reflected mass"
    if isinstance(plant, ImpedancePlant):
        text += f", pulled by {format_quantity(plant.stiffness, 'N/m')} and {format_quantity(plant.damping, 'N*s/m')}"
        finite = plant.bandwidth < float("inf")
        text += f" through a servo of {format_quantity(plant.bandwidth, 'Hz')}" if finite else " without servo lag"
        friction = plant.coulomb_friction
        text += f", {format_quantity(friction, 'N')} of Coulomb friction" if friction else ""
    elif isinstance(plant, PositionPlant):
        text += f", position-controlled with a bandwidth of {format_quantity(plant.bandwidth, 'Hz')}"
        text += f" and a damping ratio of {plant.damping_ratio:.3g}"
    return text + "."


def _contact(loop: ClosedLoop, impact: ImpactModel | None) -> str:
    contact = loop.contact
    if contact is None:
        text = "Contact: no force is simulated"
        return text + ("; an impact model makes one of the speed of contact." if impact is not None else ".")
    met = "driven on" if contact.obstacle_mass == float("inf") else format_quantity(contact.obstacle_mass, "kg")
    if isinstance(contact, HuntCrossley):
        text = f"Contact: {contact.stiffness:.3g} N/m^{contact.exponent:g}, dissipation {contact.dissipation:.3g} s/m"
    elif isinstance(contact, SpringDamper):
        text = f"Contact: {contact.stiffness:.3g} N/m and {contact.damping:.3g} N s/m"
    else:
        text = f"Contact: {type(contact).__name__}"
    text += f", obstacle {met}; followed for {format_quantity(loop.follow, 's')}. "
    if isinstance(impact, ElasticImpact):
        text += "The predicted impact force is that of the same stiffness without loss on the robot's mass alone"
    else:
        text += "The predicted impact force is that of the impact model that was given"
    return text + "; loss in the contact lowers the simulated one, the robot's drive and a driven obstacle raise it."


def _uncertain(sensor: SensorModel, uncertainty: Uncertainty | None) -> list[str]:
    if not uncertainty:
        return ["Encounter: the nominal one in every run; nothing of it is uncertain."]
    return [f"Uncertain: {name} {text}." for name, text in uncertainty_in_words(uncertainty, sensor)]
