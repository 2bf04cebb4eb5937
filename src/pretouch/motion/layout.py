"""The quantities that the kernels write, by name and in their order. Shared by all that calls them."""

from __future__ import annotations

from typing import Final

__all__ = ["COLUMNS", "PEAKS", "RESOLUTION", "STATES", "TRACE_COLUMNS"]

COLUMNS: Final = (
    "time",
    "distance",
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "virtual_force",
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_acceleration",
    "largest_virtual_force",
    "closest_distance",
    "settling_distance",
    "displacement_integral",
)
"""What the guaranteed paths write, one row per encounter."""

STATES: Final = (
    "time",
    "displacement",
    "displacement_velocity",
    "displacement_acceleration",
    "relative_velocity",
    "displacement_integral",
)
"""What the fast paths find at a contact."""

PEAKS: Final = (
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_acceleration",
    "largest_virtual_force",
)
"""The largest demands until then, by kernels of their own."""

TRACE_COLUMNS: Final = ("distance", "displacement", "displacement_velocity", "displacement_acceleration")

RESOLUTION: Final = 1e-12
"""How close to zero a smallest distance is taken for zero, of the terms that l is the difference of."""
