"""The shipped vehicle under stress, with default settings: every target, and what is known to miss one."""

from __future__ import annotations

from pathlib import Path

import pytest

from builder.pipeline.chosen_estimator import Estimators
from builder.reporting import Silent
from builder.stress.run import run_stress
from builder.vehicle.file import IC3X

KNOWN_OF_LINEAR = {
    ("incidence beyond its largest", "+5 to +20 %"): 13.0,
    ("another engine", "newtonian"): 20.0,
    ("another engine", "tangent cones"): 25.0,
    ("altitude in all inputs", "+5 km"): 66.0,
    ("altitude in all inputs", "+5 km, as static pressure"): 62.0,
    ("opposite rows exchanged", "pair in the plane of the flow, with angles"): 7.0,
    ("Mach number below its least, no navigation", "-20 %"): 36.0,
    ("local pressure, windward", "+100 % of p_inf"): 16.0,
    ("vortex pair, leeward", "-10 % of p_inf at 0.5 L"): 6.0,
    ("vortex pair, leeward", "-30 % of p_inf at 0.3 L"): 9.0,
    ("vortex pair, leeward", "-30 % of p_inf at 0.5 L"): 30.0,
    ("vortex pair, leeward", "-30 % of p_inf at 0.6 L"): 17.0,
}
"""Kinds beyond the envelope whose silent share is above 5 % with the linear map, and what it may be at most [%].
Measured: 10.4, 17.4, 21.9, 59.3, 55.6, 5.6, 31.9 and 14.6; of the vortex pairs 5.2, 7.1, 25.3 and 14.3. The states
of the map fit their strain within the stated errors of the hardware."""


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
@pytest.mark.parametrize(("estimator", "known"), [(None, {}), ("linear", KNOWN_OF_LINEAR)])
def test_targets_of_the_shipped_vehicle(
    estimator: Estimators | None, known: dict[tuple[str, str], float], tmp_path: Path
) -> None:
    """Silent at most 3 % within and 5 % outside, 95 % flagged 20 % beyond, OUTSIDE at most 0.1 % inside; every
    target by default."""
    result = run_stress(IC3X, tmp_path / "stress", Silent(), estimator=estimator)
    entries = {(one["error"], one["size"]): one for one in result.entries}
    assert len(entries) >= 34
    missed = {name: one for name, one in entries.items() if one["missed"]}
    assert missed.keys() <= known.keys(), missed
    for name, largest in known.items():
        assert entries[name]["undetected_percent"] <= largest
    assert all(one["undetected_percent"] <= 3.0 for one in entries.values() if one["class"] == "within")
