"""Build the compiled core as one shared library, with the machine's compiler or, if none can build it, with zig.

    python native/build.py            into src/pretouch/_core/
    python native/build.py --sanitize check addresses and undefined behavior at run time, into build/native/sanitized/
    python native/build.py --page     into src/pretouch/studio/page/, as WebAssembly for browsers; needs ziglang
    python native/build.py --tidy     run clang-tidy on every source, if it is installed; nothing is built

The sources do not need Python.h, so one library serves every Python version. `lanes_*.cpp` are compiled once for each
kind of processor; the library selects one of them when it is loaded. Objects are cached in build/native/ under a hash
of their sources and options, so only changed files are compiled again.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib.util
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

NATIVE = Path(__file__).resolve().parent
KEPT = NATIVE.parent / "build/native"
ZIG = "ziglang>=0.14,<0.18"
"""Requirement that pip installs if the machine has no compiler."""

WARNINGS = "-Wall -Wextra -Wconversion -Wno-psabi"
LAW = f"-std=c99 -O2 -ffp-contract=off -pedantic {WARNINGS}"
PLAIN = f"-std=c++20 -O2 -ffp-contract=off -fno-exceptions -fno-rtti -fno-threadsafe-statics {WARNINGS}"
UNFUSED = {"lanes_loop"}
"""Vectorized sources that are compiled without fused multiply-add.

Their results have the same bits as those of a single encounter.
"""

UNROLLED = {"stiff_step", "lanes_loop"}
"""Sources whose loops have constant lengths; they are compiled with -O3, which unrolls these loops."""

LANES = (
    f"-std=c++20 -O2 -fno-math-errno -fno-trapping-math -ffp-contract=fast -fno-exceptions -fno-rtti "
    f"-fno-threadsafe-statics {WARNINGS}"
)
_AVX2 = "-mavx2 -mfma -mbmi -mbmi2"  # features instead of -march, since zig has other names for its levels
PROCESSORS = {
    "base": "",
    "avx2": _AVX2,
    "avx512": f"{_AVX2} -mavx512f -mavx512dq -mavx512bw -mavx512vl -mavx512cd -mprefer-vector-width=512",
}
SANITIZED = "-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer -g -O1"
STALE = 7 * 86400.0
"""Seconds after which an unused object is removed from the cache."""

SUFFIXES = {"win32": ".dll", "darwin": ".dylib"}


class Target(NamedTuple):
    """A kind of machine: its name in zig, with the oldest supported system, and the platform tag of its wheels."""

    triple: str
    tag: str


TARGETS = {
    "linux-x86_64": Target("x86_64-linux-gnu.2.17", "manylinux_2_17_x86_64.manylinux2014_x86_64"),
    "linux-aarch64": Target("aarch64-linux-gnu.2.17", "manylinux_2_17_aarch64.manylinux2014_aarch64"),
    "darwin-arm64": Target("aarch64-macos.11.0", "macosx_11_0_arm64"),
    "darwin-x86_64": Target("x86_64-macos.11.0", "macosx_11_0_x86_64"),
    "win32-AMD64": Target("x86_64-windows-gnu", "win_amd64"),
}


PAGE_TARGET = "wasm32-wasi"
"""Target of zig for the page of pretouch studio. The module imports nothing, so it needs no WASI at run time."""

PAGE_FUNCTIONS = ("solve_linear", "respond", "solve_series", "drag_approaches", "find_gains")
"""Functions that the page calls; the linker omits everything else, such as the sampled loop."""


def this_target() -> str:
    """Return the target machine: that of the variable PRETOUCH_TARGET if it is set, else this machine."""
    return os.environ.get("PRETOUCH_TARGET") or f"{sys.platform}-{platform.machine()}"


def compilers() -> tuple[list[str], list[str]] | None:
    """Return the compiler commands for C and C++; None if zig must be used."""
    if os.environ.get("PRETOUCH_COMPILER") == "zig" or os.environ.get("PRETOUCH_TARGET") or sys.platform == "win32":
        return None
    if "CC" in os.environ and "CXX" in os.environ:
        return os.environ["CC"].split(), os.environ["CXX"].split()
    for c, cxx in (("cc", "c++"), ("gcc", "g++"), ("clang", "clang++")):
        if shutil.which(c) and shutil.which(cxx):
            return [c], [cxx]
    return None


@lru_cache(maxsize=1)
def working_compilers() -> tuple[list[str], list[str]] | None:
    """Return the compilers that can build the library; None if zig must be used.

    A compiler that is too old fails here, and zig takes its place. A compiler that CC and CXX name is not replaced.
    """
    found = compilers()
    if found is None or ("CC" in os.environ and "CXX" in os.environ) or this_target() not in TARGETS:
        return found
    try:
        _objects(_library_jobs(found))  # the build itself uses these objects
    except RuntimeError as error:
        print(f"{error}\n{found[1][0]} cannot build pretouch, so that zig builds it; pip installs zig", file=sys.stderr)
        return None
    return found


def library_path(root: Path) -> Path:
    """Return the path of the library of a source tree."""
    return root / "src/pretouch/_core" / f"libpretouch{SUFFIXES.get(this_target().split('-')[0], '.so')}"


def record_path(library: Path) -> Path:
    """Return the path of the record of a library.

    It has the size, the hash and the interface of the library. Python checks them before it loads the library.
    """
    return library.with_name(f"{library.name}.json")


def interface() -> str:
    """Return a hash of the declarations that Python uses: both headers, without comments and with single spaces."""
    texts = [(NATIVE / name).read_text(encoding="utf-8") for name in ("core/pretouch.h", "law/pretouch_law.h")]
    bare = [" ".join(re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL).split()) for text in texts]
    return hashlib.sha256("\0".join(bare).encode()).hexdigest()[:16]


def check_interface() -> str:
    """Return the hash of the interface; raise RuntimeError if native.py has another one."""
    side, current = NATIVE.parent / "src/pretouch/_core/native.py", interface()
    named = re.search(r'^INTERFACE: Final = "(\w+)"$', side.read_text(encoding="utf-8"), re.MULTILINE)
    if named is None or named[1] != current:
        raise RuntimeError(
            f"the headers of pretouch's compiled core have changed: check the calls in Python, then set INTERFACE in "
            f'src/pretouch/_core/native.py to "{current}"'
        )
    return current


def write_record(library: Path, version: str) -> Path:
    """Write the record of a library with the hash of its interface, and return the record's path."""
    content = library.read_bytes()
    record = {"size": len(content), "sha256": hashlib.sha256(content).hexdigest(), "interface": version}
    record_path(library).write_text(json.dumps(record) + "\n", encoding="utf-8")
    return record_path(library)


