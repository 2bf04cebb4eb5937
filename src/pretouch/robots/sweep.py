"""Simulate robots that meet a ball in many postures and directions.

An interrupted sweep can be resumed.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, finite, positive
from pretouch.simulation.result import whole
from pretouch.sweeps.axes import Axis
from pretouch.sweeps.executors import Progress
from pretouch.sweeps.grid import Columns, Grid, Region
from pretouch.sweeps.record import identify_sensor, spoken
from pretouch.sweeps.results import STATUS
from pretouch.sweeps.run import run_sweep

from .dynamics import drivetrain_of, falls
from .encounter import HORIZON, simulate_robot
from .model import Model, make_data, mujoco, site_index, unit_of_joint
from .result import QUANTITIES, RobotSimulation, touches_elsewhere
from .robot_file import RobotFile, load_model
from .scene import MASS, RADIUS, Ball, model_with_ball, put_ball
from .site_law import SiteLaw
from .tracking import ComputedTorque, Tracking

ENCOUNTER: Final = "encounter"
"""Name of the axis of a sweep of simulated encounters of a robot."""

_STATUSES: Final = ("contact", "no_contact", "refused", "touched_elsewhere")
_CHUNK: Final = 8  # encounters, which take a few seconds
_PREDICTED: Final = "predicted_"
_ROBOT_FORCE: Final = "robot_force"
_UNITS: Final = {
    "time": ("time of contact", "s"),
    "relative_velocity": ("relative velocity at contact", "m/s"),
    "peak_force": ("peak contact force", "N"),
    "impulse": ("impulse of the contact forces", "N s"),
    "excursion": ("largest excursion", "m"),
    "energy": ("energy of the impact", "J"),
    "axis_turn": ("turn of the axis of the sensor until contact", "rad"),
    "sideways": ("motion of the site across its axis until contact", "m"),
    "saturated": ("time until contact with a drive at its limit", "s"),
    _ROBOT_FORCE: ("peak contact force on the whole robot", "N"),
}
_RESULTS: Final = (*_UNITS, *(_PREDICTED + name for name in QUANTITIES))
_DEFAULT: Final = (
    *("relative_velocity", "peak_force", _ROBOT_FORCE, "excursion"),
    *("predicted_relative_velocity", "predicted_excursion"),
)
_OBJECT: Final[dict[str, tuple[str, float | None]]] = {  # unit and default value
    "distance": ("m", None),
    "velocity": ("m/s", None),
    "radius": ("m", RADIUS),
    "mass": ("kg", MASS),
    "offset": ("m", 0.0),
}


@check_arguments
def sweep_robot(
    path: str | os.PathLike[str] | RobotFile,
    law: SiteLaw,
    postures: Sequence[Mapping[str, Any]],
    objects: Mapping[str, Any],
    *,
    directions: Sequence[Any] = (),
    tracking: Tracking | None = None,
    horizon: float = HORIZON,
    results: Sequence[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    dask: Any = None,
    seed: int = 0,
    progress: Callable[[Progress], object] | None = None,
) -> Any:
    """Simulate how a robot meets a ball in many postures.

    Each encounter is a run of `simulate_robot` with its own noise. With an output, finished blocks are stored: if the
    sweep is interrupted, the same call resumes it. One process computes on one core; a Dask cluster uses all.

    Args:
        path: file of the robot model, or a `RobotFile`, to which a ball is added. The ball flies straight; with a robot
            on a floating base, it falls.
        law: the law of the sensor site.
        postures: joint positions by name, one mapping for each encounter, such as from `random_postures`.
        objects: the ball of each encounter, one value for each or one for all: `distance` from the site [m] and
            `velocity` along the axis [m/s], negative toward the robot; optionally `radius` [m], `mass` [kg] and
            `offset` of its center from the axis [m], upward, or along x for a vertical axis.
        directions: axis of the site in each encounter, such as "+x" or a unit vector; by default that of the law.
        tracking: how the joints follow; computed torque by default.
        horizon: longest time to wait for the contact [s].
        results: quantities of `SiteContact`, those of the prediction after `predicted_`, such as
            `predicted_relative_velocity`, and `robot_force`, the largest force of all contacts of the robot; None for a
            default selection.
        output: a Zarr folder `NAME.zarr` or a NetCDF file `NAME.nc`; None for a dataset in memory.
        overwrite: whether another sweep at the output may be replaced; other files are never replaced.
        dask: address of a Dask scheduler, or a `distributed.Client`; its workers write to the output themselves.
        seed: seed of the noise.
        progress: function that is called with a `Progress` after each block.

    Returns:
        An `xarray.Dataset` with the dimension "encounter". Its status is `contact`, `no_contact`, `touched_elsewhere`
        if the ball touches another part of the robot than the surface of the site, also if it touches this surface too,
        or `refused` if the robot cannot start so, for example because the ball overlaps the robot. Each encounter has
        its own `noise_seed`. If every encounter is refused, the reason is raised as an error.
    """
    robot = load_model(path)
    site = site_index(robot, law.site.name)
    start = make_data(robot, postures[0]) if postures else make_data(robot)
    plan = RobotPlan(
        axes=(_axis(robot, law, postures, objects, directions, seed=seed),),
        results=_checked_results(results),
        seed=seed,
        chunk=(min(_CHUNK, len(postures)),),
        model=model_with_ball(path, gravity=falls(robot, start, drivetrain_of(robot, start, site))),
        law=law,
        tracking=tracking or ComputedTorque(),
        horizon=positive(horizon, "horizon", "s"),
    )
    _refuse_hopeless(plan)
    return run_sweep(plan, output, overwrite=overwrite, dask=dask, progress=progress)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotPlan(Grid):
    """A planned sweep of simulated encounters of a robot with a ball.

    Args:
        model: the robot with a ball.
        law: the law of the site.
        tracking: how the joints follow.
        horizon: longest time to wait for the contact [s].
    """

    model: Model
    law: SiteLaw
    tracking: Tracking
    horizon: float

    @property
    def subject(self) -> str:
        """A description of what the sweep computes, for its title."""
        return "simulated encounters of a robot"

    def evaluate(self, region: Region) -> Columns:
        """Simulate the encounters in one part of the sweep.

        Returns:
            The status and the results of the encounters, as arrays.
        """
        (axis,) = (a.at(part) for a, part in zip(self.axes, region, strict=True))
        columns: Columns = {name: np.full(len(axis), math.nan) for name in self.results}
        columns[STATUS] = np.full(len(axis), _STATUSES.index("refused"), dtype=np.int8)
        for i in range(len(axis)):
            try:
                result = self.simulate({name: float(v[i]) for name, v in axis.columns.items()})
            except InvalidInputError:
                continue
            contact, predicted = result.contacts[0][0], result.predictions[0][0]
            status = "no_contact" if math.isnan(contact.time) else "contact"
            status = "touched_elsewhere" if touches_elsewhere(result.touches) else status
            columns[STATUS][i] = _STATUSES.index(status)
            for name in self.results:
                if name == _ROBOT_FORCE:
                    columns[name][i] = result.robot_forces[0]
                    continue
                source = predicted if name.startswith(_PREDICTED) else contact
                columns[name][i] = math.nan if source is None else getattr(source, name.removeprefix(_PREDICTED))
        return columns

    def simulate(self, row: Mapping[str, float]) -> RobotSimulation:
        """Simulate one encounter, and return its contacts with their prediction."""
        posture, ball, axis = (_part(row, name) for name in ("posture", "object", "direction"))
        law = replace(self.law, site=replace(self.law.site, axis=tuple(axis.values())))
        scene = put_ball(self.model, make_data(self.model, posture), law.site, Ball(**ball))
        noise = int(row["noise_seed"])
        return simulate_robot(*scene, [law], tracking=self.tracking, seed=noise, horizon=self.horizon)

    def inputs(self) -> dict[str, Any]:
        """Return all inputs that are constant during the sweep.

        They are in SI units, and in a form that JSON can represent.
        """
        curve: Any = self.law.site.sensor
        content = np.empty(mujoco().mj_sizeModel(self.model), dtype=np.uint8)
        mujoco().mj_saveModel(self.model, None, content)
        return {
            "model": hashlib.sha256(content.tobytes()).hexdigest(),
            "law": repr(self.law),
            "sensor": identify_sensor(curve),
            "tracking": repr(self.tracking),
            "horizon": self.horizon,
        }

    def input_attributes(self, name: str) -> dict[str, Any]:
        """Return the unit and the name of a varied input.

        The name is in plain words.
        """
        part, _, member = name.partition(".")
        unit = "1"
        if part == "posture":
            joint = mujoco().mj_name2id(self.model, mujoco().mjtObj.mjOBJ_JOINT, member)
            unit = unit_of_joint(self.model, joint)
        elif part == "object":
            unit = _OBJECT[member][0]
        return {"long_name": spoken(name), "units": unit}

    def result_attributes(self, name: str) -> dict[str, Any]:
        """Return the metadata of a result, such as its unit.

        They include a name in plain words.
        """
        if name == STATUS:
            codes = list(range(len(_STATUSES)))
            return {"long_name": "how it ended", "flag_values": codes, "flag_meanings": " ".join(_STATUSES)}
        words, unit = _UNITS[name.removeprefix(_PREDICTED)]
        return {"long_name": f"predicted {words}" if name.startswith(_PREDICTED) else words, "units": unit}


def _part(row: Mapping[str, float], part: str) -> dict[str, float]:
    """Select inputs by the prefix of their names."""
    return {name.removeprefix(f"{part}."): value for name, value in row.items() if name.startswith(f"{part}.")}


def _axis(
    robot: Model,
    law: SiteLaw,
    postures: Sequence[Mapping[str, Any]],
    objects: Mapping[str, Any],
    directions: Sequence[Any],
    *,
    seed: int,
) -> Axis:
    """Return the sweep axis with the inputs of each encounter."""
    count = len(postures)
    joints = list(postures[0]) if count else []
    if not joints or any(set(posture) != set(joints) for posture in postures):
        raise InvalidInputError("postures: expected one or more postures, all with positions of the same joints")
    if len(directions) not in {0, count}:
        raise InvalidInputError(
            f"directions: found {len(directions)} directions for {count} postures; give one for each posture, or none"
        )
    states = [make_data(robot, posture) for posture in postures]
    axes = np.array([replace(law.site, axis=axis).direction for axis in directions or [law.site.axis] * count])
    columns: dict[str, Any] = {f"posture.{name}": [state.joint(name).qpos[0] for state in states] for name in joints}
    columns |= {f"direction.{name}": column for name, column in zip("xyz", axes.T, strict=True)}
    columns |= {f"object.{name}": column for name, column in _balls(objects, count).items()}
    columns["noise_seed"] = np.random.SeedSequence(whole(seed, "seed", 0, 2**64 - 1)).generate_state(count)
    return Axis(name=ENCOUNTER, columns={name: _column(values) for name, values in columns.items()}, zipped=True)


def _balls(objects: Mapping[str, Any], count: int) -> dict[str, FloatArray]:
    """Return size, mass, position and velocity of each ball."""
    unknown = next((name for name in objects if name not in _OBJECT), None)
    if unknown is not None:
        raise InvalidInputError(f"objects: found {unknown!r}, expected some of {', '.join(_OBJECT)}", value=unknown)
    columns = {}
    for name, (unit, default) in _OBJECT.items():
        value = objects.get(name, default)
        if value is None:
            raise InvalidInputError(
                f"objects: the {name} of the ball is missing; give one value [{unit}] for all postures, or one value "
                "for each posture"
            )
        check = finite if name in {"velocity", "offset"} else positive
        column = np.asarray(check(value, f"objects {name}", unit), dtype=np.float64)
        if column.shape not in {(), (count,)}:
            raise InvalidInputError(
                f"objects: found {column.size} values for the {name} of the ball, expected one value for all "
                f"postures, or {count} values, one for each posture",
                value=column.size,
            )
        columns[name] = np.broadcast_to(column, count)
    return columns


def _column(values: Any) -> FloatArray:
    column = np.array(values, dtype=np.float64)
    column.setflags(write=False)
    return column


def _checked_results(results: Sequence[str] | None) -> tuple[str, ...]:
    """Check and return the names of the requested results."""
    names = _DEFAULT if results is None else (results,) if isinstance(results, str) else tuple(results)
    wrong = next((name for name in names if name not in {STATUS, *_RESULTS}), None)
    if wrong is not None:
        raise InvalidInputError(f"results: found {wrong!r}, expected some of {', '.join(_RESULTS)}", value=wrong)
    return tuple(dict.fromkeys(name for name in names if name != STATUS))


def _refuse_hopeless(plan: RobotPlan) -> None:
    """Raise an error if no encounter of the sweep can be simulated."""
    (axis,) = plan.axes
    for i in range(len(axis)):
        try:
            plan.simulate({name: float(values[i]) for name, values in axis.columns.items()})
        except InvalidInputError:
            if i == len(axis) - 1:
                raise
        else:
            return
