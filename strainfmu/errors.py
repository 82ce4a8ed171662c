"""The errors a user can cause or meet; each carries one line with the cause and the cure.

Only :class:`SeveralErrors` and :class:`FaultsError` carry several.

The command line prints them and ends with :attr:`StrainfmuError.exit_code`.
"""

from importlib import import_module
from typing import Any


class StrainfmuError(Exception):
    """Something failed that is not the user's input: exit code 1."""

    exit_code = 1

    @property
    def lines(self) -> list[str]:
        """The message as the command line prints it: one line, but for :class:`SeveralErrors`."""
        return [" ".join(str(self).split())]


class InputError(StrainfmuError):
    """An input is wrong: which file, entry or signal, what was found, what is allowed. Exit code 2."""

    exit_code = 2


class SeveralErrors(StrainfmuError):
    """Several things failed: a line each."""

    @property
    def lines(self) -> list[str]:
        return [" ".join(line.split()) for line in str(self).split("\n")]


class FaultsError(SeveralErrors, InputError):
    """Several entries of a file are wrong: a line each."""


class FlowReachError(InputError):
    """A flight condition is outside what the marching flow solver can compute."""


def library(module: str, package: str, extra: str) -> Any:
    """Return a module of a ``package`` that is installed with an ``extra`` of this one.

    Raises
    ------
    StrainfmuError
        It is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise StrainfmuError(f"{package} is not installed: pip install 'strainfmu[{extra}]'") from error


def importable(module: str) -> Any:
    """Return a module, None where it is not installed."""
    try:
        return import_module(module)
    except ImportError:
        return None
