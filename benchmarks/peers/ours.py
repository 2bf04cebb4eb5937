"""pretouch, through its public names only."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from .protocol import Job, Way
from .work import (
    BOUNDS,
    DAMPING,
    DISTANCE,
    EXCURSION,
    LATEST,
    MASS,
    POSITION_SCALE,
    SENSORS,
    STIFFNESS,
    VELOCITY_SCALE,
    Column,
)

__all__ = ["Pretouch", "scenario", "sensor_named"]


class Pretouch:
    """The package itself."""

    name = "pretouch"

    def available(self) -> str:
        """Return an empty reason."""
        return ""

    def cases(self) -> Sequence[Way]:
        """Return its ways: the same for every curve."""
        ways = []
        for sensor in SENSORS:
            on = partial(Way, sensor=sensor)
            ways += [
                on(name="find_contact", cases="B", make=partial(_contacts, sensor), tolerance=1e-9, grows=True),
                on(name="design_gain", cases="AD", make=partial(_one_by_one, sensor), tolerance=1e-7),
                on(name="design_gain", cases="C", make=partial(_designs, sensor), tolerance=1e-7),
                on(name="design_gain", cases="E", make=partial(_limited, sensor), tolerance=1e-7),
                on(name="find_contact", cases="F", make=partial(_drag_contacts, sensor), tolerance=1e-9),
                on(name="design_gain, each alone", cases="C", make=partial(_scattered, sensor), tolerance=1e-7),
            ]
        return ways


def sensor_named(name: str) -> Any:
    """Return a sensor of Table I."""
    import pretouch as pt  # noqa: PLC0415

    if name == "exponential-1":
        return pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)
    return pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)


def scenario(velocity: Any) -> Any:
    """Return the encounter of the cases, or an array of them."""
    import pretouch as pt  # noqa: PLC0415

    return pt.Scenario(
        admittance=pt.Admittance(mass=MASS, damping=DAMPING, stiffness=STIFFNESS),
        obstacle=pt.Obstacle(position=DISTANCE, velocity=velocity),
    )


def _design(encounter: Any, sensor: Any, constraints: Any = ()) -> Any:
    import pretouch as pt  # noqa: PLC0415

    objective = pt.excursion_objective(position_scale=POSITION_SCALE, velocity_scale=VELOCITY_SCALE)
    design = pt.design if callable(pt.design) else pt.design_gain  # in earlier builds, `design` is a folder
    return design(pt.Task(encounter, sensor, objective, bounds=BOUNDS, constraints=constraints)).gain


def _contacts(name: str, v: Column, gain: Column) -> Job:
    from pretouch import find_contact  # noqa: PLC0415

    sensor, encounters = sensor_named(name), scenario(v if len(v) > 1 else float(v[0]))
    gains: Any = gain if len(gain) > 1 else float(gain[0])

    def job() -> Column:
        import numpy as np  # noqa: PLC0415

        return np.atleast_1d(find_contact(encounters, sensor, gains).contact.time)

    return job


def _one_by_one(name: str, v: Column) -> Job:
    import numpy as np  # noqa: PLC0415

    sensor, encounters = sensor_named(name), [scenario(velocity) for velocity in v.tolist()]
    return lambda: np.array([_design(encounter, sensor) for encounter in encounters])


def _scattered(name: str, v: Column) -> Job:
    """Return the same designs for encounters that also differ in a second input, by a unit of rounding."""
    import numpy as np  # noqa: PLC0415

    from pretouch import Admittance, Obstacle, Scenario  # noqa: PLC0415

    damping = DAMPING * (1 + 2.0**-52 * (np.arange(len(v)) % 2))
    encounters = Scenario(
        admittance=Admittance(mass=MASS, damping=damping, stiffness=STIFFNESS),
        obstacle=Obstacle(position=DISTANCE, velocity=v),
    )
    sensor = sensor_named(name)
    return lambda: np.asarray(_design(encounters, sensor), dtype=np.float64)


def _designs(name: str, v: Column) -> Job:
    import numpy as np  # noqa: PLC0415

    sensor, encounters = sensor_named(name), scenario(v)
    return lambda: np.asarray(_design(encounters, sensor), dtype=np.float64)


def _limited(name: str, v: Column) -> Job:
    import numpy as np  # noqa: PLC0415

    from pretouch import Constraint  # noqa: PLC0415

    limits = [Constraint(name="excursion", limit=EXCURSION), Constraint(name="time", limit=LATEST)]
    sensor, encounters = sensor_named(name), scenario(v if len(v) > 1 else float(v[0]))
    return lambda: np.atleast_1d(np.asarray(_design(encounters, sensor, limits), dtype=np.float64))


def _drag_contacts(name: str, v: Column, drag: Column) -> Job:
    import numpy as np  # noqa: PLC0415

    from pretouch import find_contact  # noqa: PLC0415
    from pretouch.motion import DRAG  # noqa: PLC0415

    sensor, encounters = sensor_named(name), scenario(v)
    return lambda: np.asarray(find_contact(encounters, sensor, drag, law=DRAG).contact.time)
