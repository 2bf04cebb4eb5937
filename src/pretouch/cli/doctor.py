"""Implement the command `pretouch doctor`, which checks an installation."""

from __future__ import annotations

import platform
import shutil
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from pretouch._core.errors import PretouchError
from pretouch._core.files import as_json

from .terminal import conclude, end, print_text

if TYPE_CHECKING:
    from packaging.requirements import Requirement

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

    Exit status: 0 pretouch works, though an extra may be missing, 1 the compiled core does not work, or a package is
    missing or too old, 2 a mistake in the request.
    """
    conclude(partial(_doctor, json=json), json_wanted=json)


def _doctor(*, json: bool) -> None:
    """Collect the state of the installation and print it."""
    from pretouch.studio.page_file import BUILD_CORE, CORE  # noqa: PLC0415 - keeps `pretouch --help` quick

    core = _core()
    extras = {name: _lacking(name) for name in _EXTRAS}
    programs = {name: shutil.which(name) is not None for name in _PROGRAMS}
    packages = {name: _version(name) for name in ("pretouch", *(one.name for one in _required("")))}
    lacking = _lacking("")
    works = "problem" not in core and not lacking
    page = "" if CORE.exists() else BUILD_CORE
    if json:
        document = {"status": "works" if works else "broken", "python": platform.python_version(), "core": core}
        parts: dict[str, Any] = {"packages": packages, "missing": lacking, "missing_of_extras": extras}
        parts |= {"page_core": not page, "programs": programs}
        print_text(as_json(document | parts))
    else:
        print_text("\n".join(_lines(core, packages, {"": lacking, **extras}, programs, page=page)))
    end(good=works)


def _lines(
    core: dict[str, Any],
    packages: dict[str, str | None],
    lacking: dict[str, list[str]],
    programs: dict[str, bool],
    *,
    page: str,
) -> list[str]:
    """Describe the installation in lines of text. `page` says how to build the core of the studio if it is missing."""
    own = packages.pop("pretouch")
    lines = [f"pretouch {own}, Python {platform.python_version()}, {platform.system()} {platform.machine()}"]
    lines.append("  " + ", ".join(f"{name} {number or 'MISSING'}" for name, number in packages.items()))
    if lacking[""]:
        lines.append(f"  MISSING or too old: {', '.join(lacking[''])}: pip install --upgrade pretouch")
    if "problem" in core:
        lines.append(f"  compiled core  does not work: {core['problem']}")
    else:
        lines.append(f"  compiled core  works, with code for the processor variant {core['variant']}")
    for name, purpose in _EXTRAS.items():
        missing = lacking[name]
        state = "installed" if not missing else f"missing {', '.join(missing)}: pip install -U 'pretouch[{name}]'"
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


def _required(extra: str) -> list[Requirement]:
    """Return the packages that an extra, or pretouch without extras (""), installs on this machine."""
    from importlib.metadata import requires  # noqa: PLC0415 - keeps `pretouch --help` quick

    from packaging.requirements import Requirement  # noqa: PLC0415

    found = []
    for one in map(Requirement, requires("pretouch") or []):
        without, wanted = (one.marker is None or one.marker.evaluate({"extra": name}) for name in ("", extra))
        if wanted and (not extra or not without):
            found.append(one)
    return found


def _lacking(extra: str) -> list[str]:
    """Return those packages of a pip extra that are missing, or too old."""
    lacking = []
    for one in _required(extra):
        number = _version(one.name) or _version(f"{one.name}-core")
        if number is None:
            lacking.append(one.name)
        elif not one.specifier.contains(number, prereleases=True):
            lacking.append(f"{one.name}{one.specifier} (found {number})")
    return lacking


def _version(package: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - keeps `pretouch --help` quick

    try:
        return version(package)
    except PackageNotFoundError:
        return None
