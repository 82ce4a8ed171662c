"""What the estimator of a map offers in addition to five loads: a filter, rolling moment, section loads."""

from __future__ import annotations

from strainfmu.estimator.map.inverse_map import InverseMap


def has_filter(inverse_map: InverseMap) -> bool:
    """Return whether FMUs of ``inverse_map`` can filter: linear maps that follow q_inf, and maps with tables."""
    return inverse_map.manifold is not None or inverse_map.form == "dynamic_pressure"


def has_further_outputs(inverse_map: InverseMap) -> bool:
    """Return whether FMUs of the map state such loads: in form "dynamic_pressure", and its tables hold them."""
    manifold = inverse_map.manifold
    by_tables = manifold is None or manifold.further is not None
    return inverse_map.further is not None and inverse_map.form == "dynamic_pressure" and by_tables
