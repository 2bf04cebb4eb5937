"""A plugin of pytest that records which lines of src/ and native/ each test reaches, and how long it takes.

`record` in reach.py sets the environment that it reads. Lines of Python come from coverage, with the test as context;
those of the compiled core from a library that marks each block of code that it enters. Processes that a test starts
record themselves, by `record_child`.
"""

from __future__ import annotations

import atexit
import ctypes
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from coverage import Coverage, CoverageData

FOLDER = "MUTANTS_FOLDER"
"""Where the processes of a recording leave what they find; it is set in those alone."""


class Blocks:
    """Blocks of the compiled core that were entered since they were last asked for."""

    def __init__(self) -> None:
        library = ctypes.CDLL(os.environ["PRETOUCH_LIBRARY"])
        size = ctypes.c_size_t.in_dll(library, "mutants_size").value
        self._entered = np.ctypeslib.as_array((ctypes.c_uint8 * size).in_dll(library, "mutants_entered"))

    def taken(self) -> list[int]:
        """Return their addresses in the library, and forget them."""
        found = np.flatnonzero(self._entered)
        self._entered[found] = 0
        return [int(address) for address in found]


def started_coverage(folder: Path, context: str | None = None) -> Coverage:
    """Start to record lines of the package, into a file of this process's own."""
    data_file = str(folder / "lines")
    coverage = Coverage(data_file=data_file, data_suffix=True, include=["*/src/pretouch/*"], context=context)
    coverage.set_option("run:core", "ctrace")
    coverage.set_option("run:disable_warnings", ["no-data-collected"])
    coverage.start()
    return coverage


class Recorder:
    """Records one process: the tests of a group, one after the other."""

    def __init__(self) -> None:
        self.folder = Path(os.environ[FOLDER])
        self.coverage = started_coverage(self.folder)
        self.blocks = Blocks()
        self.entered: dict[str, list[int]] = {}
        self.outcomes: dict[str, tuple[float, bool]] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.blocks.taken()
        self.coverage.switch_context(item.nodeid)
        began = time.process_time()
        children = os.times()
        try:
            return (yield)
        finally:
            after = os.times()
            spent = after.children_user + after.children_system - children.children_user - children.children_system
            ok = self.outcomes.get(item.nodeid, (0.0, True))[1]
            self.outcomes[item.nodeid] = (time.process_time() - began + spent, ok)
            self.coverage.switch_context("")
            self.entered[item.nodeid] = self.blocks.taken()

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.outcomes[report.nodeid] = (0.0, False)

    def pytest_unconfigure(self) -> None:
        self.coverage.stop()
        self.coverage.save()
        (self.folder / "outcomes.json").write_text(json.dumps(self.outcomes))
        (self.folder / f"blocks-{os.getpid()}.json").write_text(json.dumps(self.entered))


def record_child() -> None:
    """Record this process from now on, for the test that started it."""
    test, folder = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0], os.environ.get(FOLDER)
    if not test or folder is None:
        return
    coverage = started_coverage(Path(folder), context=test)

    @atexit.register
    def _leave() -> None:
        coverage.stop()
        coverage.save()
        if "pretouch._core.native" in sys.modules:
            entered = {test: Blocks().taken()}
            Path(folder, f"blocks-{os.getpid()}.json").write_text(json.dumps(entered))


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Recorder())


def native_lines(library: Path, addresses: list[int], root: Path) -> dict[int, list[tuple[str, int]]]:
    """Return the lines of each address of the compiled core: its own, and those of functions that it is part of."""
    asked = "".join(f"{address - 1:#x}\n" for address in addresses)  # the call's own line, not that after it
    command = ["addr2line", "-a", "-i", "-e", str(library)]
    found: dict[int, list[tuple[str, int]]] = {}
    for line in subprocess.run(command, input=asked, capture_output=True, text=True, check=True).stdout.splitlines():
        if line.startswith("0x"):
            here = found.setdefault(int(line, 16) + 1, [])
            continue
        path, _, number = line.partition(" ")[0].rpartition(":")
        if number.isdigit() and "/native/" in path:
            here.append((str(root / "native" / path.partition("/native/")[2]), int(number)))
    return found


def gather(folder: Path, library: Path, root: Path, data_file: Path) -> None:
    """Put together what the processes of a recording found, as coverage's data with the tests as contexts."""
    data = CoverageData(str(data_file))
    for part in sorted(folder.glob("lines.*")):
        other = CoverageData(str(part))
        other.read()
        data.update(other)
    entered: dict[str, set[int]] = {}
    for part in folder.glob("blocks-*.json"):
        for test, addresses in json.loads(part.read_text()).items():
            entered.setdefault(test, set()).update(addresses)
    lines = native_lines(library, sorted(set().union(*entered.values())), root) if any(entered.values()) else {}
    for test, addresses in entered.items():
        reached: dict[str, set[int]] = {}
        for path, number in {place for address in addresses for place in lines[address]}:
            reached.setdefault(path, set()).add(number)
        if reached:
            data.set_context(test)
            data.add_lines(reached)
    data.write()
    data.close()
