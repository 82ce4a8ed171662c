"""A map whose last digits are others, as another machine's linear algebra leaves them."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap


def perturbed(inverse_map: InverseMap, seed: int, size: float) -> InverseMap:
    """Return ``inverse_map`` with every number of its float64 arrays changed by some ``size`` of itself."""
    changed: InverseMap = _perturbed(inverse_map, np.random.default_rng(seed), size)
    return changed


def _perturbed(part: Any, random: np.random.Generator, size: float) -> Any:
    changes = {}
    for one in fields(part):
        value = getattr(part, one.name)
        if is_dataclass(value) and not isinstance(value, type):
            changes[one.name] = _perturbed(value, random, size)
        elif isinstance(value, np.ndarray) and value.dtype == np.float64:
            factor = random.uniform(-size, size, value.shape)
            if value.ndim == 2 and value.shape[0] == value.shape[1] and np.array_equal(value, value.T):
                factor = 0.5 * (factor + factor.T)
            changes[one.name] = value * (1.0 + factor)
    return replace(part, **changes)
