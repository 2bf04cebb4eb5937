#!/usr/bin/env bash
# MuJoCo's rangefinder: the value -1 for "no hit" is treated as a distance.
#
# Expected: a rangefinder whose ray hits nothing reads -1, and otherwise a real distance. The XML reference says: "If a ray does not
#   intersect any geom surface, the sensor output is -1." The section on delays warns against interpolation only for "sensors that report
#   integer values"; a rangefinder is not one of them.
# What happens: (1) with `delay` and `interp="linear"`, MuJoCo interpolates between -1 and the first distance. An object at 0.45 m enters the
#   ray, and one reading is 0.16 m. With `interp="cubic"` it also overshoots: distances that no geom ever had, and values below -1.
#   (2) With `cutoff` below 1 m, a ray without a hit reads -cutoff, so a test for -1 never succeeds.
# Why it matters: a controller that reacts to a near object retreats from one that is three times as far away, once for every object that
#   enters the beam. A sensor model with a maximum range of 0.3 m looks as if every free ray reported a penetration of 0.3 m.
# Remedy: keep `interp="zoh"` for rangefinders, and test for a negative reading instead of -1.
# Source: mujoco/doc/XMLreference.rst (sensor/rangefinder) and mujoco/doc/modeling.rst (Delays), both inside the wheel.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "this script needs Python 3.11 or later as python3")'
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -qq --disable-pip-version-check mujoco-core==4.0.0 numpy==2.4.6
"$work/venv/bin/python" - <<'PY'
import sys

import mujoco
import numpy as np

MODEL = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <site name="beam" zaxis="1 0 0"/>
    <body name="object" pos="0.5 -0.1 0">
      <joint name="sideways" type="slide" axis="0 1 0"/>
      <geom type="box" size="0.05 0.05 0.05"/>
    </body>
  </worldbody>
  <sensor>
    <rangefinder name="direct" site="beam"/>
    <rangefinder name="hold" site="beam" delay="0.0102" nsample="12"/>
    <rangefinder name="linear" site="beam" delay="0.0102" nsample="12" interp="linear"/>
    <rangefinder name="cubic" site="beam" delay="0.0102" nsample="12" interp="cubic"/>
    <rangefinder name="cutoff" site="beam" cutoff="0.3"/>
  </sensor>
</mujoco>
"""
model = mujoco.MjModel.from_xml_string(MODEL)
data = mujoco.MjData(model)
data.qvel[0] = 0.1  # m/s: the object crosses the beam
readings = {name: [] for name in ("direct", "hold", "linear", "cubic", "cutoff")}
for step in range(2000):
    mujoco.mj_step(model, data)
    if step >= 20:  # the history starts with zeros, as documented
        for name, values in readings.items():
            values.append(round(float(data.sensor(name).data[0]), 6))
values = {name: sorted(set(series)) for name, series in readings.items()}
print("mujoco", mujoco.__version__, "- different readings while an object at 0.45 m crosses the beam:")
for name, numbers in values.items():
    print(f"  {name:7s}", numbers)

checks = {
    "direct and held readings are -1 or the distance": values["direct"] == values["hold"] == [-1.0, 0.45],
    "linear interpolation reports 0.16 m, where there is no object": bool(np.isclose(values["linear"], 0.16, atol=1e-6).any()),
    "cubic interpolation exceeds both ends": min(values["cubic"]) < -1 and max(values["cubic"]) > 0.45,
    "a cutoff of 0.3 m turns -1 into -0.3": values["cutoff"] == [-0.3, 0.3],
}
for text, holds in checks.items():
    print("as found:" if holds else "CHANGED: ", text)
sys.exit(not all(checks.values()))
PY
