#!/usr/bin/env bash
# URDF planar joint: MuJoCo moves perpendicular to <axis>, Pinocchio ignores <axis> and always moves in x and y.
#
# Expected: two loaders of the same URDF agree on the direction in which a joint moves. The URDF specification (ROS wiki, urdf/XML/joint)
#   says: "planar - this joint allows motion in a plane perpendicular to the axis", and that <axis> defaults to (1, 0, 0).
# What happens: MuJoCo 4.0.0 follows the specification, also without an <axis>. Pinocchio 4.1.0 builds the same joint for each axis: it
#   translates along x and y and turns about z of the joint's frame, without a message. The two agree only for the axis (0, 0, 1).
# Why it matters: a controller whose kinematics come from Pinocchio and whose simulation is MuJoCo has a base that retreats in another plane
#   than the one that the distances refer to. For a mobile base without an <axis>, Pinocchio drives on the floor and MuJoCo moves the
#   same base in the vertical plane y-z. Both load the file without a warning.
# Remedy: give each planar joint <axis xyz="0 0 1"/> and rotate its <origin> instead.
# Source: URDF specification, joint element: type "planar" and element <axis>.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "this script needs Python 3.11 or later as python3")'
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -qq --disable-pip-version-check mujoco-core==4.0.0 pin==4.1.0 libpinocchio==4.1.0 coal==3.0.3 libcoal==3.0.3 numpy==2.4.6
"$work/venv/bin/python" - <<'PY'
import sys

import mujoco
import numpy as np
import pinocchio


def link(name):
    inertia = '<mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    return f'<link name="{name}"><inertial>{inertia}</inertial></link>'


def robot(axis):
    joint = f'<joint name="slide" type="planar"><parent link="floor"/><child link="base"/>{axis}</joint>'
    return f'<robot name="r">{link("floor")}{link("base")}{joint}</robot>'


def fixed_direction(velocities):
    """Direction in which no joint velocity moves the base: the normal of its plane."""
    return np.abs(np.linalg.svd(np.array(velocities).T)[0][:, 2]).round(6) + 0.0


def mujoco_normal(urdf):
    model = mujoco.MjModel.from_xml_string(urdf)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, model.body("base").id)
    return fixed_direction(jacobian.T)


def pinocchio_normal(urdf):
    model = pinocchio.buildModelFromXML(urdf)
    jacobian = pinocchio.computeFrameJacobian(
        model, model.createData(), pinocchio.neutral(model), model.getFrameId("base"), pinocchio.LOCAL_WORLD_ALIGNED
    )
    return fixed_direction(jacobian[:3].T)


print("mujoco", mujoco.__version__, "- pinocchio", pinocchio.__version__, "- normal of the plane in which the base moves:")
normals = {}
for axis in ("1 0 0", "0 1 0", "0 0 1", None):
    urdf = robot(f'<axis xyz="{axis}"/>' if axis else "")
    normals[axis] = (mujoco_normal(urdf).tolist(), pinocchio_normal(urdf).tolist())
    print(f"  axis {axis or 'absent (default 1 0 0)':22s} MuJoCo {normals[axis][0]}  Pinocchio {normals[axis][1]}")

x, y, z = np.eye(3).tolist()
checks = {
    "MuJoCo moves perpendicular to the axis": [normals[a][0] for a in normals] == [x, y, z, x],
    "Pinocchio moves in x and y for each axis": [normals[a][1] for a in normals] == [z, z, z, z],
}
for text, holds in checks.items():
    print("as found:" if holds else "CHANGED: ", text)
sys.exit(not all(checks.values()))
PY
