"""Plain functions become machine code together with those that they call, and it is kept for what it was made of."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pretouch._core.machine_code import compiled

HALF = 0.5
COUNTING = """
import sys
sys.path.insert(0, {folder!r})
import numba, counted
from pretouch._core.machine_code import compiled
made = compiled(counted.outer, inner={inner})
print(made(2.0), sum(made.stats.cache_hits.values()))
"""

ALLOCATING = """
import sys
sys.path.insert(0, ".")
import numba, numpy as np
from numba.core.runtime import rtsys
from control_samples import LETTER_FILTERS, controller, rows_of, run_rows
from pretouch._core.machine_code import compiled
made = controller(period=1e-4, **LETTER_FILTERS)
run, rows, out = compiled(run_rows, step=made.step), rows_of(np.linspace(0.1, 1.0, 10_000)), np.empty((10_000, 6))
make = numba.njit(lambda n: np.zeros(n).sum())
run(made.parameters(), made.start(), rows, out), make(3)
def count(call):
    before = rtsys.get_allocation_stats().mi_alloc
    call()
    return rtsys.get_allocation_stats().mi_alloc - before
boxed = count(lambda: run(made.parameters(), made.start(), rows[:1], out))
print(count(lambda: run(made.parameters(), made.start(), rows, out)) - boxed, count(lambda: make(3)))
"""


def inner(x: float) -> float:
    return HALF * x


def other(x: float) -> float:
    return math.sqrt(x)


def outer(x: float) -> float:
    return inner(x) + 1.0


def test_a_function_is_compiled_with_those_that_it_calls_and_stays_as_it_was() -> None:
    made = compiled(outer)
    assert made(3.0) == outer(3.0) == 2.5
    assert made.nopython_signatures, "it ran as machine code"
    assert not hasattr(outer, "nopython_signatures")


def test_a_name_can_stand_for_another_function() -> None:
    assert compiled(outer, inner=other)(9.0) == 4.0
    assert compiled(outer, inner=compiled(other))(9.0) == 4.0
    assert outer(9.0) == 5.5


def test_a_function_is_compiled_once() -> None:
    assert compiled(outer) is compiled(outer)
    assert compiled(outer) is not compiled(outer, inner=other)


def test_machine_code_is_kept_per_binding_and_source(tmp_path: Path) -> None:
    """In processes of their own: what was kept is used again, and never for another function or another source."""
    folder, cache = tmp_path / "code", tmp_path / "cache"
    folder.mkdir()
    source = (
        "def inner(x):\n    return 2 * x\ndef other(x):\n    return 3 * x\ndef outer(x):\n    return inner(x) + 1\n"
    )
    (folder / "counted.py").write_text(source)
    (folder / "beside.py").write_text("")

    def run(name: str) -> list[str]:
        code = COUNTING.format(folder=str(folder), inner=f"counted.{name}")
        environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
        answer = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
        )
        return answer.stdout.split()

    assert run("inner") == ["5.0", "0"]
    assert run("inner") == ["5.0", "1"]
    assert run("other") == ["7.0", "0"]
    assert run("other") == ["7.0", "1"]
    (folder / "counted.py").write_text(source.replace("2 * x", "5 * x"))
    assert run("inner") == ["11.0", "0"]
    (folder / "beside.py").write_text("a = 1")
    assert run("inner") == ["11.0", "0"], "a constant may have come from there"


def test_a_step_of_the_controller_allocates_nothing() -> None:
    """Counted by Numba's own runtime over 10,000 steps, beside a function of which each call allocates."""
    answer = subprocess.run(
        [sys.executable, "-c", ALLOCATING],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[1],
        env=os.environ | {"NUMBA_NRT_STATS": "1"},
    )
    assert answer.stdout.split() == ["0", "1"]


def test_a_function_that_cannot_be_compiled_says_so_when_it_is_called() -> None:
    made = compiled(_impossible)
    with pytest.raises(Exception, match=r"(?s)nopython|[Cc]annot|No implementation"):
        made(1.0)


def _impossible(x: float) -> object:
    return {str(x): object()}
