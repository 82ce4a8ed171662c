"""Standard deviations of the vehicle's parameters before and after a test, kind by kind, and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from builder.structure.as_built.as_built_vehicle import Counts, slices
from builder.structure.as_built_kinds import KINDS
from strainfmu.arrays import BoolArray, FloatArray

ESTABLISHED, AT_PRIOR = 0.5, 0.9
"""Standard deviation after a test over that before: up to which a kind is established, from which it stays as it
was."""


@dataclass(frozen=True, kw_only=True)
class KindSigmas:
    """Root mean square of the standard deviations of one kind, in SI.

    Attributes
    ----------
    kind : of :data:`~builder.structure.as_built_kinds.KINDS`.
    before, after : the test.
    """

    kind: str
    before: float
    after: float

    @property
    def is_established(self) -> bool:
        """Whether the test at least halves it."""
        return self.after <= ESTABLISHED * self.before

    @property
    def stays(self) -> bool:
        """Whether the test hardly changes it."""
        return self.after >= AT_PRIOR * self.before

    def size(self, value: float) -> str:
        """Return a size of this kind, to two digits, with its unit."""
        digits = float(f"{value / KINDS[self.kind].scale:.2g}")
        return f"{np.format_float_positional(digits, trim='-')} {KINDS[self.kind].unit}"


def kind_sigmas(
    counts: Counts, before: FloatArray, after: FloatArray, used: BoolArray | None = None
) -> list[KindSigmas]:
    """Return the kinds that are not known exactly before a test.

    Parameters
    ----------
    before, after : (n,) of the vector.
    used : (n_d,) gauges that count; all by default.
    """
    kinds = []
    for kind, place in slices(counts).items():
        chosen = used if used is not None and used.any() and KINDS[kind].extent == "gauge" else slice(None)
        if before[place][chosen].any():
            prior, left = (float(np.sqrt(np.mean(stds[place][chosen] ** 2))) for stds in (before, after))
            kinds.append(KindSigmas(kind=kind, before=prior, after=left))
    return kinds


def established(kinds: Sequence[KindSigmas]) -> str:
    """Return the kinds that a test establishes, in one line; empty without any."""
    parts = [
        f"{KINDS[kind.kind].in_words} {kind.size(kind.after)} ({kind.size(kind.before)})"
        for kind in kinds
        if kind.is_established
    ]
    return f"of the vehicle, 1 sigma (before the test): {', '.join(parts)}" if parts else ""


def undetermined(kinds: Sequence[KindSigmas]) -> str:
    """Return the kinds that a test leaves as they were, in one line; empty without any."""
    parts = [f"{KINDS[kind.kind].in_words} ({kind.size(kind.after)})" for kind in kinds if kind.stays]
    return f"as uncertain as before the test: {', '.join(parts)}" if parts else ""
