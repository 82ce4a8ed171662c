"""The shipped vehicle under stress, with default settings: nothing is missed, but for what is known."""

from __future__ import annotations

from pathlib import Path

import pytest

from builder.pipeline.chosen_estimator import Estimators
from builder.pipeline.trial_run import TrialOptions, run_trial
from builder.reporting import Silent
from builder.trial.cases import trial_path
from builder.trial.rules import MISSED
from builder.trial.score import ALL
from builder.vehicle.file import IC3X

MOST_UNDETECTED = {
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
"""Cases beyond of the linear map with more than 5 % undetected samples, and how many at most [%]. Measured: 10.4,
17.4, 21.9, 59.3, 55.6, 5.6, 31.9 and 14.6; of the vortex pairs 5.2, 7.1, 25.3 and 14.3. The states of the map fit
their strain within the stated errors of the hardware."""

KNOWN = {"linear": {("all_stated", "")}}
"""Cases that are missed by an estimator: sigma of the linear map includes no pressure between its snapshots."""


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
@pytest.mark.parametrize("estimator", [None, "linear"])
def test_what_the_shipped_vehicle_misses(estimator: Estimators | None, tmp_path: Path) -> None:
    options = TrialOptions(changes={}, estimator=estimator)
    result = run_trial(trial_path("stress"), IC3X, tmp_path / "stress", Silent(), options)
    rows = {(row["error"], row["size"]): row for row in result.rows if row["load"] == ALL}
    assert len(rows) >= 34
    known = MOST_UNDETECTED if estimator == "linear" else {}
    missed = {name for name, row in rows.items() if row["verdict"] == MISSED}
    assert missed <= known.keys() | KNOWN.get(estimator or "", set()), [rows[name]["why"] for name in missed]
    for name, largest in known.items():
        assert rows[name]["undetected_percent"] <= largest
    assert all(row["undetected_percent"] <= 3.0 for row in rows.values() if row["class"] == "alone")
