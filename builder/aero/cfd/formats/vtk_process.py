"""The process that reads VTK files, one after another: starting it takes longer than reading a small file."""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

from strainfmu.errors import InputError

_CHILD = Path(__file__).with_name("vtk_child.py")
_LONGEST = 600.0


class VtkProcess:
    """Starts the process with the first file, and again after a file on which it ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def read(self, path: Path) -> bytes:
        """Return the .npz image of the surface in a file.

        Raises
        ------
        InputError
            VTK refuses the file, breaks down on it, or does not end.
        """
        with self._lock:
            process = self._started()
            late = threading.Event()
            timer = threading.Timer(_LONGEST, _kill, (process, late))
            timer.daemon = True
            timer.start()
            try:
                answer = _ask(process, path)
            finally:
                timer.cancel()
            if answer is None:
                self._running = None
                code = _ended(process)
        if answer is None and late.is_set():
            raise InputError(f"{path}: damaged: VTK's reader did not end within {_LONGEST:g} s")
        if answer is None:
            raise InputError(f"{path}: damaged: VTK's reader broke down on it (exit code {code})")
        word, content = answer
        if word == b"refused":
            raise InputError(f"{path}: {content.decode('utf-8', 'replace')}")
        return content

    @property
    def number(self) -> int | None:
        """The process's number; None where none runs."""
        return None if self._running is None else self._running.pid

    def end(self) -> None:
        """End the process."""
        with self._lock:
            if self._running is not None and self._owner == os.getpid():
                _ended(self._running)
            self._running = None

    def _started(self) -> subprocess.Popen[bytes]:
        """Return the process; a copy of this one made by fork has its own."""
        if self._running is None or self._owner != os.getpid() or self._running.poll() is not None:
            self._running = subprocess.Popen(
                [sys.executable, "-P", str(_CHILD)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            self._owner = os.getpid()
        return self._running


def _kill(process: subprocess.Popen[bytes], late: threading.Event) -> None:
    late.set()
    process.kill()


def _ask(process: subprocess.Popen[bytes], path: Path) -> tuple[bytes, bytes] | None:
    """Return word and content of the answer on a file, None where the process ended without one."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(str(path)).encode() + b"\n")
        process.stdin.flush()
    except OSError:
        return None
    word, _, length = process.stdout.readline().partition(b" ")
    if not length.endswith(b"\n"):
        return None
    content = process.stdout.read(int(length))
    return (word, content) if len(content) == int(length) else None


def _ended(process: subprocess.Popen[bytes]) -> int:
    """Close the process's pipes, wait for its end and return its exit code."""
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):
                stream.close()
    return process.wait()


VTK_PROCESS = VtkProcess()
atexit.register(VTK_PROCESS.end)
