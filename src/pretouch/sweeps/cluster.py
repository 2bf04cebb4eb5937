"""Distribute a sweep over Dask workers.

The workers write their results to a Zarr folder.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from pretouch._core.errors import InvalidInputError, require

from .executors import BlockRecord, run_block
from .stores import ZarrStore

_RETRIES: Final = 3  # for a block whose worker was lost; finished blocks are not computed again
_TIMEOUT: Final = "10 s"


@contextmanager
def connected(dask: Any) -> Iterator[Any]:
    """Connect to a Dask scheduler, and yield the Dask client.

    Args:
        dask: the address of a scheduler, such as `tcp://10.0.0.1:8786`, or a `distributed.Client`, which is not closed.

    Yields:
        The client.

    Raises:
        InvalidInputError: no scheduler answers at this address.
    """
    distributed = require("distributed", extra="dask")
    if not isinstance(dask, str):
        yield dask
        return
    try:
        client = distributed.Client(dask, timeout=_TIMEOUT)
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InvalidInputError(f"dask: found no scheduler at {dask} ({reason})", value=dask) from None
    try:
        yield client
    finally:
        client.close()


def worker_count(client: Any) -> int:
    """Return the number of threads of a Dask cluster.

    The number is at least 1, even if no worker is connected yet.
    """
    return max(1, int(sum(client.nthreads().values())))


def run_on(client: Any, store: ZarrStore, blocks: list[int], report: Callable[[BlockRecord], None]) -> None:
    """Compute blocks of encounters on the workers of a Dask cluster.

    The workers must have access to the store at the same path.
    """
    distributed = require("distributed", extra="dask")
    shared = ZarrStore(store.path.resolve(), store.plan)  # workers have other current folders
    for future in distributed.as_completed(client.map(_run, blocks, store=shared, pure=False, retries=_RETRIES)):
        report(future.result())


def _run(block: int, store: ZarrStore) -> BlockRecord:
    """Compute a block of encounters on a Dask worker. A block that another worker has finished is skipped."""
    _check_folder(store.path)  # without shared storage, zarr would create a new folder here
    if store.is_finished(block):
        return BlockRecord(encounters=store.size(block), repeated=True)
    return run_block(store.plan, store, block)


def _check_folder(path: Path) -> None:
    if not (path / "zarr.json").is_file():
        raise InvalidInputError(
            f"{path}: a Dask worker cannot find the files of this sweep; choose a folder that all workers can "
            "access at the same path"
        )
