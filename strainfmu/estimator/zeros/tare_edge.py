"""A tare by the edges of a flag, as an FMU takes it: while the flag is up readings are averaged, then judged.

The core has the state machine. The window is judged as the window of a recording is; besides, the dynamic pressure
must be known in every step of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Protocol

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.zeros.tare import LEAST_SAMPLES, KnownStrain, TareFault, TareLimits, limits_record
from strainfmu.estimator.zeros.tare_verdict import (
    judged_tare,
    loads_fault,
    refusal,
    refused_text,
    taken_text,
    zeros_of,
)


class TareState(IntEnum):
    """What has become of the last tare."""

    IDLE = 0
    AVERAGING = 1
    DONE = 2
    REFUSED = 3


class StepCore(Protocol):
    """What :class:`EdgeTare` needs of a core."""

    def tare_step(
        self, limits: FloatArray, is_up: bool, strain: FloatArray, dynamic_pressure: float
    ) -> tuple[bool, Mapping[str, FloatArray]]: ...

    def tare_drop(self) -> Mapping[str, FloatArray]: ...

    @property
    def tare_state(self) -> bytes: ...

    def restore_tare(self, state: bytes) -> Mapping[str, FloatArray]: ...


class EdgeTare:
    """Takes the tare of the strain gauges of ``held`` by ``core``, which takes no other tare by steps.

    ``known`` is the strain of the loads that act meanwhile.

    Attributes
    ----------
    state : of the last tare.
    is_up : the flag at the last step.
    zeros : that a tare has set; None if none has.
    text : the last outcome, one line; "" if there was none since :attr:`text` was emptied.
    """

    def __init__(self, core: StepCore, inverse_map: InverseMap, known: KnownStrain | None = None) -> None:
        self._core, self._map, self._limits = core, inverse_map, TareLimits()
        self._record = limits_record(self._limits, known, inverse_map.n_strain_gauges)
        self.state, self.is_up = TareState.IDLE, False
        self.zeros: GaugeZeros | None = None
        self.text = ""

    def step(self, is_up: bool, strain: FloatArray, dynamic_pressure: float) -> bool:
        """Take a step in; return whether there are other zeros now.

        Parameters
        ----------
        is_up : the flag.
        strain : (n_d,) readings [m/m], NaN for gauges not in use.
        dynamic_pressure : q_inf [Pa], NaN if unknown.
        """
        may_end = self.state == TareState.AVERAGING or (is_up and not self.is_up)
        changed, outcome = self._core.tare_step(self._record, is_up, strain, dynamic_pressure)
        self._take(outcome)
        if changed:
            self.zeros = zeros_of(outcome)
        if may_end and self.state in (TareState.DONE, TareState.REFUSED):
            self.text = self._ended(outcome)
        return changed

    def drop(self) -> None:
        """Forget the zeros: others are given."""
        self._take(self._core.tare_drop())
        self.zeros = None

    def saved(self) -> bytes:
        """Return all of it, for :meth:`restore`."""
        return self._core.tare_state

    def restore(self, saved: bytes) -> None:
        """Go on from what :meth:`saved` gave.

        Raises
        ------
        InputError
            It cannot be; then nothing has changed.
        """
        outcome = self._core.restore_tare(saved)
        self._take(outcome)
        self.zeros, self.text = zeros_of(outcome) if outcome["has_zeros"][0] else None, ""

    def _take(self, outcome: Mapping[str, FloatArray]) -> None:
        self.state, self.is_up = TareState(int(outcome["state"][0])), bool(outcome["is_up"][0])

    def _ended(self, outcome: Mapping[str, FloatArray]) -> str:
        """Return what is said of the tare that has ended."""
        reasons = TareFault(int(outcome["faults"][0]))
        if TareFault.NO_CORE in reasons:
            return refused_text("it needs the compiled estimator, which this machine does not have")
        if reasons & (TareFault.NO_PRESSURE | TareFault.PRESSURE):
            return refused_text(loads_fault(float(outcome[DYNAMIC_PRESSURE][0]), self._limits))
        if TareFault.SHORT in reasons:
            return refused_text(
                f"window: expected at least {LEAST_SAMPLES} steps, got {int(outcome['samples'][0])}"
            )
        tare = judged_tare(self._map, outcome, self._limits)
        return refused_text(refusal(tare)) if reasons else taken_text(tare, "steps")
