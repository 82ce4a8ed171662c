"""What a bridge does with the zeros of a tare besides using them: zeros.toml, and a line for its summary."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType

from strainfmu.can.cycle.estimate.taring import TareEnd
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros


class ZerosKeeper:
    """Writes the zeros of every tare to a file, by a thread of its own, for a disk must not hold up the bridge.

    Parameters
    ----------
    path : of zeros.toml; the zeros of the latest tare stay.
    gauge_names : in the order of the zeros.
    source : where they come from, for the file.
    on_zeros : called with them.

    Attributes
    ----------
    lines : one on each tare that was asked for, and on each file.
    """

    def __init__(
        self, path: Path, gauge_names: Sequence[str], source: str, on_zeros: Callable[[GaugeZeros], None]
    ) -> None:
        self._on_zeros = on_zeros
        self._path, self._names, self._source = path, tuple(gauge_names), source
        self._threads: list[threading.Thread] = []
        self._lock = threading.Lock()
        self.lines: list[str] = []

    def __enter__(self) -> ZerosKeeper:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.finish()

    def ended(self, end: TareEnd) -> None:
        """Take in the end of a tare; never waits for the disk."""
        self.lines.append(end.text)
        if end.zeros is not None:
            self._on_zeros(end.zeros)
            made_from = {
                "bus": self._source,
                "taken_at": datetime.now(UTC).isoformat(timespec="seconds"),
                "samples": float(end.samples),
            }
            thread = threading.Thread(target=self._write, args=(end.zeros, made_from), name="zeros")
            self._threads.append(thread)
            thread.start()

    def finish(self) -> None:
        """Wait until all is written."""
        for thread in self._threads:
            thread.join()

    def _write(self, zeros: GaugeZeros, made_from: dict[str, str | float]) -> None:
        try:
            with self._lock:
                write_zeros(self._path, self._names, zeros, made_from)
        except StrainfmuError as error:
            self.lines.append(f"{error}: the zeros are in use and in no file")
        else:
            self.lines.append(f"{self._path}: zeros written")
