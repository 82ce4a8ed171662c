"""What a map says of its making: words, units, no names of the program's parts."""

from typing import Any

import pytest

from strainfmu.cli.inspection.provenance import in_words, provenance_rows, with_unit

pytestmark = pytest.mark.fast

LEVELS = {"rate_before": 0.001345, "samples": 200000, "stated_rate": 0.0001, "used": True}
HELD: dict[str, Any] = {
    "alarm_levels": {"chi_square_scale": 1.09227, "outlier_scale": 1.44, **LEVELS},
    "flight_alarm_levels": {"scales": [0.99215, 1.5625, 0.73757], **LEVELS},
    "altitude_m": [20000.0, 20000.0],
    "energy_of_modes": 0.90238,
    "flow": {
        "conditions_not_solved": 2,
        "engine": "euler",
        "marching_grid": {"n_radial": 24, "n_circumferential": 36, "clustering": 2.5},
        "method_version": 4,
        "sets": ["vehicle file (90)"],
    },
    "form": "dynamic_pressure",
    "internal_pressure_Pa": "ambient",
    "mesh_error": {
        "against": "a coarser mesh",
        "largest_at": "axial_1",
        "largest_sigma": 1.3,
        "rms_sigma": 1.1,
        "sigmas_trusted": False,
    },
    "modes_skipped": [4, 5],
    "moment_station_m": 2.0,
    "calibration": {
        "test": "loadtest.toml",
        "cases": ["weight", "pad 1"],
        "readings": 108,
        "chi_square_per_reading": 1.0456,
        "faults": ["gauge 'axial_1': dead"],
        "zero_um_per_m": [1.0, 2.0],
        "accepted": "no vehicle has these readings",
    },
}


def test_every_entry_is_in_words_with_units() -> None:
    rows = dict(provenance_rows(HELD, ("altitude_m",)))
    assert len(rows) == len(HELD) - 1
    assert rows["alarm levels, linear estimate"] == (
        "chi-square times 1.09, largest |z| times 1.2, for 0.01 % false alarms in 200000 samples of the "
        "independent model (0.13 % with the levels of the theory)"
    )
    assert (
        "largest |z| times 1.25, chi-square of the shapes times 0.738" in rows["alarm levels, nonlinear estimator"]
    )
    assert rows["variance of the snapshots in the modes"] == "90.24 %"
    assert rows["flow"] == (
        "engine euler, 24 cells outwards, 36 over half a turn, conditions: vehicle file (90), 2 of them not solved"
    )
    assert rows["internal pressure"] == "ambient"
    assert rows["modes left to the noise, not observed"] == "4, 5"
    assert rows["moment station"] == "2 m"
    assert rows["mesh error"].endswith("against a coarser mesh; the sigmas of the map are not to be trusted")
    assert rows["calibrated"] == (
        "by loadtest.toml, 2 cases, 108 readings, chi-square per reading 1.05 (1 is expected); "
        "accepted: no vehicle has these readings; gauge 'axial_1': dead"
    )
    assert not any("_" in name for name in rows)


def test_levels_of_the_theory_are_called_so() -> None:
    facts = {"alarm_levels": {"chi_square_scale": 9.0, "outlier_scale": 9.0, **LEVELS, "used": False}}
    ((_, text),) = provenance_rows(facts, ())
    assert text.startswith("levels of the theory: 0.13 % of 200000 samples")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "yes"),
        ([0.99214840598, 2], "0.992148, 2"),
        ([], "none"),
        (None, "none"),
        ({"a_mm": 1.5}, "a 1.5 mm"),
    ],
)
def test_values_are_as_an_engineer_writes_them(value: Any, text: str) -> None:
    assert in_words(value) == text


def test_a_word_has_no_unit() -> None:
    assert with_unit("internal_pressure_Pa", "ambient") == ("internal pressure", "ambient")
    assert with_unit("internal_pressure_Pa", 3000.0) == ("internal pressure", "3000 Pa")
