"""Create the simulated control loop from a scenario file.

The loop consists of sensor chain, controller, robot and contact.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import caution
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

from .controller import make_controller, refuse_curve_below_floor
from .output_units import refuse_mixed_units
from .robot_section import has_model
from .schema import FREE, LOOP_SECTIONS
from .section import one_of
from .sensor import CALIBRATION

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

    from .reading import Reading

_FITTED: Final = ("noise", "relative_noise", "misfit", "misfit_length", "offset")
_NEEDED: Final = {"chain": 'part = "VCNL4010" or rate = "250 Hz"', "controller": 'rate = "1 kHz"'}


def loop_fields(
    file: Reading,
    scenario: Scenario | None,
    sensor: SensorModel | None,
    calibration: CalibrationReport | None,
) -> dict[str, Any]:
    """Return the task fields that describe the sampled loop.

    The result is empty if the scenario file contains mistakes.
    """
    _refuse_missing_sections(file)
    plant, contact = _plant(file), _contact(file)
    settings = file.settings("loop")
    if "stability_margin" in settings and set(FREE) & set(file.values("admittance") or {}):
        file.refuse(
            ("loop", "stability_margin"),
            "found a margin together with bounds in [admittance], expected [admittance] without bounds: the stability "
            "limit holds for one admittance only",
        )
    if calibration is None and CALIBRATION in (file.values("sensor") or {}):
        return {}  # the fit failed, so that noise and offset are unknown
    part = _part(file)
    refuse_mixed_units(file, part, calibration)
    chain = _chain(file, part, calibration)
    values = file.values("controller")
    if chain is None or scenario is None or values is None:
        return {}
    controller = make_controller(file, values, chain, scenario, isinstance(plant, PositionPlant))
    if controller is None or plant is None:
        return {}
    if sensor is not None:
        refuse_curve_below_floor(file, sensor, controller.conditioning, part)
    options = {name: settings.pop(name) for name in ("seed", "horizon", "follow_time")}
    options["start_distance"] = settings.pop("start_distance", None)
    loop = ClosedLoop(law=controller, chain=chain, plant=plant, contact=contact, **options)
    warnings = tuple(_rate_in_words(chain, part))
    return {"loop": loop, "gain": values.get("gain"), "sensor_part": part, "warnings": warnings, **settings}


def _rate_in_words(chain: SensorChain, part: SensorPart | None) -> Iterator[str]:
    """Yield a warning if the sensor part cannot reach the rate of the chain."""
    if part is not None and chain.rate > part.largest_rate:
        rate, most = (format_quantity(value, "Hz") for value in (chain.rate, part.largest_rate))
        yield caution(
            "PT418",
            f'The {part.name} reaches at most {most}, but the scenario has {rate}: set rate = "{most}" in [chain], or '
            "use a faster sensor. Verdict, gain margin and stability limit hold only at the rate of the scenario.",
        )


def _refuse_missing_sections(file: Reading) -> None:
    """Report a missing sensor chain or controller of the loop."""
    data = file.data
    first = next(name for name in LOOP_SECTIONS if name in data)
    for name, keys in _NEEDED.items():
        if name not in data and name not in file.misspelled:
            file.refuse(
                (first,),
                f"the section [{first}] also needs the section [{name}]; add, for example: [{name}] with {keys}",
            )


def _plant(file: Reading) -> PlantModel | None:
    """Return the robot model of the sampled loop. The result is None if the section [robot] contains mistakes."""
    if "robot" not in file.data or has_model(file.data):
        return IdealPlant()
    plant: PlantModel | None = file.make("robot")
    # computing the coefficients checks that the values fit together
    return None if plant is None or file.attempt("robot", plant.coefficients) is None else plant


def _contact(file: Reading) -> ContactModel | None:
    """Return the contact model of the loop; None if the section [contact] is missing or has mistakes."""
    robot = file.data.get("robot", {} if "robot" in file.misspelled else {"kind": "ideal"})
    robot = {"kind": "ideal"} if has_model(file.data) else robot
    if "contact" in file.data and isinstance(robot, dict) and robot.get("kind") == "ideal":
        file.refuse(
            ("contact",),
            "found a contact model for an ideal robot, which has no mass, expected [robot] with "
            'kind = "impedance" or kind = "position"',
        )
    contact: ContactModel | None = file.make("contact")
    return contact


def _part(file: Reading) -> SensorPart | None:
    name = (file.values("chain") or {}).get("part")
    if name is not None and name not in PARTS:
        file.refuse(("chain", "part"), f'found "{name}", {one_of(name, tuple(PARTS))}')
    return PARTS.get(name or "")


def _chain(file: Reading, part: SensorPart | None, calibration: CalibrationReport | None) -> SensorChain | None:
    """Return the sensor chain: the file has priority over the calibration, and that over the data sheet."""
    values = file.values("chain")
    if values is None or ("part" in values and part is None):
        return None
    merged = {} if part is None else {f.name: getattr(part.chain, f.name) for f in fields(SensorChain)}
    merged |= _fitted(calibration, values.get("rate", merged.get("rate"))) | values
    random = isinstance(values["phase"], str)
    merged |= {"random_phase": random, "phase": 0.0 if random else values["phase"]}
    merged.pop("part", None)
    disturbances = file.make_each("disturbance")
    if disturbances is None:
        return None
    chain = file.attempt("chain", lambda: SensorChain(**merged | {"disturbances": ()}))
    if chain is None or not disturbances:
        return chain
    return file.attempt("disturbance", lambda: replace(chain, disturbances=disturbances))


def _fitted(calibration: CalibrationReport | None, rate: Any) -> dict[str, float]:
    """Return the sensor-chain properties determined by a calibration. Examples are noise and resolution."""
    if calibration is None or calibration.best is None:
        return {}
    chain = chain_of_fit(calibration.best, rate=rate)
    fitted = {name: getattr(chain, name) for name in _FITTED}
    if chain.resolution > 0:
        fitted["resolution"] = chain.resolution
    return fitted | ({"highest": chain.highest} if np.isfinite(chain.highest) else {})
