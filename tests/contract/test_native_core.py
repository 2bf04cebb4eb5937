"""The compiled core: how it is found, chosen and called, and what it refuses before anything is read."""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from native_code import NATIVE, fields_of, offsets
from pretouch._core import native
from pretouch.motion import kernels, layout
from pretouch.simulation import native_loop

ROOT = Path(__file__).parents[2]


def load_build():
    spec = importlib.util.spec_from_file_location("native_build", ROOT / "native/build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def shown(program: str, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", program], env=os.environ | environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    "array",
    [
        np.zeros(4, dtype=np.float32),
        np.zeros(4, dtype=np.int64),
        np.zeros(8)[::2],
        np.zeros((3, 4), order="F"),
        np.zeros((3, 4))[:, 1:],
    ],
    ids=["float32", "integers", "every second", "columns first", "part of each row"],
)
def test_an_array_that_a_kernel_would_misread_is_refused(array):
    with pytest.raises(TypeError, match="contiguous array of the type float64"):
        native.address(array)


def test_an_array_of_another_shape_is_refused():
    array = np.zeros((3, 4))
    assert native.shaped(array, (3, 4)) == array.ctypes.data
    with pytest.raises(TypeError, match=r"an array of the shape \(4, 3\), but received an array of the shape \(3, 4\)"):
        native.shaped(array, (4, 3))
    with pytest.raises(TypeError, match="contiguous array of the type int64"):
        native.shaped(array, (3, 4), np.dtype(np.int64))


