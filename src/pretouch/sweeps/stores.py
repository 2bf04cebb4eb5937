"""Store results of a sweep in memory or in a Zarr folder.

An interrupted sweep can be resumed. A store first writes the data of a block, each chunk atomically as a file. Then it
marks the block as finished in the ledger, in a file of one byte. If the process is killed, only unfinished blocks are
lost. A block with damaged data is computed again. A process that writes to a folder locks the folder, so that no other
process removes it.

The ledger is an array in a subgroup of the Zarr group, so that `xarray.open_zarr` shows only axes, status and results.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from pretouch._core.errors import InvalidInputError, OutputError, OutputExistsError, require
from pretouch._core.files import temporary_path
from pretouch._core.numbers import BoolArray

from .dataset import DIGEST, attributes_of, differing_parts, make_dataset
from .grid import Grid, Region
from .results import STATUS

if sys.platform != "win32":  # Windows has no such locks
    import fcntl

if TYPE_CHECKING:
    import xarray as xr


LEDGER: Final = "pretouch-ledger/finished"
"""Path of the ledger in the Zarr group; no axis or result can have this name."""

_PER_BLOCK: Final = "chunks_per_block"
_MOST_BYTES: Final = 4_000_000_000  # largest size of the results in memory
_MOST_CHECKED: Final = 2_000  # largest number of chunks that are checked before resuming, which takes about a second


def refuse_beyond_memory(plan: Grid) -> None:
    """Raise an error if sweep results do not fit into memory.

    Raises:
        InvalidInputError: the results are too large; raised before anything is computed.
    """
    bytes_each = 1 + 8 * len(plan.results)
    if plan.size * bytes_each > _MOST_BYTES:
        raise InvalidInputError(
            f"axes: found {plan.size:,} encounters, expected at most {_MOST_BYTES // bytes_each:,} in memory. "
            f"Their results need {plan.size * bytes_each / 1e9:,.0f} GB of memory. Write the results to a folder with "
            "output='NAME.zarr', or use fewer values",
            value=plan.size,
        )


class Store:
    """Storage for the results of a sweep.

    It records the finished blocks of encounters.

    Args:
        plan: the sweep.
        chunks_per_block: number of chunks per block.
        arrays: ledger, status and results by name, as NumPy or Zarr arrays.
    """

    def __init__(self, plan: Grid, chunks_per_block: int, arrays: dict[str, Any]) -> None:
        self.plan, self.chunks_per_block, self._arrays = plan, chunks_per_block, arrays

    def regions(self, block: int) -> list[Region]:
        """Return the index ranges of all chunks in a block."""
        first = block * self.chunks_per_block
        return [self.plan.region(i) for i in range(first, min(first + self.chunks_per_block, self.plan.chunk_count))]

    def size(self, block: int) -> int:
        """Return the number of encounters in a block."""
        return sum(math.prod(part.stop - part.start for part in region) for region in self.regions(block))

    def finished(self) -> BoolArray:
        """Return for each block of encounters whether it is finished."""
        return np.asarray(self._arrays[LEDGER][:] == 1)

    def is_finished(self, block: int) -> bool:
        """Return True if one block of encounters is finished. The other entries of the ledger are not read."""
        return bool(self._arrays[LEDGER][block] == 1)

    def intact(self) -> BoolArray:
        """Return for each block whether it is finished and undamaged."""
        return self.finished()

    def write(self, region: Region, columns: dict[str, NDArray[Any]]) -> None:
        """Store the results of one part of the sweep grid.

        The part must consist of whole chunks.
        """
        for name, column in columns.items():
            self._arrays[name][region] = column

    def finish(self, block: int) -> None:
        """Record that a block of encounters is finished.

        Its results must be written first.
        """
        self._arrays[LEDGER][block] = 1

    def dataset(self) -> xr.Dataset:
        """Return all results of the sweep as an xarray dataset."""
        return make_dataset(self.plan, {name: a for name, a in self._arrays.items() if name != LEDGER})


class MemoryStore(Store):
    """Storage that keeps the results of a sweep in memory."""

    def __init__(self, plan: Grid, chunks_per_block: int) -> None:
        arrays = {name: np.empty(plan.shape) for name in plan.results}
        ledger = np.zeros(-(-plan.chunk_count // chunks_per_block), dtype=np.uint8)
        status = np.empty(plan.shape, dtype=np.int8)
        super().__init__(plan, chunks_per_block, {LEDGER: ledger, STATUS: status, **arrays})


class ZarrStore(Store):
    """Storage for sweep results in a Zarr folder.

    Several processes may write to the folder.

    Args:
        path: the folder, made by `create`.
        plan: the sweep that the folder must contain.

    Raises:
        OutputExistsError: the folder does not contain this sweep, or its files are damaged.
    """

    def __init__(self, path: str | os.PathLike[str], plan: Grid) -> None:
        self.path = Path(path)
        attributes = _attributes(self.path)
        if attributes is None:
            raise OutputExistsError(
                f"{path}: this path does not contain a sweep of pretouch, so pretouch does not overwrite it; choose "
                "another name for the output"
            )
        if attributes.get(DIGEST) != attributes_of(plan)[DIGEST]:
            parts = differing_parts(attributes, plan)
            raise OutputExistsError(
                f"{path}: the stored sweep differs from the requested sweep in {parts}. Therefore, "
                "pretouch does not overwrite it. Choose another name with --output, or replace the sweep with --force "
                "(overwrite=True in Python)",
                value=parts,
                remedy="--force",
            )
        zarr = require("zarr")
        try:
            with zarr.config.set(
                {"array.write_empty_chunks": True}
            ):  # finding empty chunks would take longer than writing them
                group = zarr.open_group(str(path), mode="r+")
                arrays = {name: group[name] for name in (LEDGER, STATUS, *plan.results)}
            for name in (STATUS, *plan.results):
                if (arrays[name].shape, arrays[name].chunks) != (plan.shape, plan.chunk):
                    raise ValueError(f"the shape of {name}")
            per_block = int(arrays[LEDGER].attrs[_PER_BLOCK])
            if arrays[LEDGER].shape != (-(-plan.chunk_count // per_block),):
                raise ValueError("the shape of its ledger")
            arrays[LEDGER][:]
        except Exception as error:  # the parsers of zarr raise many kinds of exceptions
            raise OutputExistsError(
                f"{path}: the files of this sweep are damaged ({' '.join(str(error).split())[:200]}). Choose "
                "another name with --output, or replace the sweep with --force (overwrite=True in Python)",
                remedy="--force",
            ) from None
        super().__init__(plan, per_block, arrays)

    def intact(self) -> BoolArray:
        """Return for each block whether it is finished and undamaged.

        Damaged blocks are marked as unfinished.
        """
        intact = self.finished()
        for block in np.flatnonzero(intact) if self.plan.chunk_count <= _MOST_CHECKED else ():
            intact[block] = all(map(self._is_intact, self.regions(int(block))))
            if not intact[block]:
                with self._explaining():
                    self._arrays[LEDGER][block] = 0
        return intact

    def _is_intact(self, region: Region) -> bool:
        chunk_index = [str(part.start // size) for part, size in zip(region, self.plan.chunk, strict=True)]
        bytes_ = 8 * math.prod(self.plan.chunk)
        try:
            files = (self.path.joinpath(name, "c", *chunk_index) for name in self.plan.results)
            if (
                any(file.stat().st_size != bytes_ for file in files)
                or not self.path.joinpath(STATUS, "c", *chunk_index).exists()
            ):
                return False
            codes = np.asarray(self._arrays[STATUS][region])
        except Exception:
            return False
        meanings = self.plan.result_attributes(STATUS)["flag_values"]
        return bool(np.isin(codes, meanings).all())

    def write(self, region: Region, columns: dict[str, NDArray[Any]]) -> None:
        """Store the results of one part of the sweep grid.

        The part must consist of whole chunks.
        """
        with self._explaining():
            super().write(region, columns)

    def finish(self, block: int) -> None:
        """Record that a block of encounters is finished.

        Its results must be written first.
        """
        with self._explaining():
            super().finish(block)

    @contextmanager
    def _explaining(self) -> Iterator[None]:
        """Convert system errors to errors that explain how to resume the sweep."""
        try:
            yield
        except OSError as error:
            raise OutputError(
                f"{self.path}: the folder cannot be written ({error.strerror or error}). Finished results are kept. To "
                "finish the sweep, run the same command again",
                value=error.strerror,
            ) from None

    @classmethod
    def create(cls, path: str | os.PathLike[str], plan: Grid, chunks_per_block: int) -> ZarrStore:
        """Create the Zarr folder of a sweep in one atomic step.

        The folder contains axes and metadata, but no results.

        Args:
            path: the folder; its parent must exist, and the path must be free.
            plan: the sweep.
            chunks_per_block: number of chunks per block.

        Returns:
            The new store, or the same store if another process has created it meanwhile.

        Raises:
            InvalidInputError: the parent does not exist.
            OutputError: the folder cannot be written, for example because the disk is full.
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
                    compressors="auto" if status else None,  # results do not compress well
                    dimension_names=plan.dims,
                    attributes=plan.result_attributes(name),
                )
            subgroup, ledger = LEDGER.split("/")
            group.create_group(subgroup).create_array(
                ledger,
                shape=(-(-plan.chunk_count // chunks_per_block),),
                chunks=(1,),
                dtype="uint8",
                fill_value=0,
                compressors=None,
                dimension_names=("block",),
                attributes={"long_name": "blocks that are computed and written", _PER_BLOCK: chunks_per_block},
            )
            with warnings.catch_warnings():  # consolidated metadata are not part of the specification of Zarr 3 yet
                warnings.simplefilter("ignore")
                zarr.consolidate_metadata(str(temporary))  # without them `xarray.open_zarr` warns
            temporary.rename(target)
        except OSError as error:
            if not target.exists():
                raise OutputError(
                    f"{path}: cannot be written ({error.strerror or error})", value=error.strerror
                ) from None
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        return cls(path, plan)

    def dataset(self) -> xr.Dataset:
        """Open the stored sweep results as a dataset without loading them."""
        xarray = require("xarray")
        dataset: xr.Dataset = xarray.open_zarr(str(self.path), chunks=None)
        return dataset[[STATUS, *self.plan.results]]


def _attributes(path: Path) -> dict[str, Any] | None:
    """Return the metadata of a stored sweep. The result is None if the folder contains no sweep."""
    zarr = require("zarr")
    if not (path / "zarr.json").is_file():
        return None
    try:
        group = zarr.open_group(str(path), mode="r")
        return dict(group.attrs) if DIGEST in group.attrs and LEDGER in group else None
    except Exception:
        return None


def is_sweep(path: Path) -> bool:
    """Return True if a folder contains a sweep that pretouch wrote."""
    return _attributes(path) is not None


def replace_sweep(path: Path) -> None:
    """Remove a stored sweep.

    Raises:
        OutputExistsError: the path contains anything else, or another process is writing to the sweep.
    """
    if not is_sweep(path):
        raise OutputExistsError(
            f"{path}: this path does not contain a sweep of pretouch, so pretouch does not remove it; choose another "
            "name for the output"
        )
    if not remove_unused(path):
        raise OutputExistsError(
            f"{path}: another process is writing to this sweep; wait until the other process has finished, or "
            "choose another name"
        )


def remove_unused(path: Path) -> bool:
    """Remove the folder of a sweep.

    Returns:
        False if another process is writing to the folder.
    """
    lock = _locked(path, exclusive=True)
    if lock is None:
        return not path.exists()
    try:
        renamed = temporary_path(path)
        path.rename(renamed)  # first, so that an interrupted removal does not leave a partial sweep
        shutil.rmtree(renamed, ignore_errors=True)
    finally:
        _unlock(lock)
    return True


@contextmanager
def in_use(path: Path) -> Iterator[bool]:
    """Protect a folder against removal by other processes.

    Yields:
        False if the folder no longer exists.
    """
    lock = _locked(path, exclusive=False)
    try:
        yield lock is not None
    finally:
        if lock is not None:
            _unlock(lock)


_NO_LOCKS: Final = -1  # stands for a lock on systems without locks


def _locked(path: Path, *, exclusive: bool) -> int | None:
    """Lock a folder, exclusively or shared with other processes. The result is None if the lock is not available."""
    if sys.platform == "win32":
        return _NO_LOCKS if path.exists() else None
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
    except FileNotFoundError:  # removed between opening and locking
        pass
    except OSError:  # a file system without locks
        os.close(lock)
        return _NO_LOCKS
    os.close(lock)
    return None


def _unlock(lock: int) -> None:
    if lock != _NO_LOCKS:
        os.close(lock)
