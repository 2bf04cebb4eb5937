"""What a scenario file says of the sampled loop, as what `simulate` and `gain_limit` take."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch.control import Conditioning, Controller, Limits, VirtualAdmittance, VirtualDamper, VirtualDrag
from pretouch.motion.laws import DRAG
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel
from pretouch.simulation import (
    PARTS,
    ClosedLoop,
    ContactModel,
    IdealPlant,
    PlantModel,
    PositionPlant,
    SensorChain,
    SensorPart,
    chain_of_fit,
)

from .law import sampled_drag
from .quantities import KeyPath, Quantity, output_unit
from .schema import FREE, LOOP_SECTIONS
from .section import one_of
from .sensor import CALIBRATION

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .reading import Reading


def refuse_mixed_units(file: Reading, part: SensorPart | None, calibration: CalibrationReport | None) -> None:
    """Refuse a part and outputs of the loop in another unit than the sensor's; bare numbers are in whichever it is."""
    path, unit = _of_sensor(file, calibration)
    if part is not None and unit and part.unit not in {"", unit}:
        file.refuse(
            ("chain", "part"),
            f"found a part that reports {part.unit} beside a sensor in {unit} ({_named(file, path)}), "
            f"expected one unit in the file: give the curve in {part.unit}, or choose a part that reports {unit}",
        )
        return
    if part is not None and not unit:
        path, unit = ("chain", "part"), part.unit
    for key, found, other in _given(file):
        if not unit:
            path, unit = key, other
        elif other != unit:
            file.refuse(key, f'found "{found}", expected {unit}, the unit of {_named(file, path)}')


def _of_sensor(file: Reading, calibration: CalibrationReport | None) -> tuple[KeyPath, str]:
    """Return where the unit of the sensor stands, and the unit; empty where its outputs are bare."""
    if calibration is not None:
        return ("sensor", "calibration"), calibration.calibration.unit
    sensor = file.data["sensor"] if "sensor" in file.sections else {}
    if "outputs" in sensor:
        units = [output_unit(output) for output in sensor["outputs"]]
        return ("sensor", "outputs"), next(filter(None, units), "")
    return ("sensor", "scale"), output_unit(sensor.get("scale"))


def _given(file: Reading) -> Iterator[tuple[KeyPath, str, str]]:
    """Return the outputs of the loop that name a unit, with their places and units."""
    for section in ("chain", "controller", "law"):
        keys = file.sections[section][0].keys if section in file.sections else {}
        for key, value in file.data[section].items() if keys else ():
            read = keys[key].read
            unit = output_unit(value) if isinstance(read, Quantity) and read.unit.startswith("output") else ""
            if unit:
                yield (section, key), value, unit


def _named(file: Reading, path: KeyPath) -> str:
    line = file.source.lines.get(path)
    return f"{'.'.join(map(str, path))}" + (f", line {line}" if line else "")


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
    law = _law(file, given, chain)
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


def _law(file: Reading, given: Mapping[str, Any], chain: SensorChain) -> VirtualDamper | VirtualDrag | None:
    """Build the sampled law, with a number of 0 where the file names none."""
    if file.kind == DRAG.kind:
        return sampled_drag(file, chain)
    own = {key: given[key] for key in _LAW}
    return file.attempt("controller", lambda: VirtualDamper(gain=given.get("gain", 0.0), **own))


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


_FITTED: Final = ("noise", "relative_noise", "misfit", "misfit_length", "offset")
_NEEDED: Final = {"chain": 'part = "VCNL4010" or rate = "250 Hz"', "controller": 'rate = "1 kHz"'}


