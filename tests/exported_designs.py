"""Designs whose laws the tests export: both laws, a reference that moves, and all filters and limits together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pretouch as pt
from pretouch.control import Limits

EXAMPLES = Path(__file__).parents[1] / "examples"


def _filters() -> pt.Task:
    """The loop example with a long median, an odd low-pass, limits that act, and a damper that acts on approaches."""
    task = pt.load_scenario(EXAMPLES / "loop.toml")
    law = task.loop.law
    changed = replace(
        law,
        conditioning=replace(law.conditioning, median_window=10, low_pass_order=5, cutoff=60.0, saturation=20_000.0),
        law=replace(law.law, approach_only=True, release=0.02, ramp_time=0.05),
        limits=Limits(force=20.0, speed=0.15, acceleration=6.0, excursion=0.04),
        contact_gain=0.5,
    )
    return task.replace(loop=replace(task.loop, law=changed), gain=-0.86)


DESIGNS = {
    "damper": lambda: pt.load_scenario(EXAMPLES / "loop.toml").replace(gain=-0.86),
    "drag": lambda: pt.load_scenario(EXAMPLES / "drag.toml"),
    "course": lambda: pt.load_scenario(EXAMPLES / "course.toml").replace(gain=-0.7),
    "filters": _filters,
}
