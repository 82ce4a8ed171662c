"""A clean end of the process for PythonFMU's compiled wrapper.

At the end of a process on Linux, PythonFMU 0.7 lets go of its hold on the interpreter twice: once as a static
object of C++ and once more as its library is unloaded, from memory that is free by then. In a Python host the C
library now and then finds its heap damaged and aborts, after the last result; in any other host it always does
(github.com/NTNU-IHB/PythonFMU/issues/228). The reference is released here before either: what comes later finds
none.
"""

import atexit
import ctypes
import os
import sys
from functools import cache
from pathlib import Path


def let_go_at_exit(resources: Path, model_identifier: str) -> None:
    """Let the wrapper of the FMU unzipped around ``resources`` release the interpreter before Python ends."""
    if sys.platform.startswith("linux"):
        _register(resources.parent / "binaries" / "linux64" / f"{model_identifier}.so")


@cache  # once for each library, however many instances it has
def _register(library: Path) -> None:
    """Remember the library for the end of Python, without a hold on it: hosts may unload it before."""
    if library.exists():  # not while the FMU is packed
        atexit.register(_let_go, library)


def _let_go(library: Path) -> None:
    """Call the wrapper's own release, if the library is still loaded and has one."""
    try:
        wrapper = ctypes.CDLL(str(library), os.RTLD_NOLOAD | os.RTLD_LAZY)
    except OSError:  # unloaded: it has released itself, in the right order
        return
    let_go = getattr(wrapper, "finalizePythonInterpreter", None)
    if let_go is not None:
        let_go()
