"""Compilation of numerical functions by numba."""

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile ``function``: machine code kept on disk, run without the interpreter lock, IEEE results for x/0.

    A compiled function is renewed when its own file changes, not when a function that it calls does: after an
    edit delete ``__pycache__`` of its folder. Where no folder for the machine code can be written, the function
    is compiled again in every process.
    """
    try:
        return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))
    except RuntimeError:
        return cast(Function, njit(nogil=True, error_model="numpy")(function))


def inlined(function: Function) -> Function:
    """Compile ``function`` into each of its callers: a loop that calls functions gets no vector instructions."""
    return cast(Function, njit(nogil=True, error_model="numpy", forceinline=True)(function))
