"""Export a verified control law as co-simulation units.

The result is two functional mock-up units (FMU), for FMI 2.0 and FMI 3.0.
"""

from __future__ import annotations

import hashlib
import io
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from pretouch._core.errors import InvalidInputError

from .c import design_header, filled
from .fmu_description import build_description, model_description, variables
from .law_design import LawDesign
from .law_source import HEADER, SOURCE, law_text
from .vectors import cases_as_csv

_STANDARDS: Final = (2, 3)
_COMPILERS: Final = ("cc", "gcc", "clang")
_ENDINGS: Final = {"Linux": "so", "Darwin": "dylib", "Windows": "dll"}
_SYSTEMS: Final = {"Linux": "linux", "Darwin": "darwin", "Windows": "windows"}
_NAMES_IN_FMI_2: Final = {
    "x86_64-linux": "linux64",
    "x86_64-darwin": "darwin64",
    "aarch64-darwin": "darwin64",
    "x86_64-windows": "win64",
}
_ARCHITECTURES: Final = {"AMD64": "x86_64", "arm64": "aarch64", "ARM64": "aarch64"}
_DATE: Final = (1980, 1, 1, 0, 0, 0)  # of every file in an archive: the same design gives the same bytes


def fmu_kind() -> str:
    """Return the name of the FMU format.

    Without a C compiler, the name contains "sources only".
    """
    return "FMU" if _compiler() else "FMU with sources only, because this machine has no C compiler"


def fmu_files(design: LawDesign) -> dict[str, str | bytes]:
    """Return the name and content of each file of an FMU export.

    The units have a library for the platform on which pretouch runs, if there is a C compiler. The environment variable
    CC names another compiler.

    Args:
        design: the design.

    Returns:
        Both units, the test vectors, a test and instructions.
    """
    compiler, name = _compiler(), design.identifier
    library = f"a library for {_platform()}" if compiler else "no library, because the export found no C compiler"
    units: dict[str, str | bytes] = {
        f"{name}-fmi{standard}.fmu": _archive(_unit(design, standard, compiler)) for standard in _STANDARDS
    }
    return {
        **units,
        "vectors.csv": cases_as_csv(design.cases),
        "test_fmu.py": filled("fmu/test_fmu.py.in"),
        "README.md": filled("fmu/README.md", design, unit=name, library=library),
    }


def _unit(design: LawDesign, standard: int, compiler: tuple[str, ...]) -> dict[str, bytes]:
    """Return the path and content of each file of an FMU archive."""
    identifier = f"pretouch_{design.identifier}"
    token = _token(design, standard, identifier)
    sources = {
        f"fmi{standard}.c": filled(f"fmu/fmi{standard}.c"),
        "unit.h": _instance(design, identifier, token),
        "pretouch_design.h": design_header(design),
        HEADER: law_text(HEADER),
        SOURCE: law_text(SOURCE),
    }
    texts = {f"sources/{name}": text for name, text in sources.items()}
    texts["modelDescription.xml"] = model_description(design, standard, identifier, token)
    if standard == 3:
        texts["sources/buildDescription.xml"] = build_description(identifier)
    files = {name: text.encode() for name, text in texts.items()}
    if compiler:
        place = _NAMES_IN_FMI_2.get(_platform(), _platform()) if standard == 2 else _platform()
        ending = _ENDINGS.get(platform.system(), "so")
        files[f"binaries/{place}/{identifier}.{ending}"] = _library(compiler, standard, sources)
    return files


def _instance(design: LawDesign, identifier: str, token: str) -> str:
    """Return the C header `unit.h` of an FMU."""
    chosen = variables(design)
    reference = {variable.name: i for i, variable in enumerate(chosen)}
    reals = (f"    case {reference[v.name]}: return &{v.place};" for v in chosen if v.kind == "real")
    return filled(
        "fmu/unit.h",
        design,
        identifier=identifier,
        token=token,
        number_unit="N s^2" if design.is_drag else "N s",
        reals="\n".join(reals),
        number_reference=str(reference[design.number]),
        fresh_reference=str(reference["fresh"]),
        no_object_reference=str(reference["no_object"]),
        status_reference=str(reference["status"]),
    )


def _token(design: LawDesign, standard: int, identifier: str) -> str:
    """Return a hash of an FMU's C sources and XML description."""
    parts = (
        _instance(design, identifier, ""),
        design_header(design),
        filled(f"fmu/fmi{standard}.c"),
        law_text(HEADER),
        law_text(SOURCE),
        model_description(design, standard, identifier, ""),
    )
    return f"{{{uuid.UUID(bytes=hashlib.sha256(chr(0).join(parts).encode()).digest()[:16])}}}"


def _archive(files: Mapping[str, bytes]) -> bytes:
    """Return files as a reproducible ZIP archive."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, _DATE)
            entry.create_system = 3  # the same entry on every system: file permissions as in Unix
            entry.external_attr = 0o100644 << 16
            archive.writestr(entry, files[name], zipfile.ZIP_DEFLATED)
    return memory.getvalue()


def _platform() -> str:
    """Return the FMI 3.0 platform name of this machine."""
    machine, system = platform.machine(), platform.system()
    return f"{_ARCHITECTURES.get(machine, machine)}-{_SYSTEMS.get(system, system.lower())}"


def _compiler() -> tuple[str, ...]:
    """Return the command of the C compiler on this machine. The tuple is empty without a compiler."""
    if "CC" in os.environ:
        words = tuple(shlex.split(os.environ["CC"]))
        return words if words and shutil.which(words[0]) else ()
    return next(((name,) for name in _COMPILERS if shutil.which(name)), ())


def _library(compiler: tuple[str, ...], standard: int, sources: Mapping[str, str]) -> bytes:
    """Compile the C sources of an FMU into a shared library."""
    options = ["-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden"]
    options += [f"-DFMI{standard}_OVERRIDE_FUNCTION_PREFIX"]
    options += ["-s"] if platform.system() == "Linux" else []  # without names of temporary files
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        command = [*compiler, *options, "-o", "library", f"fmi{standard}.c", "-lm"]
        done = subprocess.run(  # noqa: S603 - the user's own compiler
            command, cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise InvalidInputError(
                f"C compiler: the command {shlex.join(compiler)} cannot compile the FMU. Set the environment variable "
                f"CC to another compiler. Error of this compiler: {done.stderr.strip()[:500]}"
            )
        return (Path(folder) / "library").read_bytes()
