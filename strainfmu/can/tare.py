"""A tare on the running bus: strains of a window of cycles, while loads are known, become the zeros of the gauges.

The window is judged as a recording's is (:meth:`strainfmu.Estimator.tare`); besides, the dynamic pressure
must be known and the sender proven in every cycle of it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType

import numpy as np

from strainfmu.can.machine import Result
from strainfmu.can.quality import Cause
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.tare import (
    KnownStrain,
    TareLimits,
    loads_fault,
    refusal,
    refused_text,
    taken_text,
)

MOST_CYCLES = 100_000
"""Longest window [cycles]."""

_PATIENCE = 2.0
"""Times its length that a window may last, with cycles that are of no use."""

_USELESS = (
    Cause.NOT_TRUSTED | Cause.CYCLE_CRC | Cause.OLD | Cause.CLOCK_JUMP | Cause.SENDER_STATUS | Cause.PARTIAL_CYCLE
)
"""Causes with which a cycle is left out of the window."""

_UNPROVEN = Cause.HIDDEN_DELAY | Cause.UNPROVEN_RESTART | Cause.SECOND_SENDER | Cause.SECOND_BRIDGE
"""Causes that end it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TareEnd:
    """The end of a tare.

    Attributes
    ----------
    text : what became of it, one line.
    zeros : that are in use from now on; None if it was refused.
    samples : number of cycles of the window.
    """

    text: str
    zeros: GaugeZeros | None = None
    samples: int = 0


class Taring:
    """Collects the window that was asked for, and gives the estimator the zeros that follow from it.

    Parameters
    ----------
    estimator : of a map of the gauges, for their noise and the pattern of a flight; it judges the window.
    set_zeros : gives zeros to the estimator.
    n_cycles : length of the window.
    said_for : number of results that say how it ended.
    known : strain of the loads that act meanwhile; None for none.

    Raises
    ------
    InputError
        ``n_cycles`` is out of range.
    """

    def __init__(
        self,
        estimator: Estimator,
        set_zeros: Callable[[GaugeZeros], None],
        n_cycles: int,
        *,
        said_for: int = 10,
        known: KnownStrain | None = None,
    ) -> None:
        fewest = POLICIES.least_samples
        if not fewest <= n_cycles <= MOST_CYCLES:
            raise InputError(f"tare: expected a window of {fewest} to {MOST_CYCLES} cycles, got {n_cycles}")
        self._estimator, self._set_zeros, self._n_cycles = estimator, set_zeros, n_cycles
        self._limits, self._known = TareLimits(), known
        self._strain = np.empty((n_cycles, estimator.inverse_map.n_strain_gauges))
        self._pressure = np.empty(n_cycles)
        self._taken = self._seen = 0
        self._is_running = False
        self._request: int | None = None
        self._said_for, self._to_say, self._outcome = said_for, 0, Cause.NONE
        self.ends: list[TareEnd] = []
        self.on_end: Callable[[TareEnd], None] | None = None
        """Called at the end of each, in the thread that steps."""

    def ask(self, request: int) -> None:
        """Take in the number of the last command; one that changes to another than 0 begins a window.

        The first one of a run begins none: a bridge that is started again finds the last request on the bus.
        """
        known, self._request = self._request, request
        if known is None or request in (0, known):
            return
        self._is_running, self._taken, self._seen, self._to_say = True, 0, 0, 0

    def take(self, result: Result, dynamic_pressure: float, request: int) -> Cause:
        """Take in a judged cycle; return the causes that its result gets.

        Parameters
        ----------
        dynamic_pressure : q_inf that the bus states [Pa], 0 of air at rest; NaN if it is not known.
        request : number of the last command, below 0 for none.
        """
        if request >= 0:
            self.ask(request)
        if not self._is_running and self._to_say <= 0:
            return Cause.NONE
        if self._is_running:
            self._collect(result, dynamic_pressure)
            if self._is_running:
                return Cause.TARE_RUNNING
        self._to_say -= 1
        return self._outcome

    def _collect(self, result: Result, pressure: float) -> None:
        self._seen += 1
        if result.causes & _UNPROVEN:
            self._refuse("the sender of the strains is not proven")
        elif fault := loads_fault(pressure, self._limits, " on the bus"):
            self._refuse(fault)
        elif self._seen > _PATIENCE * self._n_cycles:
            self._refuse(f"{self._taken} of {self._seen} cycles were of use, expected {self._n_cycles}")
        elif not result.causes & _USELESS:
            self._strain[self._taken], self._pressure[self._taken] = result.strain, pressure
            self._taken += 1
            if self._taken == self._n_cycles:
                self._finish()

    def _finish(self) -> None:
        """Judge the window, and use its zeros if nothing speaks against them."""
        n = self._estimator.inverse_map.n_strain_gauges
        try:
            outcome = self._estimator.tare(self._strain[:, :n], self._pressure, self._limits, self._known)
            why = refusal(outcome)
            if not why:
                self._set_zeros(outcome.zeros)
        except StrainfmuError as error:
            why = str(error)
        if why:
            self._refuse(why)
            return
        text = taken_text(outcome, "cycles") + "".join(f"; {note}" for note in outcome.notes)
        self._end(Cause.ZEROS_TAKEN, TareEnd(text=text, zeros=outcome.zeros, samples=outcome.samples))

    def _refuse(self, why: str) -> None:
        self._end(Cause.TARE_REFUSED, TareEnd(text=refused_text(why)))

    def _end(self, outcome: Cause, end: TareEnd) -> None:
        self._is_running = False
        self._outcome, self._to_say = outcome, self._said_for
        self.ends.append(end)
        if self.on_end is not None:
            self.on_end(end)


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
