"""What a sampled loop is made of, as rows of text with units: sensor chain, controller, robot, contact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pretouch.control import Controller, VirtualDamper
from pretouch.simulation import (
    ClosedLoop,
    ContactModel,
    HuntCrossley,
    IdealPlant,
    ImpedancePlant,
    PlantModel,
    PositionPlant,
    SensorChain,
    SpringDamper,
)
from pretouch.simulation.law import SampledLaw

from .wording import number, quantity

__all__ = ["chain_rows", "contact_rows", "controller_rows", "loop_rows", "robot_rows"]

Row = tuple[str, ...]

_XI: Final = "unit of \u03be"


def loop_rows(loop: ClosedLoop) -> Iterator[Row]:
    """Yield how runs of a loop are drawn and how long they last."""
    yield "seed of the noise", str(loop.seed)
    yield "waits for contact", quantity(loop.horizon, "s")
    if loop.contact is not None:
        yield "goes on after the first contact", quantity(loop.follow, "s")


def chain_rows(chain: SensorChain) -> Iterator[Row]:
    """Yield the parameters of a sensor chain, those that are zero and need not be left out."""
    yield "readings", f"{quantity(chain.rate, 'Hz')}, one every {quantity(chain.period, 's')}"
    if chain.random_phase:
        yield "first exposure", "at another instant of the period in each run"
    elif chain.phase:
        yield "first exposure", f"after {quantity(chain.phase, 's')}"
    yield "exposure", quantity(chain.exposure, "s")
    yield "delay after the exposure", quantity(chain.delay, "s")
    yield "age of a new reading", f"{quantity(chain.latency, 's')}, from the middle of its exposure"
    if chain.reports_distance:
        yield "reports", "a distance, which its driver turns into \u03be by the curve"
        yield "noise of the distance", quantity(chain.distance_noise, "m")
        yield "step of the distance", quantity(chain.distance_resolution, "m")
    yield "noise without a signal", _output(chain.noise)
    yield "noise relative to \u03be", f"{number(100 * chain.relative_noise)} %"
    if chain.misfit:
        alike = f"alike over {quantity(chain.misfit_length, 'm')} of distance"
        yield "misfit of the curve relative to \u03be", f"{number(100 * chain.misfit)} %, another in each run, {alike}"
    for label, value in (("ambient offset", chain.offset), ("crosstalk", chain.crosstalk), ("step", chain.resolution)):
        if value:
            yield label, _output(value)
    if chain.drift:
        yield "drift", f"{number(chain.drift)} [{_XI} per s]"
    if math.isfinite(chain.lowest) or math.isfinite(chain.highest):
        yield "clips", f"below {number(chain.lowest, 6)} and above {_output(chain.highest)}"
    if chain.jitter:
        yield "jitter of an exposure", quantity(chain.jitter, "s")
    if chain.dropout:
        yield "readings that are missing", f"{number(100 * chain.dropout)} %"


def _output(value: float) -> str:
    return f"{number(value, 6)} [{_XI}]"


def controller_rows(law: SampledLaw) -> Iterator[Row]:
    """Yield the parameters of a controller, its gain left out; of any other law its name and its period."""
    yield "law", type(law.law if isinstance(law, Controller) else law).__name__
    yield "period", quantity(law.period, "s")
    if not isinstance(law, Controller):
        return
    if isinstance(law.law, VirtualDamper):
        if law.law.approach_only:
            yield "damps", f"approaches alone, with a release of {number(law.law.release)} in ln \u03be"
        if law.law.ramp_time:
            yield "ramp of the gain", quantity(law.law.ramp_time, "s")
    yield from _conditioning_rows(law)
    a = law.admittance
    yield "virtual mass M_a", quantity(a.mass, "kg")
    yield "virtual damping D_a", quantity(a.damping, "N*s/m")
    yield "virtual stiffness K_a", quantity(a.stiffness, "N/m")
    limits = law.limits
    for label, value, unit in (
        ("largest virtual force", limits.force, "N"),
        ("largest speed", limits.speed, "m/s"),
        ("largest acceleration", limits.acceleration, "m/s^2"),
        ("largest excursion", limits.excursion, "m"),
    ):
        if value is not None:
            yield f"limit: {label}", quantity(value, unit)
    yield "share of the contact force in the admittance", number(law.contact_gain)
    yield "reports a contact from", quantity(law.contact_threshold, "N")


def _conditioning_rows(law: Controller) -> Iterator[Row]:
    """Yield what is done to a reading before its logarithm is differenced."""
    c, used = law.conditioning, law.conditioning.numbers(law.period)
    yield "expects a reading every", quantity(used.sensor_period, "s")
    yield "offset taken off", _output(c.offset)
    yield "floor", f"{_output(c.floor)}: what is below is taken for nothing there"
    if c.saturation is not None:
        yield "saturated from", _output(c.saturation)
    yield "running median", f"over {c.median_window} readings" if c.median_window > 1 else "none"
    if c.low_pass_order and c.cutoff is not None:
        yield "low-pass", f"Butterworth of order {c.low_pass_order} at {quantity(c.cutoff, 'Hz')}"
    else:
        yield "low-pass", "none"
    yield "sensor lost after", quantity(used.timeout, "s")
    if c.largest_rate is not None:
        yield "largest |d ln \u03be/dt| that is believed", quantity(c.largest_rate, "1/s")


_COEFFICIENT_UNITS: Final = (
    ("mass", "kg"),
    ("stiffness", "N/m"),
    ("damping on the reference's velocity", "N*s/m"),
    ("damping on its own velocity", "N*s/m"),
    ("feedforward mass", "kg"),
    ("rate of the servo", "1/s"),
    ("Coulomb friction", "N"),
    ("speed of the friction", "m/s"),
)


def robot_rows(plant: PlantModel) -> Iterator[Row]:
    """Yield the parameters of a robot; of a class that is not known here, its coefficients."""
    if isinstance(plant, IdealPlant):
        yield "robot", "ideal: it follows the virtual object exactly and has no mass"
    elif isinstance(plant, ImpedancePlant):
        yield "robot", "a mass behind an impedance controller"
        yield "physical mass m", quantity(plant.mass, "kg")
        yield "stiffness K_c", quantity(plant.stiffness, "N/m")
        yield "damping D_c", quantity(plant.damping, "N*s/m")
        yield "bandwidth of the force servo", quantity(plant.bandwidth, "Hz")
        yield "viscous friction", quantity(plant.viscous_friction, "N*s/m")
        yield "Coulomb friction", quantity(plant.coulomb_friction, "N")
        yield "acceleration fed forward", "yes" if plant.feedforward else "no"
    elif isinstance(plant, PositionPlant):
        yield "robot", "position-controlled: a lag of second order"
        yield "physical mass m", quantity(plant.mass, "kg")
        yield "bandwidth", quantity(plant.bandwidth, "Hz")
        yield "damping ratio", number(plant.damping_ratio)
    else:
        yield "robot", type(plant).__name__
        for (label, unit), value in zip(_COEFFICIENT_UNITS, plant.coefficients(), strict=True):
            yield label, quantity(value, unit)


def contact_rows(contact: ContactModel | None) -> Iterator[Row]:
    """Yield the parameters of a contact force; of a class that is not known here, what the loop is handed."""
    if contact is None:
        yield "contact", "no contact force: a run ends at the touch"
        return
    if isinstance(contact, HuntCrossley):
        yield "contact", "Hunt and Crossley: F = k \u03b4\u207f (1 + a \u03b4\u2032)"
        yield "stiffness k", quantity(contact.stiffness, "N/m^n")
        yield "exponent n", number(contact.exponent)
        yield "dissipation a", quantity(contact.dissipation, "s/m")
    elif isinstance(contact, SpringDamper):
        yield "contact", "spring and damper: F = max(0, k \u03b4 + c \u03b4\u2032)"
        yield "stiffness k", quantity(contact.stiffness, "N/m")
        yield "damping c", quantity(contact.damping, "N*s/m")
    else:
        stiffness, damping, exponent, grows, _ = contact.numbers()
        yield "contact", type(contact).__name__
        yield "stiffness", quantity(stiffness, "N/m^n")
        yield "exponent", number(exponent)
        yield "damping", f"{number(damping)}, {'which grows with depth' if grows else 'the same at any depth'}"
    driven = math.isinf(contact.obstacle_mass)
    yield "obstacle", "driven: it does not yield" if driven else f"of {quantity(contact.obstacle_mass, 'kg')}"
