"""A vehicle as built: the errors of its hardware, drawn at the sizes that the section [noise] states."""

from __future__ import annotations

import numpy as np

from builder.structure.as_built.vehicle import AsBuilt, Counts
from builder.structure.as_built_kinds import ALWAYS_DRAWN, IN_NOISE
from builder.vehicle.map.options import Noise


def drawn(entry: Noise, counts: Counts | int, random: np.random.Generator, scale: float = 1.0) -> AsBuilt:
    """Return a vehicle whose errors are drawn from normal distributions of ``scale`` times the sizes in
    ``entry``; ``counts`` may be the number of gauges alone."""
    return _drawn(entry, counts, (), random, scale)


def drawn_many(
    entry: Noise, counts: Counts | int, count: int, random: np.random.Generator, scale: float = 1.0
) -> AsBuilt:
    """Return ``count`` vehicles at once: what is (n,) of one is (count, n) here."""
    return _drawn(entry, counts, (count,), random, scale)


def _drawn(
    entry: Noise, counts: Counts | int, lead: tuple[int, ...], random: np.random.Generator, scale: float
) -> AsBuilt:
    of = counts if isinstance(counts, Counts) else Counts(counts)
    found = {}
    for kind in IN_NOISE:
        size, std = (*lead, of.in_flight(kind)), kind.noise_std(entry)
        takes = std > 0.0 or kind.name in ALWAYS_DRAWN
        found[kind.name] = scale * std * random.standard_normal(size) if takes else np.zeros(size)
    return AsBuilt(of, found)
