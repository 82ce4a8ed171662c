"""Derivatives of readings by the parameters of a vehicle as built.

A parameter of one gauge changes its own reading alone, so one difference serves all gauges. Derivatives are kept
by kind: (n_d, ..) where each gauge has its own parameter, or one for the whole vehicle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts
from builder.structure.as_built_kinds import AS_BUILT, IN_NOISE, KINDS
from builder.vehicle.map.options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.estimator.signal_names import ZERO

Key = tuple[str, int]
"""Kind of a parameter, and the number of the region, row or joint, or 0."""


def derivative_keys(counts: Counts) -> list[Key]:
    """Return the keys in the order of the vector, without the zeros."""
    return [
        (kind.name, number)
        for kind in AS_BUILT
        if kind.name != ZERO
        for number in range(1 if kind.extent in ("gauge", "vehicle") else getattr(counts, kind.extent))
    ]


def uncertain_keys(std: AsBuilt, in_flight: bool = False) -> list[Key]:
    """Return the keys of parameters whose standard deviation is not zero; those alone that strain in flight
    depends on, where it is ``in_flight`` that they are needed."""
    return [
        key
        for key in derivative_keys(std.counts)
        if (KINDS[key[0]].flight or not in_flight)
        and np.any(getattr(std, key[0]) if of_gauges(key) else getattr(std, key[0])[key[1]])
    ]


def stated_keys(noise: Noise, counts: Counts) -> list[Key]:
    """Return the keys of errors in proportion to strain that the section [noise] states, in the order of draws."""
    return [
        (kind.name, number)
        for kind in IN_NOISE
        if kind in AS_BUILT and kind.std(noise) > 0.0
        for number in range(1 if kind.extent == "gauge" else counts.in_flight(kind))
    ]


def of_gauges(key: Key) -> bool:
    """Return whether every gauge has its own parameter of a kind."""
    return KINDS[key[0]].extent == "gauge"


def parameter_derivatives(
    evaluate: Callable[[AsBuilt], FloatArray],
    parameters: AsBuilt,
    keys: Sequence[Key] | None = None,
) -> dict[Key, FloatArray]:
    """Return the derivative of ``evaluate`` (n_d, ..), readings without zeros that go with 1 / E, by ``keys``.

    These are all by default.
    """
    value = evaluate(parameters)
    scale = (1.0 + parameters.gauge_gain).reshape(-1, *[1] * (value.ndim - 1))
    found: dict[Key, FloatArray] = {}
    for key in derivative_keys(parameters.counts) if keys is None else keys:
        kind, region = key
        if kind == "gauge_gain":
            found[key] = value / scale
        elif kind == "common_gain":
            found[key] = value / (1.0 + parameters.common_gain[0])
        elif kind == "youngs_modulus":
            found[key] = -value / (1.0 + parameters.youngs_modulus[0])
        else:
            found[key] = _difference(evaluate, parameters, kind, region)
    return found


def _difference(
    evaluate: Callable[[AsBuilt], FloatArray], parameters: AsBuilt, kind: str, region: int
) -> FloatArray:
    held = getattr(parameters, kind)
    step = KINDS[kind].step
    change = np.full(len(held), step)
    if KINDS[kind].extent not in ("gauge", "vehicle"):
        change[np.arange(len(held)) != region] = 0.0
    plus, minus = (evaluate(parameters.changed(**{kind: held + sign * change})) for sign in (1.0, -1.0))
    return np.asarray((plus - minus) / (2.0 * step))
