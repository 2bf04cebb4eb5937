# ruff: noqa: PLC0415 - the program that starts the processes does not need MuJoCo
"""Project robot models of other people, and compare the masses with MuJoCo's response to a push.

    python -m benchmarks.models PYTHON_OR_FOLDER ... --count 90 --seed 1

Each argument is a folder with model files, or a Python executable in whose environment packages with models are
installed, such as dm_control, gymnasium-robotics, robosuite or example-robot-data. The program

- finds URDF files with moving joints, and MJCF files with joints that no other file includes,
- draws `--count` of them (0 for all), the same for the same seed,
- computes mass and limits at the body at the end of the longest chain, in the first of six directions that has numbers
  (at the surface ahead of its origin, else of its center of mass), in a process for each model with a time limit, and
- prints for each model the masses or the reason why there are none.

For each model with numbers, it applies a small force along the axis in MuJoCo, and compares the response with the
reflected mass. The drives move the site along the axis with an impulse in MuJoCo's equations of motion, and the energy
and the motion of the site are compared with the moved mass and the recoil share. URDF files without coupled joints are
also compared with Pinocchio, if it is installed. Required: numbers for at least 90 % of the models, and differences of
at most 1e-6; then the exit code is 0. Without arguments, or if they have no models, the program says so and ends.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

SHARE = 0.9  # of the models that need numbers
SAME = 1e-6  # largest relative difference of masses
AXES = ("+z", "+x", "+y", "-z", "-x", "-y")
SOFTNESS = (0.9999, 0.9998, 0.9996)  # impedances of constraints, from which the response of rigid ones is extrapolated


def folders_of(sources: list[str]) -> list[Path]:
    """Return the folders of the arguments; of a Python executable, those of its packages and its shared files."""
    folders = []
    for source in map(Path, sources):
        if source.is_file():
            code = (
                "import sysconfig; print(sysconfig.get_path('purelib')); print(sysconfig.get_path('data') + '/share')"
            )
            printed = subprocess.run([str(source), "-c", code], capture_output=True, text=True, check=True).stdout
            folders += [Path(line) for line in printed.splitlines()]
        else:
            folders.append(source)
    return [folder for folder in folders if folder.is_dir()]


def find_models(folders: list[Path]) -> list[Path]:
    """Return the model files in folders that stand alone."""
    found, included = [], set()
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if path.suffix not in {".urdf", ".xml"} or not path.is_file():
                continue
            text = path.read_text(encoding="utf-8", errors="replace")
            included |= {(path.parent / name).resolve() for name in re.findall(r'<include\s+file="([^"]+)"', text)}
            if path.suffix == ".urdf":
                stands = re.search(r'<joint[^>]*type="(revolute|continuous|prismatic)"', text)
            else:
                stands = "<mujoco" in text and "<worldbody" in text and ("<joint" in text or "<include" in text)
            if stands:
                found.append(path.resolve())
    return [path for path in dict.fromkeys(found) if path not in included]


def examine(path: Path) -> dict[str, Any]:
    """Project one model, and compare its masses with MuJoCo. It runs in a process of its own."""
    from pretouch.errors import PretouchError
    from pretouch.robots import SensorSite, load_model, project
    from pretouch.robots.robot_file import SiteOnBody

    start = time.perf_counter()
    try:
        body, middle = end_of_chain(load_model(path))
        if body is None:
            return {"reason": "no joint", "skip": True}
        reason = ""
        for axis, offset in [(axis, offset) for offset in (None, middle) for axis in AXES]:
            site = SiteOnBody(body, axis, offset)
            model = load_model(path, sites=[site])
            try:
                table = project(model, [SensorSite(site.name, axis=axis)])
            except PretouchError as error:
                reason = reason or str(error)
                continue
            row, projection = table.projections[0]
            return {
                "site": site.name,
                "posture": row.posture,
                "mass": projection.reflected_mass,
                "moved": projection.moved_mass,
                "recoil": projection.recoil_share,
                "seconds": time.perf_counter() - start,
                "codes": sorted({text[:5] for text in projection.warnings}),
                "differences": compare(path, model, row, projection),
            }
    except PretouchError as error:
        reason = str(error)
    return {"reason": reason}


def end_of_chain(model: Any) -> tuple[str | None, tuple[float, ...]]:
    """Return the body that is moved by most joints with an actuator, else by most joints, and its center of mass."""
    import mujoco

    from pretouch.robots.dynamics import actuator_moment

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    driven = np.abs(actuator_moment(model, data)).max(axis=0, initial=0.0) > 0
    best, found, middle = (0, 0), None, (0.0, 0.0, 0.0)
    for body in range(1, model.nbody):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
        degrees, at = [], body
        while at:
            degrees += range(model.body_dofadr[at], model.body_dofadr[at] + model.body_dofnum[at])
            at = model.body_parentid[at]
        rank = int(driven[degrees].sum()), len(degrees)
        if name and rank > best and degrees:
            best, found, middle = rank, name, tuple(model.body_ipos[body].tolist())
    return found, middle


def compare(path: Path, model: Any, row: Any, projection: Any) -> dict[str, float]:
    """Return relative differences of masses and recoil share from MuJoCo, and from Pinocchio for simple URDF files."""
    import mujoco

    from pretouch.robots import make_data
    from pretouch.robots.dynamics import drivetrain_of
    from pretouch.robots.obstruction import take_to_surface

    data = make_data(model, keyframe=row.posture if row.posture not in {"reference", "mid-range"} else None)
    places = {model.joint(i).name: int(model.jnt_qposadr[i]) for i in range(model.njnt)}
    for name, value in projection.posture.items():
        if name in places:
            data.qpos[places[name]] = value
    mujoco.mj_forward(model, data)
    model, data, _ = take_to_surface(model, data, [projection.site])
    index = model.site(projection.site.name).id
    drivetrain = drivetrain_of(model, data, index)
    push = pushed_acceleration(model, data, index, projection.axis)
    differences = {"reflected mass": abs(projection.reflected_mass * push - 1)}
    moved, forward = driven_motion(model, data, drivetrain, projection, index)
    differences["moved mass"] = abs(moved / projection.moved_mass - 1)
    differences["recoil share"] = abs(1 - forward - projection.recoil_share)
    balanced = any(text.startswith("PT541") for text in projection.warnings)  # other inertias than in the file
    simple = projection.site.name.count(":") == 1  # on the axis through the origin of the link
    if path.suffix == ".urdf" and simple and not model.neq and not balanced:
        mass = pinocchio_mass(path, projection)
        if mass is not None:
            differences["Pinocchio"] = abs(projection.reflected_mass / mass - 1)
    return differences


def pushed_acceleration(model: Any, data: Any, index: int, axis: np.ndarray) -> float:
    """Return MuJoCo's acceleration of a site along an axis per force [1/kg], with rigid equality constraints.

    Contacts, limits, friction and passive forces are off. MuJoCo's constraints are slightly soft; the response of rigid
    ones is extrapolated from three degrees of softness.
    """
    import copy

    import mujoco

    copied = copy.copy(model)
    flags = mujoco.mjtDisableBit
    copied.opt.disableflags |= int(
        flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS | flags.mjDSBL_ACTUATION
    )
    copied.opt.solver, copied.opt.iterations, copied.opt.tolerance = mujoco.mjtSolver.mjSOL_NEWTON, 200, 0.0
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(copied, data, jacobian, None, index)
    row, values = axis @ jacobian, []
    for impedance in SOFTNESS if model.neq else SOFTNESS[:1]:
        copied.eq_solimp[:] = (impedance, impedance, 1.0, 0.5, 1.0)
        accelerations = []
        for force in (1.0, -1.0):
            state = mujoco.MjData(copied)
            state.qpos[:] = data.qpos
            state.qfrc_applied[:] = force * row
            mujoco.mj_forward(copied, state)
            accelerations.append(state.qacc.copy())
        values.append(row @ (accelerations[0] - accelerations[1]) / 2)
    if len(values) == 1:
        return float(values[0])
    softness = np.array([(1 - d) / d for d in SOFTNESS])
    return float(np.polynomial.polynomial.polyfit(softness / softness[-1], values, 2)[0])


def driven_motion(model: Any, data: Any, drivetrain: Any, projection: Any, index: int) -> tuple[float, float]:
    """Return twice the kinetic energy and the velocity of a site, after an impulse of the drives moves the joints.

    The impulse gives the driven joints the velocities of the projection. Everything else moves as the equations of
    motion with the equality constraints say.
    """
    import mujoco

    mass, jacobian = np.zeros((model.nv, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_fullM(model, data, mass)
    mujoco.mj_jacSite(model, data, jacobian, None, index)
    rows = equality_rows(model, data)
    wanted = np.array([projection.joint_motion[name] for name in projection.joint_motion])
    every = np.concatenate([drivetrain.base, drivetrain.driven])
    drive = np.zeros((model.nv, len(drivetrain.driven)))
    drive[drivetrain.driven, range(len(drivetrain.driven))] = 1.0
    held = rows[:, every][np.abs(rows[:, every]).max(axis=1, initial=0.0) > 0]
    count, constraints, driven = len(every), len(held), len(drivetrain.driven)
    system = np.block(
        [
            [mass[np.ix_(every, every)], held.T, -drive[every]],
            [held, np.zeros((constraints, constraints + driven))],
            [drive[every].T, np.zeros((driven, constraints + driven))],
        ]
    )
    right = np.concatenate([np.zeros(count + constraints), wanted])
    velocity = np.linalg.lstsq(system, right, rcond=1e-13)[0][:count]
    return (
        float(velocity @ mass[np.ix_(every, every)] @ velocity),
        float(projection.axis @ jacobian[:, every] @ velocity),
    )


def equality_rows(model: Any, data: Any) -> np.ndarray:
    """Return the Jacobian of MuJoCo's equality constraints."""
    import mujoco

    equal = np.asarray(data.efc_type) == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    if not equal.any():
        return np.zeros((0, model.nv))
    rows = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    else:
        rows[:] = np.array(data.efc_J).reshape(-1, model.nv)[: data.nefc]
    return rows[equal]


