"""Controllers for the tests, run over many samples: by the law in C, and by its reference in plain Python."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

import plain_law
from pretouch._core.native import INTEGER, POINTER, kernel
from pretouch.control import (
    Arrival,
    CompiledStep,
    Conditioning,
    Controller,
    Limits,
    Output,
    Sample,
    VirtualAdmittance,
    VirtualDamper,
)
from pretouch.control.structures import RawOutput, RawSample

MASS, DAMPING, STIFFNESS = 1.0, 10.0, 25.0
ADMITTANCE = VirtualAdmittance(mass=MASS, damping=DAMPING, stiffness=STIFFNESS)
LETTER_FILTERS = {"median_window": 10, "low_pass_order": 5, "cutoff": 500.0}
LIMITS = Limits(force=20.0, speed=0.5, acceleration=30.0, excursion=0.1)

COLUMNS = ("reading", "fresh", "age", "contact_force", *(f"reference_{s}" for s in Output._fields[:3]))
SAMPLE, OUTPUT = np.dtype(RawSample), np.dtype(RawOutput)
_run_law = kernel("run_law", *[POINTER] * 4, INTEGER, POINTER)


def controller(gain: float = -0.7, period: float = 1e-3, **changed: Any) -> Controller:
    """The letter's admittance without filters and limits, unless said; the letter's law unless another is given."""
    given = changed.pop("law", None)
    law = {k: changed.pop(k) for k in ("approach_only", "release", "ramp_time") if k in changed}
    rest = {k: changed.pop(k) for k in ("limits", "contact_gain", "contact_threshold", "admittance") if k in changed}
    return Controller(
        period=period,
        conditioning=Conditioning(**({"floor": 1e-3} | changed)),
        law=VirtualDamper(gain=gain, **law) if given is None else given,
        **({"admittance": ADMITTANCE} | rest),
    )


class Batch:
    """PageTable (reading, fresh, age, force, reference x, v, a) as samples in C, for a controller's compiled step."""

    def __init__(self, made: Controller, rows: np.ndarray) -> None:
        self.samples, self.out = np.zeros(len(rows), SAMPLE), np.zeros(len(rows), OUTPUT)
        for name, column in zip(COLUMNS, rows.T, strict=True):
            self.samples[name] = column
        self.parameters, self.state = made.parameters(), made.start()
        self.step = made.step.located()

    def run(self) -> None:
        places = self.samples.ctypes.data, len(self.samples), self.out.ctypes.data
        _run_law(self.step, ctypes.byref(self.parameters), ctypes.byref(self.state), *places)


def run_rows(made: Controller, rows: np.ndarray) -> np.ndarray:
    """Feed rows to a controller; return the outputs, a row for each."""
    if not isinstance(made.step, CompiledStep):
        run, samples = made.begin(), [Sample(r[0], Arrival(int(r[1])), *r[2:]) for r in rows.tolist()]
        return np.array([run.step(**sample._asdict()) for sample in samples], dtype=float)
    batch = Batch(made, rows)
    batch.run()
    return np.column_stack([batch.out[name] for name in Output._fields])


def run_plain(made: Controller, rows: np.ndarray) -> np.ndarray:
    """Do the same by the plain law."""
    parameters = plain_law.plain(made.parameters())
    state, out = plain_law.start(parameters), np.empty((len(rows), 6))
    for i, r in enumerate(rows.tolist()):
        state, output = plain_law.step(parameters, state, Sample(r[0], Arrival(int(r[1])), *r[2:]))
        out[i] = output
    return out


def rows_of(readings: Any, *, fresh: Any = 1.0, age: Any = 0.0, force: Any = 0.0, reference: Any = 0.0) -> np.ndarray:
    """PageTable for `run_rows` from columns; the reference is at rest."""
    readings = np.asarray(readings, dtype=float)
    rows = np.zeros((readings.size, 7))
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], rows[:, 4] = readings, fresh, age, force, reference
    return rows
