"""A sweep on disk: killed at any moment it goes on without loss and without repeats, and it overwrites nothing."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.errors import OutputError, OutputExistsError
from pretouch._core.files import write_text
from pretouch.sweeps import stores
from pretouch.sweeps.results import counts
from refusals import refused
from sweep_samples import AXES, BLOCKS, CONSTANT, CURVED, RESULTS, SCENARIO, cut_small, note_chunks, noted, sweep_to

pytest.importorskip("zarr", reason="needs the extra 'sweep'")
pytest.importorskip("h5py", reason="needs the extra 'sweep'")
xr = pytest.importorskip("xarray", reason="needs the extra 'sweep'")

TESTS = Path(__file__).parents[1]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Cut sweeps into blocks of ten encounters, and note each that is computed in the file that is returned."""
    cut_small(monkeypatch.setattr)
    log = tmp_path / "computed.txt"
    note_chunks(monkeypatch.setattr, log)
    return log


def ledger(folder: Path) -> Any:
    """Return which blocks of a store are finished."""
    import zarr

    return zarr.open_group(str(folder), mode="r")[stores.LEDGER][:]


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("moment", ["computing", "writing", "before the ledger", "after the ledger"])
@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_a_killed_sweep_goes_on_without_loss_and_without_repeats(
    small: Path, tmp_path: Path, moment: str, suffix: str
) -> None:
    output, first = tmp_path / f"out{suffix}", tmp_path / "first.txt"
    code = f"import sweep_samples as s; s.sweep_until_killed({str(output)!r}, {str(first)!r}, {moment!r}, 8)"
    killed = subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": _path()}, check=False)
    assert killed.returncode == -signal.SIGKILL
    before = noted(first)
    assert len(before) == 8
    folder = tmp_path / ("out.zarr" if suffix == ".zarr" else "out.nc.unfinished.zarr")
    kept = ledger(folder)
    assert kept.sum() == (8 if moment == "after the ledger" else 7)

    found = sweep_to(output)
    after = noted(small)
    assert sorted(after) == np.flatnonzero(kept == 0).tolist(), "what the ledger has is not computed again, the rest is"
    xr.testing.assert_equal(found.load(), sweep_to(None))
    found.close()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_a_sweep_that_is_killed_again_and_again_ends(small: Path, tmp_path: Path) -> None:
    """Killed by its parent after it has told of a block, whatever it then does."""
    output, log = tmp_path / "out.zarr", tmp_path / "all.txt"
    code = (
        "import sys, pathlib, sweep_samples as s; s.cut_small(setattr); "
        f"s.note_chunks(setattr, pathlib.Path({str(log)!r})); "
        f"s.sweep_to({str(output)!r}, progress=lambda p: print(p.finished, flush=True))"
    )
    finished, runs = 0, 0
    while finished < 240:
        runs += 1
        with subprocess.Popen(
            [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": _path()}, stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            for line in process.stdout:
                if int(line) >= min(finished + 90, 240):
                    break
            process.kill()
        finished = 10 * int(ledger(output).sum())
    assert runs >= 2
    assert len(noted(log)) <= BLOCKS + 2 * runs, "a kill costs at most the block under way"
    xr.testing.assert_equal(sweep_to(output).load(), sweep_to(None))


def _path() -> str:
    return os.pathsep.join([str(Path(pt.__file__).parents[1]), str(TESTS)])


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_a_finished_sweep_is_opened_and_not_computed_again(small: Path, tmp_path: Path, suffix: str) -> None:
    sweep_to(tmp_path / f"out{suffix}").close()
    count = len(noted(small))
    assert count == BLOCKS
    with sweep_to(tmp_path / f"out{suffix}", overwrite=True) as found:
        assert len(noted(small)) == count
        xr.testing.assert_equal(found.load(), sweep_to(None))
    assert names(tmp_path) == ["computed.txt", f"out{suffix}"], "nothing else is left"


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_another_sweep_is_refused_and_replaced_only_where_that_is_asked_for(
    small: Path, tmp_path: Path, suffix: str
) -> None:
    output = tmp_path / f"out{suffix}"
    sweep_to(output).close()
    other = {**AXES, "gain": np.linspace(-3.0, -0.05, 10)}
    with refused(str(output), error=OutputExistsError, value="axes", remedy="--force"):
        pt.sweep(pt.Task(SCENARIO, CURVED), other, results=RESULTS, output=output)
    with refused(str(output), error=OutputExistsError, value="sensor", remedy="--force"):
        pt.sweep(pt.Task(SCENARIO, CONSTANT), AXES, results=RESULTS, output=output)
    with refused(str(output), error=OutputExistsError, remedy="--force"):
        sweep_to(output, seed=3)
    with sweep_to(output) as kept:
        xr.testing.assert_equal(kept.load(), sweep_to(None))
    with pt.sweep(pt.Task(SCENARIO, CURVED), other, results=RESULTS, output=output, overwrite=True) as replaced:
        assert replaced["gain"].values[0] == -3.0
        xr.testing.assert_equal(replaced.load(), pt.sweep(pt.Task(SCENARIO, CURVED), other, results=RESULTS))
    assert names(tmp_path) == ["computed.txt", f"out{suffix}"]


def test_what_is_no_sweep_is_never_overwritten(tmp_path: Path) -> None:
    import zarr

    folder, file, foreign = tmp_path / "mine.zarr", tmp_path / "mine.nc", tmp_path / "foreign.zarr"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    file.write_text("mine")
    zarr.create_group(str(foreign), attributes={"digest": "none of ours"})
    for output in (folder, file, foreign):
        for overwrite in (False, True):
            with refused(str(output), error=OutputExistsError):
                sweep_to(output, overwrite=overwrite)
    assert (folder / "notes.txt").read_text() == file.read_text() == "mine"
    assert names(tmp_path) == ["foreign.zarr", "mine.nc", "mine.zarr"]


@pytest.mark.parametrize(("output", "argument"), [("none/out.zarr", "{output}"), ("out.csv", "output")])
def test_an_output_that_cannot_be_is_refused_before_anything_is_computed(
    small: Path, tmp_path: Path, output: str, argument: str
) -> None:
    with refused(argument.format(output=tmp_path / output)):
        sweep_to(tmp_path / output)
    assert names(tmp_path) == []


def test_a_mistake_that_only_the_solver_finds_leaves_no_store(tmp_path: Path) -> None:
    with refused("method"):
        sweep_to(tmp_path / "out.zarr", method="closed-form")
    assert names(tmp_path) == []


@pytest.mark.parametrize("output", [None, "out.zarr", "out.nc"])
def test_a_dataset_tells_units_and_where_it_comes_from(tmp_path: Path, output: str | None) -> None:
    found = pt.sweep(
        pt.Task(SCENARIO, CURVED),
        {"sample": {"obstacle.velocity": [-0.3, -0.2], "sensor.exponent": [3.3, 3.4]}, "gain": [-0.7, -0.6, -0.5]},
        results=["relative_velocity", "impulse_residual"],
        output=output and tmp_path / output,
        seed=20261121,
    )
    with found:
        assert found["relative_velocity"].dims == ("sample", "gain")
        assert set(found.coords) == {"sample", "gain", "obstacle.velocity", "sensor.exponent"}
        units = {name: found[name].attrs["units"] for name in found.variables if name not in {"sample", "status"}}
        assert units == {
            "gain": "N*s",
            "obstacle.velocity": "m/s",
            "sensor.exponent": "1",
            "relative_velocity": "m/s",
            "impulse_residual": "1",
        }
        meanings = found["status"].attrs["flag_meanings"].split()
        assert meanings[0] == "contact"
        assert list(found["status"].attrs["flag_values"]) == list(range(len(meanings)))
        assert all(found[name].attrs["long_name"] for name in found.variables)
        assert found["relative_velocity"].attrs["long_name"] == "relative velocity at contact"
        assert found["impulse_residual"].attrs["long_name"] == "residual of the impulse balance"
        assert found.attrs["seed"] == 20261121
        assert json.loads(found.attrs["versions"])["pretouch"] == pt.__version__
        inputs = json.loads(found.attrs["inputs"])
        assert inputs["scenario"]["admittance"] == {"mass": 1.0, "damping": 10.0, "stiffness": 25.0}
        assert inputs["sensor"]["parameters"] == CURVED.parameters
        assert inputs["axes"]["sample"]["sensor.exponent"]["last"] == 3.4


def test_a_store_opens_in_xarray_alone_with_its_axes_and_units(small: Path, tmp_path: Path) -> None:
    found = sweep_to(tmp_path / "out.zarr")
    alone = xr.open_zarr(tmp_path / "out.zarr")  # any warning is an error: the metadata are consolidated
    assert set(alone.data_vars) == {"status", *RESULTS}, "the ledger is not a variable of the sweep"
    xr.testing.assert_identical(alone.load(), found.load())
    near = alone["relative_velocity"].sel({"obstacle.velocity": -0.3, "gain": -0.7}, method="nearest")
    assert near.attrs["units"] == "m/s"


# --- disks that are full

WIDE = {"obstacle.velocity": np.linspace(-1.0, -0.1, 60), "gain": np.linspace(-2.0, -0.05, 100)}
LIMITED = """
import resource, sys, test_sweep_stores as t
t.cut_small(setattr, encounters=2000)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    t.sweep_wide(sys.argv[1])
except t.OutputError as error:
    print(error)
"""


def sweep_wide(output: str | Path | None) -> Any:
    return pt.sweep(pt.Task(SCENARIO, CURVED), WIDE, results=RESULTS, output=output)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="POSIX limits of a process")
@pytest.mark.parametrize(
    ("suffix", "most"),
    [(".zarr", 1), (".zarr", 900), (".zarr", 12_000), (".nc", 1), (".nc", 12_000), (".nc", 20_000), (".nc", 140_000)],
)
def test_a_disk_that_takes_no_more_is_one_sentence_and_nothing_is_lost(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, suffix: str, most: int
) -> None:
    """HDF5 crashed the process where it could not write at its end; what Zarr could not write was a traceback."""
    output = tmp_path / f"out{suffix}"
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(output), str(most)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([_path(), str(Path(__file__).parent)])},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "cannot be written (File too large)" in done.stdout
    assert done.stdout.count("\n") == 1
    assert not output.exists() or suffix == ".zarr"
    assert not [name for name in names(tmp_path) if name.startswith(".")]
    cut_small(monkeypatch.setattr, encounters=2000)
    with sweep_wide(output) as found:
        xr.testing.assert_equal(found.load(), sweep_wide(None))
    assert names(tmp_path) == [output.name]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a disk of 96 kB in memory; only the administrator of a machine may."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = (
        subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", str(disk)], capture_output=True, text=True, check=False
        )
        if shutil.which("mount")
        else None
    )
    if mounted is None or mounted.returncode:
        pytest.skip("this user may not mount a small disk")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_a_real_disk_that_is_full_is_told_so(small_disk: Path, tmp_path: Path, suffix: str) -> None:
    with refused(error=OutputError, value="No space left on device"):
        sweep_wide(small_disk / f"out{suffix}")
    with refused(str(small_disk / "a.html"), error=OutputError, value="No space left on device"):
        write_text(small_disk / "a.html", 100_000 * "x")
    assert not [name for name in names(small_disk) if name.startswith(".")]


