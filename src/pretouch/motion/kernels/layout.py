"""The columns that the kernels write: one row per encounter. Shared by both kernels and their Python skin."""

from __future__ import annotations

from typing import Final

__all__ = ["COLUMNS", "TRACE_COLUMNS"]

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
TRACE_COLUMNS: Final = ("distance", "displacement", "displacement_velocity", "displacement_acceleration")
