"""Create the sampled controller from the section `[controller]` of a scenario file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch.control import Conditioning, Controller, Law, Limits, VirtualAdmittance, VirtualDamper
from pretouch.control.laws import release_for_noise
from pretouch.motion.laws import DAMPER, DRAG
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import SensorChain, SensorPart

from .law import sampled_drag, sampled_law

if TYPE_CHECKING:
    from .reading import Reading

_FLOOR: Final = 3.0  # default floor, in standard deviations of the noise
_SAME: Final = 1e-9  # relative difference of two equal periods, from the rounding of 1 / rate
_LIMITS: Final = ("force", "speed", "acceleration", "excursion")
_FILTERS: Final = ("median_window", "moving_average", "low_pass_order", "cutoff")
_CONDITIONING: Final = (*_FILTERS, "timeout", "fade_time", "largest_rate")
_LAW: Final = ("approach_only", "release", "ramp_time")


def make_controller(
    file: Reading, values: Mapping[str, Any], chain: SensorChain, scenario: Scenario, positioned: bool
) -> Controller | None:
    """Build the controller and check its initial state."""
    period = 1 / values["rate"] if "rate" in values else values["period"]
    sensing = _conditioning(file, values, chain, period)
    law = _law(file, values, chain)
    largest = {name: values.get(f"largest_{name}") for name in _LIMITS}
    limits = file.attempt("controller", lambda: Limits(**largest))
    if sensing is None or law is None or limits is None:
        return None
    virtual = scenario.admittance

    def make() -> Controller:
        controller = Controller(
            period=period,
            conditioning=sensing,
            law=law,
            admittance=VirtualAdmittance(mass=virtual.mass, damping=virtual.damping, stiffness=virtual.stiffness),
            limits=limits,
            # a position-controlled robot does not yield to a contact force by itself
            contact_gain=values.get("contact_gain", 1.0 if positioned else 0.0),
            contact_threshold=values["contact_threshold"],
        )
        start, reference = scenario.plant, scenario.reference
        controller.start(start.position - reference.position, start.velocity - reference.velocity)
        return controller

    return file.attempt("controller", make)


def _law(file: Reading, values: Mapping[str, Any], chain: SensorChain) -> Law | None:
    """Return the sampled control law of a scenario file. Its gain is 0 if the scenario file has no gain."""
    if file.law == DRAG:
        return sampled_drag(file, chain)
    if file.law != DAMPER:
        return sampled_law(file)
    options = _release(values, chain) | {key: values[key] for key in _LAW if key in values}
    return file.attempt("controller", lambda: VirtualDamper(gain=values.get("gain", 0.0), **options))


def _release(values: Mapping[str, Any], chain: SensorChain) -> dict[str, float]:
    """Return the default release of the virtual damper, if the noise of the readings is known."""
    floor, noise = values.get("floor", _FLOOR * chain.noise), chain.additive_noise
    known = (chain.noise > 0 or chain.relative_noise > 0) and not chain.measures_distance
    if not (values["approach_only"] and known and floor > 0):
        return {}
    return {"release": release_for_noise(floor, noise, chain.relative_noise)}


def _conditioning(file: Reading, values: Mapping[str, Any], chain: SensorChain, period: float) -> Conditioning | None:
    if chain.period < period * (1 - _SAME):
        file.refuse(
            ("controller", "rate" if "rate" in values else "period"),
            f"the controller runs at {1 / period:g} Hz, but needs at least {chain.rate:g} Hz, the rate of the "
            f'sensor. Raise the controller rate, or read the sensor less often: set rate = "{1 / period:g} Hz" '
            "in the section [chain]",
        )
    slower = chain.period > period * (1 + _SAME)
    floor = values.get("floor", _FLOOR * chain.noise)
    if "floor" not in values and not floor > 0:
        file.refuse(
            ("controller", "floor"),
            "the floor is missing. The floor is the smallest sensor output that counts as an object. Its default is "
            f"{_FLOOR:g} standard deviations of the noise, but the section [chain] has no noise. Add a floor above "
            "drift and background reflections, for example: floor = 30.0",
        )
    if chain.period < period * (1 - _SAME) or not floor > 0:
        return None
    offset, saturation = values.get("offset", chain.offset + chain.crosstalk), values.get("saturation")
    if saturation is None and np.isfinite(chain.highest):
        saturation = chain.highest
        if saturation <= offset + floor:
            file.refuse(
                ("chain", "highest"),
                f"the readings saturate at {saturation:g}, expected more than {offset + floor:g}, the sum of the "
                "controller's offset and floor. Both numbers are in the unit of the sensor output",
            )
            return None
    return file.attempt(
        "controller",
        lambda: Conditioning(
            floor=floor,
            offset=offset,
            saturation=saturation,
            sensor_period=chain.period if slower else period,
            **{key: values[key] for key in _CONDITIONING if key in values},
        ),
    )


def refuse_curve_below_floor(
    file: Reading, sensor: SensorModel, conditioning: Conditioning, part: SensorPart | None
) -> None:
    """Report a sensor output below the controller's detection threshold.

    The output at contact is checked. Below the threshold, the controller would ignore the object.
    """
    if not sensor.contains(0.0):
        return  # another check refuses this curve
    log_output = float(sensor.log_output(0.0))  # its exponential may overflow
    if log_output > math.log(conditioning.floor):
        return
    unit = f"{part.unit}, the unit of {part.name}" if part is not None and part.unit else "the same unit"
    key = next(k for k in ("scale", "outputs", "calibration") if k in file.data["sensor"])
    file.refuse(
        ("sensor", key),
        f"the sensor output at contact is {math.exp(log_output):.4g}, which is below the controller's "
        f"floor of {conditioning.floor:.4g}. To detect the object, the controller needs outputs well above the floor. "
        f"Give outputs, noise and floor in {unit}",
    )
