"""Find the files of robot models by their names in robot_descriptions and MuJoCo Menagerie, without a download."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Final

from pretouch._core.errors import InvalidInputError

_DESCRIPTIONS: Final = "robot_descriptions"
_MENAGERIE: Final = "mujoco_menagerie"
_FILES: Final = ("MJCF_PATH", "URDF_PATH", "XACRO_PATH")


@dataclass(frozen=True, slots=True)
class Description:
    """The file of a robot model, and what a xacro file needs.

    Args:
        path: path of an MJCF, URDF or xacro file.
        arguments: arguments of a xacro file by name.
        packages: folders of packages that the file names.
    """

    path: Path
    arguments: Mapping[str, str] = field(default_factory=dict)
    packages: tuple[str, ...] = ()


class _NotAtHandError(Exception):
    """The files of a description would have to be downloaded."""


def find_description(name: str) -> Description:
    """Return the file of a robot model with a name of robot_descriptions or of MuJoCo Menagerie.

    Nothing is downloaded.

    Args:
        name: the name, such as "ur5e_mj_description" or "universal_robots_ur5e".

    Returns:
        The description.

    Raises:
        InvalidInputError: no installed package knows the name, or the files are not on this computer.
    """
    known = {}
    for package, names, find in ((_DESCRIPTIONS, _descriptions, _description), (_MENAGERIE, _robots, _menagerie_robot)):
        if find_spec(package) is None:
            continue
        listed = names()
        if name in listed:
            return find(name)
        known[package] = listed
    near = get_close_matches(name, [entry for listed in known.values() for entry in listed], 3)
    if near:
        hint = f"did you mean {' or '.join(near)}?"
    elif known:
        hint = f"{' and '.join(known)} have no robot of this name"
    else:
        hint = "for names of robots, install robot_descriptions or mujoco-menagerie"
    raise InvalidInputError(
        f"model: the file {name} does not exist; give the path of an MJCF or URDF file ({hint})", value=name
    )


def _descriptions() -> list[str]:
    package = import_module(_DESCRIPTIONS)
    return [module.name for module in iter_modules(package.__path__) if module.name.endswith("_description")]


def _description(name: str) -> Description:
    try:
        with _without_download():
            module = import_module(f"{_DESCRIPTIONS}.{name}")
    except _NotAtHandError:
        raise InvalidInputError(
            f"model: the files of {name} are not on this computer. Download them with: robot_descriptions pull {name}",
            value=name,
            remedy=f"robot_descriptions pull {name}",
        ) from None
    except ImportError as error:
        raise InvalidInputError(
            f"model: robot_descriptions cannot load {name}: {error}; give the path of a file instead", value=name
        ) from None
    paths = [path for path in (getattr(module, attribute, None) for attribute in _FILES) if path is not None]
    for path in paths:
        if Path(path).is_file():
            folders = getattr(module, "XACRO_PACKAGE_PATHS", {})
            return Description(Path(path), getattr(module, "XACRO_ARGS", {}), tuple(map(str, folders.values())))
    if paths:
        raise InvalidInputError(
            f"model: the file {paths[0]} of {name} is missing on this computer. Delete the folder of this robot, and "
            f"download it again with: robot_descriptions pull {name}",
            value=name,
            remedy=f"robot_descriptions pull {name}",
        )
    raise InvalidInputError(f"model: {name} has no MJCF or URDF file; give the path of a file instead", value=name)


@contextmanager
def _without_download() -> Iterator[None]:
    """Let robot_descriptions use files of its cache only."""
    cache: Any = import_module(f"{_DESCRIPTIONS}._cache")
    download = cache.clone_to_directory
    loaded = set(sys.modules)

    def use_cache(_: str, target: str, *, commit: str | None = None) -> Any:  # noqa: ARG001 - their signature
        if not Path(target).is_dir():
            raise _NotAtHandError
        return _Clone(target)

    cache.clone_to_directory = use_cache
    try:
        yield
    except BaseException:
        for module in set(sys.modules) - loaded:
            if module.startswith(f"{_DESCRIPTIONS}."):
                del sys.modules[module]
        raise
    finally:
        cache.clone_to_directory = download


class _Clone:
    """A folder in the cache of robot_descriptions."""

    def __init__(self, folder: str) -> None:
        self.working_dir = folder


def _robots() -> list[str]:
    return list(import_module(_MENAGERIE).names())


def _menagerie_robot(name: str) -> Description:
    package = import_module(_MENAGERIE)
    robot, cache = package.get(name), package.Cache()
    at_hand = (cache.root / name).is_dir() if cache.root else cache.is_cached(robot)
    if not at_hand:
        raise InvalidInputError(
            f"model: the files of {name} are not on this computer. Download them with: mujoco-menagerie prefetch "
            f"{name}",
            value=name,
            remedy=f"mujoco-menagerie prefetch {name}",
        )
    return Description(Path(robot.xml(robot.default_model, cache)))
