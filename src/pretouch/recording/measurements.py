"""Separate the measurements of a recording from values that are none, such as those without an object."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from .no_object import classify_distances, idle_codes
from .recording import Recording

_LARGEST: Final = 1e30  # of a reading; the squares of larger ones are no numbers any more


def measurements_of(recording: Recording) -> Recording:
    """Replace readings that are no measurements.

    Args:
        recording: the readings as recorded.

    Returns:
        The recording: a distance without an object is infinite, one that is too near to be measured is minus infinity,
        and other values that are no readings are NaN. It names the values that mean "no object", and has remarks on the
        others.
    """
    if recording.no_object:  # from an earlier replay
        return recording
    beyond = np.isfinite(recording.values) & (np.abs(recording.values) > _LARGEST)
    if beyond.any():
        note = f"{beyond.sum():,} readings are beyond 1e30, which no sensor measures: they count as NaN."
        values = np.where(beyond, np.nan, recording.values)
        recording = replace(recording, values=values, notes=(*recording.notes, note))
    if recording.kind != "distance":
        return replace(recording, no_object=idle_codes(recording.values))
    distances = classify_distances(recording.values, recording.bounds)
    notes = []
    if distances.too_near:
        notes.append(
            f"{distances.too_near:,} distances are below min_range ({1e3 * recording.bounds[0]:.4g} mm) of the sensor: "
            "pretouch treats them as too near to be measured."
        )
    if np.isfinite(distances.unclear):
        notes.append(
            f"The distance {distances.unclear:.6g} m repeats exactly, and some readings jump to it. It may mean that "
            "there is no object, but it counts as a distance. If it means this, let the driver publish infinity."
        )
    if distances.failed:
        notes.append(
            f"{distances.failed:,} distances equal a value by which drivers report a failed measurement (65535 mm): "
            "they count as NaN."
        )
    if distances.impossible:
        notes.append(
            f"{distances.impossible:,} distances are negative, and far from the readings before and after them: they "
            "count as NaN."
        )
    return replace(recording, values=distances.values, no_object=distances.no_object, notes=(*recording.notes, *notes))
