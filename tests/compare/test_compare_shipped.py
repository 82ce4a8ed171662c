"""The shipped vehicle under comparison: every aim of the nonlinear estimator, and what the others miss."""

from __future__ import annotations

from pathlib import Path

import pytest

from builder.compare.flights import Effort
from builder.compare.rivals import RIVALS
from builder.compare.run import run_compare
from builder.reporting import Silent
from builder.vehicle.file import IC3X

KNOWN = {f"rms {name} over the better linear map's, hardware" for name in ("C_N", "C_Y")}
"""Aims that are near what is found."""


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
def test_aims_on_the_shipped_vehicle(tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    effort = Effort(conditions=150, draws=4, training=6000)
    result = run_compare(IC3X, tmp_path / "compare", Silent(), effort=effort)
    missed = {aim.what for aim in result.aims if not aim.is_met}
    assert missed <= KNOWN
    of = {(one["estimator"], one["errors"]): one for one in result.entries if one["air_data_inputs"] == "given"}
    for errors, worst in (("gauge noise", 1.0), ("hardware", 1.4)):
        nonlinear = of["nonlinear", errors]["rms"]
        for rival in RIVALS:
            assert all(nonlinear[name] < worst * of[rival, errors]["rms"][name] for name in nonlinear)
    # A filter that takes lasting errors for noise is too sure of itself.
    assert min(of["Kalman filter, random walk", "hardware"]["coverage_percent"].values()) < 95.0
