"""``strainfmu`` in a child process with limits of time and memory: what a damaged file may cost."""

import os
import resource
import signal
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from strainfmu.cli.main import main

LONGEST = 10
"""Processor time [s] of each process within which a damaged file ends, however busy the host."""

PATIENCE = 300.0
"""Time [s] within which it ends if it waits for something."""

LARGEST = 1 << 30
"""Memory [bytes] that a damaged file may need beyond what the program has."""


@dataclass(frozen=True)
class Ended:
    """How a run ended: exit code, None where it was killed; what it printed; time [s] and memory [bytes]."""

    code: int | None
    errors: str
    duration: float
    memory: int

    def problem(self) -> str:
        """Return what is wrong with it, "" if nothing is."""
        if self.code is None:
            return f"not ended after {self.duration:.0f} s"
        if self.code not in (0, 1, 2) or "internal error" in self.errors or "Traceback" in self.errors:
            return f"exit code {self.code}: {self.errors[-300:]}"
        if self.code == 2 and self.errors.count("\n") != 1:
            return f"more than one line: {self.errors[-300:]}"
        return "" if self.memory <= LARGEST else f"{self.memory / 1e6:.0f} MB"


def limited_run(folder: Path, *arguments: object) -> Ended:
    """Run ``strainfmu`` with ``arguments`` in a child process of this one, and of its own children."""
    begin, before = time.monotonic(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with tempfile.TemporaryFile(dir=folder) as errors:
        child = os.fork()
        if child == 0:
            _run([str(argument) for argument in arguments], errors.fileno())
        killed, status, used = False, 0, None
        while used is None:
            finished, status, usage = os.wait4(child, os.WNOHANG)
            if finished:
                used = usage
            elif time.monotonic() - begin > PATIENCE and not killed:
                os.kill(child, signal.SIGKILL)
                killed = True
            else:
                time.sleep(0.002)
        errors.seek(0)
        text = errors.read().decode(errors="replace")
    code = None if killed or os.WTERMSIG(status) == signal.SIGXCPU else os.waitstatus_to_exitcode(status)
    return Ended(code, text, time.monotonic() - begin, 1024 * max(used.ru_maxrss - before, 0))


def _run(arguments: list[str], errors: int) -> None:
    """Run the command and end the process."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, 2 * LONGEST))
    os.dup2(errors, 2)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    sys.stdout, sys.stderr = os.fdopen(os.dup(1), "w"), os.fdopen(os.dup(2), "w")
    code = 99
    try:
        main(arguments)
    except SystemExit as ended:
        code = int(ended.code or 0)
    finally:
        sys.stderr.flush()
        os._exit(code)
