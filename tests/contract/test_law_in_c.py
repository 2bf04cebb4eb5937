"""What native/law promises to whoever compiles it: its structures, single precision, nothing but a little of libm."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from control_samples import LETTER_FILTERS, LIMITS, controller
from native_code import NATIVE, compile_c, fields_of, offsets
from pretouch.control import VirtualDrag, structures

SOURCE = (NATIVE / "law/pretouch_law.c").read_text()
NAMES = {
    "sample": structures.RawSample,
    "output": structures.RawOutput,
    "sensing_numbers": structures.SensingNumbers,
    "sensing_state": structures.SensingState,
    "observation": structures.Observation,
    "drive_numbers": structures.DriveNumbers,
    "drive_state": structures.DriveState,
    "parameters": structures.ControllerNumbers,
    "state": structures.ControllerState,
    "drag_numbers": structures.DragNumbers,
    "drag_state": structures.DragState,
}


@pytest.mark.parametrize("name", NAMES)
def test_structures_are_those_of_the_header(name: str, tmp_path: Path) -> None:
    kind = NAMES[name]
    fields = fields_of(kind)
    found = offsets(tmp_path, "law/pretouch_law.h", f"pretouch_{name}", [path for path, _ in fields])
    assert found == [ctypes.sizeof(kind), *(offset for _, offset in fields)]


def single(kind: Any) -> Any:
    """The same structure in single precision."""
    if kind is ctypes.c_double:
        return ctypes.c_float
    if issubclass(kind, ctypes.Array):
        return single(kind._type_) * kind._length_
    if issubclass(kind, ctypes.Structure):
        return type(kind.__name__, (ctypes.Structure,), {"_fields_": [(n, single(k)) for n, k in kind._fields_]})
    return kind


def fill(target: Any, given: Any) -> None:
    for i in range(len(target)) if isinstance(target, ctypes.Array) else ():
        if isinstance(target[i], ctypes.Structure):
            fill(target[i], given[i])
        else:
            target[i] = given[i]
    for name, kind in getattr(target, "_fields_", ()):
        if issubclass(kind, ctypes.Structure | ctypes.Array):
            fill(getattr(target, name), getattr(given, name))
        else:
            setattr(target, name, getattr(given, name))


@pytest.mark.parametrize("changed", [{}, LETTER_FILTERS | {"period": 1e-4, "limits": LIMITS}], ids=["bare", "letter"])
def test_single_precision_gives_the_same_motion(changed: dict[str, Any], tmp_path: Path) -> None:
    """Both are within 1e-4 of the largest: a change of ln xi of 6e-4 is good to 2^-24 of ln's argument, 1e-4 of it."""
    library = compile_c(tmp_path, SOURCE, "-DPRETOUCH_FLOAT")
    made = controller(**changed)
    parameters = single(structures.ControllerNumbers)()
    state, sample, out = (single(k)() for k in (structures.ControllerState, structures.RawSample, structures.RawOutput))
    fill(parameters, made.parameters())
    library.pretouch_start(ctypes.byref(parameters), ctypes.c_float(0.0), ctypes.c_float(0.0), ctypes.byref(state))
    run, found = made.begin(), []
    for reading in 0.1 * np.exp(6.0 * made.period * np.arange(400)):
        sample.reading, sample.fresh = reading, 1
        library.pretouch_step(*map(ctypes.byref, (parameters, state, sample, out)))
        exact = run.step(np.float32(reading))
        assert out.status == exact.status
        found.append([(getattr(o, name)) for o in (out, exact) for name in ("position", "velocity", "log_level")])
    rows = np.array(found)
    assert (np.abs(rows[:, :3] - rows[:, 3:]).max(axis=0) <= 1e-4 * np.abs(rows[:, 3:]).max(axis=0)).all()


