"""Exported co-simulation units compute what the package computes, in FMPy and in both versions of FMI.

The environment variable FMILIB names the folder in which FMI Library is installed, for the test with that importer.
"""

from __future__ import annotations

import ctypes
import dataclasses
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from exported_designs import DESIGNS
from pretouch.control import Arrival, Controller, Sample
from pretouch.exports import export
from pretouch.exports.law_design import law_design
from refusals import refused

WARNINGS = "-Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -pedantic -Werror"
INPUTS = ("reading", "age", "contact_force", "reference_position", "reference_velocity", "reference_acceleration")
OUTPUTS = ("position", "velocity", "acceleration", "virtual_force", "log_level")
STANDARDS = (2, 3)

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler: the units have no library"
)


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One export of each design, without its verification, which other tests run."""
    root = tmp_path_factory.mktemp("fmu")
    for name, design in DESIGNS.items():
        assert export(design(), root / name, "fmu", verify=False).is_written
    return {name: root / name for name in DESIGNS}


def unit_in(folder: Path, standard: int) -> Path:
    (path,) = folder.glob(f"*-fmi{standard}.fmu")
    return path


class Unit:
    """One instance of a unit in FMPy, with the same methods for both versions of FMI."""

    def __init__(self, fmu: Any, description: Any) -> None:
        self.fmu, self.is_2 = fmu, description.fmiVersion == "2.0"
        self.reference = {v.name: v.valueReference for v in description.modelVariables}
        self.time = 0.0

    def set_reals(self, **values: float) -> None:
        set_values = self.fmu.setReal if self.is_2 else self.fmu.setFloat64
        set_values([self.reference[name] for name in values], list(values.values()))

    def get_reals(self, *names: str) -> list[float]:
        get_values = self.fmu.getReal if self.is_2 else self.fmu.getFloat64
        return list(get_values([self.reference[name] for name in names]))

    def start(self, time: float = 0.0) -> None:
        self.time = time
        if self.is_2:
            self.fmu.setupExperiment(startTime=time)
        self.fmu.enterInitializationMode(*(() if self.is_2 else (None, time)))
        self.fmu.exitInitializationMode()

    def step(self, sample: Sample, duration: float, time: float | None = None) -> list[float]:
        """The real outputs and the status after one communication step, which starts where the last one ended."""
        self.time = self.time if time is None else time
        self.set_reals(**{name: getattr(sample, name) for name in INPUTS})
        references = [self.reference["fresh"], self.reference["no_object"]]
        self.fmu.setBoolean(references, [bool(sample.fresh), sample.fresh == Arrival.NO_OBJECT])
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=duration)
        self.time += duration
        status = (self.fmu.getInteger if self.is_2 else self.fmu.getInt32)([self.reference["status"]])
        return [*self.get_reals(*OUTPUTS), status[0]]


@contextmanager
def instance(path: Path) -> Iterator[Unit]:
    """An instance of a unit that is not initialized yet."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (pip install pretouch[fmu])")
    from fmpy.simulation import instantiate_fmu

    description, folder = fmpy.read_model_description(str(path)), fmpy.extract(str(path))
    try:
        fmu = instantiate_fmu(folder, description, "CoSimulation")
        yield Unit(fmu, description)
        fmu.freeInstance()
    finally:
        shutil.rmtree(folder)


def controller_of(task: pt.Task) -> Controller:
    return law_design(task, verify=False).controller


