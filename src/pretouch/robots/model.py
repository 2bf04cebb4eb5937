"""Load MuJoCo models, set their posture, and find sites, joints and keyframes by name."""

from __future__ import annotations

import copy
import math
import re
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError, require
from pretouch._core.messages import short_repr
from pretouch._core.numbers import IntArray
from pretouch._core.units import to_si

Model: TypeAlias = Any
"""A `mujoco.MjModel`, which has no static type because MuJoCo is an optional library."""

Data: TypeAlias = Any
"""A `mujoco.MjData`."""

NOTE: Final = "pretouch note "
"""Start of the names of texts in a model that are warnings about its file."""

SPEED: Final = "pretouch speed of "
"""Start of the names of numbers in a model that are largest speeds of joints [rad/s or m/s]."""

LOCK: Final = "pretouch hold of "
"""Start of the names of equality constraints that hold joints or the base of a robot."""


_HARDLY_VISIBLE: Final = 1e-6  # alpha of a geom
_MESSAGE: Final = re.compile(r"^WARNING [^\n]*?\d{4}: (.*?)(?=^WARNING |\Z)", re.DOTALL | re.MULTILINE)
_quiet: Final[list[bool]] = []


def mujoco() -> Any:
    """Import MuJoCo without its log file, or raise an error that says how to install it."""
    if sys.modules.get("mujoco") is None or not _quiet:  # a simulation asks at every step
        library = require("mujoco", extra="mujoco")
        if not hasattr(library, "MjLogConfig"):
            return library
        settings = library.MjLogConfig.get()
        settings.logto_file = False  # MuJoCo would write MUJOCO_LOG.TXT into the folder of the user
        library.MjLogConfig.set(settings)
        _quiet.append(True)
    return sys.modules["mujoco"]


@contextmanager
def collect_messages() -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo's reader and compiler of models, which it prints otherwise.

    Yields:
        A list that has the warnings at the end.
    """
    settings = mujoco().MjLogConfig.get()
    messages: list[str] = []
    names = "logfile", "logto_file", "logto_console"
    before = {name: getattr(settings, name) for name in names}
    with TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as repeated:
        warnings.simplefilter("always")  # MuJoCo's Python package repeats some of them
        file = Path(folder) / "messages"
        _set_log(dict(zip(names, (str(file), True, False), strict=True)))
        try:
            yield messages
        finally:
            _set_log(before)
            text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
            found = [*_MESSAGE.findall(text), *(str(warning.message) for warning in repeated)]
            messages += dict.fromkeys(" ".join(message.split()) for message in found)


def _set_log(settings: Mapping[str, Any]) -> None:
    """Change where MuJoCo writes its messages."""
    library = mujoco()
    config = library.MjLogConfig.get()
    for name, value in settings.items():
        setattr(config, name, value)
    library.MjLogConfig.set(config)


def check_model(model: Any) -> None:
    """Check that an argument is a model of MuJoCo.

    Raises:
        InvalidInputError: it is something else.
    """
    if not isinstance(model, mujoco().MjModel):
        found = f"found {short_repr(model)}, expected a mujoco.MjModel, such as load_model(path) returns"
        raise InvalidInputError(f"model: {found}", value=model)


def make_data(model: Model, posture: Mapping[str, Any] | None = None, *, keyframe: int | str | None = None) -> Data:
    """Return the MuJoCo state of a robot at rest in a posture.

    Args:
        model: the model.
        posture: positions of joints by name [rad or m], as numbers or as text such as "45 deg"; other joints stay as in
            the keyframe.
        keyframe: index or name of a keyframe of the model; by default the posture in which the model is defined.

    Returns:
        The `mujoco.MjData`, without velocities, after `mj_forward`.

    Raises:
        InvalidInputError: this is no model, there is no such keyframe or joint, or the joint has no single position.
    """
    check_model(model)
    library = mujoco()
    data = library.MjData(model)
    if keyframe is not None:
        library.mj_resetDataKeyframe(model, data, _keyframe_index(model, keyframe))
        data.qvel[:] = 0.0
    for name, value in (posture or {}).items():
        joint = _joint_index(model, name)
        if not is_scalar_joint(model, joint):
            raise InvalidInputError(
                f"posture: the joint {name!r} is neither a hinge nor a slide, so one number cannot set its position"
            )
        unit = unit_of_joint(model, joint)
        data.qpos[model.jnt_qposadr[joint]] = to_si(value, unit, name=f"posture {name}")
    _hold(model, data)
    library.mj_forward(model, data)
    return data


def _hold(model: Model, data: Data) -> None:
    """Set joints and bases that a `RobotFile` holds to the positions in which they are held."""
    welds = int(mujoco().mjtEq.mjEQ_WELD)
    for constraint in range(model.neq):
        if not _name(model, "EQUALITY", constraint).startswith(LOCK):
            continue
        held = int(model.eq_obj1id[constraint])
        if int(model.eq_type[constraint]) == welds:
            first = int(model.jnt_qposadr[model.body_jntadr[held]])
            data.qpos[first : first + 7] = model.qpos0[first : first + 7]
        else:
            place = int(model.jnt_qposadr[held])
            data.qpos[place] = model.qpos0[place] + model.eq_data[constraint, 0]


def _name(model: Model, kind: str, index: int) -> str:
    library = mujoco()
    return library.mj_id2name(model, getattr(library.mjtObj, f"mjOBJ_{kind}"), index) or ""


def notes_of(model: Model) -> tuple[str, ...]:
    """Return the warnings about the file of a model."""
    texts = []
    for i in range(model.ntext):
        if _name(model, "TEXT", i).startswith(NOTE):
            first, size = int(model.text_adr[i]), int(model.text_size[i])
            texts.append(bytes(model.text_data[first : first + size - 1]).decode("utf-8", "replace"))
    return tuple(texts)


def joint_speeds_of(model: Model) -> dict[str, float]:
    """Return the largest speeds of joints that the file of a model states [rad/s or m/s], by name."""
    names = ((i, _name(model, "NUMERIC", i)) for i in range(model.nnumeric))
    return {
        name.removeprefix(SPEED): float(model.numeric_data[model.numeric_adr[i]])
        for i, name in names
        if name.startswith(SPEED)
    }


def _keyframe_index(model: Model, keyframe: int | str) -> int:
    """Return the index of a keyframe."""
    names = names_of(model, "key")
    if isinstance(keyframe, str) and keyframe in names:
        return names.index(keyframe)
    if not isinstance(keyframe, str) and 0 <= keyframe < model.nkey:
        return keyframe
    listed = ", ".join(names) or "no keyframes"
    raise InvalidInputError(f"keyframe: found {keyframe!r}, but the model has {listed}", value=keyframe)


def _joint_index(model: Model, name: str) -> int:
    """Return the index of a joint."""
    names = names_of(model, "joint")
    if name not in names:
        listed = ", ".join(filter(None, names)) or "none with a name"
        raise InvalidInputError(
            f"posture: found no joint {name!r} in the model; joints of the model: {listed}", value=name
        )
    return names.index(name)


def site_index(model: Model, name: str) -> int:
    """Return the index of a site.

    Raises:
        InvalidInputError: there is no such site; the error lists all sites of the model.
    """
    names = names_of(model, "site")
    if name not in names:
        listed = ", ".join(filter(None, names)) or "none with a name"
        raise InvalidInputError(f"site: found no site {name!r} in the model; sites of the model: {listed}", value=name)
    return names.index(name)


def names_of(model: Model, kind: str) -> list[str]:
    """Return the names of all elements of one kind in a model.

    Kinds are "site", "joint", "key", "geom" and "body". The order is that of the indices.
    """
    library = mujoco()
    number = {"site": model.nsite, "joint": model.njnt, "key": model.nkey, "geom": model.ngeom, "body": model.nbody}[
        kind
    ]
    code = getattr(library.mjtObj, f"mjOBJ_{kind.upper()}")
    return [library.mj_id2name(model, code, i) or "" for i in range(number)]


def joint_label(model: Model, joint: int) -> str:
    """Return a joint's name, or its number if it is unnamed."""
    return _name(model, "JOINT", joint) or f"number {joint}"


