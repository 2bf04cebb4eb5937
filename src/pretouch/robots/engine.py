"""Give compiled code access to the MuJoCo library that Python has loaded.

The compiled core calls MuJoCo's functions by their addresses. It reads the arrays of a state by the addresses of their
NumPy views, which stay the same for the life of the state. Only two things have no view: the numbers of contacts and
constraints, whose places in the structure are measured, and the list of contacts, whose layout is that of the views of
its fields.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.native import POINTER, Structure, numbers

from .model import Data, mujoco

_FUNCTIONS: Final = (
    *("step1", "step2", "kinematics", "comPos", "subtreeVel", "mulM", "mulJacTVec", "jac", "contactForce"),
    *("ray", "multiRay"),
)
_HANDLER: Final = "_mjPRIVATE_setTlsLogHandler"  # MuJoCo's own Python package sets the handler of a thread with it
_MARKS: Final = 0x5EA1C0DE, 0x1D0C0FFE
_BLOCK: Final = 1024  # bytes
_FIELDS: Final = "geom", "flex", "pos", "frame"


class Engine(Structure):
    """Addresses of the functions of MuJoCo, as a C structure."""

    _fields_ = numbers(
        *("step1", "step2", "kinematics", "com_pos", "subtree_vel", "mul_m", "mul_jac_t", "jac", "contact_force"),
        *("ray", "multi_ray", "set_log_handler"),
        kind=POINTER,
    )


@lru_cache(maxsize=1)
def engine() -> Engine:
    """Return the functions of the loaded MuJoCo library.

    Raises:
        InvalidInputError: the package of MuJoCo has no library next to it, or the library lacks a function.
    """
    folder = Path(mujoco().__file__).parent
    files = sorted(file for pattern in ("libmujoco*", "mujoco.dll") for file in folder.glob(pattern))
    if not files:
        raise InvalidInputError(
            f"mujoco: found no shared library of MuJoCo in {folder}; install the package mujoco 4.0 or later by pip"
        )
    library = ctypes.CDLL(str(files[0]))  # it is loaded already, so this is the same library
    try:
        addresses = [ctypes.cast(library[f"mj_{name}"], POINTER).value for name in _FUNCTIONS]
    except AttributeError as error:
        raise InvalidInputError(
            f"mujoco: the library {files[0].name} lacks a function ({error}); install the package mujoco 4.0 or later"
        ) from None
    handler = getattr(library, _HANDLER, None)
    return Engine(*addresses, ctypes.cast(handler, POINTER).value if handler else None)


def address_of(view: Any) -> int:
    """Return the address of an array of a model or a state; it is valid as long as the model or the state lives."""
    return int(view.__array_interface__["data"][0])


@dataclass(frozen=True, slots=True)
class ContactList:
    """Where compiled code finds the contacts of a state.

    Args:
        count: address of the number of contacts.
        start: address of the first contact.
        size: bytes of a contact.
        fields: offsets of geom, flex, pos and frame in a contact.
    """

    count: int
    start: int
    size: int
    fields: tuple[int, int, int, int]


def contact_list(data: Data) -> ContactList:
    """Return where compiled code finds the contacts of a state."""
    number, place = data.ncon, count_address(data, "ncon")
    data.ncon = 1  # the views of the fields exist only for contacts
    try:
        views = [getattr(data.contact, name) for name in _FIELDS]
        first = address_of(data.contact.dist)
        places = [address_of(view) - first for view in views]
        size = views[0].strides[0]
    finally:
        data.ncon = number
    return ContactList(place, first, size, (places[0], places[1], places[2], places[3]))


_offsets: Final[dict[str, int]] = {}


def count_address(data: Data, name: str) -> int:
    """Return the address of a number of a state that has no view, such as the number of contacts.

    It is where marks appear that are written through the Python package.

    Args:
        data: the state, which is not changed.
        name: "ncon", "ne" or "nefc".

    Raises:
        InvalidInputError: the marks appear nowhere.
    """
    if name not in _offsets:
        number = getattr(data, name)
        try:
            setattr(data, name, _MARKS[0])
            offset = _find(data._address, _MARKS[0])
            setattr(data, name, _MARKS[1])
            if ctypes.c_int32.from_address(data._address + offset).value != _MARKS[1]:
                raise InvalidInputError(f"mujoco: cannot find the number {name} in the state of this MuJoCo version")
        finally:
            setattr(data, name, number)
        _offsets[name] = offset
    return int(data._address + _offsets[name])


def _find(address: int, mark: int) -> int:
    """Return the offset of a number after an address. The number is in the structure, so the search ends there."""
    offset = 0
    while True:
        block = np.frombuffer(ctypes.string_at(address + offset, _BLOCK), dtype=np.int32)
        places = np.flatnonzero(block == mark)
        if len(places):
            return offset + 4 * int(places[0])
        offset += _BLOCK
