"""What the sections [map] and [noise] take, and how they refuse the rest."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from builder.vehicle.gamma_rules import RULES
from builder.vehicle.map_options import MapEntry, Noise

pytestmark = pytest.mark.fast


def test_defaults_are_case_1_with_truncated_modes() -> None:
    entry, noise = MapEntry(), Noise(std_um_per_m=0.4)
    assert (entry.case, entry.modes, entry.inner_product, entry.gamma) == (1, 5, "euclidean", 1.0)
    assert (entry.prior_modes, entry.keep_field) == (None, False)
    assert noise.with_truncated_modes
    assert not Noise(std_um_per_m=0.4, model="paper").with_truncated_modes
    assert not Noise(std_um_per_m=0.4, truncated_modes=False).with_truncated_modes


@pytest.mark.parametrize("gamma", [1, 1e-6, *RULES])
def test_gamma_is_a_number_or_a_rule(gamma: float | str) -> None:
    assert MapEntry.model_validate({"case": 2, "gamma": gamma}).gamma == gamma


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"gamma": 0.0}, r"expected 1e-12 .. 1e\+12 or one of morozov.* got 0.0"),
        ({"gamma": -1.0}, "got -1.0"),
        ({"gamma": True}, "got True"),
        ({"gamma": "L-curve"}, "or one of morozov.* got 'L-curve'"),
        ({"case": 3}, "Input should be 1 or 2"),
        ({"modes": 0}, "greater than or equal to 1"),
        ({"inner_product": "mass"}, "Input should be 'euclidean' or 'area'"),
    ],
)
def test_map_entries_out_of_range_are_refused(entries: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        MapEntry.model_validate(entries)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (
            {},
            "give either percent_of_median_strain or std_um_per_m or .* or covariance_file, and only one of them",
        ),
        ({"std_um_per_m": 1.0, "covariance_file": "a.csv"}, "give either"),
        ({"std_um_per_m": 1.0, "std_of_gauges_um_per_m": [1.0]}, "give either"),
        ({"std_of_gauges_um_per_m": [1.0, 0.0]}, "greater than or equal to"),
        ({"std_of_gauges_um_per_m": []}, "at least 1 item"),
        ({"std_um_per_m": "1"}, "valid number"),
        ({"std_um_per_m": 1.0, "gauge_gain_percent": -1.0}, "greater than or equal to 0"),
        (
            {"std_um_per_m": 1.0, "model": "paper", "gauge_gain_percent": 1.0},
            "model 'paper' is gauge noise alone, but gauge_gain_percent is 1",
        ),
        (
            {"std_um_per_m": 1.0, "model": "paper", "nuisance_file": "heat.csv"},
            "model 'paper' is gauge noise alone, but nuisance_file is 'heat.csv'",
        ),
        ({"std_um_per_m": 1.0, "thermal": 1.0}, "Extra inputs are not permitted"),
    ],
)
def test_noise_entries_that_contradict_are_refused(entries: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Noise.model_validate(entries)
