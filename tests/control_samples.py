"""Controllers for the tests, and loops over many samples that can be compiled together with the step."""

from __future__ import annotations

from typing import Any

import numpy as np

from pretouch.control import Conditioning, Controller, Limits, Sample, VirtualAdmittance, VirtualDamper

MASS, DAMPING, STIFFNESS = 1.0, 10.0, 25.0
ADMITTANCE = VirtualAdmittance(mass=MASS, damping=DAMPING, stiffness=STIFFNESS)
LETTER_FILTERS = {"median_window": 10, "low_pass_order": 5, "cutoff": 500.0}
LIMITS = Limits(force=20.0, speed=0.5, acceleration=30.0, excursion=0.1)


def controller(gain: float = -0.7, period: float = 1e-3, **changed: Any) -> Controller:
    """The letter's admittance without filters and limits, unless said."""
    law = {k: changed.pop(k) for k in ("approach_only", "release", "ramp_time") if k in changed}
    rest = {k: changed.pop(k) for k in ("limits", "contact_gain", "contact_threshold", "admittance") if k in changed}
    return Controller(
        period=period,
        conditioning=Conditioning(**({"floor": 1e-3} | changed)),
        law=VirtualDamper(gain=gain, **law),
        **({"admittance": ADMITTANCE} | rest),
    )


def step(parameters: Any, state: Any, sample: Any) -> Any:
    """Take the place of a controller's step; `compiled` binds the real one."""
    raise NotImplementedError


def run_rows(parameters: Any, state: Any, rows: Any, out: Any) -> Any:
    """Feed rows (reading, fresh, age, force, reference x, v, a); keep the output."""
    for i in range(rows.shape[0]):
        r = rows[i]
        state, output = step(parameters, state, Sample(r[0], r[1] > 0.0, r[2], r[3], r[4], r[5], r[6]))
        out[i, 0], out[i, 1], out[i, 2] = output.position, output.velocity, output.acceleration
        out[i, 3], out[i, 4], out[i, 5] = output.virtual_force, output.log_level, output.status
    return state


def run_plain(made: Controller, rows: np.ndarray) -> np.ndarray:
    """Do the same in plain Python."""
    parameters, state, out = made.parameters(), made.start(), np.empty((len(rows), 6))
    for i, r in enumerate(rows.tolist()):
        state, output = made.step(parameters, state, Sample(r[0], r[1] > 0.0, *r[2:]))
        out[i] = output
    return out


def rows_of(readings: Any, *, fresh: Any = 1.0, age: Any = 0.0, force: Any = 0.0, reference: Any = 0.0) -> np.ndarray:
    """Rows for `run_rows` from columns; the reference is at rest."""
    readings = np.asarray(readings, dtype=float)
    rows = np.zeros((readings.size, 7))
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], rows[:, 4] = readings, fresh, age, force, reference
    return rows
