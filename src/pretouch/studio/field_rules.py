"""Give the page of the studio the checks of scenario files, so that page and command accept the same values."""

from __future__ import annotations

from typing import Any

from pretouch._core.units import MAGNITUDES, WORKABLE
from pretouch.config import FASTEST, STEEPEST
from pretouch.config.quantities import Quantity
from pretouch.config.schema import variants

from .answers import SECTIONS


def field_rules() -> dict[str, dict[str, Any]]:
    """Return the check of each quantity in the sections that the page shows.

    Returns:
        The rules by `section.key`, see `Quantity.rule`.
    """
    rules: dict[str, dict[str, Any]] = {}
    for section in SECTIONS:
        for variant in variants(section).values():
            for name, key in variant.keys.items():
                if isinstance(key.read, Quantity):
                    rules.setdefault(f"{section}.{name}", key.read.rule())
    return rules


def largest_values() -> dict[str, Any]:
    """Return further limits of the scenario file, in SI units.

    Returns:
        `magnitudes`, the smallest and the largest magnitude of a quantity, and `workable`, these in words; `fastest`,
        the largest natural frequency [rad/s]; and `steepest`, the largest slope of ln xi [1/m].
    """
    return {"magnitudes": list(MAGNITUDES), "workable": WORKABLE, "fastest": FASTEST, "steepest": 1 / STEEPEST}
