"""The optional libraries of the bus: python-can, cantools, cryptography; imported when needed and quiet."""

from __future__ import annotations

import logging
from typing import Any

from strainfmu.errors import library


def import_can() -> Any:
    """Return the package python-can.

    Raises
    ------
    StrainfmuError
        It is not installed.
    """
    return _imported("can", "python-can")


def import_cantools() -> Any:
    """Return the package cantools.

    Raises
    ------
    StrainfmuError
        It is not installed.
    """
    return _imported("cantools", "cantools")


def import_cmac() -> tuple[Any, Any]:
    """Return the modules of CMAC and of block ciphers of the package cryptography.

    Raises
    ------
    StrainfmuError
        It is not installed.
    """
    primitives = "cryptography.hazmat.primitives"
    cmac, ciphers = (
        library(f"{primitives}.{name}", "cryptography", "auth") for name in ("cmac", "ciphers.algorithms")
    )
    return cmac, ciphers


def error_line(error: BaseException) -> str:
    """Return the text of ``error`` on one line, its type where it has no text."""
    return " ".join(str(error).split()) or type(error).__name__


def _imported(package: str, name: str) -> Any:
    """Return ``package``, which is installed by the ``name``."""
    module = library(package, name, "can")
    # Without a handler, logging writes to standard error, where each failure is to be one line of this program.
    logger = logging.getLogger(package)
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    return module
