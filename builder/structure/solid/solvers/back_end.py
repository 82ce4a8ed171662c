"""Interface of a solver back end: a name, a licence, how to get it, and a function that factorises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from builder.structure.solid.solvers.problem import SparseProblem
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

Factor = Callable[[FloatArray], FloatArray]
"""(n_free, k) loads [N] to displacements [m]; the prepared matrix is kept inside."""


@dataclass(frozen=True, kw_only=True)
class BackEnd:
    """One way to solve a sparse problem.

    Attributes
    ----------
    name : the name that a user gives.
    licence : licence of the binding over the licence of the library.
    install : the command that installs it.
    installed : returns whether it is there.
    factor : prepares a problem; imports the library when called.
    """

    name: str
    licence: str
    install: str
    installed: Callable[[], bool]
    factor: Callable[[SparseProblem], Factor]

    def missing(self) -> InputError:
        """Return the error for a named back end that is not installed."""
        return InputError(f"solver '{self.name}' is not installed: {self.install} (licence: {self.licence})")


def importable(module: str) -> bool:
    """Return whether a module is there; only packages above it are imported."""
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # the package above it
        return False
