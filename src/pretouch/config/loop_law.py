"""The controller of a scenario file: what it says, and what follows from the chain, the encounter and the robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch.control import Conditioning, Controller, Limits, VirtualAdmittance, VirtualDamper
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import SensorChain, SensorPart

if TYPE_CHECKING:
    from .reading import Reading

__all__ = ["controller_of", "refuse_a_curve_below_the_floor"]

_FLOOR: Final = 3.0  # standard deviations of the noise
_SAME: Final = 1e-9  # relative: two periods that differ by the rounding of 1 / rate
_LIMITS: Final = ("force", "speed", "acceleration", "excursion")
_CONDITIONING: Final = ("median_window", "low_pass_order", "cutoff", "timeout", "fade_time", "largest_rate")
_LAW: Final = ("approach_only", "release", "ramp_time")


def controller_of(
    file: Reading, given: Mapping[str, Any], chain: SensorChain, scenario: Scenario, positioned: bool
) -> Controller | None:
    """Build the controller, with a gain of 0 where the file names none, checked with the start of the encounter."""
    period = 1 / given["rate"] if "rate" in given else given["period"]
    sensing = _conditioning(file, given, chain, period)
    own = {key: given[key] for key in _LAW}
    law = file.attempt("controller", lambda: VirtualDamper(gain=given.get("gain", 0.0), **own))
    largest = {name: given.get(f"largest_{name}") for name in _LIMITS}
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
            # a robot that is position-controlled feels no contact force itself
            contact_gain=given.get("contact_gain", 1.0 if positioned else 0.0),
            contact_threshold=given["contact_threshold"],
        )
        start, reference = scenario.plant, scenario.reference
        controller.start(start.position - reference.position, start.velocity - reference.velocity)
        return controller

    return file.attempt("controller", make)


def _conditioning(file: Reading, given: Mapping[str, Any], chain: SensorChain, period: float) -> Conditioning | None:
    if chain.period < period * (1 - _SAME):
        file.refuse(
            ("controller", "rate" if "rate" in given else "period"),
            f"found {1 / period:g} Hz, slower than the sensor with its {chain.rate:g} Hz, expected at least that; "
            f'or read the sensor as often as the loop runs: [chain] with rate = "{1 / period:g} Hz"',
        )
    slower = chain.period > period * (1 + _SAME)
    floor = given.get("floor", _FLOOR * chain.noise)
    if "floor" not in given and not floor > 0:
        file.refuse(
            ("controller", "floor"),
            "missing, expected a sensor output above drift and what the scene reflects, since the chain has no noise "
            f"that it could be {_FLOOR:g} times of; add, for example: floor = 30.0",
        )
    if chain.period < period * (1 - _SAME) or not floor > 0:
        return None
    offset, saturation = given.get("offset", chain.offset + chain.crosstalk), given.get("saturation")
    if saturation is None and np.isfinite(chain.highest):
        saturation = chain.highest
        if saturation <= offset + floor:
            file.refuse(
                ("chain", "highest"),
                f"found readings that saturate at {saturation:g}, expected more than the controller's offset and floor "
                f"together, {offset + floor:g}",
            )
            return None
    return file.attempt(
        "controller",
        lambda: Conditioning(
            floor=floor,
            offset=offset,
            saturation=saturation,
            sensor_period=chain.period if slower else period,
            **{key: given[key] for key in _CONDITIONING if key in given},
        ),
    )


def refuse_a_curve_below_the_floor(
    file: Reading, sensor: SensorModel, conditioning: Conditioning, part: SensorPart | None
) -> None:
    """Refuse a curve whose scale is not that of the readings, on which a loop depends, unlike a design."""
    if not sensor.contains(0.0):
        return  # which is a mistake of its own
    log_output = float(sensor.log_output(0.0))  # its exponential may be beyond all numbers
    if log_output > math.log(conditioning.floor):
        return
    unit = f" in {part.unit}, which {part.name} reports," if part is not None and part.unit else ""
    key = next(k for k in ("scale", "outputs", "calibration") if k in file.data["sensor"])
    file.refuse(
        ("sensor", key),
        f"found an output of {math.exp(log_output):.4g} at contact, which the controller's floor of "
        f"{conditioning.floor:.4g} hides, expected outputs{unit} well above it: in a loop the scale of the curve "
        "counts, since noise and floor have its unit",
    )