def pinocchio_mass(path: Path, projection: Any) -> float | None:
    """Return the reflected mass that Pinocchio computes for a URDF file on a fixed base; None without Pinocchio."""
    try:
        import pinocchio
    except ImportError:
        return None
    body = projection.site.name.split(":+")[0].split(":-")[0]
    try:
        model = pinocchio.buildModelFromUrdf(str(path))
    except (ValueError, RuntimeError):
        return None
    data, configuration = model.createData(), pinocchio.neutral(model)
    for name, value in projection.posture.items():
        joint = model.joints[model.getJointId(name)]
        angle = (np.cos(value), np.sin(value)) if joint.nq == 2 else (value,)
        configuration[joint.idx_q : joint.idx_q + joint.nq] = angle
    frame = model.getFrameId(body)
    mass = pinocchio.crba(model, data, configuration)
    mass = np.triu(mass) + np.triu(mass, 1).T
    jacobian = pinocchio.computeFrameJacobian(
        model, data, configuration, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    pinocchio.updateFramePlacements(model, data)
    row = projection.axis @ jacobian[:3]
    massless = np.diag(mass) <= 0
    row, mass = row[~massless], mass[np.ix_(~massless, ~massless)]
    return float(1 / (row @ np.linalg.solve(mass, row)))


def examine_all(paths: list[Path], limit: float) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Examine each model in a process of its own with a time limit [s]."""
    for path in paths:
        command = [sys.executable, "-m", "benchmarks.models", "--one", str(path)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=limit, check=False, cwd=Path(__file__).parents[1]
            )
        except subprocess.TimeoutExpired:
            yield path, {"reason": f"longer than {limit:g} s"}
            continue
        lines = done.stdout.strip().splitlines()
        last = done.stderr.strip().splitlines()[-1:] or ["no output"]
        yield path, json.loads(lines[-1]) if done.returncode == 0 and lines else {"reason": f"crash: {last[0]}"}


def main() -> int:
    """Project the models, print the table, and return 1 if a requirement is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("sources", nargs="*", help="folders, or Python executables with packages that have models")
    parser.add_argument("--count", type=int, default=90, help="number of models; 0 for all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=120.0, help="time limit for each model [s]")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one is not None:
        print(json.dumps(examine(options.one)))
        return 0
    print("Robot models of other people")
    paths = find_models(folders_of(options.sources))
    if not paths:
        print("  skipped: give a folder with MJCF or URDF files, or the python of an environment with such packages")
        return 0
    order = np.random.default_rng(options.seed).permutation(len(paths))
    chosen = [paths[i] for i in sorted(order[: options.count or len(paths)].tolist())]
    print(f"  {len(paths)} models found, {len(chosen)} drawn with seed {options.seed}", flush=True)
    return summarize(chosen, options.limit)


def summarize(chosen: list[Path], limit: float) -> int:
    """Examine models, print their table, and return 1 if a requirement is missed."""
    shown: dict[str, dict[str, Any]] = {}
    for path, found in examine_all(chosen, limit):
        if found.get("skip"):
            continue
        name = "/".join(path.parts[-3:])
        shown[str(path)] = found
        if "reason" in found:
            print(f"  {name}: no numbers. {found['reason']}", flush=True)
            continue
        worst = max(found["differences"].values(), default=0.0)
        print(
            f"  {name}: {found['site']}, {found['posture']}: reflected {found['mass']:.4g} kg, moved "
            f"{found['moved']:.4g} kg, recoil {found['recoil']:.3g}, {found['seconds']:.1f} s, "
            f"{' '.join(found['codes'])}; largest difference {worst:.1e}"
            + ("" if worst <= SAME else f" {found['differences']}"),
            flush=True,
        )
    numbers = [found for found in shown.values() if "reason" not in found]
    differences = [d for found in numbers for d in found["differences"].values()]
    compared = sum("Pinocchio" in found["differences"] for found in numbers)
    wrong = sum(not d <= SAME for d in differences)
    print(
        f"  numbers for {len(numbers)} of {len(shown)} models (required: {SHARE:.0%}); {wrong} of {len(differences)} "
        f"differences above {SAME:g} (required: none), {compared} models compared with Pinocchio; slowest model "
        f"{max((found['seconds'] for found in numbers), default=0.0):.1f} s"
    )
    return int(len(numbers) < SHARE * len(shown) or wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
