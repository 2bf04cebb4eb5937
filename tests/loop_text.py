"""A scenario file with a sampled loop in its sections, for the tests that read and damage it."""

from __future__ import annotations

from scenario_text import SENSOR, WHOLE

COUNTS = SENSOR.replace("1.30e-5", '"0.533 counts"')
ENCOUNTER = WHOLE.replace(SENSOR, COUNTS)
CHAIN = """\
[chain]
part = "VCNL4010"
noise = "20 counts"
"""
CONTROLLER = """\
[controller]
rate = "1 kHz"
"""
ROBOT = """\
[robot]
kind = "impedance"
mass = "4 kg"
stiffness = "4 kN/m"
damping = "250 N*s/m"
"""
CONTACT = """\
[contact]
kind = "hunt-crossley"
stiffness = "1.3e5 N/m^1.5"
"""
LOOP = """\
[loop]
stability_margin = 2.0
[verify]
runs = 500
"""
LOOPED = ENCOUNTER + CHAIN + CONTROLLER + ROBOT + CONTACT + LOOP