def expected(controller: Controller, samples: tuple[Sample, ...]) -> list[list[float]]:
    run = controller.begin()
    names = ("contact_force", "reference_position", "reference_velocity", "reference_acceleration")
    outputs = (run.step(s.reading, s.fresh, s.age, **{name: getattr(s, name) for name in names}) for s in samples)
    return [[*out[:-1], int(out.status)] for out in outputs]


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("design", DESIGNS)
def test_both_units_are_valid_and_every_bit_is_that_of_the_vectors(design: str, exports: dict[str, Path]) -> None:
    """The exported test counts findings of FMPy and differences; it runs all cases in both versions of FMI."""
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install pretouch[fmu])")
    command = [sys.executable, str(exports[design] / "test_fmu.py")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    rows = [
        re.findall(r": (\d+) findings; (\d+) steps, .* difference (\S+), (\d+) ", s) for s in run.stdout.splitlines()
    ]
    assert len(rows) == len(STANDARDS)
    for ((findings, steps, difference, flags),) in rows:
        assert (int(findings), float(difference), int(flags)) == (0, 0, 0)
        assert int(steps) > 1000


@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
def test_the_library_gives_every_bit_of_the_vectors_without_an_importer(
    standard: int, exports: dict[str, Path], tmp_path: Path
) -> None:
    """Called as the standard declares the functions, also where FMPy is not installed."""
    law = law_design(DESIGNS["filters"](), verify=False)
    archive = zipfile.ZipFile(unit_in(exports["filters"], standard))
    (name,) = (name for name in archive.namelist() if name.startswith("binaries"))
    library = ctypes.CDLL(archive.extract(name, tmp_path))
    description = archive.read("modelDescription.xml").decode()
    token = re.search(r"\{[-0-9a-f]{36}\}", description)
    assert token is not None
    call = lambda name: getattr(library, f"fmi{standard}{name}")  # noqa: E731
    call("Instantiate" if standard == 2 else "InstantiateCoSimulation").restype = ctypes.c_void_p
    flag, number, handle = (ctypes.c_int if standard == 2 else ctypes.c_bool), ctypes.c_double, ctypes.c_void_p
    size, none = ctypes.c_size_t, ctypes.c_void_p()
    no = flag(0)

    def create(given: bytes) -> ctypes.c_void_p:
        if standard == 2:
            made = library.fmi2Instantiate(b"unit", ctypes.c_int(1), given, none, none, no, no)
        else:
            none_of = (none, size(0), none, none, none)
            made = library.fmi3InstantiateCoSimulation(b"unit", given, none, no, no, no, no, *none_of)
        return handle(made)

    assert not create(b"another token")
    unit = create(token[0].encode())
    variables = re.findall(r'name="(\w+)" valueReference="(\d+)"', description)
    reference = {name: ctypes.c_uint32(int(text)) for name, text in variables}

    def access(verb: str, kind: str, variable: str, value: Any) -> Any:
        more = () if standard == 2 else (size(1),)
        assert call(verb + kind)(unit, ctypes.byref(reference[variable]), size(1), ctypes.byref(value), *more) == 0
        return value.value

    real, integer = ("Real", "Integer") if standard == 2 else ("Float64", "Int32")
    period = law.controller.period
    for case in law.cases:
        assert call("Reset")(unit) == 0
        if standard == 2:
            assert call("EnterInitializationMode")(unit) == 0
        else:
            assert call("EnterInitializationMode")(unit, no, number(0), number(0), no, number(0)) == 0
        assert call("ExitInitializationMode")(unit) == 0
        for i, (sample, out) in enumerate(zip(case.samples, case.outputs, strict=True)):
            for variable in INPUTS:
                access("Set", real, variable, number(getattr(sample, variable)))
            access("Set", "Boolean", "fresh", flag(bool(sample.fresh)))
            access("Set", "Boolean", "no_object", flag(sample.fresh == Arrival.NO_OBJECT))
            results = () if standard == 2 else tuple(map(ctypes.byref, (flag(), flag(), flag(), number())))
            assert call("DoStep")(unit, number(i * period), number(period), no, *results) == 0
            found = [access("Get", real, variable, number()) for variable in OUTPUTS]
            assert [*found, access("Get", integer, "status", ctypes.c_int32())] == [*out[:-1], int(out.status)]
    call("FreeInstance")(unit)


@pytest.mark.slow
@needs_compiler
def test_the_exported_test_notices_another_output(exports: dict[str, Path], tmp_path: Path) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install pretouch[fmu])")
    shutil.copytree(exports["damper"], tmp_path / "law")
    unit_in(tmp_path / "law", 2).unlink()
    vectors = tmp_path / "law/vectors.csv"
    *lines, last = vectors.read_text().splitlines()
    *cells, log_level, status = last.split(",")
    vectors.write_text("\n".join([*lines, ",".join([*cells, repr(float(log_level) + 1e-6), status])]) + "\n")
    command = [sys.executable, str(tmp_path / "law/test_fmu.py")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 1, run.stdout + run.stderr
    assert "FAILED" in run.stdout


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
def test_a_simulation_of_fmpy_gives_the_same_bits(standard: int, exports: dict[str, Path]) -> None:
    """FMPy's own loop over time, with signals for all inputs."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (pip install pretouch[fmu])")
    design = law_design(DESIGNS["course"](), verify=False)
    case, period = design.cases[0], design.controller.period
    columns = [("time", "f8"), *((name, "f8") for name in INPUTS), ("fresh", "?")]
    signals = np.array(
        [(i * period, *(getattr(s, name) for name in INPUTS), s.fresh) for i, s in enumerate(case.samples)], columns
    )
    path = str(unit_in(exports["course"], standard))
    steps = len(case.samples) - 1  # signals hold until the last sample
    result = fmpy.simulate_fmu(path, input=signals, output=[*OUTPUTS, "status"], stop_time=steps * period)
    assert len(result) == steps + 1
    for name in (*OUTPUTS, "status"):
        wanted = [getattr(out, name) for out in case.outputs[:steps]]
        np.testing.assert_array_equal(result[name][1:], wanted)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
def test_a_step_of_several_periods_equals_single_periods(standard: int, exports: dict[str, Path]) -> None:
    """The reading is fresh once, and the reference moves on with its constant acceleration."""
    task = DESIGNS["damper"]()
    controller = controller_of(task)
    period, (x, v, a) = controller.period, (0.1, 0.3, 2.0)
    samples = []
    for i in range(60):  # twenty communication steps of three periods
        at = period * (i % 3)
        moved = {"reference_position": x + v * at + a * at**2 / 2, "reference_velocity": v + a * at}
        samples.append(
            Sample(
                reading=3000.0 * 1.01**i,
                fresh=i % 3 == 0,
                age=0.0,
                contact_force=0.0,
                reference_acceleration=a,
                **moved,
            )
        )
    wanted = expected(controller, tuple(samples))[2::3]
    with instance(unit_in(exports["damper"], standard)) as unit:
        unit.start()
        found = [unit.step(sample, 3 * period) for sample in samples[::3]]
    assert max(abs(out[3]) for out in wanted) > 0.1
    # both add up the reference of the second and third period, in another order
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def on_the_grid(controller: Controller, start: float, steps: list[tuple[float, float, Sample]]) -> list[list[float]]:
    """What a unit has to give after each step of a master: the law, sampled at its own period.

    Args:
        controller: the law.
        start: time of the first step [s].
        steps: start and duration [s] of each step, and its inputs.
    """
    run, period, count, waiting, found, last = controller.begin(), controller.period, 0, None, [], []
    for time, duration, sample in steps:
        if sample.fresh:
            waiting = (time, sample)
        while start + count * period < time + duration - 1e-6 * period:
            tick = start + count * period
            after = tick - time if tick - time > 1e-6 * period else 0.0
            reading, age, fresh = sample.reading, sample.age, Arrival.NOTHING
            if waiting is not None:
                fresh = waiting[1].fresh
                waited = tick - waiting[0]
                reading = waiting[1].reading
                age = waiting[1].age + (waited if waited > 1e-6 * period else 0.0)
                waiting = None
            x, v, a = sample.reference_position, sample.reference_velocity, sample.reference_acceleration
            moved = {"reference_position": x + after * (v + after / 2 * a), "reference_velocity": v + after * a}
            force = {"contact_force": sample.contact_force, "reference_acceleration": a}
            out = run.step(reading, fresh, age, **moved, **force)
            last = [*out[:-1], int(out.status)]
            count += 1
        found.append(last)
    return found


def random_master(rng: np.random.Generator, period: float) -> tuple[float, list[tuple[float, float, Sample]]]:
    """The steps of a master with a step of its own, or with steps of any length, and inputs at any time."""
    start = float(rng.choice([0.0, 0.0123, 100.0, -3.7]))
    lengths = {
        "fraction": np.full(300, period / rng.integers(1, 12)),
        "multiple": np.full(60, period * rng.integers(1, 7)),
        "other": np.full(150, period * rng.uniform(0.05, 4.0)),
        "variable": period * 10 ** rng.uniform(-3, 0.9, 200),
        "short end": np.append(np.full(40, 2 * period), 0.5 * period),
    }[str(rng.choice(["fraction", "multiple", "other", "variable", "short end"]))]
    accumulates, time, steps, reading = rng.random() < 0.5, start, [], 3000.0
    for i, length in enumerate(lengths):
        if not accumulates and len(set(lengths)) == 1:
            time = start + i * length
        reading *= np.exp(rng.normal(0.01, 0.03))
        inputs = Sample(
            reading=float(reading),
            fresh=Arrival(rng.choice(3, p=[0.3, 0.65, 0.05])),
            age=float(rng.choice([0.0, 0.3 * period])),
            contact_force=float(rng.choice([0.0, -2.0])),
            reference_position=float(rng.normal(0, 0.1)),
            reference_velocity=float(rng.normal(0, 0.1)),
            reference_acceleration=float(rng.normal(0, 1.0)),
        )
        steps.append((float(time), float(length), inputs))
        time += length
    return start, steps


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
@pytest.mark.parametrize("design", ["damper", "drag", "filters"])
def test_any_steps_of_a_master_give_the_law_at_its_own_period(
    design: str, standard: int, exports: dict[str, Path]
) -> None:
    """200 random masters in all: each output after each step is, bit for bit, that of the law on its grid."""
    controller = controller_of(DESIGNS[design]())
    rng = np.random.default_rng(standard)
    forces = 0
    with instance(unit_in(exports[design], standard)) as unit:
        for _ in range(34):
            start, steps = random_master(rng, controller.period)
            unit.fmu.reset()
            unit.start(start)
            found = [unit.step(sample, length, time) for time, length, sample in steps]
            assert found == on_the_grid(controller, start, steps)
            forces += sum(out[3] != 0 for out in found)
    assert forces > 1000


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
@pytest.mark.parametrize("periods", [0.5, 1.5, 3.7])
def test_a_simulation_of_fmpy_may_have_any_step_and_stop_time(
    periods: float, standard: int, exports: dict[str, Path]
) -> None:
    """FMPy's own loop over time, also with a last step that is shorter."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (pip install pretouch[fmu])")
    design = law_design(DESIGNS["course"](), verify=False)
    period = design.controller.period
    path, stop = str(unit_in(exports["course"], standard)), 41.3 * period
    result = fmpy.simulate_fmu(path, output=["position"], stop_time=stop, output_interval=periods * period)
    assert result["time"][-1] >= stop - periods * period


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
@pytest.mark.parametrize("share", [0.0, -1.0, float("nan"), 1e30])
def test_a_step_that_does_not_move_on_is_refused(share: float, standard: int, exports: dict[str, Path]) -> None:
    task = DESIGNS["damper"]()
    samples = law_design(task, verify=False).cases[0].samples
    period = task.loop.law.period
    with instance(unit_in(exports["damper"], standard)) as unit:
        unit.start()
        first = unit.step(samples[0], period)
        with pytest.raises(Exception, match="status 3"):
            unit.step(samples[1], share * period)
        with pytest.raises(Exception, match="status 3"):
            unit.step(samples[1], period, time=5 * period)
        assert unit.get_reals(*OUTPUTS) == first[:-1]


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
def test_the_gain_can_be_weaker_but_not_stronger(standard: int, exports: dict[str, Path]) -> None:
    design = law_design(DESIGNS["damper"](), verify=False)
    samples = design.cases[0].samples
    wanted = expected(design.controller.with_value(-0.43), samples)
    archive = zipfile.ZipFile(unit_in(exports["damper"], standard))
    (about,) = re.findall(r'name="gain" .*description="([^"]*)"', archive.read("modelDescription.xml").decode())
    assert "harder" in about
    with instance(unit_in(exports["damper"], standard)) as unit:
        for wrong in (-0.8601, 1e-9, float("nan")):
            with pytest.raises(Exception, match="status 3"):
                unit.set_reals(gain=wrong)
        unit.set_reals(gain=-0.43)
        unit.start()
        assert [unit.step(sample, design.controller.period) for sample in samples] == wanted
        with pytest.raises(Exception, match="status 3"):
            unit.set_reals(gain=-0.2)
    assert wanted != expected(design.controller, samples)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
@pytest.mark.parametrize("design", ["damper", "drag"])
def test_a_restored_state_repeats_the_run(design: str, standard: int, exports: dict[str, Path]) -> None:
    """Stored in the middle of an approach, restored later, directly and from bytes."""
    law = law_design(DESIGNS[design](), verify=False)
    samples, period = law.cases[0].samples, law.controller.period
    with instance(unit_in(exports[design], standard)) as unit:
        fmu = unit.fmu
        store, restore = (fmu.getFMUstate, fmu.setFMUstate) if standard == 2 else (fmu.getFMUState, fmu.setFMUState)
        serialize, deserialize = (
            (fmu.serializeFMUstate, fmu.deSerializeFMUstate)
            if standard == 2
            else (fmu.serializeFMUState, fmu.deserializeFMUState)
        )
        unit.start()
        middle = len(samples) // 2
        for sample in samples[:middle]:
            unit.step(sample, period)
        stored, time = store(), unit.time
        stored_bytes = serialize(stored)
        wanted = [unit.step(sample, period) for sample in samples[middle:]]
        restore(stored)
        unit.time = time
        assert [unit.step(sample, period) for sample in samples[middle:]] == wanted
        restore(deserialize(stored_bytes))
        unit.time = time
        assert [unit.step(sample, period) for sample in samples[middle:]] == wanted


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("standard", STANDARDS)
def test_before_the_first_step_the_outputs_are_the_reference(standard: int, exports: dict[str, Path]) -> None:
    with instance(unit_in(exports["damper"], standard)) as unit:
        unit.set_reals(reference_position=0.2, reference_velocity=-0.1, reference_acceleration=3.0)
        unit.start()
        assert unit.get_reals(*OUTPUTS) == [0.2, -0.1, 3.0, 0.0, 0.0]


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("prefix", [False, True])
def test_sources_compile_without_warnings(
    compiler: str, prefix: bool, exports: dict[str, Path], tmp_path: Path
) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    for design in ("damper", "drag"):
        for standard in STANDARDS:
            folder = tmp_path / f"{design}{standard}"
            zipfile.ZipFile(unit_in(exports[design], standard)).extractall(folder)
            define = [] if prefix else [f"-DFMI{standard}_OVERRIDE_FUNCTION_PREFIX"]
            options = f"-std=c99 -fPIC -ffp-contract=off -fvisibility=hidden {WARNINGS}".split()
            target = folder / "unit.o"
            command = [compiler, *options, *define, "-c", f"fmi{standard}.c", "-o", str(target)]
            subprocess.run(command, cwd=folder / "sources", check=True)
            name = "loop" if design == "damper" else "drag"
            assert (f"pretouch_{name}_fmi{standard}DoStep".encode() in target.read_bytes()) == prefix


def test_the_same_design_gives_the_same_bytes(exports: dict[str, Path], tmp_path: Path) -> None:
    assert export(DESIGNS["damper"](), tmp_path / "again", "fmu", verify=False).is_written
    for standard in STANDARDS:
        first, second = (unit_in(folder, standard) for folder in (exports["damper"], tmp_path / "again"))
        assert first.read_bytes() == second.read_bytes()
        names = zipfile.ZipFile(first).namelist()
        assert names == sorted(names)


def test_without_a_compiler_the_units_have_sources_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "a-compiler-that-does-not-exist")
    result = export(DESIGNS["damper"](), tmp_path / "law", "fmu", verify=False)
    assert "no C compiler" in result.headline
    for standard in STANDARDS:
        names = zipfile.ZipFile(unit_in(tmp_path / "law", standard)).namelist()
        assert not [name for name in names if name.startswith("binaries")]
        assert {f"sources/fmi{standard}.c", "modelDescription.xml"} <= set(names)


