"""Work in threads: whole, in any order of stretches, and also in a process that was forked."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from pretouch.motion import parallel
from pretouch.motion.parallel import run_in_chunks


@pytest.mark.parametrize("cores", [1, 2, 5])
@pytest.mark.parametrize("size", [0, 1, 99, 100, 101, 1000, 12_345])
def test_every_encounter_is_worked_on_once(cores: int, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "_cores", lambda: cores)
    count, lock, longest = np.zeros(size, dtype=int), threading.Lock(), [0]

    def run(start: int, stop: int) -> None:
        with lock:
            count[start:stop] += 1
            longest[0] = max(longest[0], stop - start)

    run_in_chunks(run, size, least=100, most=1000)
    assert (count == 1).all()
    assert longest[0] <= 1000


@pytest.mark.parametrize("size", [0, 1, 99, 101, 1000, 12_345, 1_000_000])
def test_where_stretches_end_does_not_depend_on_the_number_of_cores(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for cores in (1, 2, 5, 100):
        monkeypatch.setattr(parallel, "_cores", lambda cores=cores: cores)
        stretches: list[tuple[int, int]] = []
        run_in_chunks(lambda start, stop, own=stretches: own.append((start, stop)), size, least=100, most=1000)
        found.append(sorted(stretches))
    assert found[0] == found[1] == found[2] == found[3]


def test_a_mistake_in_a_thread_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "_cores", lambda: 3)

    def run(start: int, stop: int) -> None:
        if start:
            raise ZeroDivisionError(f"at {start} to {stop}")

    with pytest.raises(ZeroDivisionError, match="at"):
        run_in_chunks(run, 1000, least=10, most=100)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_works_on() -> None:
    """The child inherits the pool, but not its threads."""
    code = """
import os, warnings
import numpy as np
from pretouch.motion import parallel
parallel._cores = lambda: 2
done = np.zeros(1000, dtype=int)
def run(start, stop):
    done[start:stop] += 1
parallel.run_in_chunks(run, 1000, least=10, most=100)
warnings.simplefilter("ignore")
child = os.fork()
if child == 0:
    parallel.run_in_chunks(run, 1000, least=10, most=100)
    os._exit(0 if (done == 2).all() else 3)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), (done == 1).all())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "0 True\n"