def build(library: Path, *, sanitize: bool = False) -> Path:
    """Compile every source, link the library and write its record.

    The C compiler links, since no C++ runtime is needed.

    Args:
        library: path of the library; the record is written next to it.
        sanitize: check addresses and undefined behavior at run time.

    Returns:
        The path of the library. If a command fails, a RuntimeError reports its output.
    """
    version = check_interface()
    system = this_target().split("-", 1)[0]
    compiler = cc, _ = (compilers() if sanitize else working_compilers()) or _zig()
    objects = _objects(_library_jobs(compiler, sanitize=sanitize))
    made = KEPT / f"{os.getpid()}-{library.name}"  # a linker may write further files there
    link = [*cc, "-shared", *(["-fsanitize=address,undefined"] if sanitize else ["-s"] if system != "darwin" else [])]
    _link(made, objects, link, ["-lm"] if system == "linux" else [])
    noted = write_record(made, version)
    library.parent.mkdir(parents=True, exist_ok=True)
    made.replace(library)  # atomic; a process that uses the old library keeps it
    noted.replace(record_path(library))
    return library


def _library_jobs(compiler: tuple[list[str], list[str]], *, sanitize: bool = False) -> list[list[str]]:
    """Return the compiler commands for the library of the target machine."""
    system, machine = this_target().split("-", 1)
    common = ["-fvisibility=hidden", *([] if system == "win32" else ["-fPIC"])]
    return _jobs(compiler, [*common, *(SANITIZED.split() if sanitize else ["-g0"])], machine)


def has_zig() -> bool:
    """Return whether Python can run zig, which builds the core of the page."""
    return importlib.util.find_spec("ziglang") is not None


def page_core_path(root: Path) -> Path:
    """Return the path of the compiled core of the page in a source tree."""
    return root / "src/pretouch/studio/page/core.wasm"


def build_page_core(made: Path) -> Path:
    """Compile the unchanged sources of the core for browsers, and link those functions that the page calls.

    The options make the code small, so that it loads fast; they do not change any bit of the results.

    Args:
        made: path of the module.

    Returns:
        The path of the module. The module imports nothing. JavaScript places its arrays in the exported memory, from
        `__heap_base` on.
    """
    check_interface()
    zig = [sys.executable, "-m", "ziglang"]
    compiler = [*zig, "cc", "-target", PAGE_TARGET], [*zig, "c++", "-target", PAGE_TARGET]
    common = ["-fvisibility=hidden", "-msimd128", "-Os", "-flto", "-g0"]
    exported = [f"-Wl,--export=pretouch_{name}" for name in PAGE_FUNCTIONS]
    link = [*compiler[0], "-mexec-model=reactor", "-nostartfiles", "-Wl,--no-entry", "-Wl,--export=__heap_base", "-s"]
    return _link(made, _objects(_jobs(compiler, common, "wasm32")), [*link, *exported], [])