def loop_fields(
    file: Reading,
    scenario: Scenario | None,
    sensor: SensorModel | None,
    calibration: CalibrationReport | None,
) -> dict[str, Any]:
    """Return the fields of a task that speak of the loop; none where it has mistakes, which the file keeps."""
    _refuse_a_part_alone(file)
    plant, contact = _plant(file), _contact(file)
    asked = file.settings("loop")
    if "stability_margin" in asked and set(FREE) & set(file.values("admittance") or {}):
        file.refuse(
            ("loop", "stability_margin"),
            "found a margin beside an admittance that is to be chosen, expected [admittance] without bounds: "
            "the limit of stability belongs to one admittance",
        )
    if calibration is None and CALIBRATION in (file.values("sensor") or {}):
        return {}  # the fit failed, and noise and offset with it
    part = _part(file)
    refuse_mixed_units(file, part, calibration)
    chain = _chain(file, part, calibration)
    given = file.values("controller")
    if chain is None or scenario is None or given is None:
        return {}
    controller = controller_of(file, given, chain, scenario, isinstance(plant, PositionPlant))
    if controller is None or plant is None:
        return {}
    if sensor is not None:
        refuse_a_curve_below_the_floor(file, sensor, controller.conditioning, part)
    ways = {name: asked.pop(name) for name in ("seed", "horizon", "follow")}
    loop = ClosedLoop(law=controller, chain=chain, plant=plant, contact=contact, **ways)
    return {"loop": loop, "gain": given.get("gain"), "part": part, **asked}


def _refuse_a_part_alone(file: Reading) -> None:
    """A loop has a chain and a controller; all else of it may be left out."""
    data = file.data
    first = next(name for name in LOOP_SECTIONS if name in data)
    for name, keys in _NEEDED.items():
        if name not in data and name not in file.meant:
            file.refuse((first,), f"found no [{name}] beside it, expected [{name}] with {keys}")


def _plant(file: Reading) -> PlantModel | None:
    """Build the robot; None where it has a mistake."""
    if "robot" not in file.data:
        return IdealPlant()
    plant: PlantModel | None = file.made("robot")
    # its checks of what does not go together
    return None if plant is None or file.attempt("robot", plant.coefficients) is None else plant


def _contact(file: Reading) -> ContactModel | None:
    """Build the contact; None where the file has none, or a mistake in it."""
    robot = file.data.get("robot", {} if "robot" in file.meant else {"kind": "ideal"})
    if "contact" in file.data and isinstance(robot, dict) and robot.get("kind") == "ideal":
        file.refuse(
            ("contact",),
            "found a contact of an ideal robot, which has no mass that a force could act on, expected [robot] with "
            'kind = "impedance" or kind = "position"',
        )
    contact: ContactModel | None = file.made("contact")
    return contact


def _part(file: Reading) -> SensorPart | None:
    name = (file.values("chain") or {}).get("part")
    if name is not None and name not in PARTS:
        file.refuse(("chain", "part"), f'found "{name}", {one_of(name, tuple(PARTS))}')
    return PARTS.get(name or "")


def _chain(file: Reading, part: SensorPart | None, calibration: CalibrationReport | None) -> SensorChain | None:
    """Build the chain: what the file says, then what the calibration knows, then what the part has."""
    given = file.values("chain")
    if given is None or ("part" in given and part is None):
        return None
    known = {} if part is None else {f.name: getattr(part.chain, f.name) for f in fields(SensorChain)}
    known |= _fitted(calibration, given.get("rate", known.get("rate"))) | given
    random = isinstance(given["phase"], str)
    known |= {"random_phase": random, "phase": 0.0 if random else given["phase"]}
    known.pop("part", None)
    return file.attempt("chain", lambda: SensorChain(**known))


def _fitted(calibration: CalibrationReport | None, rate: Any) -> dict[str, float]:
    """Return what a calibration tells of a chain; steps and saturation only where it has found them."""
    if calibration is None or calibration.best is None:
        return {}
    chain = chain_of_fit(calibration.best, rate=rate)
    found = {name: getattr(chain, name) for name in _FITTED}
    if chain.resolution > 0:
        found["resolution"] = chain.resolution
    return found | ({"highest": chain.highest} if np.isfinite(chain.highest) else {})
