"""A vehicle as built: the errors of its hardware, drawn at the sizes that the section [noise] states."""

from __future__ import annotations

import numpy as np

from builder.structure.as_built.vehicle import AsBuilt, Counts
from builder.structure.as_built_kinds import ALWAYS_DRAWN, IN_NOISE
from builder.vehicle.map.options import Noise


def drawn(
    entry: Noise,
    counts: Counts | int,
    random: np.random.Generator,
    scale: float = 1.0,
    count: int | None = None,
) -> AsBuilt:
    """Return a vehicle whose errors are drawn from normal distributions of ``scale`` times the sizes in ``entry``;
    ``counts`` may be the number of gauges alone.

    With ``count`` they are as many vehicles at once: what is (n,) of a single vehicle is (count, n) then.
    """
    of, errors = counts if isinstance(counts, Counts) else Counts(counts), {}
    for kind in IN_NOISE:
        size, std = (*(() if count is None else (count,)), of.in_flight(kind)), kind.noise_std(entry)
        takes = scale > 0.0 and (std > 0.0 or kind.name in ALWAYS_DRAWN)
        errors[kind.name] = scale * std * random.standard_normal(size) if takes else np.zeros(size)
    return AsBuilt(of, errors)
