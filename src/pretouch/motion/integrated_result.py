"""Compute the results of numerically integrated motions.

The results are final states, peak values, impulse balance and sampled motions.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray

from .integration import Integration, Steps
from .layout import PEAKS
from .radau import apply, evaluate, tables

_PEAK_OF: Final = dict(zip(PEAKS, ("displacement", "travel", "velocity", "acceleration", "virtual_force"), strict=True))
_NEEDS_FORCE: Final = ("acceleration", "virtual_force")
_FINE: Final = 17  # points on which a peak is searched
_ROUNDS: Final = 4  # refinements of these points


def quantities(
    run: Integration, steps: Steps, share: FloatArray, nodes: tuple[FloatArray, ...]
) -> dict[str, FloatArray]:
    """Return all motion quantities at given points of integration steps.

    Args:
        run: the motions.
        steps: the steps, shape (n,).
        share: position of each point in its step, from 0 to 1; shape (n, m) or (m,).
        nodes: distance [m], speed [m/s] and force [N] at the points, shape (n, m).
    """
    distance, speed, force = nodes
    e, start, which = run.encounters, steps.start, steps.encounter
    after = steps.duration[:, None] * share
    time = steps.time[:, None] + after
    position, velocity = start.obstacle_after(after)
    pull = start.pull(after, distance, speed)
    acting = start.acting(pull, force, run.law)
    acceleration = (force - acting) / start.mass[:, None]
    v, a = e.reference_velocity[which, None], e.reference_acceleration[which, None]
    displacement = position - distance
    return {
        "time": time,
        "distance": distance,
        "relative_velocity": speed,
        "displacement": displacement,
        "displacement_velocity": velocity - speed,
        "displacement_acceleration": acceleration,
        "virtual_force": force,
        "held": pull - acting,
        "travel": displacement - e.displacement[which, None] + (v + a * time / 2) * time,
        "position": displacement + e.reference[which, None] + (v + a * time / 2) * time,
        "velocity": velocity - speed + v + a * time,
        "acceleration": acceleration + a,
    }


def columns_of(run: Integration) -> dict[str, FloatArray]:
    """Return all results of the encounters by name."""
    e, steps = run.encounters, run.steps
    at_nodes = quantities(run, steps, tables().nodes, (steps.distance, steps.speed, steps.force))
    first = np.searchsorted(steps.encounter, np.arange(len(e)))
    last = np.append(first[1:], len(steps.encounter)) - 1
    end = {name: values[last, -1] for name, values in at_nodes.items()}
    closest = np.minimum.reduceat(steps.distance.min(axis=1), first)
    return {
        **end,
        "status": run.status.astype(np.float64),
        "gain": e.value,
        "closest_distance": closest,
        "settling_distance": run.settling,
        "impulse_residual": _residual(run, end),
        **{name: _largest(run, of, at_nodes[of], first, last) for name, of in _PEAK_OF.items()},
    }


def _largest(run: Integration, name: str, values: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Return the largest magnitude of a quantity during each motion."""
    # It lies next to the largest magnitude at the nodes, in the same step or in an adjacent one.
    magnitude, final = np.abs(values), tables().nodes.size - 1
    of_steps = magnitude.max(axis=1)
    motion = np.repeat(np.arange(len(first)), last - first + 1)
    largest = np.maximum.reduceat(of_steps, first)
    hits = np.flatnonzero(of_steps == largest[motion])
    best = hits[np.searchsorted(motion[hits], np.arange(len(first)))]
    node = magnitude[best].argmax(axis=1)
    largest = np.maximum(largest, _near_node(run, name, best, node))
    aside = np.where(node == 0, np.maximum(best - 1, first), np.where(node == final, np.minimum(best + 1, last), best))
    some = np.flatnonzero(aside != best)
    largest[some] = np.maximum(largest[some], _near_node(run, name, aside[some], final - node[some]))
    return largest


