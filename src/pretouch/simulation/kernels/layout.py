"""What the columns of the compiled loop's arrays mean."""

from __future__ import annotations

from typing import Final

__all__ = ["CONTACT_COLUMNS", "RESULT_COLUMNS", "TRACE_COLUMNS"]

RESULT_COLUMNS: Final = (
    "status",
    "time",
    "position",
    "velocity",
    "displacement",
    "relative_velocity",
    "closest_distance",
    "largest_excursion",
    "largest_travel",
    "largest_speed",
    "largest_virtual_force",
    "peak_force",
    "impulse",
    "rebound_velocity",
    "contacts",
    "detection_time",
    "flags",
    "end_time",
    "impact_force",
)
CONTACT_COLUMNS: Final = ("time", "relative_velocity", "peak_force", "impulse", "rebound_velocity", "duration")
TRACE_COLUMNS: Final = (
    "time",
    "distance",
    "position",
    "velocity",
    "obstacle_position",
    "virtual_position",
    "virtual_velocity",
    "virtual_force",
    "contact_force",
    "reading",
    "log_level",
    "flags",
)
