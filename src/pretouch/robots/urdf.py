"""Prepare URDF files, so that MuJoCo reads them with all of their links, shapes and limits."""

from __future__ import annotations

import os
import re
import sys
import types
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as Xml

import numpy as np

from pretouch._core.errors import InvalidInputError

_READABLE: Final = {".stl", ".obj", ".msh"}
"""The formats of meshes that MuJoCo reads."""

_URI: Final = "package://"
_XACRO: Final = ("{http://www.ros.org/wiki/xacro}", "{http://ros.org/wiki/xacro}", "{xacro}")
_MOMENTS: Final = ("xx", "yy", "zz", "xy", "xz", "yz")
_POINT: Final = 4e-9  # m^2: inertia of a point mass, per mass
_LEAST: Final = 2e-14  # kg m^2: MuJoCo refuses moments of inertia below 1e-14
_ROUNDING: Final = 1e-6  # of moments of inertia, as MuJoCo allows
_MOVING: Final = {"revolute", "continuous", "prismatic", "planar", "floating"}
_COMPILER: Final = {
    "strippath": "false",  # meshes have absolute paths
    "fusestatic": "false",  # links behind fixed joints keep their names
    "inertiafromgeom": "false",  # in URDF, a link without <inertial> has no mass
    "discardvisual": "false",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedUrdf:
    """A URDF file in a form that MuJoCo reads.

    Args:
        text: the text for MuJoCo.
        speeds: largest speeds of joints by name [rad/s or m/s].
        without_effort: joints whose effort limit is 0 in the file, which MuJoCo takes as no limit.
        missing: meshes that do not exist, as the file names them, each with whether it is a collision shape.
        unreadable: meshes in formats that MuJoCo does not read, likewise.
        held: joints that are held because the links beyond them have no mass.
        balanced: links whose inertia no rigid body can have, with the mean of its principal moments instead.
        ignored: what is left out because the file contradicts itself.
    """

    text: str
    speeds: dict[str, float]
    without_effort: tuple[str, ...]
    missing: tuple[tuple[str, bool], ...]
    unreadable: tuple[tuple[str, bool], ...]
    held: tuple[str, ...]
    balanced: tuple[str, ...]
    ignored: tuple[str, ...]


def is_urdf(text: str) -> bool:
    """Return True if a text is a URDF or xacro file, whose root element is <robot>."""
    first = re.search(r"<([A-Za-z_][\w.-]*)", re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL))
    return first is not None and first[1] == "robot"


def prepare_urdf(
    path: Path, text: str, packages: Sequence[str | os.PathLike[str]], arguments: Mapping[str, str] | None = None
) -> PreparedUrdf:
    """Prepare the text of a URDF or xacro file for MuJoCo.

    Paths of meshes become absolute. Meshes that MuJoCo cannot read are left out. Joints of links without any mass are
    held, because MuJoCo refuses them.

    Args:
        path: the file.
        text: its text.
        packages: folders in which packages are searched first.
        arguments: arguments of a xacro file by name.

    Returns:
        The text for MuJoCo, and what was changed.

    The file is refused if it is no valid XML, if xacro cannot process it, or if a joint names a link that is missing.
    """
    folders = Packages(path, tuple(map(Path, packages)))
    root = None if path.suffix == ".xacro" else _parse(path, text, strict="<xacro:" not in text)
    if root is None or any(str(element.tag).startswith(_XACRO) for element in root.iter()):
        root = _parse(path, _expand_xacro(path, folders, arguments or {}))
    _check_joints(path, root)
    missing, unreadable = _resolve_meshes(root, folders)
    balanced = tuple(_correct_inertias(root))
    _remove_repeated_names(root)
    held, ignored = _hold_massless(root), tuple(_remove_lost_mimics(root))
    extension = root.find("mujoco")
    if extension is None:
        extension = Xml.SubElement(root, "mujoco")
    compiler = extension.find("compiler")
    if compiler is None:
        compiler = Xml.SubElement(extension, "compiler")
    compiler.attrib.pop("meshdir", None)
    compiler.attrib.update(_COMPILER)
    return PreparedUrdf(
        text=Xml.tostring(root, encoding="unicode"),
        speeds={name: speed for name, speed in _joint_limits(root, "velocity") if speed > 0},
        without_effort=tuple(name for name, effort in _joint_limits(root, "effort") if effort == 0),
        missing=missing,
        unreadable=unreadable,
        held=held,
        balanced=balanced,
        ignored=ignored,
    )


def _parse(path: Path, text: str, *, strict: bool = True) -> Any:
    """Return the root element of a text; None if it is no valid XML and may be a xacro file."""
    if "<!ENTITY" in text:  # entities can expand without bounds
        raise InvalidInputError(
            f"model: {path} defines XML entities, which URDF does not need; remove them", value=str(path)
        )
    try:
        return Xml.fromstring(_declare_prefixes(text))  # noqa: S314 - it has no entities
    except Xml.ParseError as error:
        if not strict:
            return None
        raise InvalidInputError(f"model: {path} is no valid XML: {error}", value=str(path)) from None


