"""Implement the command `pretouch doctor`, which checks an installation."""

from __future__ import annotations

import platform
import re
import shutil
from functools import partial
from typing import Annotated, Any, Final

import typer

from pretouch._core.errors import PretouchError
from pretouch._core.files import as_json

from .terminal import conclude, end, print_text

_EXTRAS: Final = {
    "sweep": "datasets of pretouch sweep",
    "dask": "sweeps on several machines",
    "ros": "ROS 2 bags, MCAP files and live topics",
    "files": "spreadsheets and measurement files (TDMS)",
    "mujoco": "robot models",
    "fmu": "running exported FMUs",
    "record": "serial port and I2C of pretouch record",
    "studio": "pretouch studio",
}
_PROGRAMS: Final = {
    "cc": "compiling an exported law",
    "cmake": "building exported FMUs and ROS 2 packages",
}


def doctor(*, json: Annotated[bool, typer.Option("--json", help="Print only a JSON object.")] = False) -> None:
    """Check the installation: versions, processor, optional libraries, and how to install missing parts.

    Exit status: 0 pretouch works, though an extra may be missing, 1 the compiled core does not work, 2 a mistake in
    the request.
    """
    conclude(partial(_doctor, json=json), json_wanted=json)


def _doctor(*, json: bool) -> None:
    """Collect the state of the installation and print it."""
    from pretouch.studio.page_file import BUILD_CORE, CORE  # noqa: PLC0415 - keeps `pretouch --help` quick

    core = _core()
    extras = {name: _missing(name) for name in _EXTRAS}
    programs = {name: shutil.which(name) is not None for name in _PROGRAMS}
    packages = {name: _version(name) for name in ("pretouch", *_required(""))}
    works = "problem" not in core and None not in packages.values()
    page = "" if CORE.exists() else BUILD_CORE
    if json:
        document = {"status": "works" if works else "broken", "python": platform.python_version(), "core": core}
        parts = {"packages": packages, "missing_of_extras": extras, "page_core": not page, "programs": programs}
        print_text(as_json(document | parts))
    else:
        print_text("\n".join(_lines(core, packages, extras, programs, page=page)))
    end(good=works)


def _lines(
    core: dict[str, Any],
    packages: dict[str, str | None],
    extras: dict[str, list[str]],
    programs: dict[str, bool],
    *,
    page: str,
) -> list[str]:
    """Describe the installation in lines of text. `page` says how to build the core of the studio if it is missing."""
    own = packages.pop("pretouch")
    lines = [f"pretouch {own}, Python {platform.python_version()}, {platform.system()} {platform.machine()}"]
    lines.append(
        "  " + ", ".join(f"{name} {number or 'MISSING: pip install ' + name}" for name, number in packages.items())
    )
    if "problem" in core:
        lines.append(f"  compiled core  does not work: {core['problem']}")
    else:
        lines.append(f"  compiled core  works, with code for the processor variant {core['variant']}")
    for name, purpose in _EXTRAS.items():
        missing = extras[name]
        state = "installed" if not missing else f"missing {', '.join(missing)}: pip install 'pretouch[{name}]'"
        if name == "studio" and page:
            state += f"; the core of its page is missing: {page}"
        lines.append(f"  extra {name:<8} {state}  ({purpose})")
    for name, purpose in _PROGRAMS.items():
        state = "found" if programs[name] else f"not found: install {'a C compiler' if name == 'cc' else name}"
        lines.append(f"  program {name:<6} {state}  ({purpose})")
    return lines


def _core() -> dict[str, Any]:
    """Test the compiled core by computing the contact of one encounter."""
    try:
        import pretouch as pt  # noqa: PLC0415
        from pretouch._core import native  # noqa: PLC0415

        scenario = pt.Scenario(
            admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
            obstacle=pt.Obstacle(position=0.04, velocity=-0.3),
        )
        pt.find_contact(scenario, pt.ExponentialFirstOrder(scale=1.0, rate=-60.0), -0.5)
        return {"variant": native.variant()}
    except (PretouchError, OSError) as error:
        return {"problem": str(error)}


def _required(extra: str) -> list[str]:
    """Return the packages that an extra, or pretouch without extras (""), installs on this machine."""
    from importlib.metadata import requires  # noqa: PLC0415 - keeps `pretouch --help` quick

    names = []
    for line in requires("pretouch") or []:
        name = re.match(r"[\w.-]+", line)
        of = re.search(r"extra == ['\"](\w+)['\"]", line)
        if name and (of[1] if of else "") == extra and not ("sys_platform" in line and _no_dds()):
            names.append(name[0])
    return names


def _no_dds() -> bool:
    """Check whether the DDS library lacks a wheel for this machine."""
    return platform.python_version_tuple() >= ("3", "14") or (
        platform.system() == "Linux" and platform.machine() != "x86_64"
    )


def _missing(extra: str) -> list[str]:
    """Return those packages of a pip extra that are not installed."""
    return [name for name in _required(extra) if _version(name) is None and _version(f"{name}-core") is None]


def _version(package: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - keeps `pretouch --help` quick

    try:
        return version(package)
    except PackageNotFoundError:
        return None
