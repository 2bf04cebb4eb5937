#!/usr/bin/env bash
# python-control: a stable loop with a long dead time has poles outside the unit circle, and its step response depends on whether slycot
# is installed.
#
# Expected: poles() of a transfer function are the roots of its denominator; the docstring says: "Compute the poles of a transfer function".
#   The README recommends slycot and says that much works without it; it should not change a step response.
# What happens: python-control 0.10.2 computes the roots, multiplies them out to a new denominator, and takes the roots again. From a dead
#   time of about 70 samples on, the new denominator is another polynomial. The loop below has a gain margin of 3.3, and python-control says
#   so, but poles() reports |z| = 1.4 for 100 samples. Without slycot, the step response is right. With slycot 0.7.1 installed, the same call
#   converts through the wrong denominator: it ends at 0.62 instead of 1 for 60 samples (no warning), and diverges for 100.
#   The docstring of tf2ss mentions wrong poles "in some (rare) instances" with slycot only; poles() does not need slycot to be wrong.
# Why it matters: a proximity loop at 1 kHz with a time-of-flight sensor has a dead time of 30 to 100 samples. A good gain is rejected as
#   unstable, and two colleagues with the same pinned python-control get different answers.
# Remedy: numpy.roots(system.den[0][0]), and tf2ss(system, method="scipy") before a simulation.
# Source: python-control, docstrings of TransferFunction.poles and tf2ss; README, section on slycot.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat > "$work/loop.py" <<'PY'
import importlib.metadata
import sys
import warnings

import control
import numpy as np

warnings.simplefilter("ignore")
PERIOD = 1e-3


def simulate(gain, dead_time, steps):
    """Distance loop without a library: velocity command = gain * error, seen dead_time samples late."""
    position = np.zeros(steps)
    for k in range(1, steps):
        error = 1 - position[k - 1 - dead_time] if k > dead_time else 0.0
        position[k] = position[k - 1] + gain * PERIOD * error
    return position[-1]


slycot = "slycot" in sys.argv
version = f"with slycot {importlib.metadata.version('slycot')}" if slycot else "without slycot"
print("control", control.__version__, version)
poles, ends = {}, {}
for dead_time in (30, 60, 100):
    frequency = np.pi / (2 * dead_time + 1)  # rad/sample, where the phase is -180 degrees
    gain = 0.3 * abs(np.exp(1j * frequency) - 1) / PERIOD  # gain margin 10/3
    loop = control.tf([gain * PERIOD], [1, -1] + [0] * dead_time, PERIOD)
    closed = control.feedback(loop, 1)
    roots = np.abs(np.roots(closed.den[0][0])).max()
    poles[dead_time] = np.abs(closed.poles()).max()
    time = np.arange(6000) * PERIOD
    ends[dead_time] = control.step_response(closed, time).outputs[-1]
    print(
        f"  dead time {dead_time:3d}: gain margin {control.margin(loop)[0]:.3f}, largest |root| of the denominator {roots:.4f}, "
        f"largest |pole| {poles[dead_time]:.4f}, step response ends at {ends[dead_time]:.4g}, direct simulation {simulate(gain, dead_time, 6000):.4g}"
    )

checks = {
    "30 samples: the poles are stable": poles[30] < 1,
    "100 samples: poles() reports an unstable loop": poles[100] > 1.1,
    "100 samples: the step response diverges" if slycot else "100 samples: the step response settles at 1": (
        not abs(ends[100] - 1) < 1 if slycot else abs(ends[100] - 1) < 1e-3
    ),
}
for text, holds in checks.items():
    print("as found:" if holds else "CHANGED: ", text)
sys.exit(not all(checks.values()))
PY
python3 -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "this script needs Python 3.11 or later as python3")'
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -qq --disable-pip-version-check control==0.10.2 numpy==2.4.6 scipy==1.17.1
"$work/venv/bin/python" "$work/loop.py"
"$work/venv/bin/pip" install -qq --disable-pip-version-check slycot==0.7.1 numpy==2.4.6
"$work/venv/bin/python" "$work/loop.py" slycot