def tidy() -> int:
    """Run clang-tidy on every source with its compiler options; if a source has variants, only with the last one's.

    Returns:
        The number of sources with findings; clang-tidy prints the findings.
    """
    if shutil.which("clang-tidy") is None:
        print("clang-tidy: found none on this machine, nothing is read")
        return 0
    last = {
        job[-1]: [flag for flag in job if flag.startswith(("-std", "-D", "-m"))]
        for job in _jobs(([], []), [], this_target().split("-", 1)[1])
    }
    with ThreadPoolExecutor(max_workers=int(os.environ.get("JOBS", "2"))) as pool:
        commands = (["clang-tidy", "--quiet", path, "--", *flags] for path, flags in last.items())
        done = list(pool.map(lambda c: subprocess.run(c, stderr=subprocess.DEVNULL, text=True, check=False), commands))
    return sum(one.returncode != 0 for one in done)


def _objects(jobs: list[list[str]]) -> list[Path]:
    """Compile every source whose object is not in the cache, remove stale objects, and return all objects."""
    KEPT.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(max_workers=int(os.environ.get("JOBS", "2"))) as pool:
        objects = list(pool.map(_compiled, jobs))
    _drop_stale(objects)
    return objects


def _link(made: Path, objects: list[Path], link: list[str], libraries: list[str]) -> Path:
    """Link objects into one file with a command, and return the file."""
    made.parent.mkdir(parents=True, exist_ok=True)
    _run([*link, *map(str, objects), "-o", str(made), *libraries])
    return made


def _jobs(compilers: tuple[list[str], list[str]], common: list[str], machine: str) -> list[list[str]]:
    """Return one compiler command for each source and each of its variants; its last argument is the source."""
    cc, cxx = compilers
    jobs = [[*cc, *LAW.split(), *common, "-c", str(p)] for p in sorted(NATIVE.glob("law/*.c"))]
    for path in sorted(NATIVE.glob("core/*.cpp")):
        more = ["-O3"] if path.stem in UNROLLED else []
        if not path.name.startswith("lanes_"):
            jobs.append([*cxx, *PLAIN.split(), *more, *common, "-c", str(path)])
            continue
        for name, flags in PROCESSORS.items():
            if name == "base" or machine in {"x86_64", "AMD64"}:
                unfused = ["-ffp-contract=off"] if path.stem in UNFUSED else []
                variant = [*LANES.split(), *more, *unfused, *flags.split(), f"-DPRETOUCH_VARIANT=pretouch_{name}"]
                jobs.append([*cxx, *variant, *common, "-c", str(path)])
    return jobs


def _drop_stale(used: list[Path]) -> None:
    """Mark the used objects by their file time, and remove objects that no build has used for a week."""
    for path in used:
        path.touch()
    for path in KEPT.glob("*.o"):
        with contextlib.suppress(FileNotFoundError):  # another build may have removed it
            if path.stat().st_mtime < time.time() - STALE:
                path.unlink()


def _zig() -> tuple[list[str], list[str]]:
    """Return the commands of zig, the compiler that pip installs, for C and C++."""
    known = TARGETS.get(this_target())
    if known is None:
        raise RuntimeError(
            f"pretouch's compiled core can not be built: found no C and C++ compiler, and none comes by pip for "
            f"{this_target()}; install one, or name it by CC and CXX"
        )
    if not has_zig():
        raise RuntimeError(
            f"pretouch's compiled core can not be built: no compiler on this machine can compile it; install gcc 12, "
            f'clang 14 or newer, or zig: python -m pip install "{ZIG}"'
        )
    zig = [sys.executable, "-m", "ziglang"]
    return [*zig, "cc", "-target", known.triple], [*zig, "c++", "-target", known.triple]


def _compiled(job: list[str]) -> Path:
    """Return the object of one source; compile the source if the object is not in the cache."""
    digest = hashlib.sha256("\0".join(job).encode())
    for path in [Path(job[-1]), *sorted(NATIVE.glob("*/*.h")), *sorted(NATIVE.glob("*/*.hpp"))]:
        digest.update(path.read_bytes())
    made = KEPT / f"{Path(job[-1]).stem}-{digest.hexdigest()[:20]}.o"
    if not made.exists():
        partial = made.with_suffix(f".{os.getpid()}")
        _run([*job, "-o", str(partial)])
        partial.replace(made)
    return made


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"pretouch's compiled core could not be built:\n  {' '.join(command)}\n{done.stderr}")


def main() -> None:
    """Build the library or the page's core in the source tree, or run clang-tidy, as the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--sanitize", action="store_true", help="check addresses and undefined behavior")
    parser.add_argument("--page", action="store_true", help="build WebAssembly for the page of pretouch studio")
    parser.add_argument("--tidy", action="store_true", help="let clang-tidy read the sources, and build nothing")
    wanted, root = parser.parse_args(), NATIVE.parent
    if wanted.tidy:
        sys.exit(tidy() and 1)
    if wanted.page:
        if not has_zig():
            parser.error(f'the page needs zig: python -m pip install "{ZIG}"')
        print(build_page_core(page_core_path(root)).relative_to(root))
        return
    own = library_path(root)
    made = root / "build/native/sanitized" / own.name if wanted.sanitize else own
    print(build(made, sanitize=wanted.sanitize).relative_to(root))


if __name__ == "__main__":
    main()
