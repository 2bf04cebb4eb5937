"""What the columns of the arrays of the loop in C++ mean."""

from __future__ import annotations

from typing import Final

__all__ = ["CONTACT_COLUMNS", "COURSE_COLUMNS", "FIRST_CONTACT", "RESULT_COLUMNS", "TRACE_COLUMNS"]

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
    "distance",
    "acceleration",
    "virtual_force",
    "largest_acceleration",
)
FIRST_CONTACT: Final = (
    "time",
    "position",
    "velocity",
    "displacement",
    "relative_velocity",
    "acceleration",
    "virtual_force",
)
"""The columns that hold the state at the first contact or, without one, at the end of the run."""

CONTACT_COLUMNS: Final = ("time", "relative_velocity", "peak_force", "impulse", "rebound_velocity", "duration")
COURSE_COLUMNS: Final = ("time", "distance", "relative_velocity", "contact_force")
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
