#!/usr/bin/env bash
# pythonfmu and FMPy: an FMU with an Integer or Boolean output does not load, not even when it is declared as in pythonfmu's README.
#
# Expected: an FMU that pythonfmu 0.7.0 builds from a class such as the README's example (an Integer output with a name and a causality,
#   a Boolean and a String) runs in FMPy 0.3.32.
# What happens: pythonfmu writes no `variability` for these variables. FMI 2.0 then takes "continuous", and says: "Only a variable of
#   type = "Real" can be "continuous"". FMPy validates by default and refuses the FMU. With an explicit discrete variability, or with
#   validate=False, the same class runs. pythonfmu reports nothing when it builds the FMU.
# Why it matters: a proximity sensor as an FMU has a sample counter and an "object detected" flag next to its distance. With the distance
#   alone the FMU loads; with the flag, it is refused.
# Remedy: variability=Fmi2Variability.discrete for each variable that is not a Real.
# Source: pythonfmu's README, first example; FMI 2.0.4, section 2.2.7 (ScalarVariable, attribute variability).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "this script needs Python 3.11 or later as python3")'
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -qq --disable-pip-version-check pythonfmu==0.7.0 fmpy==0.3.32 numpy==2.4.6
cd "$work"
sensor() {  # name, further arguments of Integer and Boolean, names of the registered flags
    cat > "$1.py" <<PY
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class $1(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.distance = 1.0
        self.samples = 0
        self.detected = False
        self.register_variable(Real("distance", causality=Fmi2Causality.output))
        for kind, name in $3:
            self.register_variable(kind(name, causality=Fmi2Causality.output$2))

    def do_step(self, time, step):
        self.distance -= step
        self.samples += 1
        self.detected = self.distance < 0.5
        return True
PY
    "$work/venv/bin/pythonfmu" build -f "$1.py" -d "$work"
}
sensor Distance "" "[]"
sensor Plain "" "[(Integer, 'samples'), (Boolean, 'detected')]"
sensor Explicit ", variability=Fmi2Variability.discrete" "[(Integer, 'samples'), (Boolean, 'detected')]"
"$work/venv/bin/python" - <<'PY'
import importlib.metadata
import sys

import fmpy


def simulate(name, **options):
    try:
        result = fmpy.simulate_fmu(f"{name}.fmu", stop_time=1, output_interval=0.1, **options)
    except Exception as error:  # noqa: BLE001
        return str(error)
    return {column: round(float(result[column][-1]), 6) for column in result.dtype.names}


print("pythonfmu", importlib.metadata.version("pythonfmu"), "- fmpy", importlib.metadata.version("fmpy"))
runs = {
    "distance only": simulate("Distance"),
    "with counter and flag": simulate("Plain"),
    "same, not validated": simulate("Plain", validate=False),
    "with explicit variability": simulate("Explicit"),
}
for name, run in runs.items():
    print(f"  {name}:", run)
refusal = runs["with counter and flag"]
final = {"time": 1.0, "distance": 0.0, "samples": 10.0, "detected": 1.0}
checks = {
    "the distance alone loads": isinstance(runs["distance only"], dict),
    "an Integer is refused": "is of type Integer and must have variability" in refusal,
    "a Boolean is refused": "is of type Boolean and must have variability" in refusal,
    "it runs without validation and with an explicit variability": runs["same, not validated"] == runs["with explicit variability"] == final,
}
for text, holds in checks.items():
    print("as found:" if holds else "CHANGED: ", text)
sys.exit(not all(checks.values()))
PY
