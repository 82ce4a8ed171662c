"""What the estimator of a map offers in addition to five loads: a filter, other loads."""

from __future__ import annotations

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import LoadGroup


def has_filter(inverse_map: InverseMap) -> bool:
    """Return whether FMUs of ``inverse_map`` can filter.

    All can but linear maps of gamma other than 1 in Case 2: the gain of these belongs to no law of the states that
    a filter could carry on.
    """
    return inverse_map.manifold is not None or inverse_map.case == 1 or inverse_map.regularisation == 1.0


def has_other_outputs(inverse_map: InverseMap) -> bool:
    """Return whether FMUs of the map state such loads: by tables, or in form "dynamic_pressure"."""
    in_core = inverse_map.manifold is not None or inverse_map.follows_pressure
    return inverse_map.has_other_loads and in_core


def groups_of_outputs(inverse_map: InverseMap) -> tuple[LoadGroup, ...]:
    """Return the groups of loads that FMUs of the map state after the five; none where they state none."""
    return inverse_map.load_groups if has_other_outputs(inverse_map) else ()
