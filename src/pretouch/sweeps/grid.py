"""Define the grid of a sweep.

The grid is computed and stored in chunks.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .axes import Axis

Region: TypeAlias = tuple[slice, ...]
"""A part of the grid: one slice per axis."""

Columns: TypeAlias = dict[str, NDArray[Any]]
"""The status and every result of some encounters, by name, as arrays of one shape."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid(ABC):
    """Abstract base class of a sweep over a grid of encounters.

    Args:
        axes: the axes, in the order of the dimensions.
        results: names of the results; the status is always added.
        seed: seed of the random number generator that made the values, for the record; None if there is none.
        chunk: shape of a chunk, which is computed by one call and stored in one file.
    """

    axes: tuple[Axis, ...]
    results: tuple[str, ...]
    seed: int | None
    chunk: tuple[int, ...]

    @property
    @abstractmethod
    def subject(self) -> str:
        """Name of the computed results in titles, such as `contacts`."""

    @abstractmethod
    def evaluate(self, region: Region) -> Columns:
        """Compute all encounters in a part of the sweep grid.

        Returns:
            Arrays of status and results.
        """

    @abstractmethod
    def inputs(self) -> dict[str, Any]:
        """Return the inputs that the sweep does not vary.

        The values are in SI units and suitable for JSON.
        """

    @abstractmethod
    def input_attributes(self, name: str) -> dict[str, Any]:
        """Return name and unit of a varied input as metadata."""

    @abstractmethod
    def result_attributes(self, name: str) -> dict[str, Any]:
        """Return the metadata of a computed quantity for the dataset.

        They include its long name and its unit.
        """

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the sweep axes, one for each dimension of the grid."""
        return tuple(axis.name for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on each axis of the sweep grid."""
        return tuple(map(len, self.axes))

    @property
    def size(self) -> int:
        """The number of encounters in the sweep."""
        return math.prod(self.shape)

    @property
    def chunk_grid(self) -> tuple[int, ...]:
        """Number of chunks along each axis of the sweep grid.

        One call computes one chunk.
        """
        return tuple(-(-n // c) for n, c in zip(self.shape, self.chunk, strict=True))

    @property
    def chunk_count(self) -> int:
        """Total number of chunks into which the sweep grid is divided."""
        return math.prod(self.chunk_grid)

    def region(self, index: int) -> Region:
        """Return the part of the sweep grid in one chunk. Chunks are numbered along the last dimension first."""
        dimensions = zip(np.unravel_index(index, self.chunk_grid), self.chunk, self.shape, strict=True)
        return tuple(slice(int(i) * c, min((int(i) + 1) * c, n)) for i, c, n in dimensions)

    def thinned(self, most: int) -> Self:
        """Return a small trial sweep with few values per axis.

        The values are evenly spaced. The trial has one chunk with at most `most` encounters.
        """
        axes: list[tuple[int, Axis]] = []
        remaining = most
        for position, axis in sorted(enumerate(self.axes), key=lambda item: len(item[1])):
            count = max(1, min(len(axis), int(remaining ** (1 / (len(self.axes) - len(axes))) + 1e-9)))
            remaining //= count
            axes.append((position, axis.at(np.linspace(0, len(axis) - 1, count).astype(np.int64))))
        in_order = tuple(axis for _, axis in sorted(axes, key=lambda item: item[0]))
        return replace(self, axes=in_order, chunk=tuple(map(len, in_order)))
