"""A scenario file in its sections, for the tests that read, damage and run it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pretouch._core.errors import ScenarioFileError
from pretouch.config import load_scenario

SENSOR = """\
[sensor]
model = "inverse-power"
scale = 1.30e-5
distance_offset = "41.9 mm"
exponent = 3.32
"""
ADMITTANCE = """\
[admittance]
mass = "1 kg"
damping = "10 N*s/m"
stiffness = "25 N/m"
"""
OBSTACLE = """\
[obstacle]
position = "42.2 mm"
velocity = "-0.3 m/s"
"""
OBJECTIVE = """\
[objective]
kind = "excursion"
position_scale = "0.5 m"
velocity_scale = "0.3 m/s"
"""
GAIN = """\
[gain]
bounds = ["-10 N*s", "-0.01 N*s"]
"""
ENCOUNTER = ADMITTANCE + OBSTACLE + OBJECTIVE + GAIN
REST = """\
[plant]
position = "0 m"
velocity = "0 m/s"
[reference]
position = "0 m"
[constraints]
excursion = "0.2 m"
"""
STILL = OBSTACLE + 'acceleration = "0 m/s^2"\n'
WHOLE = SENSOR + ADMITTANCE + STILL + OBJECTIVE + GAIN + REST


def replaced(old, new, text=WHOLE):
    assert text.count(old) == 1, old
    return text.replace(old, new)


def line_of(start, text):
    return next(i for i, line in enumerate(text.splitlines(), 1) if line.startswith(start))


def writer(folder, monkeypatch):
    """Return what writes approach.toml into a folder, which becomes the working folder."""
    monkeypatch.chdir(folder)

    def write(text):
        file = Path("approach.toml")
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return file

    return write


def refusal(file):
    """Return the message with which a file is refused."""
    return str(error_of(file))


def error_of(file):
    """Return the error with which a file is refused."""
    with pytest.raises(ScenarioFileError) as refused:
        load_scenario(file)
    return refused.value


def places(file):
    """Return line and key of each mistake of a refused file; the sentences are in snapshots/scenario-file.md."""
    return [(mistake.line, mistake.key) for mistake in error_of(file).mistakes]