@pytest.mark.parametrize("part", [np.s_[:, 1:3], np.s_[:, :], np.s_[1:2, 4:], np.s_[::2, :3]])
def test_a_part_of_an_array_is_filled_where_its_rows_are_contiguous(part):
    array = np.zeros((5, 6))[part]
    assert native.rows_of(array, array.shape) == (array.ctypes.data, array.strides[0] // 8)


@pytest.mark.parametrize(
    "array", [np.zeros((3, 8))[:, ::2], np.zeros((4, 3)).T, np.zeros((3, 4), dtype=np.float32), np.zeros((4, 3))]
)
def test_rows_that_a_kernel_would_misread_are_refused(array):
    with pytest.raises(TypeError, match=r"needs an aligned float64 array of the shape \(3, 4\) with contiguous rows"):
        native.rows_of(array, (3, 4))


@pytest.mark.parametrize("size", [0, 1, 7])
@pytest.mark.parametrize("writeable", [True, False])
def test_the_address_is_where_the_numbers_lie(size, writeable):
    array = np.arange(float(size))
    array.flags.writeable = writeable
    assert native.address(array) == array.ctypes.data


def test_one_number_for_all_encounters_has_the_stride_zero():
    arrays = [np.arange(3.0), np.ones(1)]
    assert struct.unpack("4q", native.columns(arrays, 3)) == (arrays[0].ctypes.data, 1, arrays[1].ctypes.data, 0)
    with pytest.raises(TypeError, match="takes 1 or 4 numbers, not 3"):
        native.columns(arrays, 4)


@pytest.mark.parametrize(("given", "peaks"), [(8, False), (10, True), (8, True)])
def test_a_kernel_of_contacts_refuses_too_few_columns(given, peaks):
    curves = (np.zeros((1, 10)), np.array([0, 1]), np.zeros(1, dtype=np.int64))
    out, status = np.zeros((len(layout.STATES), 2)), np.zeros(2, dtype=np.int8)
    filled = np.zeros((len(layout.PEAKS), 2)) if peaks else None
    with pytest.raises(
        TypeError,
        match=rf"needs 9 input columns, and two additional columns to compute peak values, but received {given}",
    ):
        kernels.contact_times([np.zeros(2)] * given, curves, 1.0, out, status, peaks=filled)


def test_each_kind_of_processor_up_to_this_one_can_be_asked_for():
    best = native.kernel("best_variant", result=ctypes.c_int)()
    for number, name in enumerate(native.VARIANTS):
        program = "from pretouch._core import native; native.kernel('best_variant')(); print(native.variant())"
        done = shown(program, PRETOUCH_VARIANT=name)
        if number <= best:
            assert (done.stdout.strip(), done.stderr) == (name, "")
        else:
            assert f"found the processor variant {name}, which this processor does not support" in done.stderr


def test_a_kind_that_is_none_is_named_with_those_that_are():
    done = shown("from pretouch._core import native; native.kernel('best_variant')()", PRETOUCH_VARIANT="sse9")
    assert "PRETOUCH_VARIANT: found 'sse9', expected one of base, avx2, avx512" in done.stderr


def test_a_missing_library_says_how_to_make_it(monkeypatch, tmp_path):
    monkeypatch.setattr(native, "__file__", str(tmp_path / "native.py"))
    with pytest.raises(ImportError, match=r"libpretouch.* is missing.* run python native/build\.py"):
        native._library.__wrapped__()


OWN = load_build().library_path(ROOT)


def damaged_library(tmp_path, change):
    """Copy the library and its record, and change one of them or both."""
    library, record = tmp_path / OWN.name, tmp_path / f"{OWN.name}.json"
    library.write_bytes(OWN.read_bytes())
    record.write_bytes(OWN.with_name(f"{OWN.name}.json").read_bytes())
    change(library, record)
    return library


def flip(library):
    content = bytearray(library.read_bytes())
    content[len(content) // 2] ^= 1
    library.write_bytes(content)


def pretend(library, record):
    """Write a text as a library whose record is right: what a build for another system looks like."""
    library.write_bytes(b"text")
    digest = "982d9e3eb996f559e633f4d194def3761d909f5a3b647d1a851fead67c32c9d1"  # SHA-256 of it
    record.write_text(json.dumps({"size": 4, "sha256": digest, "interface": native.INTERFACE}))


DAMAGES = {
    "truncated": (lambda library, _: os.truncate(library, 4096), "has 4,096 bytes, expected"),
    "empty": (lambda library, _: os.truncate(library, 0), "has 0 bytes, expected"),
    "foreign": (
        lambda library, _: library.write_bytes(b"\0" * OWN.stat().st_size),
        "has been changed since it was built: its hash differs",
    ),
    "one bit": (lambda library, _: flip(library), "has been changed since it was built: its hash differs"),
    "older": (
        lambda _, record: record.write_text(record.read_text().replace(native.INTERFACE, 16 * "0")),
        "was built for another version of pretouch",
    ),
    "missing": (lambda library, _: library.unlink(), "is missing"),
    "without a record": (lambda _, record: record.unlink(), "has no build record (.json) in the same folder"),
    "with half a record": (lambda _, record: os.truncate(record, 20), "has a damaged build record"),
    "with a list for a record": (lambda _, record: record.write_text("[1]"), "has a damaged build record"),
    "no library at all": (pretend, "cannot be loaded"),
    "a folder": (lambda library, _: (library.unlink(), library.mkdir()), "cannot be read"),
}


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_library_that_is_not_as_it_was_built_is_refused_in_one_sentence(tmp_path, damage):
    """A truncated one killed the process by SIGBUS; the others ended in a traceback."""
    change, what = DAMAGES[damage]
    library = damaged_library(tmp_path, change)
    command = [sys.executable, "-m", "pretouch", "design", str(ROOT / "examples/approach.toml"), "--no-report"]
    done = subprocess.run(
        command, env=os.environ | {"PRETOUCH_LIBRARY": str(library)}, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        f"pretouch: the compiled core of pretouch cannot be used. The file {library.name} has this problem: it {what}"
    )
    assert f". The file is in the folder {tmp_path}, set by PRETOUCH_LIBRARY. Reinstall pretouch by pip" in done.stderr
    assert done.stderr.endswith("run python native/build.py\n")
    assert done.stderr.count("\n") == 1


def test_an_intact_copy_in_the_place_of_the_own_library_is_taken(tmp_path):
    library = damaged_library(tmp_path, lambda *_: None)
    program = "from pretouch._core import native; native.kernel('best_variant')(); print(native._library()._name)"
    assert shown(program, PRETOUCH_LIBRARY=str(library)).stdout.strip() == str(library)


def test_python_names_the_interface_that_the_headers_declare(monkeypatch, tmp_path):
    """Changed headers end a build until somebody has looked at the calls in Python; changed comments do not."""
    build = load_build()
    assert build.check_interface() == native.INTERFACE
    for name in ("core/pretouch.h", "law/pretouch_law.h"):
        (tmp_path / "native" / name).parent.mkdir(parents=True)
        (tmp_path / "native" / name).write_text(f"/* other words */ {(ROOT / 'native' / name).read_text()}")
    (tmp_path / "src/pretouch/_core").mkdir(parents=True)
    (tmp_path / "src/pretouch/_core/native.py").write_text(Path(native.__file__).read_text())
    monkeypatch.setattr(build, "NATIVE", tmp_path / "native")
    assert build.check_interface() == native.INTERFACE
    header = tmp_path / "native/core/pretouch.h"
    header.write_text(header.read_text().replace("int64_t n,", "int32_t n,", 1))
    with pytest.raises(RuntimeError, match=rf'set INTERFACE .* to "{build.interface()}"'):
        build.check_interface()


def test_a_named_compiler_comes_before_those_that_are_found_and_pip_brings_one_where_none_is(monkeypatch):
    build = load_build()
    for name in ("PRETOUCH_COMPILER", "PRETOUCH_TARGET", "CC", "CXX"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(build.sys, "platform", "linux")
    monkeypatch.setattr(
        build.shutil, "which", lambda name: f"/bin/{name}" if name in {"clang", "clang++", "gcc"} else None
    )
    assert build.compilers() == (["clang"], ["clang++"])  # a gcc without g++ is none
    monkeypatch.setenv("CC", "ccache gcc")
    monkeypatch.setenv("CXX", "ccache g++")
    assert build.compilers() == (["ccache", "gcc"], ["ccache", "g++"])
    monkeypatch.setenv("PRETOUCH_COMPILER", "zig")
    assert build.compilers() is None
    monkeypatch.setenv("PRETOUCH_TARGET", "plan9-mips")
    with pytest.raises(RuntimeError, match="found no C and C\\+\\+ compiler, and none comes by pip for plan9-mips"):
        build._zig()


@pytest.mark.skipif(sys.platform == "win32", reason="the compilers of this test are shell scripts")
def test_a_compiler_that_is_too_old_is_replaced_unless_it_is_named(monkeypatch, tmp_path, capsys):
    for name in ("cc", "c++"):
        program = tmp_path / name
        program.write_text("#!/bin/sh\necho \"unrecognized command line option '-std=c++20'\" >&2\nexit 1\n")
        program.chmod(0o755)
    for name in ("PRETOUCH_COMPILER", "PRETOUCH_TARGET", "CC", "CXX"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    build = load_build()
    monkeypatch.setattr(build, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(build, "TARGETS", {build.this_target(): build.Target("any", "any")})
    assert build.compilers() == (["cc"], ["c++"])
    assert build.working_compilers() is None
    assert "c++20" in capsys.readouterr().err
    monkeypatch.setattr(build, "has_zig", lambda: False)
    with pytest.raises(RuntimeError, match="pip install"):
        build.build(tmp_path / "libpretouch.so")
    monkeypatch.setenv("CC", "cc")
    monkeypatch.setenv("CXX", "c++")
    build.working_compilers.cache_clear()
    with pytest.raises(RuntimeError, match="unrecognized"):
        build.build(tmp_path / "libpretouch.so")


STRUCTURES = {
    "plant": native_loop._Plant,
    "contact": native_loop._Contact,
    "chain": native_loop._Chain,
    "curve": native_loop._Curve,
    "loop": native_loop._Loop,
    "curves": kernels._CurvesOfCore,
}
ROWS = {
    "end": native_loop.RESULT_COLUMNS,
    "touch": native_loop.CONTACT_COLUMNS,
    "instant": native_loop.TRACE_COLUMNS,
    "moment": native_loop.COURSE_COLUMNS,
}


@pytest.mark.parametrize("name", STRUCTURES)
def test_structures_are_those_of_the_header(name: str, tmp_path: Path) -> None:
    fields = fields_of(STRUCTURES[name])
    found = offsets(tmp_path, "core/pretouch.h", f"pretouch_{name}", [path for path, _ in fields])
    assert found == [ctypes.sizeof(STRUCTURES[name]), *(offset for _, offset in fields)]


@pytest.mark.parametrize("name", ROWS)
def test_columns_are_the_fields_of_what_the_loop_fills(name: str, tmp_path: Path) -> None:
    columns = ROWS[name]
    found = offsets(tmp_path, "core/pretouch.h", f"pretouch_{name}", columns)
    assert found == [8 * len(columns), *(8 * i for i in range(len(columns)))]


def test_the_cases_of_another_machine_are_made() -> None:
    """What compares another kind of machine with this one is run by hand: here only that it finds what it compares."""
    path = NATIVE / "check_machine.py"
    spec = importlib.util.spec_from_file_location("check_machine", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert {name for name in module.cases() if name.startswith("EXPECTED")} >= {"EXPECTED_LINEAR", "EXPECTED_SERIES"}
