"""Convert encounters to arrays of parameters and sections of the obstacle's path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value

from .request import Request, Which
from .scenario import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounters(Value):
    """Parameters of n encounters, relative to the moving reference position.

    Args:
        mass: M [kg], shape (n,), as the next ones.
        damping: D [N s/m].
        stiffness: K [N/m].
        displacement: x~ at the start [m].
        displacement_velocity: x~' at the start [m/s].
        reference: x_d at the start [m].
        reference_velocity: its velocity there [m/s].
        reference_acceleration: its acceleration [m/s^2].
        value: the law's number.
        since: time at which each section of the obstacle's path starts [s], shape (k, n), as the next ones; the last
            section has no end.
        position: x_o - x_d at that time [m].
        velocity: its velocity at that time [m/s].
        acceleration: its acceleration in the section [m/s^2].
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    displacement: FloatArray
    displacement_velocity: FloatArray
    reference: FloatArray
    reference_velocity: FloatArray
    reference_acceleration: FloatArray
    value: FloatArray
    since: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    def __len__(self) -> int:
        return len(self.mass)

    def part(self, which: slice) -> Encounters:
        """Return the selected encounters."""
        return Encounters(**{name: getattr(self, name)[..., which] for name in self.__slots__})

    @property
    def distance(self) -> FloatArray:
        """The initial distance between robot and object [m]."""
        return np.asarray(self.position[0] - self.displacement)

    def terms(self, section: IntArray, which: IntArray, time: FloatArray) -> FloatArray:
        """Return the sum of the absolute terms of the obstacle's position [m].

        The rounding error of the position is proportional to this sum.
        """
        terms = np.abs(self.position[0, which])
        for k in range(len(self.since)):
            duration = np.maximum(np.minimum(self.until(section * 0 + k, which), time) - self.since[k, which], 0.0)
            terms = (
                terms
                + (np.abs(self.velocity[k, which]) + np.abs(self.acceleration[k, which]) * duration / 2) * duration
            )
        return np.asarray(terms)

    def until(self, section: IntArray, which: IntArray) -> FloatArray:
        """Return the end times [s] of given sections of the obstacle's path.

        The last section ends at infinity.
        """
        ends = np.concatenate([self.since, np.full((1, len(self)), np.inf)])
        return np.asarray(ends[section + 1, which])

    def obstacle_at(self, section: IntArray, which: IntArray, time: FloatArray) -> tuple[FloatArray, ...]:
        """Return the motion of selected obstacles relative to the reference.

        The result contains position, velocity and acceleration in SI units.
        """
        after = time - self.since[section, which]
        velocity, acceleration = self.velocity[section, which], self.acceleration[section, which]
        position = self.position[section, which] + (velocity + acceleration * after / 2) * after
        return position, velocity + acceleration * after, acceleration


def encounters_of(request: Request, which: Which = slice(None)) -> Encounters:
    """Convert encounters to arrays."""
    columns, value = request.part(which)
    mass, damping, stiffness, x0, u0, p, v, _, r_v, r_a = columns.T.copy()
    sections: tuple[list[FloatArray], ...] = [np.zeros_like(p)], [p], [v], []
    for until, acceleration in _stretches(request.scenario, request.shape, which):
        relative = acceleration - r_a
        duration = until - sections[0][-1]
        sections[3].append(relative)
        sections[0].append(until)
        sections[1].append(sections[1][-1] + (sections[2][-1] + relative * duration / 2) * duration)
        sections[2].append(sections[2][-1] + relative * duration)
    sections[3].append(columns[:, 7].copy())
    since, position, velocity, acceleration = map(np.array, sections)
    return Encounters(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        displacement=x0,
        displacement_velocity=u0,
        reference=np.broadcast_to(request.scenario.reference.position, request.shape).reshape(-1)[which],
        reference_velocity=r_v,
        reference_acceleration=r_a,
        value=value,
        since=since,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
    )


def path_sections(request: Request, which: Which) -> tuple[FloatArray, FloatArray]:
    """Return the path sections of selected obstacles for the compiled solver.

    Returns:
        The acceleration relative to the reference in the first section [m/s^2], shape (n,). The later sections with
        the columns of layout.SECTION_COLUMNS, shape (n, k, 4).
    """
    e = encounters_of(request, which)
    since, p, v, a = e.since[1:], e.position[1:], e.velocity[1:], e.acceleration[1:]
    # Time starts with the encounter. An obstacle at rest keeps exactly zero speed.
    columns = since, p - (v - a * since / 2) * since, v - a * since, a
    return e.acceleration[0], np.ascontiguousarray(np.stack(columns, axis=-1).swapaxes(0, 1))


def obstacle_path(request: Request, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return position [m] and velocity [m/s] of each obstacle relative to the reference.

    The times [s] have the shape (n, m).
    """
    e = encounters_of(request)
    section = (times >= e.since[1:, :, None]).sum(axis=0)
    position, velocity, _ = e.obstacle_at(section, np.arange(len(e))[:, None], times)
    return position, velocity


def _stretches(scenario: Scenario, shape: tuple[int, ...], which: Which) -> list[tuple[FloatArray, FloatArray]]:
    """Return end time [s] and acceleration [m/s^2] of each motion section."""

    def flat(values: object) -> FloatArray:
        return np.array(np.broadcast_to(np.asarray(values, dtype=np.float64), shape)).reshape(-1)[which]

    return [(flat(stretch.until), flat(stretch.acceleration)) for stretch in scenario.obstacle.course]