def _check_joints(path: Path, root: Any) -> None:
    """Raise an error if a joint connects a link that the file does not define."""
    links = {link.get("name") for link in root.findall("link")}
    for joint in root.findall("joint"):
        for end in ("parent", "child"):
            link = joint.find(end)
            name = None if link is None else link.get("link")
            if name not in links:
                missing = (
                    f"has no <{end} link=.../>" if name is None else f"connects the link {name!r}, which is missing"
                )
                raise InvalidInputError(
                    f"model: in {path}, the joint {joint.get('name', '')!r} {missing}; add this link to the file, or "
                    "remove the joint",
                    value=joint.get("name", ""),
                )


def _declare_prefixes(text: str) -> str:
    """Declare all prefixes of names that a text uses without a declaration, as other readers of URDF accept."""
    used = (
        set(re.findall(r"[<\s]/?([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*[\s=>/]", text))
        - {"xml", "xmlns"}
        - set(re.findall(r"xmlns:([\w.-]+)\s*=", text))
    )
    declared = "".join(f' xmlns:{prefix}="{prefix}"' for prefix in sorted(used))
    return re.sub(r"<robot\b", f"<robot{declared}", text, count=1) if used else text


@dataclass(frozen=True, slots=True)
class Packages:
    """The folders in which a file's packages are searched.

    Args:
        file: the file that names packages.
        given: folders that contain packages, or are packages.
    """

    file: Path
    given: tuple[Path, ...]

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; None if there is none."""
        return next((folder for folder in self._candidates(name) if folder.is_dir()), None)

    def resolve(self, uri: str, folder: Path) -> Path:
        """Return the path of a mesh that a file names; it exists if the mesh is found.

        A package is searched in the given folders, then from the folder of the file upward, then in the ROS paths of
        the environment. If no package has this name, the path inside it is searched from the folder of the file upward.
        """
        if not uri.startswith((_URI, "model://")):
            return folder / uri.removeprefix("file://")
        name, _, inside = uri.split("://", 1)[1].partition("/")
        options = [folder / inside for folder in self._candidates(name)]
        options += [parent / inside for parent in self.file.absolute().parents]
        return next((option for option in options if option.is_file()), options[0])

    def _candidates(self, name: str) -> Iterator[Path]:
        """Yield all folders that may be the package of a name."""
        for folder in (*self.given, *self.file.absolute().parents):
            if folder.name == name or _declares(folder, name):
                yield folder
            yield folder / name
        for variable, inside in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"), ("GAZEBO_MODEL_PATH", "")):
            for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
                if Path(entry).name == name and not inside:
                    yield Path(entry)
                yield Path(entry) / inside / name


def _declares(folder: Path, name: str) -> bool:
    """Return True if a folder has a package.xml with a name."""
    manifest = folder / "package.xml"
    try:
        text = manifest.read_text(encoding="utf-8", errors="replace") if manifest.is_file() else ""
    except OSError:
        return False
    found = re.search(r"<name>\s*([^<\s]+)\s*</name>", text)
    return found is not None and found[1] == name


def _resolve_meshes(root: Any, folders: Packages) -> tuple[tuple[tuple[str, bool], ...], ...]:
    """Write absolute paths into all meshes, and remove shapes whose mesh cannot be read."""
    missing: dict[tuple[str, bool], None] = {}
    unreadable: dict[tuple[str, bool], None] = {}
    compiler = root.find("mujoco/compiler")
    meshes = folders.file.absolute().parent / ("" if compiler is None else compiler.get("meshdir", ""))
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            uri = mesh.get("filename", "")
            path = folders.resolve(uri, meshes)
            entry = uri, shape.tag == "collision"
            if not path.is_file():
                missing[entry] = None
            elif path.suffix.lower() not in _READABLE:
                unreadable[entry] = None
            else:
                mesh.set("filename", path.as_posix())
                continue
            link.remove(shape)
    return tuple(missing), tuple(unreadable)


def _remove_repeated_names(root: Any) -> None:
    """Let the first of several shapes keep their common name, as MuJoCo does with a message on stderr."""
    names: set[str] = set()
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            name = shape.get("name", "")
            if name in names:
                del shape.attrib["name"]
            elif name:
                names.add(name)


def _hold_massless(root: Any) -> tuple[str, ...]:
    """Fix each joint beyond which no link has a mass, and return the names of these joints."""
    masses = {link.get("name"): _mass(link) for link in root.findall("link")}
    joints = root.findall("joint")
    children: dict[str, list[str]] = {}
    for joint in joints:
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            children.setdefault(parent.get("link"), []).append(child.get("link"))

    def total(link: str, seen: frozenset[str] = frozenset()) -> float:
        if link in seen:  # a loop, which MuJoCo reports
            return 1.0
        return masses.get(link, 0.0) + sum(total(child, seen | {link}) for child in children.get(link, ()))

    held = []
    for joint in joints:
        child = joint.find("child")
        if joint.get("type") in _MOVING and child is not None and not total(child.get("link")) > 0:
            joint.set("type", "fixed")
            held.append(joint.get("name", ""))
    for joint in joints:  # a joint cannot follow one that is held
        mimic = joint.find("mimic")
        if mimic is not None and (mimic.get("joint") in held or joint.get("name") in held):
            joint.remove(mimic)
    return tuple(held)


def _remove_lost_mimics(root: Any) -> Iterator[str]:
    """Remove couplings to joints that the file does not define, and yield what they are."""
    joints = {joint.get("name") for joint in root.findall("joint")}
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and mimic.get("joint") not in joints:
            joint.remove(mimic)
            yield f"joint {joint.get('name')!r} follows the joint {mimic.get('joint')!r}, which is missing"


def _correct_inertias(root: Any) -> Iterator[str]:
    """Replace inertias that MuJoCo refuses.

    A link without a mass has no inertia. A point mass gets the inertia of a sphere with a radius of 0.1 mm. A thin rod
    gets the smallest moment of inertia that MuJoCo accepts. An inertia with a negative principal moment, or with one
    that exceeds the sum of the others, gets the mean of all three.

    Yields:
        The links whose inertia no rigid body can have.
    """
    for link in root.findall("link"):
        inertial = link.find("inertial")
        tensor = None if inertial is None else inertial.find("inertia")
        if inertial is None or tensor is None:
            continue
        mass = _mass(link)
        try:
            xx, yy, zz, xy, xz, yz = (float(tensor.get(f"i{name}", "0")) for name in _MOMENTS)
        except ValueError:
            continue  # MuJoCo reports it
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if not mass > 0:
            link.remove(inertial)
            continue
        mean, least = float(moments.mean()), _POINT * mass
        if mean <= least:
            mean = least
        elif moments[0] > -_ROUNDING * moments[2] and moments[0] + moments[1] >= moments[2] * (1 - _ROUNDING):
            for name, value in zip(_MOMENTS[:3], (xx, yy, zz), strict=True):
                if moments[0] < _LEAST:
                    tensor.set(f"i{name}", repr(float(value + _LEAST - moments[0])))
            continue
        for name, value in zip(_MOMENTS, (mean, mean, mean, 0.0, 0.0, 0.0), strict=True):
            tensor.set(f"i{name}", repr(value))
        if np.abs(moments).max() > least:
            yield link.get("name", "")


def _mass(link: Any) -> float:
    mass = link.find("inertial/mass")
    try:
        return 0.0 if mass is None else float(mass.get("value", "0"))
    except ValueError:
        return 0.0  # MuJoCo reports it


def _joint_limits(root: Any, quantity: str) -> Iterator[tuple[str, float]]:
    """Yield the joints whose limit of a quantity, such as the velocity, is stated, with its value."""
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        value = None if limit is None else limit.get(quantity)
        try:
            if value is not None:
                yield joint.get("name", ""), float(value)
        except ValueError:
            continue


def _expand_xacro(path: Path, folders: Packages, arguments: Mapping[str, str]) -> str:
    """Return the URDF text of a xacro file."""
    try:
        xacro = import_module("xacro")
    except ModuleNotFoundError:
        raise InvalidInputError(
            f"model: {path.name} is a xacro file, which needs the Python package xacro. Install it with pip install "
            f"xacro, or convert the file with: xacro {path.name} > robot.urdf",
            value=str(path),
            remedy="pip install xacro",
        ) from None
    with _package_lookup(folders):
        try:
            return str(xacro.process_file(str(path), mappings=dict(arguments)).toxml())
        except Exception as error:
            raise InvalidInputError(
                f"model: xacro cannot process {path}: {' '.join(str(error).split())}. If a package is missing, name "
                "its folder with --packages. If an argument is missing, add it behind the file: "
                f"'{path.name} NAME:=VALUE'",
                value=str(path),
            ) from None


@contextmanager
def _package_lookup(folders: Packages) -> Iterator[None]:
    """Let xacro find packages in our folders, instead of those of an installed ROS only."""

    def share_of(name: str, *_: Any) -> str:
        folder = folders.find(name)
        if folder is None:
            raise LookupError(f"found no package {name!r}")
        return str(folder)

    module = types.ModuleType("ament_index_python.packages")
    module.get_package_share_directory = share_of  # type: ignore[attr-defined]
    parent = types.ModuleType("ament_index_python")
    parent.packages = module  # type: ignore[attr-defined]
    names = {"ament_index_python": parent, "ament_index_python.packages": module}
    before = {name: sys.modules.get(name) for name in names}
    sys.modules.update(names)
    try:
        yield
    finally:
        for name, old in before.items():
            if old is None:
                del sys.modules[name]
            else:
                sys.modules[name] = old
