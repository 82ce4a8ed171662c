"""Maps whose snapshots have further parameters of the flow."""

from __future__ import annotations

from dataclasses import replace

from strainfmu.estimator.inverse_map import InverseMap

PARAMETERS = {"fin_deg": [-4.0, 4.0], "power": [0.0, 0.5], "cant_deg": [2.0, 2.0]}


def with_parameters(inverse_map: InverseMap) -> InverseMap:
    """Return ``inverse_map`` with the ranges :data:`PARAMETERS`, of which the last is of one value."""
    return replace(inverse_map, provenance={**inverse_map.provenance, "parameters": PARAMETERS})
