"""Where results go: into memory, or into a Zarr folder with a ledger of the blocks that are finished.

A block's data are written first, each chunk a file of its own that appears whole; then its entry in the ledger, a file
of one byte. Whatever ends the process in between costs the blocks under way, never one that the ledger has. A block
whose data are damaged is computed again. A process that writes to a folder locks it, so that no other one removes it.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.errors import InvalidInputError, OutputExistsError, require
from pretouch._core.files import temporary_path
from pretouch._core.numbers import BoolArray

from .dataset import DIGEST, attributes_of, differing_parts, make_dataset
from .plan import Plan, Region
from .results import STATUS, result_attributes

if sys.platform != "win32":  # there nobody is told who else writes
    import fcntl

if TYPE_CHECKING:
    import xarray as xr


LEDGER: Final = "finished"
_PER_BLOCK: Final = "chunks_per_block"
_MOST_BYTES: Final = 4_000_000_000  # of results in memory
_MOST_CHECKED: Final = 2_000  # chunks that are looked at before a sweep goes on: about a second


def refuse_beyond_memory(plan: Plan) -> None:
    """Refuse a sweep whose results do not fit into memory, before anything is allocated or computed."""
    each = 1 + 8 * len(plan.results)
    if plan.size * each > _MOST_BYTES:
        raise InvalidInputError(
            f"axes: found {plan.size:,} encounters, whose results take {plan.size * each / 1e9:,.0f} GB, expected at "
            f"most {_MOST_BYTES // each:,} in memory: write them to a folder, output='NAME.zarr', or take fewer values"
        )


class Store:
    """Takes the results of chunks, and keeps account of blocks of them.

    Args:
        plan: the sweep.
        chunks_per_block: how many chunks make a block.
        arrays: ledger, status and every result by name: arrays of this process, or of Zarr.
    """

    def __init__(self, plan: Plan, chunks_per_block: int, arrays: dict[str, Any]) -> None:
        self.plan, self.chunks_per_block, self._arrays = plan, chunks_per_block, arrays

    def regions(self, block: int) -> list[Region]:
        """Return the chunks of a block."""
        first = block * self.chunks_per_block
        return [self.plan.region(i) for i in range(first, min(first + self.chunks_per_block, self.plan.chunk_count))]

    def size(self, block: int) -> int:
        """Count the encounters of a block."""
        return sum(math.prod(part.stop - part.start for part in region) for region in self.regions(block))

    def finished(self) -> BoolArray:
        """Tell which blocks are finished, as of now."""
        return np.asarray(self._arrays[LEDGER][:] == 1)

    def intact(self) -> BoolArray:
        """Tell which blocks are finished and whole."""
        return self.finished()

    def write(self, region: Region, columns: dict[str, NDArray[Any]]) -> None:
        """Keep a part of the grid, whole chunks only."""
        for name, column in columns.items():
            self._arrays[name][region] = column

    def finish(self, block: int) -> None:
        """Enter a block into the ledger, once its data are written."""
        self._arrays[LEDGER][block] = 1

    def dataset(self) -> xr.Dataset:
        """Return everything."""
        return make_dataset(self.plan, {name: a for name, a in self._arrays.items() if name != LEDGER})


class MemoryStore(Store):
    """Results in arrays of this process."""

    def __init__(self, plan: Plan, chunks_per_block: int) -> None:
        arrays = {name: np.empty(plan.shape) for name in plan.results}
        ledger = np.zeros(-(-plan.chunk_count // chunks_per_block), dtype=np.uint8)
        status = np.empty(plan.shape, dtype=np.int8)
        super().__init__(plan, chunks_per_block, {LEDGER: ledger, STATUS: status, **arrays})


class ZarrStore(Store):
    """Results in a Zarr folder, which this and other processes may write at the same time.

    Args:
        path: the folder, made by `create`.
        plan: the sweep that it must hold.

    Raises:
        OutputExistsError: it holds something else.
    """

    def __init__(self, path: str | os.PathLike[str], plan: Plan) -> None:
        self.path = Path(path)
        found = _attributes(self.path)
        if found is None:
            raise OutputExistsError(
                f"{path}: holds no sweep of pretouch and is not overwritten; choose another name for the output"
            )
        if found.get(DIGEST) != attributes_of(plan)[DIGEST]:
            raise OutputExistsError(
                f"{path}: holds another sweep (other {differing_parts(found, plan)}) and is not overwritten unasked; "
                "choose another name with --output, or replace it with --force (overwrite=True in Python)"
            )
        zarr = require("zarr")
        try:
            with zarr.config.set({"array.write_empty_chunks": True}):  # not worth a look at every number
                group = zarr.open_group(str(path), mode="r+")
                arrays = {name: group[name] for name in (LEDGER, STATUS, *plan.results)}
            for name in (STATUS, *plan.results):
                if (arrays[name].shape, arrays[name].chunks) != (plan.shape, plan.chunk):
                    raise ValueError(f"the shape of {name}")
            per_block = int(arrays[LEDGER].attrs[_PER_BLOCK])
            if arrays[LEDGER].shape != (-(-plan.chunk_count // per_block),):
                raise ValueError("the shape of its ledger")
            arrays[LEDGER][:]
        except Exception as error:  # zarr raises whatever its parsers do
            raise OutputExistsError(
                f"{path}: this sweep is damaged ({' '.join(str(error).split())[:200]}); choose another name with "
                "--output, or replace it with --force (overwrite=True in Python)"
            ) from None
        super().__init__(plan, per_block, arrays)

    def intact(self) -> BoolArray:
        """Tell which blocks are finished and whole: chunks of the right size, and known statuses; forget the others."""
        found = self.finished()
        for block in np.flatnonzero(found) if self.plan.chunk_count <= _MOST_CHECKED else ():
            found[block] = all(map(self._is_intact, self.regions(int(block))))
            if not found[block]:
                with self._explaining():
                    self._arrays[LEDGER][block] = 0
        return found

    def _is_intact(self, region: Region) -> bool:
        place = [str(part.start // size) for part, size in zip(region, self.plan.chunk, strict=True)]
        bytes_ = 8 * math.prod(self.plan.chunk)
        try:
            files = (self.path.joinpath(name, "c", *place) for name in self.plan.results)
            if (
                any(file.stat().st_size != bytes_ for file in files)
                or not self.path.joinpath(STATUS, "c", *place).exists()
            ):
                return False
            codes = np.asarray(self._arrays[STATUS][region])
        except Exception:
            return False
        meanings = result_attributes(STATUS, designs=self.plan.designs)["flag_values"]
        return bool(np.isin(codes, meanings).all())

    def write(self, region: Region, columns: dict[str, NDArray[Any]]) -> None:
        """Keep a part of the grid, whole chunks only."""
        with self._explaining():
            super().write(region, columns)

    def finish(self, block: int) -> None:
        """Enter a block into the ledger, once its data are written."""
        with self._explaining():
            super().finish(block)

    @contextmanager
    def _explaining(self) -> Iterator[None]:
        """Turn what the disk refuses into a sentence."""
        try:
            yield
        except OSError as error:
            raise InvalidInputError(
                f"{self.path}: cannot be written ({error.strerror or error}); what is finished is kept, and the same "
                "command goes on from there"
            ) from None

    @classmethod
    def create(cls, path: str | os.PathLike[str], plan: Plan, chunks_per_block: int) -> ZarrStore:
        """Make the folder, which appears whole: with axes, attributes and an empty ledger.

        Args:
            path: where it goes; its parent must exist, and nothing may stand there.
            plan: the sweep.
            chunks_per_block: how many chunks the ledger counts as one.

        Returns:
            The store; that of another process, if one has made the same meanwhile.

        Raises:
            InvalidInputError: the parent does not exist or cannot be written.
        """
        zarr, target = require("zarr"), Path(path)
        if not target.parent.is_dir():
            raise InvalidInputError(f"{path}: the folder {target.parent} does not exist; create it first")
        temporary = temporary_path(target)
        try:
            make_dataset(plan, {}).to_zarr(str(temporary), mode="w-", zarr_format=3, consolidated=False)
            group = zarr.open_group(str(temporary), mode="r+")
            for name in (STATUS, *plan.results):
                status = name == STATUS
                group.create_array(
                    name,
                    shape=plan.shape,
                    chunks=plan.chunk,
                    dtype="int8" if status else "float64",
                    fill_value=-1 if status else np.nan,
                    compressors="auto" if status else None,  # numbers that differ in every bit are not worth it
                    dimension_names=plan.dims,
                    attributes=result_attributes(name, designs=plan.designs, law=plan.held.law),
                )
            group.create_array(
                LEDGER,
                shape=(-(-plan.chunk_count // chunks_per_block),),
                chunks=(1,),
                dtype="uint8",
                fill_value=0,
                compressors=None,
                dimension_names=("block",),
                attributes={"long_name": "blocks that are computed and written", _PER_BLOCK: chunks_per_block},
            )
            temporary.rename(target)
        except OSError as error:
            if not target.exists():
                raise InvalidInputError(f"{path}: cannot be written ({error.strerror or error})") from None
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        return cls(path, plan)

    def dataset(self) -> xr.Dataset:
        """Open everything; numbers are read when they are used."""
        xarray = require("xarray")
        dataset = xarray.open_zarr(str(self.path), consolidated=False, chunks=None)
        return dataset[[STATUS, *self.plan.results]]


def _attributes(path: Path) -> dict[str, Any] | None:
    """Return the attributes of a sweep's folder, None where there is no such thing."""
    zarr = require("zarr")
    if not (path / "zarr.json").is_file():
        return None
    try:
        group = zarr.open_group(str(path), mode="r")
        return dict(group.attrs) if DIGEST in group.attrs and LEDGER in group else None
    except Exception:
        return None