@pytest.mark.parametrize("left", [0x00, 0x01, 0xFF], ids=["zeros", "ones", "not numbers"])
def test_a_law_begins_anew_in_memory_that_holds_anything(left: int, tmp_path: Path) -> None:
    """A robot starts it again in the state that it used: the first reading is none of a change."""
    library = compile_c(tmp_path, SOURCE, "-DPRETOUCH_FLOAT")
    made = controller(**LETTER_FILTERS | {"period": 1e-4, "limits": LIMITS})
    parameters = single(structures.ControllerNumbers)()
    fill(parameters, made.parameters())
    sample, out = (single(k)() for k in (structures.RawSample, structures.RawOutput))
    state, rows = single(structures.ControllerState)(), []
    ctypes.memset(ctypes.byref(state), left, ctypes.sizeof(state))
    for _ in range(2):  # and once more after it has run
        library.pretouch_start(ctypes.byref(parameters), ctypes.c_float(0.0), ctypes.c_float(0.0), ctypes.byref(state))
        row = []
        for reading in 0.1 * np.exp(6.0 * made.period * np.arange(50)):
            sample.reading, sample.fresh = reading, 1
            library.pretouch_step(*map(ctypes.byref, (parameters, state, sample, out)))
            row.append((out.status, out.position, out.velocity, out.virtual_force, out.log_level))
        rows.append(np.array(row))
    assert rows[0][0][3] == 0.0, "no force by the first reading"
    np.testing.assert_array_equal(rows[0], rows[1])
    assert np.abs(rows[0][-1][1:]).min() > 0


def test_the_drag_in_single_precision(tmp_path: Path) -> None:
    """The same motion to 1e-3, 2^-24 of ln xi = 8 over a rise of 6e-3 a few times; and finite, whatever is read."""
    library = compile_c(tmp_path, SOURCE, "-DPRETOUCH_FLOAT")
    made = controller(law=VirtualDrag(drag=0.0144, noise=1e-5, own_advance=-0.7), limits=LIMITS)
    numbers, start = made.parameters(), made.start()
    parameters, state, sample, out = (
        single(type(k))() for k in (numbers, start, structures.RawSample(), structures.RawOutput())
    )
    fill(parameters, numbers)
    zero = ctypes.c_float(0.0)
    library.pretouch_start_drag(ctypes.byref(parameters), zero, zero, ctypes.byref(state))
    run, found = made.begin(), []
    for reading in 0.1 * np.exp(6.0 * made.period * np.arange(400)):
        sample.reading, sample.fresh = reading, 1
        library.pretouch_step_drag(*map(ctypes.byref, (parameters, state, sample, out)))
        exact = run.step(np.float32(reading))
        found.append([(getattr(o, name)) for o in (out, exact) for name in ("position", "velocity", "log_level")])
    rows = np.array(found)
    assert (np.abs(rows[:, :3] - rows[:, 3:]).max(axis=0) <= 1e-3 * np.abs(rows[:, 3:]).max(axis=0)).all()
    rng = np.random.default_rng(8)
    for reading in rng.integers(0, 2**32, 100_000, dtype=np.uint32).view(np.float32):
        sample.reading, sample.fresh = float(reading), rng.random() < 0.9
        library.pretouch_step_drag(*map(ctypes.byref, (parameters, state, sample, out)))
        assert abs(out.position) <= 0.1 * (1 + 1e-6)
        assert abs(out.velocity) <= 0.5 * (1 + 1e-6)
        assert abs(out.virtual_force) <= 20.0


def test_the_law_allocates_nothing_and_takes_little_of_libm() -> None:
    assert re.findall(r"#include (\S+)", SOURCE) == ['"pretouch_law.h"', "<float.h>", "<math.h>"]
    code = re.sub(r"/\*.*?\*/", "", SOURCE, flags=re.DOTALL)
    called = set(re.findall(r"\b([a-z_]+)\(", code)) - {"if", "for", "while", "return", "sizeof"}
    own = set(re.findall(r"^(?:static )?(?:inline )?[a-z0-9_]+ \*?([a-z_]+)\(", code, flags=re.MULTILINE))
    assert called - own == {"isfinite"}
    assert set(re.findall(r"#define [A-Z]+ ([a-z]+)$", SOURCE, flags=re.MULTILINE)) == {
        *("log", "logf", "sqrt", "sqrtf", "fabs", "fabsf", "floor", "floorf")
    }