# --- equal sweeps at once


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_equal_sweeps_at_once_end_well_and_leave_nothing(small: Path, tmp_path: Path, suffix: str) -> None:
    """The folder of a NetCDF file was removed under the hands of the slower one."""
    output = tmp_path / f"out{suffix}"
    code = f"import sweep_samples as s; s.cut_small(setattr); s.sweep_to({str(output)!r}).close()"
    command = [sys.executable, "-c", code]
    environment = {**os.environ, "PYTHONPATH": _path()}
    running = [subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    assert [(process.communicate()[1], process.returncode) for process in running] == [("", 0)] * 3
    assert names(tmp_path) == [output.name]
    with sweep_to(output) as found:
        xr.testing.assert_equal(found.load(), sweep_to(None))


@pytest.mark.skipif(os.name == "nt", reason="POSIX locks")
def test_a_sweep_that_is_being_written_is_not_replaced(small: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.zarr"
    sweep_to(output).close()
    with stores.in_use(output) as there:
        assert there
        with refused(str(output), error=OutputExistsError):
            sweep_to(output, seed=3, overwrite=True)
    sweep_to(output, seed=3, overwrite=True).close()
    with stores.in_use(tmp_path / "gone.zarr") as there:
        assert not there


# --- damage


def damage(path: Path, rng: np.random.Generator) -> str:
    """Truncate, lengthen, remove or change a file."""
    content, how = path.read_bytes(), str(rng.choice(["cut", "empty", "longer", "gone", "noise"]))
    if how == "gone":
        path.unlink()
    else:
        at = int(rng.integers(0, max(len(content), 1)))
        noise = rng.integers(0, 256, len(content) - at, dtype=np.uint8).tobytes()
        new = {"cut": content[:at], "empty": b"", "longer": content + b"x", "noise": content[:at] + noise}
        path.write_bytes(new[how])
    return f"{path.name} {how}"


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_sweep_is_computed_again_or_refused_in_a_sentence(small: Path, tmp_path: Path, seed: int) -> None:
    """Damaged chunks were a ValueError or a KeyError; missing ones were read as NaN."""
    output, rng = tmp_path / "out.zarr", np.random.default_rng(seed)
    sweep_to(output).close()
    files = sorted(path for path in output.rglob("*") if path.is_file())
    chunks = [path for path in files if path.name != "zarr.json" and stores.LEDGER.split("/")[0] not in path.parts]
    what = damage(files[rng.integers(len(files))] if seed % 2 else chunks[rng.integers(len(chunks))], rng)
    if seed % 2 == 0:
        with sweep_to(output) as found:
            counts(found)
            if "noise" not in what:  # other numbers of the right size are numbers all the same
                xr.testing.assert_equal(found.load(), sweep_to(None))
        return
    with suppress(OutputExistsError), sweep_to(output) as found:  # metadata and ledger may be refused, in no other way
        counts(found)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("overwrite", [False, True])
def test_a_damaged_netcdf_file_is_refused_or_replaced(small: Path, tmp_path: Path, overwrite: bool) -> None:
    import h5py

    output = tmp_path / "out.nc"
    sweep_to(output).close()
    with h5py.File(output, "r+") as file:
        file["status"][3, 3] = 77  # no status has this number
    if not overwrite:
        with refused(str(output), error=OutputExistsError, remedy="--force"):
            sweep_to(output)
        return
    with sweep_to(output, overwrite=True) as found:
        xr.testing.assert_equal(found.load(), sweep_to(None))


def test_what_a_killed_sweep_left_under_a_temporary_name_is_removed(small: Path, tmp_path: Path) -> None:
    for name in (".out.zarr.0123456789ab.tmp", ".out.nc.0123456789ab.tmp"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "zarr.json").write_text("{}")
        os.utime(tmp_path / name, (0, 0))
    sweep_to(tmp_path / "out.zarr").close()
    sweep_to(tmp_path / "out.nc").close()
    assert names(tmp_path) == ["computed.txt", "out.nc", "out.zarr"]
