"""What the sections [map] and [noise] take, and how they refuse the rest."""

from typing import Any

import pytest
from pydantic import ValidationError

from builder.vehicle.map_options import HARDWARE_ERRORS, MapEntry, Noise
from strainfmu.linear.regularisation import RULES

pytestmark = pytest.mark.fast


def test_defaults_are_case_1_with_truncated_modes() -> None:
    entry, noise = MapEntry(), Noise(std_um_per_m=0.4)
    assert (entry.case, entry.modes, entry.inner_product, entry.gamma) == (1, 5, "euclidean", 1.0)
    assert (entry.prior_modes, entry.keep_field) == (None, False)
    assert (entry.form, entry.symmetry, entry.valid_altitude_km) == ("dynamic_pressure", "full", (0.0, 40.0))
    assert noise.with_truncated_modes
    assert not Noise(std_um_per_m=0.4, model="paper").with_truncated_modes
    assert not Noise(std_um_per_m=0.4, truncated_modes=False).with_truncated_modes


@pytest.mark.parametrize("gamma", [1, 1e-6, *RULES])
def test_gamma_is_a_number_or_a_rule(gamma: float | str) -> None:
    assert MapEntry.model_validate({"case": 2, "gamma": gamma, "form": "absolute"}).gamma == gamma


@pytest.mark.parametrize("gamma", [1e-6, *RULES])
def test_the_form_in_proportion_to_dynamic_pressure_takes_gamma_1(gamma: float | str) -> None:
    """Any other gamma would be none of the prior at another dynamic pressure."""
    with pytest.raises(ValidationError, match="gamma: expected 1 with form 'dynamic_pressure', got"):
        MapEntry.model_validate({"case": 2, "gamma": gamma})
    assert MapEntry.model_validate({"case": 2, "gamma": 1}).gamma == 1.0


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
        ({"form": "relative"}, "Input should be 'dynamic_pressure' or 'absolute'"),
        ({"symmetry": "mirrored"}, "Input should be 'full' or 'listed'"),
        (
            {"valid_altitude_km": [20.0, 20.0]},
            r"expected two rising numbers, got \[20.0, 20.0\]",
        ),
        ({"valid_altitude_km": [20.0]}, "valid_altitude_km"),
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


def test_hardware_errors_are_on_by_default_and_off_in_the_source() -> None:
    """Sizes of the documentation; model "paper" and without_hardware_errors set all to 0."""
    stated = {
        "gauge_gain_percent": 1.0,
        "common_gain_percent": 1.0,
        "gauge_position_mm": 1.0,
        "gauge_orientation_deg": 1.0,
        "layout_roll_deg": 0.5,
        "wall_thickness_percent": 1.0,
        "apparent_strain_um_per_m": 5.0,
        "internal_pressure_percent": 5.0,
        "dynamic_pressure_percent": 1.0,
        "clamp_compliance_mm": 0.0,
        "row_orientation_deg": 0.0,
        "wall_harmonic_percent": 0.0,
        "wall_taper_percent": 0.0,
        "wall_second_harmonic_percent": 0.0,
        "region_modulus_percent": 0.0,
        "joint_softness_mm": 0.0,
        "transverse_sensitivity_percent": 0.0,
    }
    assert set(stated) == set(HARDWARE_ERRORS)
    plain = Noise(std_um_per_m=0.4)
    assert {name: getattr(plain, name) for name in HARDWARE_ERRORS} == stated
    assert plain.moves_gauges
    for off in (Noise(std_um_per_m=0.4, model="paper"), plain.without_hardware_errors()):
        assert not any(getattr(off, name) for name in HARDWARE_ERRORS)
        assert not off.moves_gauges