def _near_node(run: Integration, name: str, which: IntArray, node: IntArray) -> FloatArray:
    """Find the largest magnitude of a quantity near a collocation node."""
    steps, nodes = run.steps.some(which), tables().nodes
    distances, speeds = (apply(tables().to_legendre, values) for values in (steps.distance, steps.speed))
    low, high = nodes[np.maximum(node - 1, 0)], nodes[np.minimum(node + 1, len(nodes) - 1)]
    rows, largest = np.arange(len(which)), np.zeros(len(which))
    for _ in range(_ROUNDS):
        share = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, _FINE)
        distance, speed = evaluate(distances, share), evaluate(speeds, share)
        force = np.zeros_like(distance)
        if name in _NEEDS_FORCE:
            force = run.law.at(steps.start.value[:, None], distance, speed, trial=True)
        magnitude = np.abs(quantities(run, steps, share, (distance, speed, force))[name])
        best = magnitude.argmax(axis=1)
        largest = np.maximum(largest, magnitude[rows, best])
        low, high = share[rows, np.maximum(best - 1, 0)], share[rows, np.minimum(best + 1, _FINE - 1)]
    return largest


def _residual(run: Integration, end: dict[str, FloatArray]) -> FloatArray:
    """Return the relative residual of the impulse balance."""
    # The integrals use other points of each step than the integration, and the force there.
    e, steps = run.encounters, run.steps
    distance, speed = (apply(tables().at_gauss, values) for values in (steps.distance, steps.speed))
    force = run.law.at(steps.start.value[:, None], distance, speed, trial=True)
    inside = quantities(run, steps, tables().gauss, (distance, speed, force))
    terms: list[FloatArray] = [e.mass * (end["displacement_velocity"] - e.displacement_velocity)]
    terms += [e.damping * (end["displacement"] - e.displacement)]
    for name, factor in (("displacement", e.stiffness), ("virtual_force", -1.0), ("held", -1.0)):
        each = steps.duration * apply(tables().weights[None], inside[name])[:, 0]
        terms.append(np.asarray(factor * np.bincount(steps.encounter, each, len(e))))
    approach = e.mass * np.abs(e.velocity[0] - e.displacement_velocity), e.damping * e.distance
    largest = np.maximum.reduce([*map(np.abs, terms), *approach])
    return np.where(largest > 0, np.abs(sum(terms)) / np.where(largest > 0, largest, 1.0), 0.0)


def sample(run: Integration, samples: int) -> dict[str, FloatArray]:
    """Return all quantities of each motion at equally spaced times.

    The times reach from the start to the end of each motion.
    """
    # The arrays have the shape (n, samples).
    steps, n = run.steps, len(run.encounters)
    first = np.searchsorted(steps.encounter, np.arange(n + 1))
    ends = steps.time + steps.duration
    which, share = np.zeros((n, samples), dtype=np.int64), np.zeros((n, samples))
    for i in range(n):
        mine = slice(first[i], first[i + 1])
        times = np.linspace(0.0, ends[mine][-1], samples)
        which[i] = first[i] + np.minimum(np.searchsorted(ends[mine], times), first[i + 1] - first[i] - 1)
        duration = steps.duration[which[i]]
        share[i] = np.where(duration > 0, (times - steps.time[which[i]]) / np.where(duration > 0, duration, 1.0), 0.0)
    flat, at = steps.some(which.ravel()), np.clip(share, 0.0, 1.0).reshape(-1, 1)
    distance, speed = (evaluate(apply(tables().to_legendre, v), at) for v in (flat.distance, flat.speed))
    final = np.arange(n) * samples + samples - 1
    distance[final, 0], speed[final, 0] = flat.distance[final, -1], flat.speed[final, -1]
    force = run.law.at(flat.start.value[:, None], distance, speed)
    course = quantities(run, flat, at, (distance, speed, force))
    return {name: values.reshape(n, samples) for name, values in course.items()}
