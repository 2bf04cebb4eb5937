#!/usr/bin/env bash
# MuJoCo's URDF import: <limit effort="0"> means unlimited force, not none.
#
# Expected: the URDF specification (ROS wiki, urdf/XML/joint) calls effort "an attribute for enforcing the maximum joint effort". MuJoCo's
#   manual says: "a joint's <limit effort="..."> becomes its actuatorfrcrange". A joint with effort 0 should take no force from an actuator.
# What happens: effort 0 is read as if the attribute were absent. The joint has no limit, and the model that is saved as MJCF has no
#   actuatorfrcrange. An effort of 10 limits to 10 N m and 0.001 limits to 0.001 N m. Only the value 0, the strictest, removes the limit.
# Why it matters: 0 is a natural entry for a passive joint, such as a compliant sensor cover or a free wheel. In the simulation, a wrongly
#   mapped command moves it with any torque, where the real joint has no motor. Pinocchio's loader keeps the 0 as effort limit.
# Remedy: write a small positive effort.
# Source: mujoco/doc/modeling.rst, section "URDF extensions", inside the wheel.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "this script needs Python 3.11 or later as python3")'
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -qq --disable-pip-version-check mujoco-core==4.0.0 numpy==2.4.6
"$work/venv/bin/python" - <<'PY'
import sys

import mujoco

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
torques = {}
print("mujoco", mujoco.__version__, "- torque that a motor with a command of 100 N m applies to the joint:")
for effort in ("10", "0.001", "0"):
    spec = mujoco.MjSpec.from_string(f"""
    <robot name="r">
      <link name="base">{INERTIAL}</link><link name="arm">{INERTIAL}</link>
      <joint name="hinge" type="revolute">
        <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="{effort}" velocity="1"/>
      </joint>
    </robot>""")
    motor = spec.add_actuator(name="motor", target="hinge")
    motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[0] = 100
    mujoco.mj_forward(model, data)
    torques[effort] = float(data.qfrc_actuator[0])
    saved = "with" if "actuatorfrcrange" in spec.to_xml() else "without"
    print(f"  effort {effort:5s} {torques[effort]:g} N m, limited: {bool(model.jnt_actfrclimited[0])}, saved {saved} actuatorfrcrange")

checks = {
    "positive efforts limit the torque": torques["10"] == 10 and torques["0.001"] == 0.001,
    "effort 0 does not limit the torque": torques["0"] == 100,
}
for text, holds in checks.items():
    print("as found:" if holds else "CHANGED: ", text)
sys.exit(not all(checks.values()))
PY
