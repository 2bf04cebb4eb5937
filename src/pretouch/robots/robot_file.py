"""Load robot models from files of other people: MJCF, URDF and xacro, with sites, motors and a base that are chosen."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final, NoReturn

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of
from pretouch._core.numbers import FloatArray, finite
from pretouch._core.units import to_si
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution

from .descriptions import Description, find_description
from .geometry import farthest_surface, move_site
from .model import LOCK, NOTE, SPEED, Data, Model, collect_messages, mujoco, names_of
from .site import AXES
from .urdf import PreparedUrdf, is_urdf, prepare_urdf

BASES: Final = ("fixed", "free")
"""How the base of a robot can stand in the world."""

_ARGUMENTS: Final = re.compile(r"(?P<file>.*?)(?P<arguments>(?:\s+[A-Za-z_][\w-]*:=\S*)+)\s*", re.DOTALL)
_ON_BODY: Final = re.compile(r"(?P<body>.+):(?P<axis>[+-][xyz])(?::(?P<offset>[^:]+))?")
_STIFF: Final = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # solimp of locks
_LISTED: Final = 5  # names that a sentence lists
_HARMLESS: Final = "empty prefix"  # part of a message of MuJoCo that matters only for saving a model
_REPAIRS: Final = 20  # meshes that MuJoCo refuses, one at a time
_READ_LIMIT: Final = 100_000_000  # bytes of a model file


@dataclass(frozen=True, slots=True)
class SiteOnBody(Value):
    """A sensor site on a body of a robot model, by a direction and an offset.

    Its axes are parallel to those of the body. The name of the site is its text, such as "wrist_3_link:+z:50mm".

    Args:
        body: name of the body, or of the link in a URDF file.
        axis: direction toward objects in the frame of the body, such as "+z".
        offset: distance from the origin of the body along the axis [m], or text such as "50 mm"; or three of them, for
            a position in the frame of the body. None for the outermost surface of the body on this axis, or the origin
            of the body if the axis meets no surface.

    Examples:
        >>> SiteOnBody("tool0", "+z", "50 mm").name
        'tool0:+z:0.05 m'
    """

    body: str
    axis: str = "+x"
    offset: Any = None

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise InvalidInputError(**not_one_of("axis", self.axis, AXES))
        if self.offset is None:
            return
        parts = self.offset if isinstance(self.offset, list | tuple) else (self.offset,)
        if len(parts) not in {1, 3}:
            raise InvalidInputError(
                f"offset: found {len(parts)} lengths, expected a distance along the axis, or a position x, y, z in the "
                "frame of the body",
                value=self.offset,
            )
        lengths = tuple(float(finite(to_si(part, "m", name="offset"), "offset", "m")) for part in parts)
        object.__setattr__(self, "offset", lengths if len(lengths) > 1 else lengths[0])

    @property
    def name(self) -> str:
        """The name of the site in the model."""
        if self.offset is None:
            return f"{self.body}:{self.axis}"
        parts = self.offset if isinstance(self.offset, tuple) else (self.offset,)
        return f"{self.body}:{self.axis}:{','.join(f'{part:.9g}' for part in parts)} m"

    @property
    def position(self) -> FloatArray:
        """The position of the site in the frame of the body [m], as far as it is stated."""
        if isinstance(self.offset, tuple):
            return np.array(self.offset)
        index, sign = AXES[self.axis]
        return np.asarray(sign * (self.offset or 0.0) * np.eye(3)[index])


def site_on_body(text: str) -> SiteOnBody | None:
    """Parse a site on a body, such as "wrist_3_link:+z:50mm" or "tool0:-x".

    Args:
        text: BODY:AXIS, BODY:AXIS:OFFSET, or BODY:AXIS:X,Y,Z with a position in the frame of the body.

    Returns:
        The site; None for any other text, such as the name of a site.
    """
    parts = _ON_BODY.fullmatch(text)
    if parts is None:
        return None
    offset = parts["offset"]
    return SiteOnBody(parts["body"], parts["axis"], offset and _lengths(offset))


def _lengths(text: str) -> Any:
    """Split a text such as "0, 0, 50 mm", whose unit holds for all of its lengths, unless they have their own."""
    parts = [part.strip() for part in text.split(",")]
    unit = re.sub(r"^[-+.\d]+(?:[eE][-+]?\d+)?", "", parts[-1])
    every = tuple(part if re.search(r"[A-Za-z]", part) else f"{part}{unit or ' m'}" for part in parts)
    return every if len(every) > 1 else every[0]


@dataclass(frozen=True, slots=True)
class RobotFile(Value):
    """A file with a robot model, and choices that such files leave open.

    Args:
        path: path of an MJCF, URDF or xacro file, or a name of robot_descriptions or MuJoCo Menagerie, if its files are
            on this computer. Arguments of a xacro file follow its path, such as "ur.urdf.xacro ur_type:=ur5e name:=ur".
        packages: folders in which the packages of a URDF file are searched first.
        base: "fixed" or "free" (floating); by default as in the file, which means fixed for URDF.
        joints: names of the joints that may move, all others are held; by default all joints.
        posture: positions in which other joints are held [rad or m]; by default as in the file.
        sites: sensor sites that are added on bodies.
    """

    path: str
    packages: tuple[str, ...] = ()
    base: str | None = None
    joints: tuple[str, ...] = ()
    posture: Mapping[str, Any] | None = None
    sites: tuple[SiteOnBody, ...] = ()

    def __post_init__(self) -> None:
        if self.base is not None and self.base not in BASES:
            raise InvalidInputError(**not_one_of("base", self.base, BASES))
        object.__setattr__(self, "path", os.fspath(self.path))
        object.__setattr__(self, "packages", tuple(map(os.fspath, self.packages)))

    @property
    def file(self) -> Path:
        """The path or name without the arguments that follow it."""
        parts = None if Path(self.path).is_file() else _ARGUMENTS.fullmatch(self.path)
        return Path(self.path if parts is None else parts["file"])

    @property
    def arguments(self) -> dict[str, str]:
        """The arguments of a xacro file, by name."""
        parts = None if Path(self.path).is_file() else _ARGUMENTS.fullmatch(self.path)
        texts = [] if parts is None else parts["arguments"].split()
        return {name: value for name, _, value in (text.partition(":=") for text in texts)}


def robot_file(path: str | os.PathLike[str] | RobotFile) -> RobotFile:
    """Return a robot file without choices for a path; a robot file stays as it is."""
    return path if isinstance(path, RobotFile) else RobotFile(os.fspath(path))


def load_model(
    path: str | os.PathLike[str] | RobotFile,
    *,
    packages: Sequence[str | os.PathLike[str]] = (),
    base: str | None = None,
    joints: Sequence[str] = (),
    posture: Mapping[str, Any] | None = None,
    sites: Sequence[str | SiteOnBody] = (),
) -> Model:
    """Load a robot model from an MJCF, URDF or xacro file.

    A model without actuators, such as every URDF file, gets a motor for each joint, with the effort limits of the file.
    What is missing or wrong in a file is left out or corrected if the masses stay what the file says; a warning of
    every result names it.

    Args:
        path: the file, or a name of robot_descriptions or MuJoCo Menagerie, if its files are on this computer.
            Arguments of a xacro file follow its path, as in `RobotFile`, which has all choices in it.
        packages: folders in which the packages of a URDF file are searched first.
        base: "fixed" or "free" (floating); by default as in the file, which means fixed for URDF.
        joints: names of the joints that may move, all others are held; by default all joints.
        posture: positions in which other joints are held [rad or m]; by default as in the file.
        sites: sensor sites that are added on bodies, such as "wrist_3_link:+z:50mm".

    Returns:
        The `mujoco.MjModel`.

    The model is refused if the file does not exist, MuJoCo cannot read it, or a choice does not fit the model.
    """
    if isinstance(path, RobotFile):
        return compile_robot(path)
    folders = tuple(os.fspath(folder) for folder in packages)
    on_bodies = tuple(s if isinstance(s, SiteOnBody) else _required(s) for s in sites)
    return compile_robot(RobotFile(os.fspath(path), folders, base, tuple(joints), posture, on_bodies))


def _required(text: str) -> SiteOnBody:
    """Parse a site on a body, or raise an error."""
    site = site_on_body(text)
    if site is None:
        raise InvalidInputError(
            f"sites: found {text!r}, expected BODY:AXIS or BODY:AXIS:OFFSET, such as 'wrist_3_link:+z:50mm'", value=text
        )
    return site


def compile_robot(robot: RobotFile, edit: Callable[[Any], None] | None = None) -> Model:
    """Compile the model of a robot file.

    Args:
        robot: the file, with its choices.
        edit: function that changes the `mujoco.MjSpec` of the robot at last, such as one that adds an object.

    Returns:
        The `mujoco.MjModel`.

    Raises:
        InvalidInputError: as in `load_model`.
    """
    path, found = robot.file, None
    if not path.is_file():
        if path.suffix or len(path.parts) > 1:
            raise InvalidInputError(
                f"model: the file {path} does not exist; give the path of an MJCF or URDF file", value=str(path)
            )
        found = find_description(str(path))
        path = found.path
    source = _read(found or Description(path), robot)
    removed: dict[str, str] = {}
    balanced: tuple[str, ...] = ()
    ignored = [] if source is None else list(source.ignored)
    for _ in range(_REPAIRS):
        try:
            with collect_messages() as messages:
                spec, notes = _spec_of(path, source, removed, balanced=balanced)
                notes += _complete(spec, robot, source)
                if edit is not None:
                    edit(spec)
                for i, note in enumerate([*notes, *_ignored_note(ignored)]):
                    spec.add_text(name=f"{NOTE}{i}", data=note)
                model = _compile(spec)
        except _CompileError as error:
            reason = " ".join(str(error).split()).removeprefix("Error: ")
            mesh = next((m for m in spec.meshes if m.name and f"Element name '{m.name}'" in reason), None)
            if "balanceinertia" in reason and not balanced:
                balanced = (_element(reason),)
            elif mesh is not None and mesh.name not in removed and isinstance(source, PreparedUrdf):
                removed[mesh.name] = reason
            else:
                _refuse(path, reason)
            continue
        new = [m for m in messages if m not in ignored and _HARMLESS not in m]
        if not new:
            _place(model, robot.sites)
            return model
        ignored += new
    raise InvalidInputError(f"model: MuJoCo cannot read {path}: it refuses {len(removed)} meshes", value=str(path))


class _CompileError(Exception):
    """MuJoCo cannot compile a model."""


def _compile(spec: Any) -> Model:
    try:
        return spec.compile()
    except ValueError as error:
        raise _CompileError(str(error)) from None


def _ignored_note(ignored: Sequence[str]) -> Iterator[str]:
    """Yield a warning about what MuJoCo ignores in a file."""
    if ignored:
        listed = "; ".join(ignored[:_LISTED]) + ("; ..." if len(ignored) > _LISTED else "")
        yield caution(
            "PT621",
            f"Something in the model is ignored ({listed}): correct it in the file. Motions, masses and limits are "
            "those of the model without it.",
        )


def _refuse(path: Path, reason: str) -> NoReturn:
    """Raise an error that MuJoCo cannot read a file."""
    advice = ""
    if "mass and inertia of moving bodies" in reason:
        advice = ". A body that moves needs a mass: add <inertial> to it, or remove its joint"
    raise InvalidInputError(f"model: MuJoCo cannot read {path}: {reason}{advice}", value=str(path)) from None


def _element(reason: str) -> str:
    """Return the name of the element in an error of MuJoCo."""
    found = re.search(r"Element name '([^']*)'", reason)
    return "without a name" if found is None else found[1]


def _read(description: Description, robot: RobotFile) -> PreparedUrdf | None:
    """Return a prepared URDF file; None for a file that MuJoCo reads as it is."""
    path, packages = description.path, (*robot.packages, *description.packages)
    try:
        if path.stat().st_size > _READ_LIMIT:
            return None
        text = path.read_bytes().decode("utf-8", "replace")
    except OSError as error:
        raise InvalidInputError(f"model: {path} cannot be read: {error.strerror}", value=str(path)) from None
    if not is_urdf(text) and path.suffix not in {".urdf", ".xacro"}:
        return None
    return prepare_urdf(path, text, packages, {**description.arguments, **robot.arguments})


def _spec_of(
    path: Path, source: PreparedUrdf | None, removed: Mapping[str, str], *, balanced: Sequence[str]
) -> tuple[Any, list[str]]:
    """Return the `mujoco.MjSpec` of a file without what is missing in it, and notes on what was changed."""
    library = mujoco()
    notes: list[str] = []
    try:
        if source is None:
            spec = library.MjSpec.from_file(str(path))
            notes += _remove_missing_meshes(path, spec)
        else:
            spec = library.MjSpec.from_string(source.text)
            notes += _mesh_notes(source, removed)
            for mesh in [m for m in spec.meshes if m.name in removed]:
                _remove_mesh(spec, mesh)
            if source.held:
                notes.append(
                    caution(
                        "PT542",
                        f"No link beyond {_listed(source.held, 'joint')} has a mass, so pretouch holds "
                        f"{'it' if len(source.held) == 1 else 'them'}: add <inertial> to these links if they are real. "
                        "The masses of all other links are those of the file.",
                    )
                )
            balanced = balanced or source.balanced
    except InvalidInputError:
        raise
    except ValueError as error:
        _refuse(path, " ".join(str(error).split()).removeprefix("Error: "))
    if balanced:
        spec.compiler.balanceinertia = True
        notes.append(
            caution(
                "PT541",
                f"No rigid body can have the inertia of {_listed(balanced, 'body', 'bodies')}, so pretouch balances "
                "it: correct the inertia in the file. The mean of the three principal moments of inertia replaces each "
                "of them, which changes masses along axes for which such a body turns.",
            )
        )
    return spec, notes


def _mesh_notes(source: PreparedUrdf, removed: Mapping[str, str]) -> Iterator[str]:
    """Yield warnings about meshes of a URDF file that are left out."""
    causes = (
        (source.missing, "files are missing", "give the folder that contains their package with --packages"),
        (source.unreadable, "MuJoCo reads only STL, OBJ and MSH files", "convert these meshes"),
    )
    for meshes, reason, remedy in causes:
        for solid in (True, False):
            yield from _mesh_note([name for name, is_solid in meshes if is_solid == solid], solid, reason, remedy)
    for mesh, reason in removed.items():
        yield from _mesh_note([mesh], True, f"MuJoCo refuses it ({reason})", "repair the mesh")


def _mesh_note(names: Sequence[str], solid: bool, reason: str, remedy: str) -> Iterator[str]:
    if names:
        effect = (
            "Rays and contacts do not meet these shapes, and sites are not taken to their surfaces"
            if solid
            else "Only pictures lack them"
        )
        files = _listed([PurePosixPath(n).name for n in names], "collision mesh" if solid else "visual mesh", "es")
        yield caution(
            "PT540",
            f"pretouch leaves out {files} of the model, because {reason}: {remedy}. {effect}. Masses do not change.",
        )


def _remove_missing_meshes(path: Path, spec: Any) -> Iterator[str]:
    """Remove meshes of an MJCF file that do not exist, and yield warnings about them."""
    folder = Path(spec.modelfiledir or path.parent)
    folder = folder if folder.is_absolute() else path.parent
    for solid in (True, False):
        lost = []
        for mesh in list(spec.meshes):
            file = mesh.file and folder / (spec.compiler.meshdir or "") / mesh.file
            if not file or file.is_file() or not _uses(spec, mesh, solid):
                continue
            name = _mesh_name(mesh)
            for geom in spec.geoms:
                moves = geom.parent.name != "world"
                if geom.meshname == name and moves and not geom.parent.explicitinertial:
                    raise InvalidInputError(
                        f"model: the mesh {mesh.file} of {path} does not exist, and the mass of the body "
                        f"{geom.parent.name or 'without a name'} is computed from it; get this file, or add <inertial> "
                        "to the body",
                        value=mesh.file,
                    )
            _remove_mesh(spec, mesh)
            lost.append(mesh.file)
        yield from _mesh_note(lost, solid, "files are missing", "get these files")


def _mesh_name(mesh: Any) -> str:
    return str(mesh.name or Path(mesh.file).stem)


def _uses(spec: Any, mesh: Any, solid: bool) -> bool:
    """Return True if a mesh is a collision shape (solid), or if it is none."""
    name = _mesh_name(mesh)
    return solid == any(g.meshname == name and (g.contype or g.conaffinity) for g in spec.geoms)


def _remove_mesh(spec: Any, mesh: Any) -> None:
    name = _mesh_name(mesh)
    for geom in [g for g in spec.geoms if g.meshname == name]:
        spec.delete(geom)
    spec.delete(mesh)


def _listed(names: Iterable[str], what: str, plural: str = "s") -> str:
    """Return a count of things with their names, such as "2 joints (a, b)"."""
    every = list(dict.fromkeys(names))
    shown = ", ".join(every[:_LISTED]) + (", ..." if len(every) > _LISTED else "")
    words = what if len(every) == 1 else f"{what}{plural}" if len(plural) <= len("es") else plural
    return f"{len(every)} {words} ({shown})"


def _complete(spec: Any, robot: RobotFile, source: PreparedUrdf | None) -> list[str]:
    """Apply the choices of a robot file to its `mujoco.MjSpec`, and return notes on what was added."""
    notes: list[str] = []
    scalar = _scalar_joints(spec)
    unknown = [name for name in robot.joints if name not in scalar]
    if unknown:
        raise InvalidInputError(
            f"joints: found {unknown[0]!r}, expected names of joints that turn or slide: {', '.join(scalar) or 'none'}",
            value=unknown[0],
        )
    if not len(spec.actuators):
        notes += _add_motors(spec, [n for n in scalar if not robot.joints or n in robot.joints])
        motors = {actuator.target for actuator in spec.actuators}
        unlimited = [] if source is None else [name for name in source.without_effort if name in motors]
        if unlimited:
            notes.append(
                caution(
                    "PT502",
                    f"Effort 0 of {', '.join(unlimited)} is taken as unlimited, as MuJoCo reads it: set <limit effort> "
                    "to what these drives can apply. Acceleration and force have no limit otherwise.",
                )
            )
    if robot.joints:
        _lock_joints(spec, [n for n in scalar if n not in robot.joints], robot.posture or {})
    if robot.base is not None:
        _set_base(spec, robot.base)
    if source is not None:
        _exclude_neighbors(spec)
    for joint, speed in ({} if source is None else source.speeds).items():
        if joint in scalar:
            spec.add_numeric(name=f"{SPEED}{joint}", data=[speed])
    for site in robot.sites:
        body = next((b for b in spec.bodies if b.name == site.body), None)
        if body is None:
            raise InvalidInputError(**not_one_of("body", site.body, [b.name for b in spec.bodies if b.name]))
        body.add_site(name=site.name, pos=site.position)
    return notes


def _scalar_joints(spec: Any) -> dict[str, Any]:
    """Return the hinges and slides of a robot by name; those without a name get one."""
    kinds = mujoco().mjtJoint
    joints = [joint for joint in spec.joints if joint.type in {kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE}]
    for i, joint in enumerate(joints):
        joint.name = joint.name or f"joint {i}"
    return {joint.name: joint for joint in joints}


def _exclude_neighbors(spec: Any) -> None:
    """Exclude contacts of the fixed links of a robot with the links that a joint connects to them.

    Neighboring links of URDF files often overlap. MuJoCo excludes such contacts itself, unless a link is fixed to the
    world.
    """
    for root in spec.worldbody.bodies:
        fixed = [] if list(root.joints) else list(_rigid(root))
        for link in fixed:
            for child in (child for child in link.bodies if list(child.joints)):
                for other in _rigid(child):
                    for own in fixed:
                        spec.add_exclude(bodyname1=own.name, bodyname2=other.name)


def _rigid(body: Any) -> Iterator[Any]:
    """Yield a body and all bodies that are fixed to it."""
    yield body
    for child in body.bodies:
        if not list(child.joints):
            yield from _rigid(child)


def _add_motors(spec: Any, names: Sequence[str]) -> Iterator[str]:
    """Add a motor to each joint that does not follow another one, and yield a warning."""
    library = mujoco()
    coupled = library.mjtEq.mjEQ_JOINT
    followers = {e.name1 for e in spec.equalities if e.type == coupled and e.name2}
    driven = [name for name in names if name not in followers]
    for name in driven:
        spec.add_actuator(name=name, target=name, trntype=library.mjtTrn.mjTRN_JOINT)
    if driven:
        yield caution(
            "PT542",
            f"The model has no actuators, so pretouch adds a motor to {_listed(driven, 'joint')}: check that these "
            "joints have motors, or name those that may move. The effort limits are those of the file.",
        )


def _lock_joints(spec: Any, names: Sequence[str], posture: Mapping[str, Any]) -> None:
    """Hold joints in their positions."""
    library = mujoco()
    joints = _scalar_joints(spec)
    for name in names:
        joint, value = joints[name], 0.0
        unit = "rad" if joint.type == library.mjtJoint.mjJNT_HINGE else "m"
        if name in posture:
            value = float(to_si(posture[name], unit, name=f"posture {name}")) - float(joint.ref)
        lock = spec.add_equality(name=f"{LOCK}{name}", type=library.mjtEq.mjEQ_JOINT, name1=name)
        lock.data[:5] = [value, 0.0, 0.0, 0.0, 0.0]
        _stiffen(spec, lock)


def _stiffen(spec: Any, lock: Any) -> None:
    """Let an equality constraint hold as firmly as MuJoCo allows."""
    lock.solref[:] = [2 * spec.option.timestep, 1.0]
    lock.solimp[:] = _STIFF


def _set_base(spec: Any, base: str) -> None:
    """Let a robot float, or weld it to the world."""
    library = mujoco()
    free = library.mjtJoint.mjJNT_FREE
    robots = [body for body in spec.worldbody.bodies if any(j.type != free for j in _joints_below(body))]
    floating = [body for body in robots if any(j.type == free for j in body.joints)]
    if base == "fixed":
        for i, body in enumerate(floating):
            body.name = body.name or f"root {i}"
            lock = spec.add_equality(
                name=f"{LOCK}{body.name}", type=library.mjtEq.mjEQ_WELD, objtype=library.mjtObj.mjOBJ_BODY
            )
            lock.name1, lock.name2 = body.name, "world"
            _stiffen(spec, lock)
        return
    standing = [body for body in robots if not list(body.joints)]
    if len(standing) == 1 and not floating:
        _free_keyframes(spec, standing[0])
        standing[0].add_freejoint()
    elif not floating:
        raise InvalidInputError(
            f"base: found {len(standing)} robots without a joint at their base, expected one; for other models, add "
            "<freejoint/> to the base in the file",
            value=base,
        )


def _joints_below(body: Any) -> Iterator[Any]:
    """Yield the joints of a body and of all bodies on it."""
    yield from body.joints
    for child in body.bodies:
        yield from _joints_below(child)


def _free_keyframes(spec: Any, base: Any) -> None:
    """Insert the position of a free base into all keyframes."""
    sizes = {mujoco().mjtJoint.mjJNT_FREE: 7, mujoco().mjtJoint.mjJNT_BALL: 4}
    before = 0
    for body in spec.worldbody.bodies:
        if body is base or body.name == base.name:
            break
        before += sum(sizes.get(joint.type, 1) for joint in _joints_below(body))
    for key in spec.keys:
        place = list(key.qpos)
        if place:
            key.qpos = [*place[:before], *base.pos, *base.quat, *place[before:]]
        key.qvel = []


def _place(model: Model, sites: Sequence[SiteOnBody]) -> None:
    """Move sites without an offset to the outermost surfaces of their bodies."""
    outer = [site for site in sites if site.offset is None]
    if not outer:
        return
    data: Data = mujoco().MjData(model)
    mujoco().mj_kinematics(model, data)
    for site in outer:
        index = names_of(model, "site").index(site.name)
        axis, sign = AXES[site.axis]
        direction = np.zeros(3)
        direction[axis] = sign
        distance = farthest_surface(model, data, index, np.array(data.site_xmat[index]).reshape(3, 3) @ direction)
        move_site(model, index, distance * direction)