def idle_actuators(model: Model, joint: int) -> list[str]:
    """Return the actuators of a joint whose gear is 0, so that they never move it."""
    kinds = mujoco().mjtTrn
    on_joints = np.isin(model.actuator_trntype, [int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)])
    idle = on_joints & (np.asarray(model.actuator_trnid)[:, 0] == joint) & ~np.any(model.actuator_gear, axis=1)
    return [_name(model, "ACTUATOR", int(i)) or f"number {i}" for i in np.flatnonzero(idle)]


def is_scalar_joint(model: Model, joint: int) -> bool:
    """Return True if a joint is a hinge or a slide.

    Such a joint has a single position.
    """
    kinds = mujoco().mjtJoint
    return int(model.jnt_type[joint]) in {int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)}


def unit_of_joint(model: Model, joint: int) -> str:
    """Return the SI unit of a joint's position.

    The unit is rad for a hinge and m for a slide.
    """
    return "rad" if int(model.jnt_type[joint]) == int(mujoco().mjtJoint.mjJNT_HINGE) else "m"


def tree_of(model: Model, site: int) -> IntArray:
    """Return the degrees of freedom of a sensor site's robot.

    Raises:
        InvalidInputError: the site cannot move.
    """
    tree = int(model.body_treeid[model.site_bodyid[site]])
    if tree < 0:
        raise InvalidInputError(
            f"site: the site {names_of(model, 'site')[site]!r} is fixed to the world, because no joint moves its body",
            value=names_of(model, "site")[site],
        )
    return np.flatnonzero(np.asarray(model.dof_treeid) == tree)


def range_of(model: Model, joint: int) -> tuple[float, float]:
    """Return the range of a joint [rad or m], infinite for a joint without a range."""
    if not model.jnt_limited[joint]:
        return -math.inf, math.inf
    low, high = map(float, model.jnt_range[joint])
    return low, high


def describe_position(value: float, unit: str) -> str:
    """Describe a joint position as text in degrees or millimeters.

    Returns:
        The position of a hinge in degrees, or that of a slide in millimeters.
    """
    return f"{math.degrees(value):.4g} deg" if unit == "rad" else f"{1e3 * value:.4g} mm"


def with_opaque_geoms(model: Model) -> Model:
    """Return a model whose rays meet all geoms that can be touched.

    MuJoCo's rays pass geoms that are completely transparent, which many models use for collisions. Such geoms become
    hardly visible instead.

    Args:
        model: the model, which is not changed.

    Returns:
        A copy, or the model itself if no such geom is transparent.
    """
    materials = np.asarray(model.geom_matid)
    own, shared = np.asarray(model.geom_rgba)[:, 3], np.asarray(model.mat_rgba).reshape(-1, 4)[:, 3]
    alpha = np.where(materials < 0, own, shared[materials] if len(shared) else own)
    touchable = np.asarray(model.geom_contype).astype(bool) | np.asarray(model.geom_conaffinity).astype(bool)
    hidden = np.flatnonzero(touchable & (alpha == 0))
    if not len(hidden):
        return model
    copied = copy.copy(model)
    copied.geom_matid[hidden] = -1
    copied.geom_rgba[hidden, 3] = _HARDLY_VISIBLE
    return copied
