"""What a scenario file says of the sampled loop, as what `simulate` and `gain_limit` take."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np

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

from .loop_law import controller_of, refuse_a_curve_below_the_floor
from .output_units import refuse_mixed_units
from .schema import FREE, LOOP_SECTIONS
from .section import one_of
from .sensor_sections import CALIBRATION

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .reading import Reading

__all__ = ["loop_fields"]

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