def test_a_compiler_that_fails_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which("false") is None:
        pytest.skip("the command false does not exist")
    monkeypatch.setenv("CC", "false")
    with refused("C compiler"):
        export(DESIGNS["damper"](), tmp_path / "law", "fmu", verify=False)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@needs_compiler
def test_a_hostile_file_name_gives_valid_units(tmp_path: Path) -> None:
    task = DESIGNS["damper"]()
    path = tmp_path / "a" / '1<x> "&*/ ü.toml'
    source = dataclasses.replace(task.source, path=path)
    assert export(task.replace(source=source), tmp_path / "law", "fmu", verify=False).is_written
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install pretouch[fmu])")
    from fmpy.validation import validate_fmu

    assert [validate_fmu(str(unit_in(tmp_path / "law", standard))) for standard in STANDARDS] == [[], []]


@needs_compiler
@pytest.mark.skipif("FMILIB" not in os.environ, reason="FMILIB names no folder with FMI Library")
@pytest.mark.parametrize("design", DESIGNS)
def test_fmi_library_accepts_both_units_and_gives_the_same_bits(
    design: str, exports: dict[str, Path], tmp_path: Path
) -> None:
    """An importer in C that shares no code with FMPy: no warnings about the XML files, and all cases."""
    root, program = Path(os.environ["FMILIB"]), tmp_path / "play"
    source = Path(__file__).parents[1] / "embedded/play_fmu.c"
    libraries = [f"-L{root / 'lib'}", "-lfmilib", "-ldl", "-lm", "-lpthread"]
    subprocess.run(["cc", "-std=c99", f"-I{root / 'include'}", str(source), *libraries, "-o", str(program)], check=True)
    law = law_design(DESIGNS[design](), verify=False)
    rows = [
        [i, *(getattr(s, name) for name in INPUTS), s.fresh] for i, case in enumerate(law.cases) for s in case.samples
    ]
    wanted = np.array([out for case in law.cases for out in case.outputs], float)
    for standard in STANDARDS:
        folder = tmp_path / f"fmi{standard}"
        folder.mkdir()
        command = [str(program), str(unit_in(exports[design], standard)), str(folder), repr(law.controller.period)]
        run = subprocess.run(command, input=np.array(rows, float).tobytes(), capture_output=True, check=False)
        assert (run.returncode, run.stderr) == (0, b"")
        found = np.frombuffer(run.stdout).reshape(-1, len(OUTPUTS) + 1)
        np.testing.assert_array_equal(found.view(np.int64), wanted.view(np.int64))