def is_sweep(path: Path) -> bool:
    """Tell whether a folder is a sweep that pretouch wrote."""
    return _attributes(path) is not None


def replace_sweep(path: Path) -> None:
    """Remove a sweep of ours; refuse to remove anything else, or one that is being written."""
    if not is_sweep(path):
        raise OutputExistsError(
            f"{path}: holds no sweep of pretouch and is not removed; choose another name for the output"
        )
    if not remove_unused(path):
        raise OutputExistsError(f"{path}: another process writes to this sweep; wait for it, or choose another name")


def remove_unused(path: Path) -> bool:
    """Remove the folder of a sweep; return False where another process writes to it, which then removes it."""
    lock = _locked(path, exclusive=True)
    if lock is None:
        return not path.exists()
    try:
        gone = temporary_path(path)
        path.rename(gone)  # at once: what is left of a removal that is broken off is no half sweep
        shutil.rmtree(gone, ignore_errors=True)
    finally:
        _unlock(lock)
    return True


@contextmanager
def in_use(path: Path) -> Iterator[bool]:
    """Keep others from removing a folder; False where it is gone already."""
    lock = _locked(path, exclusive=False)
    try:
        yield lock is not None
    finally:
        if lock is not None:
            _unlock(lock)


_UNKNOWN: Final = -1  # a lock that this system does not have


def _locked(path: Path, *, exclusive: bool) -> int | None:
    """Lock a folder, alone or together with others; None where that is not possible, or it is gone."""
    if sys.platform == "win32":
        return _UNKNOWN if path.exists() else None
    try:
        lock = os.open(path, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB if exclusive else fcntl.LOCK_SH)
        if os.path.samestat(os.fstat(lock), os.stat(path)):
            return lock
    except BlockingIOError:
        pass
    except FileNotFoundError:  # removed between the two
        pass
    except OSError:  # a file system without locks
        os.close(lock)
        return _UNKNOWN
    os.close(lock)
    return None


def _unlock(lock: int) -> None:
    if lock != _UNKNOWN:
        os.close(lock)
