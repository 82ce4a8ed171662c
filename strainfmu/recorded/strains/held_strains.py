"""Recorded strains that repeat to the last bit: what a recorder that holds its last values writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray

NOTED = 10
"""Samples in a row, all gauges equal to the bit, from which on a note says so: noise does not repeat itself."""


class HeldStrains:
    """The longest row of samples in which no gauge changes."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._last: FloatArray | None = None
        self._run, self._begin = 0, float("nan")
        self._longest, self._longest_begin = 0, float("nan")

    def add(self, time: FloatArray, strain: FloatArray) -> None:
        """Take the samples of a block: times (n,) [s] and strains (n, n_d), of which NaN are none."""
        known = np.isfinite(strain).any(axis=1)
        before = np.vstack([strain[:1] if self._last is None else self._last[None], strain[:-1]])
        equal = (strain == before) | (np.isnan(strain) & np.isnan(before))
        same = known & equal.all(axis=1)
        if self._last is None:
            same[:1] = False
        for at, repeats in zip(time.tolist(), same.tolist(), strict=True):
            if not repeats:
                self._run, self._begin = 0, at
            self._run += 1
            if self._run > self._longest:
                self._longest, self._longest_begin = self._run, self._begin
        self._last = strain[-1].copy()

    def notes(self) -> list[str]:
        """Return what is to be said of them."""
        if self._longest < NOTED:
            return []
        return [
            f"{self._path}: no gauge changes in {self._longest} samples from {self._longest_begin:g} s on, to the "
            "last bit: a recorder that holds its last values writes this, and health cannot tell"
        ]
