"""A tare by the edges of a flag, as an FMU takes it: while the flag is up readings are averaged, then judged.

The window is judged as that of a recording is (:mod:`strainfmu.estimator.zeros.tare`); besides, the dynamic
pressure must be known in every step of it. ``fmus/native/estimator/zeros/tare.h`` is the C counterpart.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.zeros.gauge_zeros import GaugeZeros
from strainfmu.estimator.zeros.reading_window import ReadingWindow
from strainfmu.estimator.zeros.tare import LEAST_SAMPLES, KnownStrain, TareLimits, judged_tare
from strainfmu.estimator.zeros.tare_verdict import loads_fault, refusal, refused_text, taken_text


class TareState(IntEnum):
    """What has become of the last tare."""

    IDLE = 0
    AVERAGING = 1
    DONE = 2
    REFUSED = 3


class EdgeTare:
    """Takes the tare of the strain gauges of ``held``; ``known`` is the strain of the loads that act meanwhile.

    Attributes
    ----------
    state : of the last tare.
    is_up : the flag at the last step.
    zeros : that a tare has set; None if none has.
    window : of readings while it is averaging.
    text : the last outcome, one line; "" if there was none since :attr:`text` was emptied.
    """

    def __init__(self, held: InverseMap, known: KnownStrain | None = None) -> None:
        self._map, self._limits, self._known = held, TareLimits(), known
        self.state, self.is_up = TareState.IDLE, False
        self.zeros: GaugeZeros | None = None
        self.window = ReadingWindow(n_gauges=held.n_strain_gauges)
        self.text = ""

    def follow(self, is_up: bool) -> bool:
        """Take in the flag of a step; return whether there are other zeros now."""
        rises, falls = is_up and not self.is_up, self.is_up and not is_up
        self.is_up = is_up
        if rises:
            self.state, self.window = TareState.AVERAGING, ReadingWindow(n_gauges=self._map.n_strain_gauges)
        return falls and self.state == TareState.AVERAGING and self._finish()

    def take(self, strain: FloatArray, dynamic_pressure: float) -> None:
        """Take in a step: readings (n_d,) [m/m], NaN for gauges not in use, and q_inf [Pa], NaN if unknown."""
        if self.state != TareState.AVERAGING:
            return
        fault = loads_fault(dynamic_pressure, self._limits)
        if fault:
            self._refuse(fault)
        else:
            self.window.add(strain)

    def drop(self) -> None:
        """Forget the zeros: others are given."""
        self.zeros = None
        if self.state != TareState.AVERAGING:
            self.state = TareState.IDLE

    def saved(self) -> dict[str, Any]:
        """Return all of it as numbers and lists, for :meth:`restore`."""
        window, zeros = self.window, self.zeros
        return {
            "flag": [int(self.state), int(self.is_up)],
            "zeros": None if zeros is None else [zeros.value.tolist(), zeros.std.tolist(), zeros.common_std],
            "window": None if self.state != TareState.AVERAGING else window.saved(),
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from what :meth:`saved` gave.

        Raises
        ------
        InputError, KeyError, TypeError, ValueError
            It cannot be; then nothing has changed.
        """
        state, is_up = saved["flag"]
        zeros, n = saved["zeros"], self._map.n_strain_gauges
        if zeros is not None:
            value, std, common = zeros
            zeros = GaugeZeros(
                value=np.array(value, dtype=float).reshape(n),
                std=np.array(std, dtype=float).reshape(n),
                common_std=float(common),
            )
        window = ReadingWindow(n_gauges=n)
        if saved["window"] is not None:
            window.restore(saved["window"])
        self.state, self.is_up = TareState(state), bool(is_up)
        self.zeros, self.window, self.text = zeros, window, ""

    def _finish(self) -> bool:
        if self.window.samples < LEAST_SAMPLES:
            return self._refuse(f"window: expected at least {LEAST_SAMPLES} steps, got {self.window.samples}")
        found = judged_tare(self._map, self.window.statistics(), np.zeros(1), self._limits, self._known)
        why = refusal(found)
        if why:
            return self._refuse(why)
        self.state, self.zeros, self.text = TareState.DONE, found.zeros, taken_text(found, "steps")
        return True

    def _refuse(self, why: str) -> bool:
        self.state, self.text = TareState.REFUSED, refused_text(why)
        return False
