"""Files, and the command run beside them, for the tests of the command line."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

import pretouch.report
from pretouch._core.files import sign, write_text
from pretouch.cli import main
from scenario_text import ENCOUNTER

SENSOR = """\
[sensor]
model = "exponential-1"
scale = 0.458
rate = "-61 1/m"
"""
SCENARIO = SENSOR + ENCOUNTER + '[constraints]\nexcursion = "0.2 m"\n'
PAGE = "<html><head><title>report</title></head><body>{}</body></html>"


def curve(rate=-60.0, label="", offset=0.1, noise=0.002, seed=1):
    generator = np.random.default_rng(seed)
    rows = []
    for distance in np.repeat(np.arange(0, 60, 4), 3):
        output = offset + 2 * np.exp(rate * distance * 1e-3) + noise * generator.standard_normal()
        rows.append(f"{label}{distance},{output:.4f}")
    rows += [f"{label}inf,{offset + noise * generator.standard_normal():.4f}" for _ in range(8)]
    return rows


def strict(text):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


def lay_out(tmp_path, monkeypatch):
    """Write a scenario and calibrations into a folder, which becomes the working folder."""
    monkeypatch.chdir(tmp_path)
    Path("approach.toml").write_text(SCENARIO)
    Path("sensor.csv").write_text("\n".join(["distance [mm],output [V]", *curve()]) + "\n")
    two = ["unit,distance [mm],output [V]", *curve(label="a,"), *curve(rate=-50.0, label="b,", seed=2)]
    Path("two.csv").write_text("\n".join(two) + "\n")
    flat = ["distance [mm],output [V]", *(f"{d},{0.1 + 0.001 * (-1) ** d}" for d in range(12)), "inf,0.1", "inf,0.101"]
    Path("flat.csv").write_text("\n".join(flat) + "\n")
    return tmp_path


def command(monkeypatch, capsys):
    """Return what runs `pretouch` in this process and tells its exit status, stdout and stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["pretouch", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        return ended.value.code, captured.out, captured.err

    return run


def in_this_process(*words: object, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `python -m pretouch` in a folder, without a process of its own, which would import all libraries again."""
    out, err = _pipe(), _pipe()
    status = _run(words, folder, environment, out, err)
    return subprocess.CompletedProcess(["pretouch", *map(str, words)], status, _content(out), _content(err))


def as_in_a_terminal(*words: object, folder: Path, stdin: Path = Path(os.devnull)) -> tuple[int, str]:
    """Run `python -m pretouch` in a folder, and return its exit status and what a terminal of 100 columns shows."""
    screen = _pipe()
    status = _run(words, folder, {"COLUMNS": "100"}, screen, screen, stdin)
    return status, _content(screen)


def _run(
    words: Sequence[object],
    folder: Path,
    environment: Mapping[str, str],
    out: io.TextIOWrapper,
    err: io.TextIOWrapper,
    stdin: Path = Path(os.devnull),
) -> int:
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.chdir(folder),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        stdin.open(encoding="utf-8") as given,
    ):
        for name, value in environment.items():
            patch.setenv(name, value)
        patch.setattr(sys, "stdin", given)
        patch.setattr(sys, "argv", ["pretouch", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


def _pipe() -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding="utf-8")


def _content(stream: io.TextIOWrapper) -> str:
    stream.flush()
    return stream.buffer.getvalue().decode("utf-8")  # type: ignore[attr-defined,no-any-return]


def stand_in_for_reports(monkeypatch):
    """Stand in for the report, which has its own tests: what is under test here is where it may be written."""

    def write(result, path, *, overwrite=False, **_):
        return write_text(path, sign(PAGE.format(type(result).__name__)), overwrite=overwrite)

    monkeypatch.setattr(pretouch.report, "write_report", write)
