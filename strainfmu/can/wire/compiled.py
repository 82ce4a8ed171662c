"""The compiled part of the bridge: its functions, and the records of numbers and arrays that they work on.

They are in the library of the compiled estimator; ``fmus/native/bus/strainbus.h`` documents them. A machine
without that library and without a C compiler has no bridge: :class:`~strainfmu.estimator.core.NoCoreError` says
why.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from strainfmu.estimator.core import NoCoreError, library

VERSION = 5
"""``SB_VERSION`` of the library that this file calls."""

INTEGER, NUMBER, ARRAY = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
"""Types of the fields of records."""

Function = Callable[..., int]
"""A function of the library. Its arguments are pointers of :func:`pointer`, bytes and whole numbers."""


class Record(ctypes.Structure):
    """A record of the library. It keeps the arrays alive that it points to.

    Subclasses state ``_fields_`` in the order of strainbus.h.
    """

    position: ClassVar[int]
    """Place of its size in what ``sb_sizes`` returns."""

    def __init__(self, **fields: Any) -> None:
        """Make a record of numbers, and of arrays and other records that it points to."""
        self.kept: Any = fields
        named = {field[0]: field[1] for field in self._fields_}
        assert named.keys() == fields.keys(), set(named) ^ set(fields)
        super().__init__(**{n: address(v) if named[n] is ARRAY else v for n, v in fields.items()})

    @classmethod
    def empty(cls) -> Self:
        """Return a record of zeros that points to nothing."""
        made = cls.__new__(cls)
        ctypes.Structure.__init__(made)
        return made


_Data = ctypes.Structure | ctypes.Array[Any] | ctypes.c_double | ctypes.c_int64


def pointer(held: NDArray[Any] | _Data) -> Any:
    """Return the address of an array or a record as an argument of a :data:`Function`.

    It is converted here once, instead of in every call; ``held`` must outlive it.
    """
    return ctypes.c_void_p.from_param(address(held))


def function(name: str, record: type[Record] | None = None) -> Function:
    """Return the function ``name`` of the library that works on ``record``.

    Raises
    ------
    NoCoreError
        There is no library for this machine and no compiler to make one, or it is of another version.
    """
    functions = _library()
    if record is not None:
        size = _sizes()[record.position]
        assert ctypes.sizeof(record) == size, f"{record.__name__}: {ctypes.sizeof(record)} bytes, must be {size}"
    # By its name as an item it is an object of its own: types declared here are those of no other.
    found = functions[name]
    found.restype = ctypes.c_int64
    return found


@cache
def _library() -> ctypes.CDLL:
    found = library()
    version = found.sb_version() if hasattr(found, "sb_version") else 0
    if version != VERSION:
        raise NoCoreError(
            f"the bridge's compiled part has version {version}, must be {VERSION}: install the whole package again"
        )
    # It works for a few microseconds, so it keeps Python to itself: to let it go and get it back costs more, and a
    # thread that records or publishes would come in between.
    return ctypes.PyDLL(found._name, handle=found._handle)


@cache
def _sizes() -> list[int]:
    """Return the bytes of every record by the library."""
    sizes = np.zeros(64, dtype=np.int64)
    count = _library().sb_sizes(pointer(sizes))
    return sizes[:count].tolist()


def address(held: Any) -> int:
    """Return where an array or a record begins, 0 of None."""
    if held is None:
        return 0
    if isinstance(held, np.ndarray):
        assert held.flags.c_contiguous
        return int(held.ctypes.data)
    return ctypes.addressof(held)
